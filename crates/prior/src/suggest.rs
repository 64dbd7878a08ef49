//! The trained prior in the loop: observations in, suggested particles out.

use std::path::Path;

use physics_model::config::ObstacleMobility;
use physics_model::theta::{NO_OBSTACLE, ObjectShape};
use pomdp::{Prior, Rng};
use push_task::{Action, Observation, Particle, PushModel};

use crate::checkpoint::{Checkpoint, FILE};
use crate::density;
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
    /// Frequency of each pair of classes in the training data.
    frequencies: Vec<f64>,
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
        let frequencies = checkpoint.baseline.structures;
        Ok(Self { inference, layout: expected, latest: None, joints: model.joint_count(), hash, frequencies })
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

    /// A draw for a filter that weighs it by [`Self::log_density_of_start`]. It is not moved into the physical ranges, so it may
    /// be impossible. Of its state only the obstacle's pose is kept. `None` before the first observation.
    pub fn sample_raw(&self, table_height_m: f64, rng: &mut Rng) -> Option<Particle> {
        let (mixture, observation) = self.latest.as_ref()?;
        Some(density::raw_particle(&self.layout, &mixture.sample(rng), observation, self.joints, table_height_m))
    }

    /// [`Self::sample_raw`] of the object's shape and the obstacle's class, which must be possible.
    pub fn sample_raw_given(&self, classes: [usize; 2], table_height_m: f64, rng: &mut Rng) -> Option<Particle> {
        let (mixture, observation) = self.latest.as_ref()?;
        let draw = mixture.sample_given(&classes, rng);
        Some(density::raw_particle(&self.layout, &draw, observation, self.joints, table_height_m))
    }

    /// ln of the density of what it can say of the start of an episode: see [`density::log_density_of_start`]. −∞ before the first observation.
    #[must_use]
    pub fn log_density_of_start(&self, mobility: ObstacleMobility, start: &Particle) -> f64 {
        let latest = self.latest.as_ref();
        latest.map_or(f64::NEG_INFINITY, |(mixture, _)| {
            density::log_density_of_start(mixture, self.joints, mobility, start)
        })
    }

    /// Frequency of the object's shape and the obstacle's class together in the training data.
    #[must_use]
    pub fn class_frequency(&self, [shape, obstacle]: [usize; 2]) -> f64 {
        self.frequencies[shape * (NO_OBSTACLE + 1) + obstacle]
    }

    /// Frequencies of the obstacle's classes in the training data.
    #[must_use]
    pub fn obstacle_frequencies(&self) -> [f64; NO_OBSTACLE + 1] {
        std::array::from_fn(|obstacle| {
            (0..ObjectShape::ALL.len()).map(|shape| self.class_frequency([shape, obstacle])).sum()
        })
    }

    /// Probability of the object's shape and the obstacle's class together; 0 before the first observation.
    #[must_use]
    pub fn class_probability(&self, classes: [usize; 2]) -> f64 {
        let latest = self.latest.as_ref();
        latest.map_or(0.0, |(mixture, _)| {
            let count = self.layout.continuous.len();
            mixture.log_density_masked(&vec![0.0; count], &vec![false; count], &classes).exp()
        })
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
