//! Motions with a closed form, simulated by us and by MuJoCo (see `tests/peers/mujoco_closed_forms.py`, which has the same ones).

use std::path::Path;

use anyhow::{Context as _, Result};
use physics_model::config::WorldConfig;
use physics_model::world::{ToolPose, World};
use physics_model::{BodyState, ObjectShape, ObjectTheta, Theta};

use crate::scenes::{Scene, Tool};

/// Where the tool is of no consequence.
const AWAY_M: [f64; 3] = [5.0, 5.0, 1.0];

/// One quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Name with unit, as recorded.
    pub name: &'static str,
    /// What it is.
    pub text: &'static str,
    /// Ours.
    pub ours: f64,
    /// MuJoCo's, with fine settings.
    pub mujoco: f64,
    /// Closed form, where there is one.
    pub exact: Option<f64>,
}

/// All measures in the world of `config`.
///
/// # Errors
///
/// The record of MuJoCo's values is missing or broken.
pub fn measure(root: &Path, config: &WorldConfig) -> Result<Vec<Measure>> {
    let path = root.join("crates/physics-model/tests/data/mujoco_closed_forms.csv");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let record = |name: &str| -> Result<(f64, Option<f64>)> {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(','));
        let cells = line.and_then(|line| line.split_once(','));
        let (mujoco, exact) = cells.with_context(|| format!("{}: expected a line {name}", path.display()))?;
        let number = |text: &str| {
            text.parse().with_context(|| format!("{}: {name}: expected a number, found {text:?}", path.display()))
        };
        Ok((number(mujoco)?, if exact.is_empty() { None } else { Some(number(exact)?) }))
    };
    let config = WorldConfig { table_height_m: 0.0, ..config.clone() };
    let yaw = |com_y, tool_y| pushed_yaw_rad(&config, com_y, tool_y);
    [
        ("push_force_n", "force of a smooth tool pushing at constant speed, N: μ m g", push_force_n(&config)),
        ("slide_m", "slide of a box from 1 m/s, m: v² / (2 μ g)", slide_m(&config)),
        (
            "sphere_rolls_mps",
            "sphere that slid at 0.5 m/s rolls at, m/s: 5/7 v",
            rolling_mps(&config, ObjectShape::Sphere),
        ),
        (
            "lying_cylinder_rolls_mps",
            "lying cylinder that slid at 0.5 m/s rolls at, m/s: 2/3 v",
            rolling_mps(&config, ObjectShape::Cylinder),
        ),
        ("spin_rad", "turn of a box on its corners from 15 rad/s, rad: ω² I / (2 μ m g r)", spin_rad(&config)),
        ("yaw_com_rad", "turn in a 2 cm push, centre of mass 2 cm aside, rad", yaw(0.02, 0.0)),
        ("yaw_offset_rad", "turn in a 2 cm push 2 cm off centre, rad", yaw(0.0, 0.02)),
        ("yaw_both_rad", "turn in a 2 cm push, centre of mass −1 cm, push +1.5 cm, rad", yaw(-0.01, 0.015)),
    ]
    .into_iter()
    .map(|(name, text, ours)| {
        let (mujoco, exact) = record(name)?;
        Ok(Measure { name, text, ours, mujoco, exact })
    })
    .collect()
}

fn theta(shape: ObjectShape, size_m: [f64; 3], mass_kg: f64, friction: f64, com_m: [f64; 3]) -> Theta {
    Theta { object: ObjectTheta { shape, mass_kg, com_m, friction, size_m }, obstacle: None, effects: vec![] }
}

/// Runs a body that nothing touches; `each` sees it after every control step.
fn launch(config: &WorldConfig, theta: &Theta, body: &BodyState, mut each: impl FnMut(&BodyState)) {
    let tool = ToolPose { position_m: AWAY_M, orientation: [0.0, 0.0, 0.0, 1.0] };
    let shapes = Tool::Ball.shapes();
    let mut world = World::restore(config, &[], theta, body, None, &tool, &shapes);
    for _ in 0..(0.5 / config.control_period_secs).round() as u32 {
        world.step(AWAY_M);
        each(&world.object());
    }
}

fn push_force_n(config: &WorldConfig) -> f64 {
    // A smooth tool: how much of the weight a rough one carries by friction is statically indeterminate, ±μ_tool F.
    let config = &WorldConfig { tool_friction: 0.0, ..config.clone() };
    let theta = theta(ObjectShape::Box, [0.08, 0.08, 0.07], 0.6, 0.45, [0.0; 3]);
    let body = BodyState::at_rest([0.0, 0.0, 0.035], 0.0);
    let tool = ToolPose { position_m: [-0.065, 0.0, 0.035], orientation: [0.0, 0.0, 0.0, 1.0] };
    let shapes = Tool::Ball.shapes();
    let mut world = World::restore(config, &[], &theta, &body, None, &tool, &shapes);
    let steps = (1.0 / 3.0 / config.control_period_secs).round() as u32;
    let (mut sum, mut count) = (0.0, 0.0);
    for step in 1..=steps {
        let along = 0.06 * config.control_period_secs * f64::from(step);
        let wrench = world.step([-0.065 + along, 0.0, 0.035]);
        if step > steps / 2 {
            sum -= wrench.force_n[0];
            count += 1.0;
        }
    }
    sum / count
}

fn slide_m(config: &WorldConfig) -> f64 {
    let theta = theta(ObjectShape::Box, [0.1, 0.1, 0.04], 0.7, 0.4, [0.0; 3]);
    let mut body = BodyState::at_rest([0.0, 0.0, 0.02], 0.0);
    body.linear_mps = [1.0, 0.0, 0.0];
    let mut end = 0.0;
    launch(config, &theta, &body, |body| end = body.position_m[0]);
    end
}

fn rolling_mps(config: &WorldConfig, shape: ObjectShape) -> f64 {
    let theta = theta(shape, [0.04, if shape == ObjectShape::Sphere { 0.0 } else { 0.1 }, 0.0], 0.7, 0.4, [0.0; 3]);
    let mut body = BodyState::at_rest([0.0, 0.0, 0.04], 0.0);
    if shape == ObjectShape::Cylinder {
        // Axis along y.
        body.orientation = [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];
    }
    body.linear_mps = [0.5, 0.0, 0.0];
    let mut end = 0.0;
    launch(config, &theta, &body, |body| end = body.linear_mps[0]);
    end
}

fn spin_rad(config: &WorldConfig) -> f64 {
    let theta = theta(ObjectShape::Box, [0.08, 0.08, 0.03], 0.5, 0.4, [0.0; 3]);
    let mut body = BodyState::at_rest([0.0, 0.0, 0.015], 0.0);
    body.angular_rps = [0.0, 0.0, 15.0];
    let mut end = 0.0;
    launch(config, &theta, &body, |body| end = body.yaw_rad());
    end
}

fn pushed_yaw_rad(config: &WorldConfig, com_y_m: f64, tool_y_m: f64) -> f64 {
    let scene = Scene {
        name: String::new(),
        theta: theta(ObjectShape::Box, [0.08; 3], 0.5, 0.4, [0.0, com_y_m, 0.0]),
        object: BodyState::at_rest([0.0, 0.0, 0.04], 0.0),
        obstacle: None,
        mobility: config.obstacle_mobility,
        tool: Tool::Ball,
        tool_m: [-0.065, tool_y_m, 0.04],
        direction: [1.0, 0.0, 0.0],
    };
    scene.simulate(config, &Tool::Ball.shapes()).object.yaw_rad()
}
