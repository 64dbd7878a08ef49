//! Recorded scenes: one tool move each, with the end that MuJoCo found (see `tests/peers/mujoco_scenes.py`).

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use nalgebra::Vector3;
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::motion::minimum_jerk;
use physics_model::robot::ToolShape;
use physics_model::state::unit_quaternion;
use physics_model::world::{ToolPose, World, Wrench};
use physics_model::{BodyState, ObjectShape, ObjectTheta, ObstacleTheta, Theta};

/// Length of a tool move, m.
pub const MOVE_M: f64 = 0.02;

/// Tool of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// A ball of 25 mm radius.
    Ball,
    /// Three capsules: two fingers ahead, one behind.
    Hand,
}

impl Tool {
    /// Collision shapes in the tool's frame, whose axes are the base's.
    #[must_use]
    pub fn shapes(self) -> Vec<ToolShape> {
        let finger = |a_m, b_m| ToolShape::Capsule { a_m, b_m, radius_m: 0.012 };
        match self {
            Self::Ball => vec![ToolShape::Ball { center_m: [0.0; 3], radius_m: 0.025 }],
            Self::Hand => vec![
                finger([-0.03, 0.03, 0.0], [-0.03, 0.09, -0.03]),
                finger([0.03, 0.03, 0.0], [0.03, 0.09, -0.03]),
                finger([0.0, -0.03, 0.0], [0.0, -0.09, -0.03]),
            ],
        }
    }
}

/// What one action did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// The object at the end.
    pub object: BodyState,
    /// The obstacle at the end.
    pub obstacle: Option<BodyState>,
    /// Mean wrench on the tool over the action, about the tool's centre, base axes.
    pub wrench: Wrench,
    /// Largest force of a control step, N.
    pub peak_n: f64,
}

/// One tool move from rest; table at z = 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name.
    pub name: String,
    /// Θ.
    pub theta: Theta,
    /// The object before.
    pub object: BodyState,
    /// The obstacle before.
    pub obstacle: Option<BodyState>,
    /// Whether the obstacle can move.
    pub mobility: ObstacleMobility,
    /// Tool.
    pub tool: Tool,
    /// Tool centre before, m.
    pub tool_m: [f64; 3],
    /// Unit direction of the move.
    pub direction: [f64; 3],
}

impl Scene {
    /// `world` with the scene's table and mobility.
    #[must_use]
    pub fn config(&self, world: &WorldConfig) -> WorldConfig {
        WorldConfig { table_height_m: 0.0, obstacle_mobility: self.mobility, ..world.clone() }
    }

    /// Simulates the move in the world of `config` (see [`Self::config`]).
    #[must_use]
    pub fn simulate(&self, config: &WorldConfig, shapes: &[ToolShape]) -> Outcome {
        let tool = ToolPose { position_m: self.tool_m, orientation: [0.0, 0.0, 0.0, 1.0] };
        let mut world = World::restore(config, &[], &self.theta, &self.object, self.obstacle.as_ref(), &tool, shapes);
        let mut wrench = Wrench::default();
        let mut peak_n = 0.0_f64;
        for step in 1..=config.control_steps {
            let share = MOVE_M * minimum_jerk(f64::from(step) / f64::from(config.control_steps));
            let read = world.step(std::array::from_fn(|i| self.tool_m[i] + share * self.direction[i]));
            wrench.add_scaled(&read, 1.0 / f64::from(config.control_steps));
            peak_n = peak_n.max(read.force_magnitude_n());
        }
        Outcome { object: world.object(), obstacle: world.obstacle(), wrench, peak_n }
    }
}

/// Scenes with their recorded ends, in the file's order.
///
/// # Errors
///
/// A missing file or column, or a value that is not a number or shape.
pub fn load(root: &Path) -> Result<Vec<(Scene, Outcome)>> {
    let path = root.join("crates/physics-model/tests/data/mujoco_scenes.csv");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    lines
        .map(|line| {
            let cells: BTreeMap<&str, &str> = names.iter().copied().zip(line.split(',')).collect();
            let name = cells.get("name").copied().unwrap_or_default();
            parse(&Row { cells }).with_context(|| format!("{}: scene {name:?}", path.display()))
        })
        .collect()
}

struct Row<'a> {
    cells: BTreeMap<&'a str, &'a str>,
}

impl Row<'_> {
    fn text(&self, column: &str) -> Result<&str> {
        self.cells.get(column).copied().with_context(|| format!("expected a column {column}"))
    }

    fn number(&self, column: &str) -> Result<f64> {
        let text = self.text(column)?;
        text.parse().with_context(|| format!("{column}: expected a number, found {text:?}"))
    }

    fn numbers<const N: usize>(&self, columns: [&str; N]) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for (value, column) in values.iter_mut().zip(columns) {
            *value = self.number(column)?;
        }
        Ok(values)
    }

    fn shape(&self, column: &str) -> Result<Option<ObjectShape>> {
        Ok(match self.text(column)? {
            "box" => Some(ObjectShape::Box),
            "cylinder" => Some(ObjectShape::Cylinder),
            "sphere" => Some(ObjectShape::Sphere),
            "none" => None,
            other => bail!("{column}: expected box, cylinder, sphere or none, found {other:?}"),
        })
    }

    fn end(&self, body: &str) -> Result<BodyState> {
        let mut state = BodyState::at_rest([0.0; 3], 0.0);
        for (value, axis) in state.position_m.iter_mut().zip(["x", "y", "z"]) {
            *value = self.number(&format!("{body}_end_{axis}"))?;
        }
        for (value, axis) in state.orientation.iter_mut().zip(["qx", "qy", "qz", "qw"]) {
            *value = self.number(&format!("{body}_end_{axis}"))?;
        }
        Ok(state)
    }
}

fn parse(row: &Row) -> Result<(Scene, Outcome)> {
    let shape = row.shape("object_shape")?.context("object_shape: expected a shape")?;
    let object = ObjectTheta {
        shape,
        mass_kg: row.number("object_mass_kg")?,
        com_m: row.numbers(["object_com_x_m", "object_com_y_m", "object_com_z_m"])?,
        friction: row.number("object_friction")?,
        size_m: row.numbers(["object_size_0", "object_size_1", "object_size_2"])?,
    };
    let obstacle = match row.shape("obstacle_shape")? {
        None => None,
        Some(shape) => {
            let movable = row.number("obstacle_movable")? != 0.0;
            let theta = ObstacleTheta {
                shape,
                // A fixed body's mass plays no part.
                mass_kg: if movable { row.number("obstacle_mass_kg")? } else { 1.0 },
                size_m: row.numbers(["obstacle_size_0", "obstacle_size_1", "obstacle_size_2"])?,
            };
            let position = row.numbers(["obstacle_x_m", "obstacle_y_m", "obstacle_z_m"])?;
            Some((theta, BodyState::at_rest(position, row.number("obstacle_yaw_rad")?), movable))
        }
    };
    let scene = Scene {
        name: row.text("name")?.into(),
        theta: Theta { object, obstacle: obstacle.as_ref().map(|(theta, _, _)| theta.clone()), effects: vec![] },
        object: BodyState::at_rest(
            row.numbers(["object_x_m", "object_y_m", "object_z_m"])?,
            row.number("object_yaw_rad")?,
        ),
        obstacle: obstacle.as_ref().map(|(_, body, _)| *body),
        mobility: match &obstacle {
            Some((_, _, true)) => ObstacleMobility::Movable,
            _ => ObstacleMobility::Fixed,
        },
        tool: match row.text("tool")? {
            "ball" => Tool::Ball,
            "hand" => Tool::Hand,
            other => bail!("tool: expected ball or hand, found {other:?}"),
        },
        tool_m: row.numbers(["tool_x_m", "tool_y_m", "tool_z_m"])?,
        direction: row.numbers(["direction_x", "direction_y", "direction_z"])?,
    };
    let outcome = Outcome {
        object: row.end("object")?,
        obstacle: scene.obstacle.map(|_| row.end("obstacle")).transpose()?,
        wrench: Wrench {
            force_n: row.numbers(["force_x_n", "force_y_n", "force_z_n"])?,
            torque_nm: row.numbers(["torque_x_nm", "torque_y_nm", "torque_z_nm"])?,
        },
        peak_n: row.number("peak_force_n")?,
    };
    Ok((scene, outcome))
}

/// Distance, m, and angle, rad, between two poses. A sphere without a centre of mass of its own has no visible orientation; pass
/// `turns = false` to leave the angle out.
#[must_use]
pub fn pose_error(a: &BodyState, b: &BodyState, turns: bool) -> (f64, f64) {
    let distance = (Vector3::from(a.position_m) - Vector3::from(b.position_m)).norm();
    let angle = if turns { unit_quaternion(a.orientation).angle_to(&unit_quaternion(b.orientation)) } else { 0.0 };
    (distance, angle)
}
