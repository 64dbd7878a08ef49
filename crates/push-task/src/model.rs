//! The pushing task as a generative model over particles (s, Θ).

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use physics_model::config::ArmConfig;
use physics_model::effect::{Effect, EffectConfig, Effects, Hooks, Memory, Nominal, ToolMoment, signal, unknown};
use physics_model::error::Impossible;
use physics_model::feasible::{check_overlaps, check_theta};
use physics_model::motion::JointPath;
use physics_model::robot::Robot;
use physics_model::state::{BodyState, unit_quaternion};
use physics_model::theta::Theta;
use physics_model::world::{Divergence, ToolPose};
use pomdp::{Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Rng, Step};
use serde::{Deserialize, Serialize};

use crate::action::Action;
use crate::config::{ForceSensing, PushConfig};
use crate::force::{ForceSensor, resting_reading};
use crate::perturb;
use crate::reward::Events;
use crate::sensor::{Observation, ObservationKey, Readings};
use crate::simulation::{Course, Simulation};
use crate::state::State;
use crate::transition_noise::SETTLING;

/// Standard deviations of where the tool comes to rest, m: at the end of its way, and where something stops it, which may be a control step earlier
/// or later (2 mm at full speed).
const TOOL_M: f64 = 0.0005;
const TOOL_STOP_M: f64 = 0.002;
/// Attempts at moving a hypothesis to a possible one.
const PERTURB_DRAWS: usize = 5;

/// One hypothesis: state and parameters, with what of the past the rewards and the sensors need.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Particle {
    /// s.
    pub state: State,
    /// Θ.
    pub theta: Theta,
    /// Whether the object has been moved in this episode: that reward is given once.
    pub object_moved: bool,
    /// Noise-free force readings of the last action (see [`Readings::force`]).
    pub force: [f64; 6],
    /// What effects remember; only where one of them does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Box<Memory>>,
}

impl Particle {
    /// A hypothesis at the start of an episode.
    #[must_use]
    pub fn new(state: State, theta: Theta) -> Self {
        Self { state, theta, object_moved: false, force: [0.0; 6], memory: None }
    }
}

/// What the arm answered to an action.
#[derive(Clone, Copy, Debug)]
pub struct Answer<'a> {
    /// Sensor values.
    pub observation: &'a Observation,
    /// Joint positions after the action, rad.
    pub joints_rad: &'a [f64],
}

/// What happened in an action, for records and statistics.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActionReport {
    /// Reward events.
    pub events: Events,
    /// The object or the tool pushed against the obstacle.
    pub obstacle_touched: bool,
    /// The tool touched something.
    pub tool_touched: bool,
    /// The tool touched something, or the object moved: the action has the noise of a push.
    pub pushed: bool,
    /// The simulation ended in an impossible world; the particle is as it was before.
    pub divergence: Option<Divergence>,
}

/// The simulator G(s, a | Θ) of the pushing task.
#[derive(Clone, Debug)]
pub struct PushModel {
    config: PushConfig,
    robot: Arc<Robot>,
    effects: Arc<Vec<Box<dyn Effect>>>,
    tool_orientation: UnitQuaternion<f64>,
}

impl PushModel {
    /// A model of `robot` in the world, task and sensors of `config`.
    #[must_use]
    pub fn new(config: PushConfig, robot: Arc<Robot>) -> Self {
        let effects: Arc<Vec<Box<dyn Effect>>> = Arc::new(config.effects.iter().map(EffectConfig::build).collect());
        let tool_orientation = robot.tool_orientation();
        Self { config, robot, effects, tool_orientation }
    }

    /// Configuration.
    #[must_use]
    pub fn config(&self) -> &PushConfig {
        &self.config
    }

    /// The arm.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Number of actuated joints.
    #[must_use]
    pub fn joint_count(&self) -> usize {
        self.robot.joint_count()
    }

    /// Tool centre, m, base frame.
    #[must_use]
    pub fn tool_position_m(&self, joints_rad: &[f64]) -> [f64; 3] {
        self.robot.base_from_tool(joints_rad).translation.vector.into()
    }

    /// Joint positions that bring the tool centre to `position_m` in its fixed orientation, starting from `seed_rad`; `None` where there
    /// are none within the limits.
    #[must_use]
    pub fn joints_for(&self, seed_rad: &[f64], position_m: [f64; 3]) -> Option<Vec<f64>> {
        let target = Isometry3::from_parts(Translation3::from(Vector3::from(position_m)), self.tool_orientation);
        self.robot.solve_ik(seed_rad, &target).ok()
    }

    /// Whether the hypothesis can be a world at all.
    ///
    /// # Errors
    ///
    /// [`Impossible`]: a value out of its range, or bodies that overlap.
    pub fn check(&self, particle: &Particle) -> Result<(), Impossible> {
        check_theta(&particle.theta)?;
        let state = &particle.state;
        let tool = self.tool_pose(&state.joints_rad);
        check_overlaps(
            &self.config.world,
            &particle.theta,
            &state.object,
            state.obstacle.as_ref(),
            &tool,
            self.robot.tool_shapes(),
        )
    }

    /// What noise-free sensors would say in the state that `particle` is in.
    #[must_use]
    pub fn readings(&self, particle: &Particle) -> Readings {
        let mut object = particle.state.object;
        if let Some(memory) = &particle.memory {
            memory.apply_lag(&mut object);
        }
        let own = self.own_effects(&particle.theta);
        let effects = Effects::new(own.as_deref().unwrap_or(&self.effects));
        if effects.hooks.contains(Hooks::POSE) {
            object = signal::read(effects.list, &object);
        }
        Readings { joints_rad: particle.state.joints_rad.clone(), force: particle.force, object }
    }

    /// The state behind a measured pose, at rest, as the effects of the list have it: what an offset or a turned frame has made of it is undone.
    #[must_use]
    pub fn unread_pose(&self, (position_m, orientation): ([f64; 3], [f64; 4])) -> ([f64; 3], [f64; 4]) {
        if !Hooks::of(&self.effects).contains(Hooks::POSE) {
            return (position_m, orientation);
        }
        let reading = BodyState { position_m, orientation, ..BodyState::at_rest([0.0; 3], 0.0) };
        let body = signal::unread(&self.effects, &reading);
        (body.position_m, body.orientation)
    }

    /// Moves the object of a hypothesis that stands where the effects of the list have put a reading to where its own values of theirs put it, on the table as
    /// before: of an unknown offset each hypothesis has its own place behind one reading.
    pub fn displace(&self, particle: &mut Particle) {
        let Some(own) = self.own_effects(&particle.theta) else { return };
        if !Hooks::of(&own).contains(Hooks::POSE) {
            return;
        }
        let object = &mut particle.state.object;
        let height_m = object.position_m[2];
        let body = signal::unread(&own, &signal::read(&self.effects, object));
        object.position_m = [body.position_m[0], body.position_m[1], height_m];
        object.orientation = body.orientation;
    }

    /// What a hypothesis that joins the belief after an action remembers, by one that was in it before: the time. `None` where no effect
    /// needs it.
    #[must_use]
    pub fn memory_after_action(&self, before: &Particle) -> Option<Box<Memory>> {
        let own = self.own_effects(&before.theta);
        Hooks::of(own.as_deref().unwrap_or(&self.effects)).contains(Hooks::MEMORY).then(|| {
            let mut memory = before.memory.clone().unwrap_or_default();
            memory.elapsed_secs += self.config.world.control_period_secs * f64::from(self.config.world.control_steps);
            memory
        })
    }

    /// The force readings that an observation holds (see [`Readings::force`]).
    #[must_use]
    pub fn measured_force(&self, observation: &Observation) -> [f64; 6] {
        let joints = self.joint_count();
        let first = match self.config.sensor.force {
            ForceSensing::Wrist => joints,
            ForceSensing::JointTorques => 0,
        };
        let mut force = [0.0; 6];
        for (slot, value) in force.iter_mut().zip(&observation.0[first..observation.0.len() - 7]) {
            *slot = *value;
        }
        force
    }

    /// Whether noise-free sensors would put the particle into the class of `observation`.
    #[must_use]
    pub fn agrees(&self, particle: &Particle, observation: &Observation) -> bool {
        self.key(&self.config.sensor.noise_free(&self.readings(particle))) == self.key(observation)
    }

    /// Observation before the first action: no contact force yet.
    pub fn initial_observation(&self, particle: &mut Particle, rng: &mut Rng) -> Observation {
        let own = self.own_effects(&particle.theta);
        let effects = Effects::new(own.as_deref().unwrap_or(&self.effects));
        particle.force = self.resting(effects, &particle.state.joints_rad);
        self.config.sensor.observe(&self.readings(particle), rng)
    }

    /// Noise-free force readings of an arm that stands still without contact (see [`Readings::force`]).
    #[must_use]
    pub fn resting_force(&self, joints_rad: &[f64]) -> [f64; 6] {
        self.resting(Effects::new(&self.effects), joints_rad)
    }

    fn resting(&self, effects: Effects, joints_rad: &[f64]) -> [f64; 6] {
        let moment = ToolMoment {
            time_secs: 0.0,
            orientation: self.tool_pose(joints_rad).orientation,
            acceleration_mps2: [0.0; 3],
            gravity_mps2: self.config.world.gravity_mps2,
        };
        resting_reading(&self.robot, &self.config.sensor, effects, joints_rad, &moment)
    }

    /// One action, in place, with a report of what happened. The observation, reward and outcome are those of
    /// [`GenerativeModel::step`].
    pub fn act(&self, particle: &mut Particle, action: Action, rng: &mut Rng) -> (Step<Observation>, ActionReport) {
        let task = &self.config.task;
        let before = particle.state.object.position_m;
        let mut report = self.advance(particle, action);
        if report.divergence.is_some() {
            // The state stays as it was, so that nothing downstream meets a value that is not finite.
            let observation = self.config.sensor.observe(&self.readings(particle), rng);
            let reward = task.reward.reward(report.events) + task.endless_cost();
            return (Step { observation, reward, outcome: Outcome::Diverged }, report);
        }
        self.disturb(particle, report.pushed, rng);
        self.settle(particle, before, &mut report);
        let observation = self.config.sensor.observe(&self.readings(particle), rng);
        let outcome = if report.events.goal { Outcome::Terminal } else { Outcome::Continue };
        (Step { observation, reward: task.reward.reward(report.events), outcome }, report)
    }

    /// One action of a history, in place: f(s, a | Θ), then the noise that `answer` asks for. Returns ln p(observation | state before, action)
    /// with the noise of the transition integrated out; −∞ where the action cannot have been that one. The state after it is a draw from what
    /// the observation leaves of the noise, which `coordinates` decide: [`STEP_COORDINATES`](crate::STEP_COORDINATES) standard normal numbers.
    ///
    /// The arm reports where its joints are, so that particles take them over. Where a particle's own arm came to rest elsewhere, that counts
    /// against it.
    pub fn replay(&self, particle: &mut Particle, action: Action, answer: Answer<'_>, coordinates: &[f64]) -> f64 {
        let before = particle.state.object.position_m;
        let mut report = self.advance(particle, action);
        if report.divergence.is_some() {
            return f64::NEG_INFINITY;
        }
        let stop_m = if report.events.large_force { TOOL_STOP_M } else { 0.0 };
        let (reached, measured) =
            (self.tool_position_m(&particle.state.joints_rad), self.tool_position_m(answer.joints_rad));
        let missed = (0..3).map(|i| (reached[i] - measured[i]).powi(2)).sum::<f64>().sqrt();
        let stop = gaussian(missed, TOOL_M.hypot(stop_m));
        particle.state.joints_rad.copy_from_slice(answer.joints_rad);

        let noise = self.config.transition_noise.of(report.pushed);
        let readings = self.readings(particle);
        let (log_likelihood, object) =
            noise.explain(&self.config.sensor, &readings, &particle.state.object, answer.observation, coordinates);
        if !log_likelihood.is_finite() {
            return f64::NEG_INFINITY;
        }
        let simulated = std::mem::replace(&mut particle.state.object, object);
        if self.check(particle).is_err() {
            // Measured into something else: the simulated pose stays, unless the arm went to where it is.
            particle.state.object = simulated;
            if self.check(particle).is_err() {
                return f64::NEG_INFINITY;
            }
        }
        self.settle(particle, before, &mut report);
        // The episode goes on, so that the object is not at the goal.
        if report.events.goal { f64::NEG_INFINITY } else { stop + log_likelihood }
    }

    /// Upper bound of what [`Self::replay`] can return.
    #[must_use]
    pub fn most_log_likelihood(&self) -> f64 {
        self.config.sensor.most_log_likelihood(self.joint_count()) + gaussian(0.0, TOOL_M)
    }

    /// s' = f(s, a | Θ), in place: without noise and without what follows for rewards.
    fn advance(&self, particle: &mut Particle, action: Action) -> ActionReport {
        let task = &self.config.task;
        let tool = self.tool_pose(&particle.state.joints_rad);
        let start = tool.position_m;
        let direction = action.direction();
        let target: [f64; 3] = std::array::from_fn(|i| start[i] + task.step_m * direction[i]);
        let goal_joints =
            if task.reach.contains(target) { self.joints_for(&particle.state.joints_rad, target) } else { None };
        let mut report = ActionReport::default();
        report.events.out_of_reach = goal_joints.is_none();

        let course = Course { tool, target_m: if goal_joints.is_some() { target } else { start } };
        let own = self.own_effects(&particle.theta);
        let effects = Effects::new(own.as_deref().unwrap_or(&self.effects));
        let nominal = Nominal::with_effects(&self.config.world, &particle.theta, effects.list);
        let period_secs = nominal.as_ref().map_or(&self.config.world, |nominal| &nominal.world).control_period_secs;
        let path = self.joint_path(effects, &particle.state.joints_rad, goal_joints.as_deref(), start, target);
        let mut sensor = ForceSensor::new(&self.robot, &self.config.sensor, effects, period_secs, path);
        let simulation = Simulation::new(self, particle, effects, nominal.as_ref(), &course, path.as_ref());
        let end = simulation.run(&mut sensor, &mut report);
        if report.divergence.is_some() {
            return report;
        }
        let (from, to) = (&particle.state.object, &end.object);
        let moved_m = (0..3).map(|i| (to.position_m[i] - from.position_m[i]).powi(2)).sum::<f64>().sqrt();
        let turned_rad = unit_quaternion(to.orientation).angle_to(&unit_quaternion(from.orientation));
        report.pushed = report.tool_touched || moved_m > SETTLING || turned_rad > SETTLING;
        particle.state.object = end.object;
        particle.state.obstacle = end.obstacle;
        if let Some(joints) = end.joints_rad {
            particle.state.joints_rad = joints;
        } else if let Some(joints) = goal_joints {
            // A move that was stopped early ends on the way to its target.
            particle.state.joints_rad = if end.tool_m == target {
                joints
            } else {
                self.joints_for(&particle.state.joints_rad, end.tool_m).unwrap_or(joints)
            };
        }
        particle.force = sensor.mean(&particle.state.joints_rad);
        if effects.hooks.contains(Hooks::MEMORY) {
            let memory = particle.memory.get_or_insert_default();
            memory.elapsed_secs += end.duration_secs;
            memory.play_rad = end.play_rad.unwrap_or(memory.play_rad);
            if let Some(hidden) = end.hidden {
                memory.hidden = hidden;
            }
            if let Some(seen) = end.seen {
                memory.note_lag(&seen, &particle.state.object);
            }
        }
        report
    }

    /// Adds the noise of the transition; no random number where there is none.
    fn disturb(&self, particle: &mut Particle, pushed: bool, rng: &mut Rng) {
        if self.config.transition_noise.is_none() {
            return;
        }
        let noise = self.config.transition_noise.of(pushed);
        let wrist = self.config.sensor.force == ForceSensing::Wrist;
        let (object, force) = noise.draw(&particle.state.object, &particle.force, wrist, rng);
        particle.force = force;
        let simulated = std::mem::replace(&mut particle.state.object, object);
        if self.check(particle).is_err() {
            // Disturbed into something else.
            particle.state.object = simulated;
        }
    }

    /// What the end of an action means for rewards; `before` is where the object was, m.
    fn settle(&self, particle: &mut Particle, before: [f64; 3], report: &mut ActionReport) {
        let task = &self.config.task;
        let after = particle.state.object.position_m;
        let moved = (0..3).map(|i| (after[i] - before[i]).powi(2)).sum::<f64>().sqrt();
        report.events.first_moved = !particle.object_moved && moved > task.reward.moved_threshold_m;
        particle.object_moved |= report.events.first_moved;
        report.events.goal = task.goal.contains(after);
    }

    pub(crate) fn tool_pose(&self, joints_rad: &[f64]) -> ToolPose {
        let base_from_tool = self.robot.base_from_tool(joints_rad);
        let q = base_from_tool.rotation;
        ToolPose { position_m: base_from_tool.translation.vector.into(), orientation: [q.i, q.j, q.k, q.w] }
    }

    /// The joints' way while the tool moves from `start_m` to `target_m`, or rests; `None` where neither the arm nor its sensor asks for it.
    fn joint_path(
        &self,
        effects: Effects,
        start_rad: &[f64],
        end_rad: Option<&[f64]>,
        start_m: [f64; 3],
        target_m: [f64; 3],
    ) -> Option<JointPath> {
        let dynamic = matches!(self.config.arm, ArmConfig::Dynamic(_)) || effects.hooks.contains(Hooks::JOINT_COMMAND);
        (dynamic || ForceSensor::needs_path(&self.config.sensor)).then(|| match end_rad {
            None => JointPath::resting(start_rad),
            Some(end_rad) => {
                let middle_m = std::array::from_fn(|i| 0.5 * (start_m[i] + target_m[i]));
                let middle_rad = self.joints_for(start_rad, middle_m).unwrap_or_else(|| {
                    // Both ends are within the limits: what lies between them is reachable but for the solver's last digits.
                    start_rad.iter().zip(end_rad).map(|(a, b)| 0.5 * (a + b)).collect()
                });
                JointPath::through(start_rad, &middle_rad, end_rad)
            }
        })
    }

    /// The effects with a hypothesis's own values; `None` where it has none and [`Self::effects`] are its own.
    fn own_effects(&self, theta: &Theta) -> Option<Vec<Box<dyn Effect>>> {
        (!theta.effects.is_empty()).then(|| unknown::build(&self.config.effects, &theta.effects))
    }
}

impl GenerativeModel for PushModel {
    type State = Particle;
    type Action = Action;
    type Observation = Observation;

    fn actions(&self) -> &[Action] {
        &Action::ALL
    }

    fn step(&self, particle: &mut Particle, action: &Action, rng: &mut Rng) -> Step<Observation> {
        self.act(particle, *action, rng).0
    }

    fn discount(&self) -> f64 {
        self.config.task.discount
    }
}

impl ObservationModel for PushModel {
    fn log_likelihood(&self, _action: &Action, next: &Particle, observation: &Observation) -> f64 {
        self.config.sensor.log_likelihood(observation, &self.readings(next), &self.config.transition_noise)
    }
}

impl Discretise for PushModel {
    type Key = ObservationKey;

    fn key(&self, observation: &Observation) -> ObservationKey {
        self.config.sensor.key(observation, self.joint_count())
    }
}

impl Perturb for PushModel {
    fn perturb(&self, particle: &mut Particle, rng: &mut Rng) {
        // Noise may push bodies into one another; such a hypothesis is drawn again, and stays as it was where none is possible.
        for _ in 0..PERTURB_DRAWS {
            let mut moved = particle.clone();
            perturb::perturb(&self.config.perturb, self.config.world.table_height_m, &mut moved, rng);
            if self.check(&moved).is_ok() {
                *particle = moved;
                return;
            }
        }
    }
}

/// ln of the density of N(0, stddev²) at `value`.
pub(crate) fn gaussian(value: f64, stddev: f64) -> f64 {
    -0.5 * (value / stddev).powi(2) - stddev.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
}
