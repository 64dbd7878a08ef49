//! Neural posterior estimation of an episode's start: an LSTM over all steps so far, with an autoregressive density of (classes, coordinates).
//!
//! The mixture of the published network says where everything is now, in diagonal Gaussians. A filter over whole histories needs something else: what
//! the episode began with. That is the same for all steps, lives in the standard normal coordinates of [`push_task::Coordinates`], and is strongly
//! correlated (Papamakarios, Pavlakou and Murray, "Masked autoregressive flow for density estimation", 2017, on why autoregressive densities are). So the
//! head gives a probability of each pair of classes, and given the pair one coordinate after the other, each as a mixture of Gaussians that has
//! seen the ones before it.
//!
//! The network is trained by `training/posterior.py` (PyTorch) on episodes of `cargo xtask datagen`.

mod features;
mod file;
mod head;
mod lstm;

use std::path::Path;
use std::sync::Arc;

use physics_model::config::ObstacleMobility;
use physics_model::theta::{NO_OBSTACLE, ObjectShape};
use push_task::sampling::WorldDistribution;
use push_task::{Action, Observation, PushModel};

use crate::Error;
use features::{Features, Seen};
pub use features::{STEP_VALUES, step_values};
pub use file::FILE;
use head::Head;
pub use head::StartDensity;
use lstm::{Lstm, LstmState};

/// Pairs of classes, of the object's shape and the obstacle.
pub const PAIRS: usize = ObjectShape::ALL.len() * (NO_OBSTACLE + 1);

/// Weights and what they were trained for.
#[derive(Debug)]
struct Weights {
    robot: String,
    mobility: ObstacleMobility,
    distribution: WorldDistribution,
    features: Features,
    lstm: Lstm,
    head: Head,
    hash: String,
}

/// A network that follows one episode. Clones share the weights and have an episode of their own.
#[derive(Clone, Debug)]
pub struct PosteriorNetwork {
    weights: Arc<Weights>,
    state: LstmState,
    /// First and latest step.
    seen: Option<(Seen, Seen)>,
    latest: Option<StartDensity>,
}

impl PosteriorNetwork {
    /// Loads the network in `folder`, which must have been trained for `robot` and the obstacle's mobility of `model`.
    ///
    /// # Errors
    ///
    /// A missing or damaged file, another version or arm, or an obstacle that can move where it could not, or the other way.
    pub fn load(folder: &Path, robot: &str, model: &PushModel) -> Result<Self, Error> {
        let weights = file::load(folder)?;
        let path = folder.join(FILE);
        if weights.robot != robot {
            return Err(Error::Robot { path, found: weights.robot, expected: robot.into() });
        }
        if weights.mobility != model.config().world.obstacle_mobility {
            let reason = match weights.mobility {
                ObstacleMobility::Fixed => "trained for obstacles that cannot move, but here they can",
                ObstacleMobility::Movable => "trained for obstacles that can move, but here they cannot",
            };
            return Err(Error::Format { path, reason: reason.into() });
        }
        Ok(Self { state: weights.lstm.start(), weights: Arc::new(weights), seen: None, latest: None })
    }

    /// Hash of the weights.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.weights.hash
    }

    /// Distribution of the worlds that it was trained on: the coordinates of its densities are those of this distribution.
    #[must_use]
    pub fn distribution(&self) -> &WorldDistribution {
        &self.weights.distribution
    }

    /// Forgets the episode.
    pub fn reset(&mut self) {
        self.state = self.weights.lstm.start();
        (self.seen, self.latest) = (None, None);
    }

    /// Takes in the first observation, or that after `action`, and where the joints are then, rad.
    pub fn observe(
        &mut self,
        model: &PushModel,
        action: Option<Action>,
        observation: &Observation,
        joints_rad: &[f64],
    ) {
        let now = Seen::new(model, observation, joints_rad);
        let (first, before) = self.seen.get_or_insert_with(|| (now.clone(), now.clone()));
        let input = self.weights.features.row(action, &now, before, first);
        *before = now;
        let top = self.weights.lstm.step(&mut self.state, &input);
        self.latest = Some(StartDensity::new(&self.weights, top));
    }

    /// What it says after the latest observation; `None` before the first.
    #[must_use]
    pub fn density(&self) -> Option<&StartDensity> {
        self.latest.as_ref()
    }
}

#[cfg(test)]
mod tests;
