//! The trained prior in the loop: observations in, suggested particles out.

use std::path::Path;

use pomdp::{Prior, Rng};
use push_task::{Action, Observation, Particle, PushModel};

use crate::checkpoint::{Checkpoint, FILE};
use crate::features::{self, ActionInput};
use crate::mixture::Mixture;
use crate::{Error, Inference, Layout};

/// A prior that follows one episode. Clones share the weights and have an episode of their own.
#[derive(Clone, Debug)]
pub struct Suggester {
    inference: Inference,
    layout: Layout,
    /// After the latest observation, and that observation.
    latest: Option<(Mixture, Vec<f64>)>,
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
        let checkpoint = Checkpoint::load(folder, None)?;
        let expected = features::layout(robot, model, ActionInput::of(&checkpoint.layout));
        checkpoint.layout.check(&expected, &folder.join(FILE))?;
        let (inference, hash) = (checkpoint.inference()?, checkpoint.weights_hash());
        Ok(Self { inference, layout: expected, latest: None, joints: model.joint_count(), hash })
    }

    /// Hash of the weights.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// A draw from the mixture; `None` before the first observation.
    pub fn sample(&self, table_height_m: f64, rng: &mut Rng) -> Option<Particle> {
        let (mixture, observation) = self.latest.as_ref()?;
        Some(features::particle(&self.layout, &mixture.sample(rng), observation, self.joints, table_height_m))
    }

    /// The mean of the strongest component with its likeliest shapes; `None` before the first observation.
    #[must_use]
    pub fn strongest(&self, table_height_m: f64) -> Option<Particle> {
        let (mixture, observation) = self.latest.as_ref()?;
        Some(features::particle(&self.layout, &mixture.strongest(), observation, self.joints, table_height_m))
    }
}

impl Prior<Action, Observation> for Suggester {
    type Suggestion = Mixture;

    fn reset(&mut self) {
        self.inference.reset();
        self.latest = None;
    }

    fn suggest(&mut self, action: Option<&Action>, observation: &Observation) -> Mixture {
        let input = features::input(&self.layout, action.copied(), &observation.0);
        let mixture = self.inference.step(&input).clone();
        self.latest = Some((mixture.clone(), observation.0.clone()));
        mixture
    }
}
