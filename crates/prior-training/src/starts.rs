//! Episodes as plain arrays of their starts and steps: what `training/posterior.py` trains on, and `training/coverage.py` judges by.
//!
//! `starts.f32` has for each episode, in little-endian f32: the classes of object and obstacle, the [`START`] coordinates of the start, and
//! [`STEP_VALUES`] values of each step. Episodes that end early have NaN for the steps that they lack. `starts.json` says what the file is.

use std::path::Path;

use physics_model::config::ObstacleMobility;
use pomdp::Rng;
use prior::posterior::{STEP_VALUES, step_values};
use prior::{Error, write_atomically};
use push_task::config::ForceSensing;
use push_task::coordinates::START;
use push_task::sampling::WorldDistribution;
use push_task::{Action, Coordinates, Observation, Particle};
use scenario::Problem;
use serde_json::{Value, json};

/// Names of the files: the one that says what the other is comes last, so that what it says is there.
pub const FILES: [&str; 2] = ["starts.f32", "starts.json"];

/// A step: the action before it, what was observed, and the joints, rad.
pub type Step<'a> = (Option<Action>, Observation, &'a [f64]);

/// The values of an episode whose start has coordinates in `coordinates`; `None` where it is outside their distribution.
pub fn values<'a>(
    problem: &Problem,
    coordinates: &Coordinates<'_>,
    start: &Particle,
    rng: &mut Rng,
    steps: impl Iterator<Item = Step<'a>>,
) -> Option<Vec<f32>> {
    let z = coordinates.of(start, rng)?;
    let classes = start.theta.classes().map(|class| class as f32);
    let start = classes.into_iter().chain(z[..START].iter().map(|z| *z as f32));
    let steps =
        steps.flat_map(|(action, observation, joints)| step_values(&problem.model, action, &observation, joints));
    Some(start.chain(steps).collect())
}

/// What arrays are, of `episodes` of `steps` each, from `dataset`.
#[must_use]
pub fn about(
    problem: &Problem,
    distribution: &WorldDistribution,
    mobility: ObstacleMobility,
    [episodes, steps]: [usize; 2],
    dataset: &Value,
) -> Value {
    let sensor = &problem.model.config().sensor;
    let noise = &sensor.noise;
    let (force, torque, joint) = (noise.force_n, noise.torque_nm, noise.joint_torque_nm);
    let force_scale = match sensor.force {
        ForceSensing::Wrist => [force, force, force, torque, torque, torque],
        ForceSensing::JointTorques => [joint; 6],
    };
    json!({
        "version": 1, "robot": problem.scenario.robot.name, "mobility": mobility,
        "episodes": episodes, "steps": steps, "coordinates": START, "step_values": STEP_VALUES,
        "force_scale": force_scale, "distribution": distribution, "dataset": dataset,
    })
}

/// Writes both files into a folder.
///
/// # Errors
///
/// [`Error::Io`] where the file system refuses.
pub fn write(folder: &Path, bytes: &[u8], about: &Value) -> Result<(), Error> {
    let text = format!("{about:#}");
    FILES.iter().zip([bytes, text.as_bytes()]).try_for_each(|(file, bytes)| write_atomically(&folder.join(file), bytes))
}
