//! The ruler of a belief: a sampler of the exact posterior that may cost what it wants, and what an observer knows who is told all but the obstacle.

use anyhow::{Result, anyhow};
use belief::{Particles, ReferenceConfig};
use physics_model::theta::NO_OBSTACLE;
use pomdp::{Replay as _, Rng, Teacher};
use push_task::coordinates::OBSTACLE;
use push_task::{History, Particle};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

use super::episode::{Row, row};

/// Obstacles that the told observer tries, and noises with which it replays the world without one.
const OBSTACLES: usize = 1000;
const NOISES: usize = 100;
/// Spreads around the true obstacle, in standard deviations of the prior. Half of the obstacles are drawn so: those that explain a contact are few.
const SPREADS: [f64; 4] = [0.01, 0.03, 0.1, 0.3];
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
    /// Probability of an obstacle for an observer who is told everything else.
    pub told: f64,
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

    /// Whether the two runs agree.
    #[must_use]
    pub fn agrees(&self) -> bool {
        let [a, b] = self.chains.each_ref().map(|chain| chain.obstacle);
        self.scale_reductions().iter().all(|scale| *scale <= MOST_SCALE) && (a - b).abs() <= MOST_DIFFERENCE
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
    Ok(Ruler { row, chains, told: told(history, truth, rng)? })
}

fn moments(belief: &Particles<Particle>, value: impl Fn(&Particle) -> f64) -> (f64, f64) {
    let mean: f64 = belief.iter().map(|(p, w)| w * value(p)).sum();
    (mean, belief.iter().map(|(p, w)| w * (value(p) - mean).powi(2)).sum())
}

fn normal(rng: &mut Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Probability of an obstacle where all else is known, by importance sampling of obstacles from their prior and from around the true one.
fn told(history: &History<'_>, truth: &Particle, rng: &mut Rng) -> Result<f64> {
    let coordinates = history.start_coordinates();
    let centre = coordinates.of(truth, rng).ok_or_else(|| anyhow!("the true world lies outside the distribution"))?;
    let [shape, true_class] = truth.theta.classes();
    let probabilities = coordinates.class_probabilities().1;
    let some: f64 = probabilities[..NO_OBSTACLE].iter().sum();
    let of_some: Vec<f64> = probabilities[..NO_OBSTACLE].iter().map(|p| p / some).collect();
    let near = if true_class == NO_OBSTACLE { 0.0 } else { 0.5 };
    let proposal = Proposal { centre: centre[OBSTACLE].to_vec(), class: true_class, near, of_some };
    let mut with = Vec::new();
    for _ in 0..OBSTACLES {
        let mut z = centre.clone();
        let (class, obstacle) = proposal.draw(rng);
        z[OBSTACLE].copy_from_slice(&obstacle);
        with.push(match history.start(&[shape, class], &z) {
            Some((state, _)) => replayed(history, state, truth, rng) - proposal.log_ratio(class, &obstacle),
            None => f64::NEG_INFINITY,
        });
    }
    let mut bare = truth.clone();
    (bare.theta.obstacle, bare.state.obstacle) = (None, None);
    let without: Vec<f64> = (0..NOISES).map(|_| replayed(history, bare.clone(), truth, rng)).collect();
    let (with, without) = (some.ln() + log_mean(&with), (1.0 - some).ln() + log_mean(&without));
    if with == f64::NEG_INFINITY && without == f64::NEG_INFINITY {
        return Err(anyhow!("not even the true world explains the history"));
    }
    Ok(1.0 / (1.0 + (without - with).exp()))
}

/// What obstacles are drawn from: their prior, and the surroundings of the true one.
struct Proposal {
    /// Coordinates of the true obstacle, and its class.
    centre: Vec<f64>,
    class: usize,
    /// Share that is drawn near it.
    near: f64,
    /// Probabilities of the classes with an obstacle.
    of_some: Vec<f64>,
}

impl Proposal {
    fn draw(&self, rng: &mut Rng) -> (usize, Vec<f64>) {
        if rng.random::<f64>() < self.near {
            let spread = SPREADS[rng.random_range(0..SPREADS.len())];
            return (self.class, self.centre.iter().map(|z| z + spread * normal(rng)).collect());
        }
        let z = self.centre.iter().map(|_| normal(rng)).collect();
        (push_task::sampling::categorical(&self.of_some, rng), z)
    }

    /// ln of its density over that of the prior.
    fn log_ratio(&self, class: usize, z: &[f64]) -> f64 {
        let half_square = |z: &[f64]| 0.5 * z.iter().map(|z| z * z).sum::<f64>();
        let mut parts = vec![(1.0 - self.near).ln()];
        if class == self.class && self.near > 0.0 {
            let off: Vec<f64> = z.iter().zip(&self.centre).map(|(z, c)| z - c).collect();
            let share = self.near / (SPREADS.len() as f64 * self.of_some[class]);
            parts.extend(SPREADS.iter().map(|spread| {
                share.ln() - half_square(&off) / (spread * spread) - off.len() as f64 * spread.ln() + half_square(z)
            }));
        }
        log_mean(&parts) + (parts.len() as f64).ln()
    }
}

/// ln likelihood of all steps in the true world with the obstacle of `drawn`.
fn replayed(history: &History<'_>, drawn: Particle, truth: &Particle, rng: &mut Rng) -> f64 {
    let mut state = truth.clone();
    (state.theta.obstacle, state.state.obstacle) = (drawn.theta.obstacle, drawn.state.obstacle);
    let mut sum = 0.0;
    for step in 0..history.steps() {
        let noise: Vec<f64> = (0..history.step_coordinates()).map(|_| normal(rng)).collect();
        sum += history.advance(step, &mut state, &noise);
        if !sum.is_finite() {
            return f64::NEG_INFINITY;
        }
    }
    sum
}

/// ln of the mean of exp.
fn log_mean(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + (logs.iter().map(|log| (log - most).exp()).sum::<f64>() / logs.len() as f64).ln()
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    #[test]
    fn weights_of_drawn_obstacles_average_to_one_and_carry_expectations_over_to_the_prior() {
        let proposal = Proposal { centre: vec![0.7, -1.2], class: 1, near: 0.5, of_some: vec![0.2, 0.5, 0.3] };
        let mut rng = Seed(5).stream(Purpose::Test, 0);
        let (mut weights, mut first, mut of_class) = (0.0, 0.0, 0.0);
        let n = 200_000;
        for _ in 0..n {
            let (class, z) = proposal.draw(&mut rng);
            let weight = (-proposal.log_ratio(class, &z)).exp();
            weights += weight / f64::from(n);
            first += weight * z[0] / f64::from(n);
            of_class += if class == 1 { weight / f64::from(n) } else { 0.0 };
        }
        assert!((weights - 1.0).abs() < 0.01 && first.abs() < 0.02, "{weights} {first}");
        assert!((of_class - 0.5).abs() < 0.01, "{of_class}");
    }
}
