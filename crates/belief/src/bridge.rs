//! Importance sampling of the whole history's posterior, from what a teacher says of it.

use std::collections::VecDeque;

use pomdp::{Replay, Rng, Teacher, UpdateReport};

use crate::config::{MOST_PARTICLES, require};
use crate::diagnostics::{log_effective_sample_size, log_sum_exp};
use crate::parallel::each;
use crate::resample_move::{Hypothesis, normal, replay};
use crate::{Error, Particles};

/// Draws from a teacher until one is possible.
const ATTEMPTS: usize = 100;
/// Bisections of an exponent.
const BISECTIONS: usize = 40;

/// Settings of [`BridgeFilter`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schemars", schemars(description = "Settings of `BridgeFilter`."))]
pub struct BridgeConfig {
    /// Possible draws from the teacher after each observation. Each costs as many transitions as the episode has steps.
    pub draws: usize,
    /// Observations for which draws are kept. Each kept draw costs one transition an update.
    pub kept: usize,
    /// Effective sample size that the belief keeps.
    pub effective: f64,
}

impl Default for BridgeConfig {
    fn default() -> Self {
        Self { draws: 100, kept: 6, effective: 100.0 }
    }
}

impl BridgeConfig {
    /// Whether all values are within their limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`], naming the first value that is not.
    pub fn validate(&self) -> Result<(), Error> {
        let most = format!("between 1 and {MOST_PARTICLES}");
        require((1..=MOST_PARTICLES).contains(&self.draws), "draws", &self.draws, most.as_str())?;
        require((1..=MOST_PARTICLES).contains(&self.kept), "kept", &self.kept, most.as_str())?;
        require(
            self.effective >= 1.0 && self.effective <= self.draws as f64,
            "effective",
            &self.effective,
            "between 1 and `draws`",
        )
    }
}

/// A hypothesis with ln ratio of each remembered teacher over the prior.
#[derive(Clone, Debug)]
struct Member<S> {
    hypothesis: Hypothesis<S>,
    ratios: VecDeque<f64>,
}

/// A teacher with what was drawn from it.
#[derive(Clone, Debug)]
struct Batch<S, T> {
    teacher: T,
    /// Draws, impossible ones included.
    drawn: usize,
    members: Vec<Member<S>>,
}

/// Neural importance sampling (Dax et al. 2023) over whole histories, that stops where it can no longer be trusted.
///
/// A teacher q, trained on complete episodes, is an amortised estimate of the posterior p. It is calibrated where it was trained, and broad. Draws from
/// the teachers of the latest observations are replayed through the history, which gives their exact likelihood, and weighted by the deterministic
/// mixture of those teachers (AMIS; Cornuet, Marin, Mira and Robert 2012). The belief is the bridge q^(1 − φ) p^φ with the largest exponent φ
/// that leaves the effective sample size asked for. φ = 1 is the posterior. Where the draws do not suffice for it, the belief stays as broad as
/// the teacher for the rest of the way, and where they do not suffice for the teacher, as the mixture of teachers: a sampler's failure shows as width, not
/// as certainty.
#[derive(Clone, Debug)]
pub struct BridgeFilter<S, T> {
    config: BridgeConfig,
    batches: VecDeque<Batch<S, T>>,
    weights: Vec<f64>,
    /// Estimate of ln p of all observations so far.
    log_evidence: f64,
}

impl<S: Clone + Send + Sync, T: Teacher> BridgeFilter<S, T> {
    /// A filter of an episode that has just begun, with what its teacher says before the first step.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] where a value lies outside its limits; [`Error::Depleted`] where no start that the teacher suggests is possible.
    pub fn new<R: Replay<State = S>>(
        config: BridgeConfig,
        episode: &R,
        teacher: T,
        rng: &mut Rng,
    ) -> Result<Self, Error> {
        config.validate()?;
        let mut filter = Self { config, batches: VecDeque::new(), weights: Vec::new(), log_evidence: 0.0 };
        filter.take_in(episode, teacher, rng).map(|_| filter)
    }

    /// The belief: states with weights.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] after an update that failed.
    pub fn belief(&self) -> Result<Particles<S>, Error> {
        let (states, weights) = self
            .members()
            .zip(&self.weights)
            .filter(|(_, w)| **w > 0.0)
            .map(|(m, w)| (m.hypothesis.state.clone(), *w))
            .unzip();
        Particles::weighted(states, weights)
    }

    /// Takes in the last step of `episode`, with what its teacher says after it.
    ///
    /// # Errors
    ///
    /// [`Error::Depleted`] where nothing that the teachers suggest explains the history.
    pub fn update<R: Replay<State = S>>(
        &mut self,
        episode: &R,
        teacher: T,
        rng: &mut Rng,
    ) -> Result<UpdateReport, Error> {
        let step = episode.steps() - 1;
        let mut transitions = 0;
        for batch in &mut self.batches {
            let members = &batch.members;
            transitions += members.len();
            batch.members = each(members.len(), rng, |index, rng| {
                let mut next = members[index].clone();
                next.hypothesis.extend(episode, step, rng);
                next
            });
            batch.members.retain(|member| member.hypothesis.logs[step + 1] > f64::NEG_INFINITY);
        }
        if self.batches.len() >= self.config.kept {
            self.batches.pop_front();
            for batch in &mut self.batches {
                batch.members.iter_mut().for_each(|member| {
                    member.ratios.pop_front();
                });
            }
        }
        let mut report = self.take_in(episode, teacher, rng)?;
        report.transitions += transitions;
        Ok(report)
    }

    fn members(&self) -> impl Iterator<Item = &Member<S>> {
        self.batches.iter().flat_map(|batch| &batch.members)
    }

    /// Draws from a teacher, and weighs all draws.
    fn take_in<R: Replay<State = S>>(&mut self, episode: &R, teacher: T, rng: &mut Rng) -> Result<UpdateReport, Error> {
        let mut report = UpdateReport { transitions: self.draw(episode, teacher, rng), ..UpdateReport::default() };
        self.weigh(&mut report)?;
        Ok(report)
    }

    /// Draws from a teacher, replays what it drew, and asks it about all that is remembered. Returns the transitions that it took.
    fn draw<R: Replay<State = S>>(&mut self, episode: &R, teacher: T, rng: &mut Rng) -> usize {
        let made = each(self.config.draws, rng, |_, rng| {
            let (attempts, found) = possible(episode, |rng| teacher.draw(rng), rng);
            (attempts, found.map(|coordinates| replay(episode, coordinates, 1.0, f64::NEG_INFINITY)))
        });
        // Impossible draws count: that they are replaced by possible ones makes the density of these larger by as much.
        let drawn = made.iter().map(|(attempts, _)| attempts).sum();
        let (mut transitions, mut members) = (0, Vec::new());
        for replayed in made.into_iter().filter_map(|(_, made)| made) {
            transitions += replayed.transitions;
            let Some(hypothesis) = replayed.hypothesis else { continue };
            let ratios = self.batches.iter().map(|batch| hypothesis.log_ratio(&batch.teacher)).collect();
            members.push(Member { hypothesis, ratios });
        }
        for member in self.batches.iter_mut().flat_map(|batch| &mut batch.members).chain(&mut members) {
            member.ratios.push_back(member.hypothesis.log_ratio(&teacher));
        }
        self.batches.push_back(Batch { teacher, drawn, members });
        transitions
    }

    /// Weighs all draws by the bridge from the latest teacher to the posterior.
    fn weigh(&mut self, report: &mut UpdateReport) -> Result<(), Error> {
        let total: usize = self.batches.iter().map(|batch| batch.drawn).sum();
        let shares: Vec<f64> = self.batches.iter().map(|batch| (batch.drawn as f64 / total as f64).ln()).collect();
        let latest = self.batches.len() - 1;
        let (mut base, mut gain, mut posterior) = (Vec::new(), Vec::new(), Vec::new());
        for member in self.members() {
            let mix = log_sum_exp(member.ratios.iter().zip(&shares).map(|(r, s)| r + s));
            let last = member.ratios[latest];
            let likelihood = member.hypothesis.log_likelihood(1.0);
            base.push(if last.is_finite() && mix.is_finite() { last - mix } else { f64::NEG_INFINITY });
            gain.push(if likelihood.is_nan() { f64::NEG_INFINITY } else { likelihood - last });
            // What the latest teacher excludes belongs to the posterior all the same, if another one suggested it.
            let full = likelihood - mix;
            posterior.push(if mix.is_finite() && !full.is_nan() { full } else { f64::NEG_INFINITY });
        }
        if base.iter().all(|b| *b == f64::NEG_INFINITY) {
            self.weights.clear();
            return Err(Error::Depleted { attempts: report.transitions, diverged: 0, terminal: 0 });
        }
        let logs = |power: f64| -> Vec<f64> {
            if power == 1.0 {
                return posterior.clone();
            }
            base.iter()
                .zip(&gain)
                .map(|(b, g)| if power == 0.0 || *b == f64::NEG_INFINITY { *b } else { b + power * g })
                .collect()
        };
        let size = |power: f64| log_effective_sample_size(logs(power).into_iter());
        let power = largest_power(self.config.effective, size);
        // Where the latest teacher itself asks too much of the draws, as next to none of its own are possible, the belief stays nearer to the mixture.
        let nearer = |share: f64| base.iter().map(move |b| if *b == f64::NEG_INFINITY { *b } else { share * b });
        let logs: Vec<f64> = if power == 0.0 && size(0.0) < self.config.effective {
            nearer(largest_power(self.config.effective, |share| log_effective_sample_size(nearer(share)))).collect()
        } else {
            logs(power)
        };
        let sum = log_sum_exp(logs.iter().copied());
        self.weights = logs.iter().map(|l| (l - sum).exp()).collect();
        report.temperature = power;
        report.particles = self.weights.len();
        report.effective_sample_size_before = size(1.0);
        report.effective_sample_size = log_effective_sample_size(logs.iter().copied());
        report.acceptance = self.batches[latest].members.len() as f64 / self.config.draws as f64;
        report.proposed = self.batches[latest].members.len();
        let before =
            std::mem::replace(&mut self.log_evidence, log_sum_exp(posterior.into_iter()) - (total as f64).ln());
        report.log_evidence = if before.is_finite() { self.log_evidence - before } else { f64::NEG_INFINITY };
        Ok(())
    }
}

/// Classes and coordinates of a start, and coordinates of the noise of all steps.
pub(crate) type Coordinates = (Vec<usize>, Vec<f64>, Vec<f64>);

/// The first of [`ATTEMPTS`] draws of a start that is possible, with noise; and the attempts.
pub(crate) fn possible<R: Replay>(
    episode: &R,
    draw: impl Fn(&mut Rng) -> Option<(Vec<usize>, Vec<f64>)>,
    rng: &mut Rng,
) -> (usize, Option<Coordinates>) {
    for attempts in 1..=ATTEMPTS {
        let Some((classes, start)) = draw(rng) else { continue };
        if episode.start(&classes, &start).is_some() {
            return (attempts, Some((classes, start, noise(episode, rng))));
        }
    }
    (ATTEMPTS, None)
}

/// Coordinates of the noise of all steps.
pub(crate) fn noise<R: Replay>(episode: &R, rng: &mut Rng) -> Vec<f64> {
    (0..episode.steps() * episode.step_coordinates()).map(|_| normal(rng)).collect()
}

/// The largest exponent in [0, 1] at which the effective size is at least `least`; 0 where there is none.
pub(crate) fn largest_power(least: f64, size: impl Fn(f64) -> f64) -> f64 {
    if size(1.0) >= least {
        return 1.0;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if size(middle) >= least { low = middle } else { high = middle }
    }
    low
}
