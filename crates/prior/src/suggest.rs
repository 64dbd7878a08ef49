//! The trained prior in the loop: observations in, suggested particles out.

use std::path::Path;

use physics_model::{Action, Observation, Particle, PushModel};
use pomdp::{Prior, Rng};

use crate::checkpoint::Checkpoint;
use crate::mixture::Mixture;
use crate::{Error, Inference, features};

/// A prior that follows one episode. Clones share the weights and have an episode of their own.
#[derive(Clone, Debug)]
pub struct Suggester {
    inference: Inference,
    latest: Option<Mixture>,
    joints: usize,
    hash: String,
}

impl Suggester {
    /// Loads the prior in `folder`, which must have been trained for `robot` with the observations of `model`.
    ///
    /// # Errors
    ///
    /// What [`Checkpoint::load`] refuses: a missing or damaged file, another version, arm or layout.
    pub fn load(folder: &Path, robot: &str, model: &PushModel) -> Result<Self, Error> {
        let checkpoint = Checkpoint::load(folder, Some(&features::layout(robot, model)))?;
        let hash = checkpoint.weights_hash().to_string();
        Ok(Self { inference: checkpoint.inference()?, latest: None, joints: model.joint_count(), hash })
    }

    /// Hash of the weights.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// The mixture after the latest observation; `None` before the first.
    #[must_use]
    pub fn mixture(&self) -> Option<&Mixture> {
        self.latest.as_ref()
    }

    /// A draw from the mixture; `None` before the first observation.
    pub fn sample(&self, table_height_m: f64, rng: &mut Rng) -> Option<Particle> {
        let draw = self.latest.as_ref()?.sample(rng);
        Some(features::particle(&draw, self.joints, table_height_m))
    }

    /// The mean of the strongest component with its likeliest shapes; `None` before the first observation.
    #[must_use]
    pub fn strongest(&self, table_height_m: f64) -> Option<Particle> {
        let draw = self.latest.as_ref()?.strongest();
        Some(features::particle(&draw, self.joints, table_height_m))
    }
}

impl Prior<Action, Observation> for Suggester {
    type Suggestion = Mixture;

    fn reset(&mut self) {
        self.inference.reset();
        self.latest = None;
    }

    /// The published network takes in observations alone.
    fn suggest(&mut self, _action: Option<&Action>, observation: &Observation) -> Mixture {
        let mixture = self.inference.step(&observation.0).clone();
        self.latest = Some(mixture.clone());
        mixture
    }
}
