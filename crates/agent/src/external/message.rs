//! Version 1 of the world protocol: what is said, and what of it is believed. `docs/src/reference/world-protocol.md` describes it.

use std::collections::BTreeMap;

use physics_model::Theta;
use physics_model::config::ObstacleMobility;
use physics_model::robot::ToolShape;
use push_task::config::{ForceSensing, GoalConfig, NoiseConfig, ReachConfig};
use push_task::sensor::observation_names;
use push_task::{Action, WorldDistribution};
use scenario::Problem;
use serde::{Deserialize, Serialize};

use super::WorldError;
use super::error::one_line;

/// Version of the protocol that this crate speaks.
pub const PROTOCOL: u32 = 1;
/// Characters of a world's own error message that are kept.
const MESSAGE_CHARS: usize = 500;

/// What a world is asked. Keys may be added within a version, none renamed.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Request<'a> {
    Hello(Box<Hello<'a>>),
    Reset { trial: u32, seed: u64 },
    Act { step: u32, action: Action, move_m: [f64; 3] },
}

impl Request<'_> {
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Hello(_) => "hello",
            Self::Reset { .. } => "reset",
            Self::Act { .. } => "act",
        }
    }
}

/// What a world has to know: the first message.
#[derive(Debug, Serialize)]
pub(super) struct Hello<'a> {
    protocol: u32,
    robot: RobotFacts<'a>,
    /// Names of the observed values, in order, units in the names.
    observation: Vec<String>,
    /// Tool moves by index, m, base frame.
    actions: Vec<[f64; 3]>,
    task: TaskFacts<'a>,
    scene: SceneFacts<'a>,
}

#[derive(Debug, Serialize)]
struct RobotFacts<'a> {
    name: &'a str,
    joints: &'a [String],
    start_rad: &'a [f64],
    locked_joints: &'a BTreeMap<String, f64>,
    tool_rotation: [[f64; 3]; 3],
    tool_shapes: &'a [ToolShape],
}

#[derive(Debug, Serialize)]
struct TaskFacts<'a> {
    horizon: usize,
    discount: f64,
    table_height_m: f64,
    tool_start_m: [f64; 3],
    reach: &'a ReachConfig,
    goal: &'a GoalConfig,
    step_m: f64,
    control_steps: u32,
    control_period_secs: f64,
    moved_threshold_m: f64,
    sensing: ForceSensing,
    large_force_limit: f64,
}

#[derive(Debug, Serialize)]
struct SceneFacts<'a> {
    gravity_mps2: f64,
    tool_friction: f64,
    obstacle_friction: f64,
    obstacle_mobility: ObstacleMobility,
    noise: &'a NoiseConfig,
    distribution: &'a WorldDistribution,
}

impl<'a> Hello<'a> {
    pub(super) fn new(problem: &'a Problem) -> Self {
        let (scenario, robot) = (&problem.scenario, problem.model.robot());
        let (task, world, sensor) = (&scenario.task, &scenario.world, &scenario.sensor);
        Self {
            protocol: PROTOCOL,
            robot: RobotFacts {
                name: &scenario.robot.name,
                joints: &scenario.robot.actuated_joints,
                start_rad: &problem.start_joints_rad,
                locked_joints: &scenario.robot.locked_joints,
                tool_rotation: robot.tool_rotation(),
                tool_shapes: robot.tool_shapes(),
            },
            observation: observation_names(sensor.force, robot.joint_count()),
            actions: Action::ALL.map(|action| move_m(action, task.step_m)).to_vec(),
            task: TaskFacts {
                horizon: task.horizon,
                discount: task.discount,
                table_height_m: world.table_height_m,
                tool_start_m: task.tool_start_m,
                reach: &task.reach,
                goal: &task.goal,
                step_m: task.step_m,
                control_steps: world.control_steps,
                control_period_secs: world.control_period_secs,
                moved_threshold_m: task.reward.moved_threshold_m,
                sensing: sensor.force,
                large_force_limit: sensor.large_force_limit,
            },
            scene: SceneFacts {
                gravity_mps2: world.gravity_mps2,
                tool_friction: world.tool_friction,
                obstacle_friction: world.obstacle_friction,
                obstacle_mobility: world.obstacle_mobility,
                noise: &sensor.noise,
                distribution: &problem.worlds,
            },
        }
    }
}

/// The tool's way in an action, m, base frame.
pub(super) fn move_m(action: Action, step_m: f64) -> [f64; 3] {
    action.direction().map(|d| step_m * d)
}

/// What a world answers: the name of the request, or `error`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Answer {
    Hello(HelloAnswer),
    Reset(ResetAnswer),
    Act(ActAnswer),
    Error(ErrorAnswer),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HelloAnswer {
    pub(super) protocol: u32,
    pub(super) world: String,
    pub(super) version: String,
    pub(super) robot: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ResetAnswer {
    pub(super) trial: u32,
    pub(super) observation: Vec<f64>,
    pub(super) joints_rad: Option<Vec<f64>>,
    pub(super) tool_m: Option<[f64; 3]>,
    pub(super) has_obstacle: Option<bool>,
    pub(super) drawn: Option<Drawn>,
}

/// What a simulated world has drawn.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Drawn {
    pub(super) theta: Theta,
    pub(super) object: Place,
    pub(super) obstacle: Option<Place>,
}

/// Where a body stands.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Place {
    pub(super) position_m: [f64; 3],
    pub(super) yaw_rad: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ActAnswer {
    pub(super) step: u32,
    pub(super) observation: Vec<f64>,
    pub(super) joints_rad: Option<Vec<f64>>,
    pub(super) tool_m: Option<[f64; 3]>,
    pub(super) outcome: AnswerOutcome,
    pub(super) events: AnswerEvents,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum AnswerOutcome {
    Continue,
    Terminal,
    Diverged,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AnswerEvents {
    pub(super) large_force: bool,
    pub(super) out_of_reach: bool,
    pub(super) object_moved: bool,
    pub(super) goal: bool,
    pub(super) obstacle_touched: Option<bool>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ErrorAnswer {
    message: String,
}

impl Answer {
    /// Reads the answer to `request`.
    pub(super) fn parse(request: &'static str, text: &str) -> Result<Self, WorldError> {
        let mut json = serde_json::Deserializer::from_str(text);
        let parsed = serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let path = error.path().to_string();
            let field = path.strip_prefix(request).and_then(|rest| rest.strip_prefix('.')).unwrap_or(&path);
            wrong(request, field, &problem_of(error.inner()))
        });
        let answer: Self = parsed?;
        json.end().map_err(|_| wrong(request, ".", "expected one JSON object in a line, found more after it"))?;
        match answer {
            Self::Error(error) => {
                Err(WorldError::Reported { request, message: one_line(&error.message, MESSAGE_CHARS) })
            }
            answer if answer.name() == request => Ok(answer),
            other => Err(wrong(request, other.name(), &format!("expected an answer named `{request}`"))),
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Hello(_) => "hello",
            Self::Reset(_) => "reset",
            Self::Act(_) => "act",
            Self::Error(_) => "error",
        }
    }
}

fn problem_of(error: &serde_json::Error) -> String {
    let text = whole_file::plain(&error.to_string());
    // What people meet: JSON knows neither, but some languages write them.
    let hint = if text.starts_with("expected value") { " (JSON has neither NaN nor Infinity)" } else { "" };
    format!("{text}{hint}")
}

/// An error in a field of the answer to `request`.
pub(super) fn wrong(request: &'static str, field: &str, problem: &str) -> WorldError {
    WorldError::Answer { request, field: one_line(field, 100), problem: one_line(problem, 300) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use scenario::{Selection, find_root};
    use serde_json::{Value, json};

    use super::*;
    use crate::external::{check, identity};

    /// The JSON blocks of the documentation: hello, its answer, reset, its answer, the same with what was drawn, act, its answer,
    /// error, close.
    fn documented(root: &Path) -> Vec<String> {
        let text = std::fs::read_to_string(root.join("docs/src/reference/world-protocol.md")).unwrap();
        let blocks: Vec<String> =
            text.split("```json\n").skip(1).map(|b| b.split("```").next().unwrap().into()).collect();
        assert_eq!(blocks.len(), 9);
        blocks
    }

    /// Keys, types and lengths without the values.
    fn outline(value: &Value) -> Value {
        match value {
            Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), outline(value))).collect(),
            Value::Array(values) => values.iter().map(outline).collect(),
            Value::String(_) => json!("text"),
            Value::Number(_) => json!(0),
            Value::Bool(_) => json!(false),
            Value::Null => Value::Null,
        }
    }

    #[test]
    fn the_documentation_shows_what_is_sent_and_what_is_understood() {
        let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let selection = Selection { domain: "obstacle".into(), robot: "jaco".into(), ..Selection::new(&root) };
        let problem = Problem::assemble(&selection.load().unwrap(), &root).unwrap();
        let blocks = documented(&root);
        let action = Action::ALL[2];
        let sent = [
            (0, Request::Hello(Box::new(Hello::new(&problem)))),
            (2, Request::Reset { trial: 3, seed: 11_617_853_411_447_968_551 }),
            (5, Request::Act { step: 1, action, move_m: move_m(action, 0.02) }),
        ];
        for (block, request) in sent {
            let documented: Value = serde_json::from_str(&blocks[block]).unwrap();
            let mut sent = serde_json::to_value(&request).unwrap();
            if block == 0 {
                // Two of them are shown.
                sent["hello"]["robot"]["tool_shapes"].as_array_mut().unwrap().truncate(2);
            } else {
                assert_eq!(documented, sent);
            }
            assert_eq!(outline(&documented), outline(&sent), "{}", request.name());
        }
        let line = |block: usize| blocks[block].replace('\n', " ");
        let Answer::Hello(hello) = Answer::parse("hello", &line(1)).unwrap() else { panic!("a hello") };
        identity(&"robot".parse().unwrap(), &problem, hello).unwrap();
        let Answer::Reset(reset) = Answer::parse("reset", &line(3)).unwrap() else { panic!("a reset") };
        check::observation("reset", &problem, reset.observation).unwrap();
        let near = &problem.start_joints_rad;
        let joints = check::joints("reset", &problem, near, reset.joints_rad, reset.tool_m).unwrap();
        check::start("reset", &problem, &joints).unwrap();
        let Answer::Reset(reset) = Answer::parse("reset", &line(4)).unwrap() else { panic!("a reset") };
        let observation = check::observation("reset", &problem, reset.observation).unwrap();
        let first = (&observation, joints.as_slice());
        let drawn = check::drawn("reset", &problem, first, reset.has_obstacle, reset.drawn.unwrap()).unwrap();
        assert_eq!(drawn.state.obstacle.unwrap().position_m, [0.53, 0.05, 0.045]);
        let Answer::Act(act) = Answer::parse("act", &line(6)).unwrap() else { panic!("an act") };
        check::observation("act", &problem, act.observation).unwrap();
        check::joints("act", &problem, near, act.joints_rad, act.tool_m).unwrap();
        let error = Answer::parse("act", &line(7)).unwrap_err().to_string();
        assert!(error.contains("the gripper does not answer"), "{error}");
        assert_eq!(blocks[8].trim(), super::super::link::CLOSE);
    }
}
