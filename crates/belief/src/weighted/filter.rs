//! The filter: memory of the episode, updates, restarts.

use pomdp::{GenerativeModel, Proposals, Rng, StructureReport, UpdateReport, Updater};

use super::advance::Advance;
use super::config::WeightedConfig;
use super::prediction::Prediction;
use super::round::{Round, Tally, Trackable};
use crate::resample::{Quota, resample};
use crate::{Error, Particles};

/// Draws a state of the start of the episode; `None` where a draw is impossible.
type Start<'a, S> = Box<dyn Fn(&mut Rng) -> Option<S> + Send + Sync + 'a>;

#[doc = include_str!("filter.md")]
pub struct WeightedFilter<'a, M: GenerativeModel> {
    config: WeightedConfig,
    start: Option<Start<'a, M::State>>,
    history: Vec<(M::Action, M::Observation)>,
    /// Steps of the episode, remembered or not.
    steps: usize,
}

impl<'a, M: GenerativeModel> WeightedFilter<'a, M> {
    /// A filter with these settings, without restarts.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] where a value lies outside its limits.
    pub fn new(config: WeightedConfig) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self { config, start: None, history: Vec::new(), steps: 0 })
    }

    /// The same filter, which restarts a lost belief from draws of `start`: states before the first action.
    #[must_use]
    pub fn with_restart(mut self, start: impl Fn(&mut Rng) -> Option<M::State> + Send + Sync + 'a) -> Self {
        self.start = Some(Box::new(start));
        self
    }

    /// Its settings.
    #[must_use]
    pub fn config(&self) -> &WeightedConfig {
        &self.config
    }
}

impl<M: GenerativeModel> std::fmt::Debug for WeightedFilter<'_, M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let restart = self.start.is_some();
        f.debug_struct("WeightedFilter")
            .field("config", &self.config)
            .field("restart", &restart)
            .field("steps", &self.steps)
            .finish_non_exhaustive()
    }
}

impl<M: Trackable> Updater<M> for WeightedFilter<'_, M> {
    type Belief = Particles<M::State>;
    type Error = Error;

    fn reset(&mut self) {
        self.history.clear();
        self.steps = 0;
    }

    fn update(
        &mut self,
        model: &M,
        belief: Self::Belief,
        action: &M::Action,
        observation: &M::Observation,
        proposals: Proposals<'_, M::State>,
        rng: &mut Rng,
    ) -> Result<(Self::Belief, UpdateReport), Error> {
        self.steps += 1;
        if self.history.len() < self.config.history_limit {
            self.history.push((action.clone(), observation.clone()));
        }
        let weights = belief.iter().map(|(_, w)| w).collect();
        let (states, weights) = thin(model, belief.into_states(), weights, &self.config, rng);
        let prediction = Prediction::new(model, states, weights);
        let tally = Tally::default();
        let config = &self.config;
        let mut round = Round { model, action, observation, config, prediction: &prediction, proposals, tally };
        let advance = round.run(rng)?;
        let tally = round.tally;

        let lost = advance.as_ref().is_none_or(|a| a.surprise > self.config.restart_surprise);
        let mut restarted = None;
        let mut replayed = 0;
        if lost {
            restarted = self.restart(model, &mut replayed, rng);
            // A restart has to explain the latest observation better than the old belief does.
            if let (Some(new), Some(old)) = (&restarted, &advance)
                && new.surprise >= old.surprise
            {
                restarted = None;
            }
        }
        let recoveries = usize::from(restarted.is_some());
        let log_evidence = advance.as_ref().map_or(f64::NEG_INFINITY, |a| a.log_evidence);
        let Some(new) = restarted.or(advance) else {
            let attempts = tally.transitions + replayed;
            return Err(Error::Depleted { attempts, diverged: tally.diverged, terminal: tally.terminal });
        };
        let structures = new.books.iter().map(|(structure, prior, posterior, particles)| StructureReport {
            structure: format!("{structure:?}"),
            prior: *prior,
            posterior: *posterior,
            log_evidence: new.log_evidence + (posterior / prior).ln(),
            particles: *particles,
        });
        let structures = structures.collect();
        let belief = Particles::weighted(new.states, new.weights)?;
        let report = UpdateReport {
            effective_sample_size: belief.effective_sample_size(),
            effective_sample_size_before: new.effective_sample_size_before,
            // Of the belief that was asked, not of the one that took its place.
            log_evidence,
            acceptance: tally.agreeing as f64 / tally.transitions.max(1) as f64,
            particles: belief.count(),
            reinvigorated: new.reinvigorated,
            proposed: new.proposed,
            diverged: tally.diverged,
            transitions: tally.transitions + replayed,
            resampled: new.resampled,
            bridges: new.bridges,
            temperature: new.temperature,
            move_acceptance: new.move_acceptance,
            surprise: new.surprise,
            recoveries,
            structures,
        };
        #[cfg(feature = "tracing")]
        tracing::debug!(?report, terminal = tally.terminal, "update");
        Ok((belief, report))
    }
}

impl<M: Trackable> WeightedFilter<'_, M> {
    /// A belief from the start of the episode, led through the whole history by the same updates; `transitions` counts what that cost. `None`
    /// where there is no sampler, no complete history, too little budget, or nothing that explains the history.
    fn restart(&self, model: &M, transitions: &mut usize, rng: &mut Rng) -> Option<Advance<M>> {
        let start = self.start.as_ref()?;
        let each = self.config.restart_transitions / self.history.len().max(1);
        if self.history.len() != self.steps || each < self.config.particles_min {
            return None;
        }
        // Half of a step's budget is for particles, half for bridges; a step that needs none leaves its half unused.
        let most = (each / 2).max(self.config.particles_min);
        let config = WeightedConfig { particles_max: most, max_transitions: each, ..self.config.clone() };
        // The first particles cost nothing before they are stepped.
        let states: Vec<M::State> = (0..most).filter_map(|_| start(rng)).collect();
        if states.is_empty() {
            return None;
        }
        let mut weights = vec![1.0 / states.len() as f64; states.len()];
        let mut states = states;
        let mut latest = None;
        for (action, observation) in &self.history {
            let prediction = Prediction::new(model, states, weights);
            let (proposals, tally) = (Proposals::none(), Tally::default());
            let config = &config;
            let mut round = Round { model, action, observation, config, prediction: &prediction, proposals, tally };
            let advance = round.run(rng);
            *transitions += round.tally.transitions;
            let advance = advance.ok()??;
            (states, weights) = (advance.states.clone(), advance.weights.clone());
            latest = Some(advance);
        }
        latest.map(|advance| {
            let (states, weights) = thin(model, states, weights, &self.config, rng);
            let count = |of: &M::Structure| states.iter().filter(|s| model.structure(s) == *of).count();
            let books = advance.books.into_iter().map(|(of, prior, after, _)| (of.clone(), prior, after, count(&of)));
            Advance { books: books.collect(), states, weights, ..advance }
        })
    }
}

/// Drops weightless particles, and resamples where more than `particles_max` are left.
fn thin<M: Trackable>(
    model: &M,
    states: Vec<M::State>,
    weights: Vec<f64>,
    config: &WeightedConfig,
    rng: &mut Rng,
) -> (Vec<M::State>, Vec<f64>) {
    let (mut states, mut weights): (Vec<_>, Vec<_>) = states.into_iter().zip(weights).filter(|(_, w)| *w > 0.0).unzip();
    if states.len() > config.particles_max {
        let books = Prediction::new(model, states, weights);
        let quota = Quota { particles: config.structure_quota, threshold: config.structure_threshold };
        let (kinds, structures) = (&books.kinds, books.structures.len());
        let drawn = resample(&books.weights, kinds, structures, config.particles_max, quota, rng);
        states = drawn.iter().map(|&(i, _)| books.states[i].clone()).collect();
        weights = drawn.iter().map(|&(_, w)| w).collect();
    }
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    (states, weights)
}
