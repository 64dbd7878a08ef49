//! Time of one action: restore (s, Θ), 20 control steps, observation.
//!
//! Every program's batch is timed in turn, by thread CPU time, and the medians of the batches are compared: a shared machine slows all of
//! them alike. The scene is the same for all: a box of 0.5 kg with the tool at its face, moved by 2 cm; an obstacle in its way that it
//! meets half-way, movable or fixed.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use anyhow::{Result, anyhow};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::Effect;
use physics_model::motion::minimum_jerk;
use physics_model::robot::ToolShape;
use physics_model::world::{ToolPose, World, Wrench};
use physics_model::{BodyState, ObjectShape, ObjectTheta, ObstacleTheta, Theta};
use pomdp::{Purpose, Seed};
use push_task::{Action, Particle, PushModel, State};
use scenario::{Problem, Scenario, Selection};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::peer::Peer;
use crate::scenes::{MOVE_M, Tool};

/// Obstacle of a case, in the order of the tables.
pub const OBSTACLES: [&str; 3] = ["none", "movable", "fixed"];
/// Tool of a case.
pub const TOOLS: [(&str, Tool); 2] = [("ball", Tool::Ball), ("hand", Tool::Hand)];

/// How long to measure.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Batches of every program.
    pub rounds: usize,
    /// Actions in a batch.
    pub actions: usize,
}

/// One case, ready to run.
pub struct Case {
    config: WorldConfig,
    effects: Vec<Box<dyn Effect>>,
    theta: Theta,
    object: BodyState,
    obstacle: Option<BodyState>,
    tool_m: [f64; 3],
    shapes: Vec<ToolShape>,
}

impl Case {
    /// The case `obstacle` × `tool` in the world and with the effects that the scenario plans with.
    #[must_use]
    pub fn new(scenario: &Scenario, obstacle: &str, tool: Tool) -> Self {
        let mobility = if obstacle == "movable" { ObstacleMobility::Movable } else { ObstacleMobility::Fixed };
        Self {
            config: WorldConfig { table_height_m: 0.0, obstacle_mobility: mobility, ..scenario.world.clone() },
            effects: scenario.effects.model.iter().map(physics_model::effect::EffectConfig::build).collect(),
            theta: theta(obstacle != "none"),
            object: BodyState::at_rest([0.0, 0.065, 0.045], 0.0),
            obstacle: (obstacle != "none").then(|| BodyState::at_rest([0.03, 0.14, 0.045], 0.0)),
            tool_m: match tool {
                Tool::Ball => [0.0, 0.0, 0.05],
                // Its fingers lead by 9 cm and 12 mm of radius; the object's face is at 2.5 cm.
                Tool::Hand => [0.0, 0.025 - 0.102, 0.06],
            },
            shapes: tool.shapes(),
        }
    }

    /// Builds the world of (s, Θ).
    #[must_use]
    pub fn restore(&self) -> World<'_> {
        let tool = ToolPose { position_m: self.tool_m, orientation: [0.0, 0.0, 0.0, 1.0] };
        let obstacle = self.obstacle.as_ref();
        World::restore(&self.config, &self.effects, &self.theta, &self.object, obstacle, &tool, &self.shapes)
    }

    /// One control step of the action; `step` from 1.
    pub fn step(&self, world: &mut World, step: u32) -> Wrench {
        let share = MOVE_M * minimum_jerk(f64::from(step) / f64::from(self.config.control_steps));
        world.step([self.tool_m[0], self.tool_m[1] + share, self.tool_m[2]])
    }

    /// The whole action; what it observes.
    #[must_use]
    pub fn act(&self) -> (BodyState, Wrench, bool) {
        let mut world = self.restore();
        let (mut mean, mut touched) = (Wrench::default(), false);
        for step in 1..=self.config.control_steps {
            let wrench = self.step(&mut world, step);
            mean.add_scaled(&wrench, 1.0 / f64::from(self.config.control_steps));
            touched |= world.obstacle_touched();
        }
        (world.object(), mean, touched)
    }
}

fn theta(obstacle: bool) -> Theta {
    Theta {
        object: ObjectTheta {
            shape: ObjectShape::Box,
            mass_kg: 0.5,
            com_m: [0.0; 3],
            friction: 0.4,
            size_m: [0.08, 0.08, 0.09],
        },
        obstacle: obstacle.then_some(ObstacleTheta {
            shape: ObjectShape::Box,
            mass_kg: 1.0,
            size_m: [0.05, 0.05, 0.09],
        }),
        effects: vec![],
    }
}

/// The transition of an arm's task with the tool at the object: inverse kinematics, world, sensors, reward.
pub struct Transition {
    model: PushModel,
    particle: Particle,
}

impl Transition {
    /// For an arm; the object stands 5 mm ahead of where its tool starts.
    ///
    /// # Errors
    ///
    /// A scenario that does not load, or a start without a possible world.
    pub fn new(root: &Path, robot: &str, obstacle: &str) -> Result<Self> {
        let mut selection = Selection { robot: robot.into(), ..Selection::new(root) };
        selection
            .set
            .push(format!("world.obstacle_mobility=\"{}\"", if obstacle == "movable" { "movable" } else { "fixed" }));
        let problem = Problem::assemble(&selection.load()?, root)?;
        let tool = problem.scenario.task.tool_start_m;
        let table = problem.scenario.world.table_height_m;
        let theta = theta(obstacle != "none");
        for millimetres in 0..200 {
            let y = tool[1] + 0.001 * f64::from(millimetres);
            let state = State {
                joints_rad: problem.start_joints_rad.clone(),
                object: BodyState::at_rest([tool[0], y, table + 0.045], 0.0),
                obstacle: (obstacle != "none")
                    .then(|| BodyState::at_rest([tool[0] + 0.03, y + 0.075, table + 0.045], 0.0)),
            };
            let mut particle = Particle::new(state, theta.clone());
            if problem.model.check(&particle).is_ok() {
                particle.state.object.position_m[1] += 0.006;
                return Ok(Self { model: problem.model, particle });
            }
        }
        Err(anyhow!("{robot}: expected a place for the object ahead of the tool"))
    }

    /// One transition.
    pub fn act(&self) {
        let mut particle = self.particle.clone();
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        black_box(self.model.act(black_box(&mut particle), Action::ALL[2], &mut rng));
    }
}

/// CPU time of this thread, s.
pub(crate) fn thread_secs() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// µs of thread CPU time per call.
fn batch_us(calls: usize, mut call: impl FnMut()) -> f64 {
    let start = thread_secs();
    for _ in 0..calls {
        call();
    }
    1e6 * (thread_secs() - start) / calls as f64
}

fn median(values: &[f64]) -> f64 {
    statistics::nearest_rank(values.iter().copied(), 0.5).expect("at least one batch was timed")
}

/// Throughput of all cores over that of one, by wall time: a core runs as many actions alone as each of all cores does at once.
#[must_use]
pub fn scaling(case: &Case, effort: Effort) -> Scaling {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let wall = |threads: usize| {
        #[expect(clippy::disallowed_methods, reason = "a benchmark measures time; no result depends on it")]
        let start = Instant::now();
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    for _ in 0..effort.actions {
                        black_box(case.act());
                    }
                });
            }
        });
        start.elapsed().as_secs_f64()
    };
    let ratios: Vec<f64> = (0..effort.rounds).map(|_| cores as f64 * wall(1) / wall(cores)).collect();
    Scaling { cores, speedup: median(&ratios) }
}

/// Speed-up by all cores.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Scaling {
    /// Cores.
    pub cores: usize,
    /// Median over the rounds.
    pub speedup: f64,
}

/// Runs everything in turn; the object of the contract in DESIGN.md.
///
/// # Errors
///
/// A scenario that does not load, or a peer that is installed but fails.
pub fn run(root: &Path, effort: Effort, mut note: impl FnMut(&str)) -> Result<Value> {
    let scenario = Selection::new(root).load()?;
    let mujoco = Peer::find(root, "mujoco_bench.py", &["--substeps", "1", "2"], &mut note)?;
    let pybullet = Peer::find(root, "pybullet_bench.py", &["--substeps", "1", "2"], &mut note)?;
    let cases: Vec<(&str, &str, Case)> = OBSTACLES
        .iter()
        .flat_map(|obstacle| TOOLS.iter().map(move |(tool, shape)| (*obstacle, *tool, *shape)))
        .map(|(obstacle, tool, shape)| (obstacle, tool, Case::new(&scenario, obstacle, shape)))
        .collect();
    let mut ours: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    let mut theirs: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for round in 1..=effort.rounds {
        note(&format!("round {round} of {}", effort.rounds));
        for (obstacle, tool, case) in &cases {
            let us = batch_us(effort.actions, || {
                black_box(case.act());
            });
            ours.entry((obstacle, tool)).or_default().push(us);
        }
        for peer in [&mujoco, &pybullet].into_iter().flatten() {
            peer.round(effort.actions, &mut theirs)?;
        }
    }
    let mut result = Map::new();
    for tool in TOOLS.map(|(tool, _)| tool) {
        let mut rows = Map::new();
        for obstacle in OBSTACLES {
            let us = median(&ours[&(obstacle, tool)]);
            let peer = |what: &str| theirs.get(&format!("{obstacle}/{tool}/{what}")).map(|values| median(values));
            let pyramidal = peer("pyramidal_us/1");
            let elliptic = peer("elliptic_us/1");
            rows.insert(
                obstacle.into(),
                json!({
                    "us": us,
                    "mujoco_pyramidal_us": pyramidal,
                    "mujoco_elliptic_us": elliptic,
                    "mujoco_pyramidal_2_substeps_us": peer("pyramidal_us/2"),
                    "mujoco_elliptic_2_substeps_us": peer("elliptic_us/2"),
                    "pybullet_us": peer("pybullet_us/1"),
                    "ratio": pyramidal.map(|p| us / p),
                    "ratio_elliptic": elliptic.map(|e| us / e),
                }),
            );
        }
        // The ball's rows are the contract's; the hand's lie beside them.
        if tool == "ball" {
            result.extend(rows);
        } else {
            result.insert(tool.into(), Value::Object(rows));
        }
    }
    note("parts, transitions of both arms, scaling");
    result.insert("parts".into(), parts(&cases, effort));
    result.insert("transition".into(), transitions(root, effort)?);
    result.insert("scaling".into(), json!(scaling(&cases[0].2, effort)));
    result.insert(
        "provenance".into(),
        json!({
            "machine": machine(),
            "commit": scenario::commit(root),
            "rounds": effort.rounds,
            "actions": effort.actions,
            "control_steps": scenario.world.control_steps,
            "solver_iterations": scenario.world.solver_iterations,
            "mujoco": mujoco.as_ref().and_then(Peer::version),
            "pybullet": pybullet.as_ref().and_then(Peer::version),
        }),
    );
    Ok(Value::Object(result))
}

fn parts(cases: &[(&str, &str, Case)], effort: Effort) -> Value {
    let mut parts = Map::new();
    for (obstacle, tool, case) in cases.iter().filter(|(_, tool, _)| *tool == "ball") {
        let restore: Vec<f64> =
            (0..effort.rounds).map(|_| batch_us(effort.actions, || drop(black_box(case.restore())))).collect();
        let whole: Vec<f64> = (0..effort.rounds)
            .map(|_| {
                batch_us(effort.actions, || {
                    black_box(case.act());
                })
            })
            .collect();
        let steps = f64::from(case.config.control_steps);
        let (restore, whole) = (median(&restore), median(&whole));
        parts.insert(
            (*obstacle).into(),
            json!({ "tool": tool, "restore_us": restore, "step_us": (whole - restore) / steps, "action_us": whole }),
        );
    }
    Value::Object(parts)
}

fn transitions(root: &Path, effort: Effort) -> Result<Value> {
    let mut arms = Map::new();
    for robot in ["sawyer", "jaco"] {
        let mut rows = Map::new();
        for obstacle in OBSTACLES {
            let transition = Transition::new(root, robot, obstacle)?;
            let us: Vec<f64> = (0..effort.rounds).map(|_| batch_us(effort.actions, || transition.act())).collect();
            rows.insert(format!("{obstacle}_us"), json!(median(&us)));
        }
        arms.insert(robot.into(), Value::Object(rows));
    }
    Ok(Value::Object(arms))
}

/// Name of the processor.
pub(crate) fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name));
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    format!("{}, {cores} cores", name.unwrap_or(std::env::consts::ARCH))
}
