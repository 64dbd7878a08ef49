//! A sampler of the whole history's posterior that may cost what it wants: the ruler of the filters.

use pomdp::{Replay, Rng, Teacher};
use rand::RngExt as _;

use crate::bridge::{Coordinates, largest_power, noise, possible};
use crate::config::{MOST_PARTICLES, require};
use crate::diagnostics::{log_effective_sample_size, log_sum_exp};
use crate::parallel::each;
use crate::resample_move::{Hypothesis, Proposal, draw, propose, replay, systematic};
use crate::{Error, Particles};

/// Share of the moves that draw a start anew from the teacher, whatever the present one is.
const INDEPENDENT: f64 = 0.1;
/// Smallest step of the exponent. A population that cannot go so far has collapsed; the next step resamples it all the same.
const LEAST_STEP: f64 = 1e-4;

/// Settings of [`reference`].
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceConfig {
    /// Hypotheses.
    pub particles: usize,
    /// Moves that each of them tries after a resampling.
    pub sweeps: usize,
    /// Effective sample size, as a share of the particles, that a step of the exponent leaves; in (0, 1).
    pub effective_share: f64,
    /// Share of the starts that are drawn from the prior, and not from the teacher; in (0, 1]. It bounds the weight of what a teacher leaves out.
    pub prior_share: f64,
}

impl Default for ReferenceConfig {
    fn default() -> Self {
        Self { particles: 500, sweeps: 10, effective_share: 0.7, prior_share: 0.2 }
    }
}

impl ReferenceConfig {
    /// Whether all values are within their limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`], naming the first value that is not.
    pub fn validate(&self) -> Result<(), Error> {
        let most = format!("between 2 and {MOST_PARTICLES}");
        require((2..=MOST_PARTICLES).contains(&self.particles), "particles", &self.particles, most.as_str())?;
        let most = format!("between 1 and {MOST_PARTICLES}");
        require((1..=MOST_PARTICLES).contains(&self.sweeps), "sweeps", &self.sweeps, most.as_str())?;
        let inside = self.effective_share > 0.0 && self.effective_share < 1.0;
        require(inside, "effective_share", &self.effective_share, "between 0 and 1")?;
        let share = self.prior_share > 0.0 && self.prior_share <= 1.0;
        require(share, "prior_share", &self.prior_share, "above 0 and at most 1")
    }
}

/// What [`reference`] came to.
#[derive(Clone, Debug)]
pub struct Reference<S> {
    /// The posterior of the state after the last step.
    pub belief: Particles<S>,
    /// Estimate of ln p of all observations.
    pub log_evidence: f64,
    /// Steps of the exponent.
    pub bridges: usize,
    /// Share of the moves that were accepted at the exponent 1.
    pub acceptance: f64,
    /// Simulated steps.
    pub transitions: usize,
}

/// A hypothesis with ln ratio of the first distribution over the prior.
#[derive(Clone, Debug)]
struct Member<S> {
    hypothesis: Hypothesis<S>,
    ratio: f64,
}

/// The posterior of an episode by annealed sequential Monte Carlo (Del Moral, Doucet and Jasra 2006).
///
/// Hypotheses are drawn from a mixture q of teacher and prior. They go to the posterior p along q^(1 − φ) p^φ. Steps of φ are as large as the
/// effective sample size allows. After each one the hypotheses are resampled, and moved by Metropolis–Hastings kernels that leave the bridge as it
/// is. One run cannot know what it has missed: compare several.
///
/// # Errors
///
/// [`Error::Config`] where a value lies outside its limits; [`Error::Depleted`] where no drawn start explains the history.
pub fn reference<R, T>(
    config: &ReferenceConfig,
    episode: &R,
    teacher: &T,
    rng: &mut Rng,
) -> Result<Reference<R::State>, Error>
where
    R: Replay,
    R::State: Clone + Send + Sync,
    T: Teacher,
{
    config.validate()?;
    let source = Source { episode, teacher, prior_share: config.prior_share };
    let made = each(config.particles, rng, |_, rng| {
        let (attempts, found) = possible(episode, |rng| source.draw(rng), rng);
        (attempts, found.map_or((None, 0), |coordinates| source.member(coordinates, f64::NEG_INFINITY)))
    });
    let drawn: usize = made.iter().map(|(attempts, _)| attempts).sum();
    let mut transitions: usize = made.iter().map(|(_, (_, cost))| cost).sum();
    let mut members: Vec<Member<R::State>> = made.into_iter().filter_map(|(_, (member, _))| member).collect();
    // What cannot be has the weight 0 at every exponent.
    let mut log_evidence = (members.len() as f64 / drawn as f64).ln();
    let (mut reached, mut bridges, mut acceptance) = (0.0, 0, 0.0);
    while reached < 1.0 {
        if members.is_empty() {
            return Err(Error::Depleted { attempts: transitions, diverged: 0, terminal: 0 });
        }
        let logs = |step: f64| members.iter().map(move |m| step * (m.hypothesis.log_likelihood(1.0) - m.ratio));
        let rest = 1.0 - reached;
        // Of a first population that is nearly empty, as of any other: so it goes slowly at first.
        let least = config.effective_share * config.particles as f64;
        let share = largest_power(least, |share| log_effective_sample_size(logs(share * rest)));
        let step = (share * rest).max(LEAST_STEP).min(rest);
        reached = if step == rest { 1.0 } else { reached + step };
        let weights: Vec<f64> = logs(step).collect();
        let sum = log_sum_exp(weights.iter().copied());
        log_evidence += sum - (members.len() as f64).ln();
        let classes = |index: usize| &members[index].hypothesis.classes;
        let chosen = systematic(&weights.iter().map(|w| w - sum).collect::<Vec<_>>(), config.particles, classes, rng);
        members = chosen.into_iter().map(|index| members[index].clone()).collect();
        bridges += 1;
        let mut accepted = 0_usize;
        for _ in 0..config.sweeps {
            let others: Vec<Hypothesis<R::State>> = members.iter().map(|m| m.hypothesis.clone()).collect();
            let moved = each(members.len(), rng, |index, rng| source.attempt(&members[index], &others, reached, rng));
            for (member, (next, cost)) in members.iter_mut().zip(moved) {
                transitions += cost;
                if let Some(next) = next {
                    accepted += 1;
                    *member = next;
                }
            }
        }
        acceptance = accepted as f64 / (config.sweeps * members.len()) as f64;
    }
    let belief = Particles::uniform(members.into_iter().map(|m| m.hypothesis.state).collect())?;
    Ok(Reference { belief, log_evidence, bridges, acceptance, transitions })
}

/// The mixture that hypotheses are drawn from.
struct Source<'a, R, T> {
    episode: &'a R,
    teacher: &'a T,
    prior_share: f64,
}

impl<R: Replay, T: Teacher> Source<'_, R, T> {
    fn draw(&self, rng: &mut Rng) -> Option<(Vec<usize>, Vec<f64>)> {
        if rng.random::<f64>() >= self.prior_share {
            return self.teacher.draw(rng);
        }
        draw(self.episode, rng).map(|hypothesis| (hypothesis.classes, hypothesis.start))
    }

    /// ln of its density over the prior's.
    fn log_ratio(&self, classes: &[usize], start: &[f64]) -> f64 {
        let teacher = (1.0 - self.prior_share).ln() + self.teacher.log_ratio(classes, start);
        log_sum_exp([self.prior_share.ln(), teacher].into_iter())
    }

    /// The hypothesis of these coordinates, and what it cost. `None` as soon as its likelihood cannot exceed `least` any more.
    fn member(&self, (classes, start, noise): Coordinates, least: f64) -> (Option<Member<R::State>>, usize) {
        let ratio = self.log_ratio(&classes, &start);
        // A broken teacher must not win.
        if !ratio.is_finite() {
            return (None, 0);
        }
        let replayed = replay(self.episode, (classes, start, noise), 1.0, least);
        (replayed.hypothesis.map(|hypothesis| Member { hypothesis, ratio }), replayed.transitions)
    }

    /// A move that leaves the bridge at `power` as it is.
    fn attempt(
        &self,
        current: &Member<R::State>,
        others: &[Hypothesis<R::State>],
        power: f64,
        rng: &mut Rng,
    ) -> (Option<Member<R::State>>, usize) {
        let proposal = if rng.random::<f64>() < INDEPENDENT {
            self.draw(rng).map(|(classes, start)| {
                let log_ratio = current.ratio - self.log_ratio(&classes, &start);
                Proposal { classes, start, noise: noise(self.episode, rng), log_ratio }
            })
        } else {
            propose(self.episode, &current.hypothesis, others, rng)
        };
        let Some(Proposal { classes, start, noise, log_ratio }) = proposal else { return (None, 0) };
        let ratio = self.log_ratio(&classes, &start);
        let bridge = |ratio: f64, likelihood: f64| (1.0 - power) * ratio + power * likelihood;
        let least =
            bridge(current.ratio, current.hypothesis.log_likelihood(1.0)) + rng.random::<f64>().ln() - log_ratio;
        // What the likelihood alone has to exceed. The exponent is above 0 here.
        self.member((classes, start, noise), (least - (1.0 - power) * ratio) / power)
    }
}
