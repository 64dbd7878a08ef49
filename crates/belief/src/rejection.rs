//! The rejection filter of POMCP, with reinvigoration and outside proposals.

use pomdp::{Belief as _, Discretise, Outcome, Perturb, Proposals, Rng, UpdateReport, Updater};

use crate::reinvigorate::{copies, perturbed};
use crate::{Error, Particles, RejectionConfig};

/// Unweighted particle filter that keeps what agrees with the class of the observation.
///
/// One update from belief b, action a and real observation o makes N = `particles` equally weighted particles, of which
/// P = min(|proposals|, ⌊`proposal_share` · N⌋) places belong to proposals:
///
/// 1. Rejection: draw s from b, step it with a, keep s' if its observation has the class of o. Stop at N − P particles
///    or after (1 − `noise_share`) · `max_attempts` attempts.
/// 2. Reinvigoration: the same, with noise added to s before the step. Stop at N − P particles or after all attempts.
/// 3. Filling: if fewer than N − P particles were kept, but at least one, they are duplicated uniformly.
/// 4. Proposals: the first P, in the caller's order, take their places. The caller has checked them against o. If
///    simulation kept nothing, the belief consists of proposals alone, duplicated to N. If there are no proposals
///    either, or `proposal_share` is zero, the update fails as depleted.
///
/// A step that ends in a terminal state disagrees with o, because the filter is called only while the real episode goes
/// on. A diverged world has likelihood zero. It is dropped and counted.
///
/// `log_evidence` is ln(acceptance) of phase 1 alone, because perturbed particles do not come from b. `acceptance`
/// covers both phases. Every attempt costs one clone of a state and one transition.
#[derive(Clone, Debug)]
pub struct RejectionFilter {
    config: RejectionConfig,
}

impl RejectionFilter {
    /// A filter with these settings.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] where a value lies outside its limits.
    pub fn new(config: RejectionConfig) -> Result<Self, Error> {
        config.validate()?;
        Ok(Self { config })
    }

    /// Its settings.
    #[must_use]
    pub fn config(&self) -> &RejectionConfig {
        &self.config
    }
}

impl<M: Discretise + Perturb> Updater<M> for RejectionFilter {
    type Belief = Particles<M::State>;
    type Error = Error;

    fn update(
        &mut self,
        model: &M,
        belief: Self::Belief,
        action: &M::Action,
        observation: &M::Observation,
        proposals: Proposals<'_, M::State>,
        rng: &mut Rng,
    ) -> Result<(Self::Belief, UpdateReport), Error> {
        let RejectionConfig { particles, max_attempts, .. } = self.config;
        let proposals = proposals.states;
        let places = self.config.proposal_places();
        let proposed = proposals.len().min(places);
        let simulated = particles - proposed;

        let mut trial = Trial::new(model, action, model.key(observation));
        trial.run(simulated, self.config.plain_attempts(), rng, |rng| belief.sample(rng).clone());
        let plain = trial.accepted.len();
        let log_evidence = (plain as f64 / trial.attempts as f64).ln();
        trial.run(simulated, max_attempts, rng, |rng| perturbed(model, &belief, rng));

        let Trial { accepted, attempts, diverged, terminal, .. } = trial;
        let acceptance = accepted.len() as f64 / attempts as f64;
        let mut report = UpdateReport {
            effective_sample_size: particles as f64,
            effective_sample_size_before: accepted.len() as f64,
            log_evidence,
            acceptance,
            particles,
            temperature: 1.0,
            diverged,
            transitions: attempts,
            ..UpdateReport::default()
        };
        let states = if !accepted.is_empty() {
            let order = copies(accepted.len(), simulated, rng);
            report.reinvigorated = order.iter().filter(|&&index| index >= plain).count();
            report.proposed = proposed;
            let mut states = take(&accepted, &order);
            states.extend_from_slice(&proposals[..proposed]);
            states
        } else if places > 0 && !proposals.is_empty() {
            report.proposed = particles;
            let usable = &proposals[..proposals.len().min(particles)];
            take(usable, &copies(usable.len(), particles, rng))
        } else {
            return Err(Error::Depleted { attempts, diverged, terminal });
        };
        #[cfg(feature = "tracing")]
        tracing::debug!(?report, terminal, plain, "update");
        Ok((Particles::uniform(states)?, report))
    }
}

fn take<S: Clone>(states: &[S], order: &[usize]) -> Vec<S> {
    order.iter().map(|&index| states[index].clone()).collect()
}

/// Particles tried against one real step.
struct Trial<'a, M: Discretise> {
    model: &'a M,
    action: &'a M::Action,
    key: M::Key,
    accepted: Vec<M::State>,
    attempts: usize,
    diverged: usize,
    terminal: usize,
}

impl<'a, M: Discretise> Trial<'a, M> {
    fn new(model: &'a M, action: &'a M::Action, key: M::Key) -> Self {
        Self { model, action, key, accepted: Vec::new(), attempts: 0, diverged: 0, terminal: 0 }
    }

    /// Steps states from `draw` and keeps those that agree, until `target` are kept or `attempts` were made, earlier runs included.
    fn run(&mut self, target: usize, attempts: usize, rng: &mut Rng, mut draw: impl FnMut(&mut Rng) -> M::State) {
        while self.accepted.len() < target && self.attempts < attempts {
            let mut state = draw(rng);
            let step = self.model.step(&mut state, self.action, rng);
            self.attempts += 1;
            match step.outcome {
                Outcome::Terminal => self.terminal += 1,
                Outcome::Diverged => self.diverged += 1,
                Outcome::Continue if self.model.key(&step.observation) == self.key => self.accepted.push(state),
                Outcome::Continue => {}
            }
        }
    }
}
