//! Errors of the simulated scenes against MuJoCo's.

use physics_model::config::WorldConfig;

use crate::scenes::{Outcome, Scene, pose_error};

/// Force below which a relative error says nothing, N: half the noise of the wrist sensor.
pub const SMALL_FORCE_N: f64 = 0.25;

/// Errors of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneError {
    /// Name.
    pub name: String,
    /// Distance of the object from where MuJoCo leaves it, mm.
    pub position_mm: f64,
    /// Angle between the two orientations of the object, degrees.
    pub angle_deg: f64,
    /// Distance of the obstacle likewise, mm; 0 without one.
    pub obstacle_mm: f64,
    /// Length of the difference of the mean forces over MuJoCo's mean force; `None` where that is below [`SMALL_FORCE_N`].
    pub force: Option<f64>,
    /// Ours.
    pub ours: Outcome,
    /// MuJoCo's.
    pub theirs: Outcome,
}

/// Simulates a scene and compares.
#[must_use]
pub fn compare(scene: &Scene, theirs: &Outcome, world: &WorldConfig) -> SceneError {
    let ours = scene.simulate(&scene.config(world), &scene.tool.shapes());
    let (position, angle) = pose_error(&ours.object, &theirs.object, true);
    let obstacle = match (&ours.obstacle, &theirs.obstacle) {
        (Some(a), Some(b)) => pose_error(a, b, true).0,
        _ => 0.0,
    };
    let difference: f64 =
        ours.wrench.force_n.iter().zip(theirs.wrench.force_n).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let scale = theirs.wrench.force_magnitude_n();
    SceneError {
        name: scene.name.clone(),
        position_mm: 1e3 * position,
        angle_deg: angle.to_degrees(),
        obstacle_mm: 1e3 * obstacle,
        force: (scale >= SMALL_FORCE_N).then(|| difference / scale),
        ours,
        theirs: *theirs,
    }
}
