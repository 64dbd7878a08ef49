//! An arm: its layer of a scenario, and its URDF.

use physics_model::robot::Robot;
use scenario::Selection;

use crate::Verdict;
use crate::parts::{join, split};
use crate::verdict::{asset, folder, put, refused, root};

/// Loads the two files as an arm. What is accepted has finite poses and torques, and masses that move.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn robot(data: &[u8]) -> Verdict {
    let [layer, urdf] = split::<2>(data);
    let folder = folder();
    let (layer_file, urdf_file) = (folder.path().join("robot.toml"), folder.path().join("arm.urdf"));
    put(&layer_file, layer);
    put(&urdf_file, urdf);
    let selection = Selection {
        robot: layer_file.display().to_string(),
        set: vec![format!("robot.urdf={:?}", urdf_file.display().to_string())],
        ..Selection::new(root())
    };
    let scenario = match selection.load() {
        Ok(scenario) => scenario,
        // What the layer lacks is missing in the first that says anything on its table.
        Err(error) => return refused(&error, &["robot.toml", "base.toml", "d1.toml", "--set"]),
    };
    match Robot::load(&scenario.robot, &root()) {
        Ok(arm) => check(&arm),
        Err(error) => {
            // What is wrong with the configuration names its key, what is wrong with the URDF its file.
            return refused(&error, &["arm.urdf", "robot."]);
        }
    }
    super::scenario_toml::assembled(&scenario)
}

fn check(arm: &Robot) {
    let home = arm.home_rad();
    assert_eq!(home.len(), arm.joint_count(), "one home value a joint");
    for pose in [arm.base_from_tool(home), arm.base_from_tip(home), arm.base_from_wrist(home)] {
        assert!(pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|v| v.is_finite()), "{pose:?}");
    }
    let gravity = arm.gravity_torque(home);
    assert!(gravity.iter().all(|v| v.is_finite()), "torques against gravity: {gravity:?}");
    let mass = arm.mass_matrix(home);
    for joint in 0..arm.joint_count() {
        let own = mass[(joint, joint)];
        assert!(own.is_finite() && own > 0.0, "joint {joint} moves {own} kg m²");
    }
}

/// Both arms.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let arm = |name: &str| {
        join(&[&asset(&format!("scenarios/robots/{name}.toml")), &asset(&format!("assets/robots/{name}.urdf"))])
    };
    vec![arm("sawyer"), arm("jaco")]
}
