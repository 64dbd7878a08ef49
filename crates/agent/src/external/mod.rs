//! Worlds that are not ours: a robot or another simulator behind the world protocol, JSON lines over the pipes of a child process or
//! over a socket of this machine. `docs/src/reference/world-protocol.md` is for those who write one.
//!
//! What a world sends is data: it is checked field by field and never names a file or a program.

mod address;
mod check;
mod error;
mod link;
mod message;
mod process;

use std::time::Duration;

use pomdp::Outcome;
use push_task::reward::Events;
use push_task::{Action, ActionReport, Observation, Particle};
use scenario::Problem;
use serde::{Deserialize, Serialize};

pub use address::WorldAddress;
pub use error::WorldError;
pub use link::LINE_LIMIT_BYTES;
pub use message::PROTOCOL;

use crate::{Error, World, WorldStep};
use link::Link;
use message::{Answer, AnswerOutcome, Hello, Request, wrong};

/// How long a world may take to answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// `hello`: from the start of the process or the connection.
    pub start: Duration,
    /// `reset`.
    pub reset: Duration,
    /// `act`.
    pub act: Duration,
}

/// What a world says it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WorldIdentity {
    /// The address that it was reached at: its command line, or its socket.
    pub address: String,
    /// Its name: letters, digits, `.`, `_` and `-`, first a letter or digit.
    pub name: String,
    /// Its version, likewise.
    pub version: String,
}

/// A running world. Dropping it ends it, by force if need be.
pub struct ExternalWorld {
    link: Link,
    timeouts: Timeouts,
    identity: WorldIdentity,
}

impl ExternalWorld {
    /// Starts the program or connects, and exchanges `hello`.
    ///
    /// # Errors
    ///
    /// A world that cannot be started, gives no proper answer in time, or speaks of another protocol or robot.
    pub fn start(address: &WorldAddress, timeouts: Timeouts, problem: &Problem) -> Result<Self, WorldError> {
        let mut link = Link::open(address, timeouts.start)?;
        let request = Request::Hello(Box::new(Hello::new(problem)));
        let answer = exchange(&mut link, &request, timeouts.start).and_then(|answer| {
            let Answer::Hello(hello) = answer else { unreachable!("the answer has the name of its request") };
            identity(address, problem, hello)
        });
        let identity = answer.inspect_err(|_| link.distrust())?;
        Ok(Self { link, timeouts, identity })
    }

    /// What it is.
    #[must_use]
    pub fn identity(&self) -> &WorldIdentity {
        &self.identity
    }

    /// An episode in it. `trial` and `seed` are all that a simulated world may draw its scene from.
    pub fn episode<'a>(&'a mut self, problem: &'a Problem, trial: u32, seed: u64) -> ExternalEpisode<'a> {
        ExternalEpisode {
            world: self,
            problem,
            trial,
            seed,
            steps: 0,
            joints_rad: problem.start_joints_rad.clone(),
            object_moved: false,
            has_obstacle: None,
            drawn: None,
        }
    }
}

fn identity(
    address: &WorldAddress,
    problem: &Problem,
    answer: message::HelloAnswer,
) -> Result<WorldIdentity, WorldError> {
    let bad = |field, problem: &str| Err(wrong("hello", field, problem));
    if answer.protocol != PROTOCOL {
        return bad("protocol", &format!("expected {PROTOCOL}, found {}", answer.protocol));
    }
    let robot = &problem.scenario.robot.name;
    if answer.robot != *robot {
        return bad("robot", &format!("expected {robot}, found {}", answer.robot));
    }
    // They become part of file names.
    let plain = |text: &str| {
        (1..=64).contains(&text.len())
            && text.starts_with(|c: char| c.is_ascii_alphanumeric())
            && text.chars().all(|c| c.is_ascii_alphanumeric() || ".-_".contains(c))
    };
    for (field, text) in [("world", &answer.world), ("version", &answer.version)] {
        if !plain(text) {
            let expectation = "expected 1 to 64 letters, digits, `.`, `_`, `-`, first a letter or digit, found";
            return bad(field, &format!("{expectation} {text:?}"));
        }
    }
    Ok(WorldIdentity { address: address.to_string(), name: answer.world, version: answer.version })
}

fn exchange(link: &mut Link, request: &Request<'_>, timeout: Duration) -> Result<Answer, WorldError> {
    let line = serde_json::to_string(request).expect("a request is plain data");
    let name = request.name();
    let answer = link.exchange(name, &line, timeout)?;
    Answer::parse(name, &answer).inspect_err(|_| link.distrust())
}

/// An episode in an external world.
pub struct ExternalEpisode<'a> {
    world: &'a mut ExternalWorld,
    problem: &'a Problem,
    trial: u32,
    seed: u64,
    steps: u32,
    joints_rad: Vec<f64>,
    object_moved: bool,
    has_obstacle: Option<bool>,
    drawn: Option<Particle>,
}

impl ExternalEpisode<'_> {
    /// Whether the scene has an obstacle, where the world says so: for tables, never for a method.
    #[must_use]
    pub fn has_obstacle(&self) -> Option<bool> {
        self.has_obstacle
    }

    /// Parameters and first places of what the world has drawn, where it says so: for statistics, never for a method.
    #[must_use]
    pub fn drawn(&self) -> Option<&Particle> {
        self.drawn.as_ref()
    }

    fn try_reset(&mut self) -> Result<(Observation, Vec<f64>), WorldError> {
        let request = Request::Reset { trial: self.trial, seed: self.seed };
        let answer = exchange(&mut self.world.link, &request, self.world.timeouts.reset)?;
        let Answer::Reset(answer) = answer else { unreachable!("the answer has the name of its request") };
        if answer.trial != self.trial {
            return Err(wrong("reset", "trial", &format!("expected {}, found {}", self.trial, answer.trial)));
        }
        let observation = check::observation("reset", self.problem, answer.observation)?;
        let near = &self.problem.start_joints_rad;
        self.joints_rad = check::joints("reset", self.problem, near, answer.joints_rad, answer.tool_m)?;
        check::start("reset", self.problem, &self.joints_rad)?;
        let first = (&observation, self.joints_rad.as_slice());
        let drawn = |drawn| check::drawn("reset", self.problem, first, answer.has_obstacle, drawn);
        self.drawn = answer.drawn.map(drawn).transpose()?;
        let said = self.drawn.as_ref().map(|drawn| drawn.theta.obstacle.is_some());
        (self.steps, self.object_moved, self.has_obstacle) = (0, false, answer.has_obstacle.or(said));
        Ok((observation, self.joints_rad.clone()))
    }

    fn try_act(&mut self, action: Action) -> Result<WorldStep, WorldError> {
        let task = &self.problem.scenario.task;
        self.steps += 1;
        let move_m = message::move_m(action, task.step_m);
        let request = Request::Act { step: self.steps, action, move_m };
        let answer = exchange(&mut self.world.link, &request, self.world.timeouts.act)?;
        let Answer::Act(answer) = answer else { unreachable!("the answer has the name of its request") };
        if answer.step != self.steps {
            return Err(wrong("act", "step", &format!("expected {}, found {}", self.steps, answer.step)));
        }
        let events = answer.events;
        if events.goal != (answer.outcome == AnswerOutcome::Terminal) {
            let expectation = "expected `terminal` with events.goal and only then";
            return Err(wrong("act", "outcome", &format!("{expectation}, found events.goal {}", events.goal)));
        }
        let observation = check::observation("act", self.problem, answer.observation)?;
        self.joints_rad = check::joints("act", self.problem, &self.joints_rad, answer.joints_rad, answer.tool_m)?;
        let first_moved = events.object_moved && !self.object_moved;
        self.object_moved |= events.object_moved;
        let (large_force, out_of_reach, goal) = (events.large_force, events.out_of_reach, events.goal);
        let report = ActionReport {
            events: Events { large_force, out_of_reach, first_moved, goal },
            obstacle_touched: events.obstacle_touched.unwrap_or(false),
            ..ActionReport::default()
        };
        // As in the planner's model: an impossible world costs what an endless episode costs.
        let cost = if answer.outcome == AnswerOutcome::Diverged { task.endless_cost() } else { 0.0 };
        Ok(WorldStep {
            observation,
            joints_rad: self.joints_rad.clone(),
            reward: task.reward.reward(report.events) + cost,
            outcome: match answer.outcome {
                AnswerOutcome::Continue => Outcome::Continue,
                AnswerOutcome::Terminal => Outcome::Terminal,
                AnswerOutcome::Diverged => Outcome::Diverged,
            },
            report,
        })
    }
}

impl World for ExternalEpisode<'_> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
        self.try_reset().map_err(|error| {
            self.world.link.distrust();
            error.into()
        })
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, Error> {
        self.try_act(action).map_err(|error| {
            self.world.link.distrust();
            error.into()
        })
    }

    /// Nobody knows: what a world says it has drawn is for statistics.
    fn truth(&self) -> Option<&Particle> {
        None
    }
}
