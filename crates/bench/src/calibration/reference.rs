//! The ruler of a belief: a sampler of the exact posterior that may cost what it wants.

use anyhow::Result;
use belief::{Particles, ReferenceConfig};
use pomdp::{Rng, Teacher};
use push_task::{History, Particle};
use serde::{Deserialize, Serialize};

use super::episode::{Row, row};

/// Chains agree where the scale reduction of mass and friction is at most this, and the probabilities of an obstacle differ by at most that.
pub(super) const MOST_SCALE: f64 = 1.05;
pub(super) const MOST_DIFFERENCE: f64 = 0.05;

/// One run of the sampler.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chain {
    /// Mean and variance of ln mass.
    pub log_mass: (f64, f64),
    /// Mean and variance of friction.
    pub friction: (f64, f64),
    /// Probability of an obstacle.
    pub obstacle: f64,
    /// Estimate of ln p of the whole history.
    pub log_evidence: f64,
    /// Share of the last moves that were accepted.
    pub acceptance: f64,
    /// Simulated steps.
    pub transitions: usize,
}

/// What the ruler says after the last step of a world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ruler {
    /// The posterior of both chains together.
    pub row: Row,
    /// Two independent runs.
    pub chains: [Chain; 2],
}

impl Ruler {
    /// Potential scale reduction (Gelman and Rubin 1992) of ln mass and of friction.
    #[must_use]
    pub fn scale_reductions(&self) -> [f64; 2] {
        let of = |value: fn(&Chain) -> (f64, f64)| {
            let [(a, va), (b, vb)] = self.chains.each_ref().map(value);
            let within = 0.5 * (va + vb);
            (1.0 + 0.5 * (a - b).powi(2) / within.max(1e-12)).sqrt()
        };
        [of(|chain| chain.log_mass), of(|chain| chain.friction)]
    }

    /// By what the two runs differ: R̂ of ln mass and of friction, and the difference of their probabilities of an obstacle.
    pub(super) fn differences(&self) -> [f64; 3] {
        let [mass, friction] = self.scale_reductions();
        let [a, b] = self.chains.each_ref().map(|chain| chain.obstacle);
        [mass, friction, (a - b).abs()]
    }

    /// Whether the two runs agree.
    #[must_use]
    pub fn agrees(&self) -> bool {
        let [mass, friction, obstacle] = self.differences();
        mass <= MOST_SCALE && friction <= MOST_SCALE && obstacle <= MOST_DIFFERENCE
    }
}

/// The ruler of a whole episode. `truth` is the world before the first step.
pub(super) fn ruler(
    particles: usize,
    history: &History<'_>,
    teacher: &impl Teacher,
    truth: &Particle,
    rng: &mut Rng,
) -> Result<Ruler> {
    let config = ReferenceConfig { particles, ..ReferenceConfig::default() };
    let mut states = Vec::new();
    let mut chain = |rng: &mut Rng| -> Result<Chain> {
        let found = belief::reference(&config, history, teacher, rng)?;
        states.extend(found.belief.states().iter().cloned());
        Ok(Chain {
            log_mass: moments(&found.belief, |p| p.theta.object.mass_kg.ln()),
            friction: moments(&found.belief, |p| p.theta.object.friction),
            obstacle: moments(&found.belief, |p| f64::from(u8::from(p.theta.obstacle.is_some()))).0,
            log_evidence: found.log_evidence,
            acceptance: found.acceptance,
            transitions: found.transitions,
        })
    };
    let chains = [chain(rng)?, chain(rng)?];
    let row = row(&Particles::uniform(states)?, truth, rng);
    Ok(Ruler { row, chains })
}

fn moments(belief: &Particles<Particle>, value: impl Fn(&Particle) -> f64) -> (f64, f64) {
    let mean: f64 = belief.iter().map(|(p, w)| w * value(p)).sum();
    (mean, belief.iter().map(|(p, w)| w * (value(p) - mean).powi(2)).sum())
}
