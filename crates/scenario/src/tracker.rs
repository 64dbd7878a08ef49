//! The filter that a scenario chooses.

use belief::{Particles, RejectionFilter, WeightedFilter};
use pomdp::{Proposals, Rng, UpdateReport, Updater as _};
use push_task::{Action, Observation, Particle, PushModel};

use crate::{Error, Filter, Problem};

/// The filter of an episode.
#[derive(Debug)]
pub enum Tracker<'a> {
    /// As published.
    Rejection(RejectionFilter),
    /// Weighted, with restarts from the first measurement.
    Weighted(Box<WeightedFilter<'a, PushModel>>),
}

impl Tracker<'_> {
    /// Belief after `action` and `observation`.
    ///
    /// # Errors
    ///
    /// As the filter; depletion among them.
    pub fn update(
        &mut self,
        model: &PushModel,
        belief: Particles<Particle>,
        action: Action,
        observation: &Observation,
        proposals: Proposals<'_, Particle>,
        rng: &mut Rng,
    ) -> Result<(Particles<Particle>, UpdateReport), belief::Error> {
        match self {
            Self::Rejection(filter) => filter.update(model, belief, &action, observation, proposals, rng),
            Self::Weighted(filter) => filter.update(model, belief, &action, observation, proposals, rng),
        }
    }
}

impl Problem {
    /// The filter for an episode that began with `observation`.
    ///
    /// # Errors
    ///
    /// Settings outside their limits, which a loaded scenario does not have.
    pub fn tracker(&self, observation: &Observation) -> Result<Tracker<'_>, Error> {
        let belief = &self.scenario.belief;
        let invalid =
            |error: belief::Error| Error::Task { name: self.scenario.name.clone(), problem: error.to_string() };
        Ok(match belief.filter {
            Filter::Rejection => Tracker::Rejection(RejectionFilter::new(belief.rejection.clone()).map_err(invalid)?),
            Filter::Weighted => {
                let first = observation.clone();
                let start = move |rng: &mut Rng| self.initial_particles(1, &first, rng).ok()?.pop();
                let filter = WeightedFilter::new(belief.weighted.clone()).map_err(invalid)?.with_restart(start);
                Tracker::Weighted(Box::new(filter))
            }
        })
    }
}
