//! One action: the tool moves along its course through a world built for it.

use physics_model::config::{ArmConfig, ObstacleMobility, WorldConfig};
use physics_model::effect::signal::PoseChain;
use physics_model::effect::{Effects, Hooks, Nominal, ToolMoment};
use physics_model::feasible::{check_overlaps, nothing_happens, parts_in_reach};
use physics_model::motion::minimum_jerk;
use physics_model::motion::{JointMoment, JointPath, ToolMotion};
use physics_model::state::{BodyState, MAX_JOINTS};
use physics_model::theta::Theta;
use physics_model::world::{Divergence, ToolPose, World, Wrench};

use crate::drive::Drive;
use crate::force::ForceSensor;
use crate::model::{ActionReport, Particle, PushModel};

/// Control steps between two looks at whether anything will still happen in an action.
const QUIET_CHECK_STEPS: u32 = 4;

/// Where the tool is to go in an action: in a straight line, in its fixed orientation.
pub(crate) struct Course {
    pub(crate) tool: ToolPose,
    pub(crate) target_m: [f64; 3],
}

/// What an action left behind.
pub(crate) struct End {
    pub(crate) object: BodyState,
    pub(crate) obstacle: Option<BodyState>,
    /// Bodies that only effects know of, if there was a world.
    pub(crate) hidden: Option<Vec<BodyState>>,
    pub(crate) tool_m: [f64; 3],
    /// Where the arm ended, rad, unless that follows from the tool.
    pub(crate) joints_rad: Option<Vec<f64>>,
    /// Where the joints stand in their play, rad.
    pub(crate) play_rad: Option<[f64; MAX_JOINTS]>,
    /// The object as a late pose sensor shows it.
    pub(crate) seen: Option<BodyState>,
    /// How long it took, s.
    pub(crate) duration_secs: f64,
}

/// How far the tool has been commanded to go.
struct Way {
    /// Control steps of the path that are made.
    made: u32,
    share: f64,
    position_m: [f64; 3],
    stopped: bool,
}

/// An action in the making.
pub(crate) struct Simulation<'a> {
    model: &'a PushModel,
    particle: &'a Particle,
    effects: Effects<'a>,
    /// With the effects.
    config: &'a WorldConfig,
    theta: &'a Theta,
    course: &'a Course,
    path: Option<&'a JointPath>,
    drive: Option<Drive>,
    world: Option<World<'a>>,
    way: Way,
    /// Where the last command sends the tool, m: on its way, unless an effect says otherwise.
    sent_m: [f64; 3],
    /// Nothing happens in all of the action.
    quiet: bool,
    /// Nothing happens any more.
    ended: bool,
}

impl<'a> Simulation<'a> {
    /// Before the first step. `nominal` is what the effects make of the world, if anything.
    pub(crate) fn new(
        model: &'a PushModel,
        particle: &'a Particle,
        effects: Effects<'a>,
        nominal: Option<&'a Nominal>,
        course: &'a Course,
        path: Option<&'a JointPath>,
    ) -> Self {
        let (config, theta) =
            nominal.map_or((&model.config().world, &particle.theta), |nominal| (&nominal.world, &nominal.theta));
        let drive = Drive::new(effects, config.control_period_secs, course.tool.position_m, path, particle);
        let start = course.tool.position_m;
        let way = Way { made: 0, share: 0.0, position_m: start, stopped: start == course.target_m };
        let mut simulation = Self {
            model,
            particle,
            effects,
            config,
            theta,
            course,
            path,
            drive,
            world: None,
            way,
            sent_m: start,
            quiet: false,
            ended: false,
        };
        let (object, obstacle) = (&particle.state.object, particle.state.obstacle.as_ref());
        simulation.quiet = simulation.is_quiet(object, obstacle, &course.tool, course.target_m);
        simulation
    }

    /// Moves the tool along its course. What is simulated lies between the control step in which the tool first comes near a body, or all
    /// of them if a body does not rest, and the one after which everything rests and the tool stays clear.
    pub(crate) fn run(mut self, sensor: &mut ForceSensor, report: &mut ActionReport) -> End {
        if !self.quiet && self.check_overlaps(&self.course.tool).is_err() {
            report.divergence = Some(Divergence::Overlaps);
            return self.unmoved();
        }
        let steps = self.config.control_steps;
        let (period_secs, elapsed_secs) = (self.config.control_period_secs, self.elapsed_secs());
        let duration_secs = period_secs * f64::from(steps);
        let late = self.effects.hooks.contains(Hooks::POSE_DELAY);
        let mut poses = late.then(|| PoseChain::new(self.effects.list, period_secs, &self.particle.state.object));
        let mut seen = None;
        let mut motion = ToolMotion::new(self.course.tool.position_m, period_secs);
        let all = steps + self.drive.as_ref().map_or(0, Drive::settling_steps);
        for step in 1..=all {
            let tool = ToolPose { position_m: self.way.position_m, ..self.course.tool };
            self.advance(step.min(steps));
            let (position, joints) = self.commanded(period_secs);
            self.sent_m = position;
            let quiet = self.quiet || self.ended || (self.world.is_none() && self.nothing_near(&tool, position));
            let (wrench, against) = if quiet {
                (Wrench::default(), false)
            } else {
                self.step_world(&tool, position, joints.as_ref(), report)
            };
            if step <= steps {
                let time_secs = elapsed_secs + period_secs * f64::from(step);
                let moment = sensor.reads_motion().then(|| self.tool_moment(time_secs, &mut motion, position));
                let time = f64::from(step) / f64::from(steps);
                let large = match joints {
                    Some(joints) => sensor.add_moment(&joints, moment.as_ref(), &wrench),
                    None if self.way.stopped => sensor.add_stopped(self.way.share, moment.as_ref(), &wrench),
                    None => sensor.add(time, duration_secs, moment.as_ref(), &wrench),
                };
                report.events.large_force |= large;
                if large && against {
                    // The arm's collision reaction: it goes back along its path, step by step, to where the force is bearable, and stays
                    // there. A force that does not push against the move is left behind by it.
                    self.way.stopped = true;
                    self.way.made = self.way.made.saturating_sub(1);
                }
                if let Some(poses) = &mut poses {
                    seen = Some(poses.seen(&self.object()));
                }
            }
            if step % QUIET_CHECK_STEPS == 0 {
                self.look(report);
            }
        }
        self.finish(seen, period_secs * f64::from(all), report)
    }

    /// The next command of the tool.
    fn advance(&mut self, step: u32) {
        let (start, target) = (self.course.tool.position_m, self.course.target_m);
        let way = &mut self.way;
        if !way.stopped {
            way.made = step;
        }
        if start != target {
            way.share = minimum_jerk(f64::from(way.made) / f64::from(self.config.control_steps));
        }
        way.position_m = std::array::from_fn(|i| start[i] + way.share * (target[i] - start[i]));
    }

    /// Where the command brings tool and joints at the end of the step; joints where an effect on commands needs or changes them.
    fn commanded(&mut self, period_secs: f64) -> ([f64; 3], Option<JointMoment>) {
        match &mut self.drive {
            None => (self.way.position_m, None),
            Some(drive) => {
                drive.follow(self.model.robot(), self.path, self.way.share, self.way.position_m, period_secs)
            }
        }
    }

    /// A step of the world, built where there is none: the wrench on the tool, and whether it pushes against the move.
    fn step_world(
        &mut self,
        tool: &ToolPose,
        position_m: [f64; 3],
        joints: Option<&JointMoment>,
        report: &mut ActionReport,
    ) -> (Wrench, bool) {
        if self.world.is_none() {
            self.world = Some(self.restore(tool));
        }
        let Some(world) = &mut self.world else { return (Wrench::default(), false) };
        let wrench = match (&self.model.config().arm, self.path) {
            (ArmConfig::Dynamic(_), Some(path)) => match joints {
                Some(joints) => world.step_arm(joints.position_rad()),
                None => world.step_arm(path.stopped(self.way.share).position_rad()),
            },
            _ => world.step(position_m),
        };
        report.tool_touched |= wrench.force_magnitude_n() > 0.0;
        report.obstacle_touched |= world.obstacle_touched();
        let (start, target) = (self.course.tool.position_m, self.course.target_m);
        let normal = world.normal_force_n();
        (wrench, (0..3).map(|i| normal[i] * (target[i] - start[i])).sum::<f64>() < 0.0)
    }

    fn restore(&self, tool: &ToolPose) -> World<'a> {
        let (model, particle) = (self.model, self.particle);
        let (object, obstacle) = (&particle.state.object, particle.state.obstacle.as_ref());
        let shapes = model.robot().tool_shapes();
        let world = if self.effects.hooks.contains(Hooks::COMMAND.and(Hooks::ASTRAY)) {
            World::restore(&model.config().world, self.effects.list, &particle.theta, object, obstacle, tool, shapes)
        } else {
            let target_m = self.course.target_m;
            let near = parts_in_reach(self.config, self.theta, object, obstacle, tool, target_m, shapes);
            World::restore(&model.config().world, self.effects.list, &particle.theta, object, obstacle, tool, &near)
        };
        let world = match &particle.memory {
            Some(memory) => world.with_memory(memory),
            None => world,
        };
        match &model.config().arm {
            ArmConfig::Kinematic => world,
            ArmConfig::Dynamic(servo) => world.with_dynamic_arm(model.robot(), servo, &particle.state.joints_rad),
        }
    }

    /// Whether the world has gone wrong, and whether anything will still happen.
    fn look(&mut self, report: &mut ActionReport) {
        if self.ended {
            return;
        }
        let Some(world) = &self.world else { return };
        report.divergence = report.divergence.or_else(|| world.divergence());
        let (object, obstacle) = (world.object(), world.obstacle());
        let position_m = self.way.position_m;
        let tool = ToolPose { position_m, ..self.course.tool };
        let end = if self.way.stopped { position_m } else { self.course.target_m };
        self.ended = self.is_quiet(&object, obstacle.as_ref(), &tool, end);
    }

    fn finish(self, seen: Option<BodyState>, duration_secs: f64, report: &mut ActionReport) -> End {
        let play_rad = self.drive.as_ref().and_then(Drive::play_rad);
        let driven = self.drive.as_ref().and_then(Drive::joints_rad);
        let Some(world) = &self.world else {
            let mut end = self.unmoved();
            for body in std::iter::once(&mut end.object).chain(&mut end.obstacle) {
                body.linear_mps = [0.0; 3];
                body.angular_rps = [0.0; 3];
            }
            return End { joints_rad: driven, play_rad, seen, duration_secs, tool_m: self.sent_m, ..end };
        };
        let object = world.object();
        // What cannot move keeps its last digits, which the engine does not have.
        let movable = self.config.obstacle_mobility == ObstacleMobility::Movable;
        let obstacle = if movable { world.obstacle() } else { self.particle.state.obstacle };
        let gives_way = world.tool_gives_way();
        let driven = driven.filter(|_| !gives_way);
        let tool_m = if gives_way { world.tool_position_m() } else { self.sent_m };
        let joints_rad = world.arm_joints_rad().or(driven);
        let tool = match &joints_rad {
            Some(joints) => self.model.tool_pose(joints),
            None => ToolPose { position_m: tool_m, ..self.course.tool },
        };
        report.divergence = report.divergence.or_else(|| world.divergence()).or_else(|| {
            let (config, shapes) = (self.config, self.model.robot().tool_shapes());
            check_overlaps(config, self.theta, &object, obstacle.as_ref(), &tool, shapes)
                .is_err()
                .then_some(Divergence::Overlaps)
        });
        End { object, obstacle, hidden: Some(world.hidden()), tool_m, joints_rad, play_rad, seen, duration_secs }
    }

    /// Nothing has happened.
    fn unmoved(&self) -> End {
        let state = &self.particle.state;
        End {
            object: state.object,
            obstacle: state.obstacle,
            hidden: None,
            tool_m: self.course.tool.position_m,
            joints_rad: None,
            play_rad: None,
            seen: None,
            duration_secs: 0.0,
        }
    }

    fn check_overlaps(&self, tool: &ToolPose) -> Result<(), physics_model::Impossible> {
        let state = &self.particle.state;
        let shapes = self.model.robot().tool_shapes();
        check_overlaps(self.config, self.theta, &state.object, state.obstacle.as_ref(), tool, shapes)
    }

    fn nothing_near(&self, tool: &ToolPose, position_m: [f64; 3]) -> bool {
        let state = &self.particle.state;
        self.is_quiet(&state.object, state.obstacle.as_ref(), tool, position_m)
    }

    fn is_quiet(&self, object: &BodyState, obstacle: Option<&BodyState>, tool: &ToolPose, target_m: [f64; 3]) -> bool {
        let shapes = self.model.robot().tool_shapes();
        // A dynamic arm does not follow its path exactly, nor does one whose commands an effect changes.
        let exact = self.model.config().arm == ArmConfig::Kinematic && !self.effects.hooks.contains(Hooks::COMMAND);
        let level = !self.effects.hooks.contains(Hooks::UNREST);
        exact && level && nothing_happens(self.config, self.theta, object, obstacle, tool, target_m, shapes)
    }

    fn object(&self) -> BodyState {
        self.world.as_ref().map_or(self.particle.state.object, World::object)
    }

    fn elapsed_secs(&self) -> f64 {
        self.particle.memory.as_ref().map_or(0.0, |memory| memory.elapsed_secs)
    }

    fn tool_moment(&self, time_secs: f64, motion: &mut ToolMotion, commanded_m: [f64; 3]) -> ToolMoment {
        let position_m = match &self.world {
            Some(world) if world.tool_gives_way() => world.tool_position_m(),
            _ => commanded_m,
        };
        ToolMoment {
            time_secs,
            orientation: self.course.tool.orientation,
            acceleration_mps2: motion.acceleration(position_m),
            gravity_mps2: self.config.gravity_mps2,
        }
    }
}
