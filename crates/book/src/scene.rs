//! The push of the pictures of effects, and its variations for effects that it does not show.

use std::sync::Arc;

use anyhow::{Context as _, Result};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::Effect;
use physics_model::robot::Robot;
use physics_model::{BodyState, ObjectShape, Rig, RigObject, RigReading, RigShape, RigStart, RigTool};

/// Lengths of the box, m.
pub(crate) const BOX_M: [f64; 3] = [0.08, 0.06, 0.05];
/// Where the object begins, m, base frame.
pub(crate) const PLACE_M: [f64; 2] = [0.45, 0.0];
/// Radius of the tool, m; that of the sphere is the half height of the box.
pub(crate) const BALL_M: f64 = 0.02;
const SPHERE_M: f64 = 0.025;
/// Between tool and object at the start, m.
const GAP_M: f64 = 0.03;
/// How far the object is pushed, m.
const PUSH_M: f64 = 0.12;
/// A row of a log, s.
pub(crate) const TICK_SECS: f64 = 0.01;
const TICK_STEPS: u32 = 10;
/// The table of the arm, m, in its base frame.
const ARM_TABLE_M: f64 = -0.1;

/// What happens to the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scene {
    /// The push, at a speed (m/s) and beside the middle of the object (m).
    Push { speed_mps: f64, aside_m: f64 },
    /// The push of a sphere.
    Roll,
    /// The tool begins almost at the object, creeps, then walks.
    Creep,
    /// The tool stands still for a minute.
    Rest,
    /// The object falls on an edge.
    Drop,
    /// The push by an arm, the Sawyer.
    Arm,
}

/// The push that most pictures show.
pub(crate) const STANDARD: Scene = Scene::Push { speed_mps: 0.3, aside_m: 0.0 };

/// What was commanded and read, from the first tick on.
pub(crate) struct Run {
    pub(crate) commands_m: Vec<[f64; 3]>,
    pub(crate) readings: Vec<RigReading>,
}

impl Scene {
    /// Plays it with effects.
    pub(crate) fn play(self, robot: &Arc<Robot>, effects: &[Box<dyn Effect>]) -> Result<Run> {
        let table_m = if self == Self::Arm { ARM_TABLE_M } else { 0.0 };
        let tool = match self {
            Self::Drop => RigTool::None,
            Self::Arm => RigTool::Arm(Arc::clone(robot)),
            _ => RigTool::Ball { radius_m: BALL_M },
        };
        let rig = Rig { world: world(table_m), tick_steps: TICK_STEPS, tool, tool_slip_mps: 0.0, cone_exponent: 1.0 };
        let (shape, size_m) = match self {
            Self::Roll => (ObjectShape::Sphere, [SPHERE_M, 0.0, 0.0]),
            _ => (ObjectShape::Box, BOX_M),
        };
        let mut object = RigObject::new(RigShape::Solid { shape, size_m }, 0.5, 0.3);
        object.on_points = !matches!(self, Self::Roll | Self::Drop);
        let mut body = BodyState::at_rest([PLACE_M[0], PLACE_M[1], table_m + 0.5 * BOX_M[2]], 0.0);
        if self == Self::Drop {
            body.position_m[2] = 0.15;
            // Turned by 30° about y.
            let (sin, cos) = (std::f64::consts::PI / 12.0).sin_cos();
            body.orientation = [0.0, sin, 0.0, cos];
        }
        // A run begins with what was read: the object begins at one place, whatever the sensor says.
        effects.iter().for_each(|effect| effect.read(&mut body));
        let (first_m, commands_m) = self.commands(table_m);
        let start = RigStart::of_episode(body, (self != Self::Drop).then_some(first_m));
        let readings = rig.run(&object, effects, &start, &commands_m).with_context(|| format!("{self:?}"))?;
        Ok(Run { commands_m, readings })
    }

    /// Where the tool begins, and where it is sent at the end of every tick.
    fn commands(self, table_m: f64) -> ([f64; 3], Vec<[f64; 3]>) {
        let touch_m = if self == Self::Roll { 0.045 } else { 0.5 * BOX_M[0] + BALL_M };
        let (gap_m, aside_m) = match self {
            Self::Creep => (0.0002, 0.0),
            Self::Push { aside_m, .. } => (GAP_M, aside_m),
            _ => (GAP_M, 0.0),
        };
        let first = [PLACE_M[0] - touch_m - gap_m, PLACE_M[1] + aside_m, table_m + 0.5 * BOX_M[2]];
        let mut x = first[0];
        let knots = self.speeds();
        let end = knots.last().map_or(0.0, |(time, _)| *time);
        let ticks = (end / TICK_SECS).round() as usize;
        let commands = (0..ticks).map(|tick| {
            x += TICK_SECS * speed_at(&knots, (tick as f64 + 0.5) * TICK_SECS);
            [x, first[1], first[2]]
        });
        (first, commands.collect())
    }

    /// (time / s, speed along x / m/s), straight lines between.
    fn speeds(self) -> Vec<(f64, f64)> {
        let push = |v: f64| {
            // Speeding up takes 0.1 s, slowing down 0.04 s.
            let cruise = (GAP_M + PUSH_M - 0.07 * v) / v;
            let stop = 0.3 + cruise + 0.04;
            let back = [(0.2, 0.0), (0.25, -0.2), (0.4, -0.2), (0.45, 0.0), (0.6, 0.0)].map(|(t, v)| (stop + t, v));
            [&[(0.2, 0.0), (0.3, v), (0.3 + cruise, v), (stop, 0.0)][..], &back].concat()
        };
        match self {
            Self::Push { speed_mps, .. } => push(speed_mps),
            Self::Roll | Self::Arm => push(0.3),
            Self::Creep => vec![(0.0, 0.0003), (2.0, 0.0003), (2.1, 0.02), (3.5, 0.02)],
            Self::Rest => vec![(0.0, 0.0), (60.0, 0.0)],
            Self::Drop => vec![(0.0, 0.0), (0.8, 0.0)],
        }
    }
}

fn speed_at(knots: &[(f64, f64)], time: f64) -> f64 {
    let mut before = (0.0, knots[0].1);
    for knot in knots {
        if time <= knot.0 {
            let share = (time - before.0) / (knot.0 - before.0).max(1e-9);
            return before.1 + share * (knot.1 - before.1);
        }
        before = *knot;
    }
    before.1
}

fn world(table_height_m: f64) -> WorldConfig {
    WorldConfig {
        control_period_secs: TICK_SECS / f64::from(TICK_STEPS),
        control_steps: 1,
        solver_iterations: 4,
        contact_frequency_hz: 60.0,
        contact_damping_ratio: 5.0,
        table_height_m,
        gravity_mps2: 9.81,
        tool_friction: 0.1,
        obstacle_friction: 0.5,
        arm_stiffness_npm: 50_000.0,
        restitution: 0.0,
        obstacle_mobility: ObstacleMobility::Fixed,
    }
}
