//! What the arm's force sensors read during an action: means over its control steps.

use nalgebra::Vector3;
use physics_model::effect::signal::ForceChain;
use physics_model::effect::{Effects, ToolMoment};
use physics_model::motion::{JointMoment, JointPath, joint_torques};
use physics_model::robot::Robot;
use physics_model::world::Wrench;

use crate::config::{ForceSensing, SensorConfig};

/// Sensor of one action.
pub(crate) struct ForceSensor<'a> {
    robot: &'a Robot,
    config: &'a SensorConfig,
    effects: Effects<'a>,
    /// What effects make of the readings.
    chain: Option<ForceChain>,
    /// Joint torques need the joints' motion, a wrist sensor does not.
    path: Option<JointPath>,
    samples: u32,
    wrench: Wrench,
    torques_nm: [f64; 6],
}

impl<'a> ForceSensor<'a> {
    /// Whether the sensor asks for the joints' motion.
    pub(crate) fn needs_path(config: &SensorConfig) -> bool {
        config.force == ForceSensing::JointTorques
    }

    /// A sensor that has read nothing yet, every `period_secs`. `path` where [`Self::needs_path`].
    pub(crate) fn new(
        robot: &'a Robot,
        config: &'a SensorConfig,
        effects: Effects<'a>,
        period_secs: f64,
        path: Option<JointPath>,
    ) -> Self {
        let chain = ForceChain::new(effects.list, period_secs);
        let path = path.filter(|_| Self::needs_path(config));
        Self { robot, config, effects, chain, path, samples: 0, wrench: Wrench::default(), torques_nm: [0.0; 6] }
    }

    /// Whether the sensor asks for the tool's motion.
    pub(crate) fn reads_motion(&self) -> bool {
        self.chain.is_some()
    }

    /// Adds a control step at whose end the arm is after the share `time` of an action that takes `duration_secs`, with the mean
    /// `wrench` on the tool; `tool` where [`Self::reads_motion`]. Returns whether the force at the wrist or the torque at a joint is above the
    /// limit.
    pub(crate) fn add(&mut self, time: f64, duration_secs: f64, tool: Option<&ToolMoment>, wrench: &Wrench) -> bool {
        let moment = self.path.map(|path| path.moment(time, duration_secs));
        self.read(moment.as_ref(), tool, wrench)
    }

    /// As [`Self::add`] for an arm that stands still after `share` of its path.
    pub(crate) fn add_stopped(&mut self, share: f64, tool: Option<&ToolMoment>, wrench: &Wrench) -> bool {
        let moment = self.path.map(|path| path.stopped(share));
        self.read(moment.as_ref(), tool, wrench)
    }

    /// As [`Self::add`] for an arm off its path.
    pub(crate) fn add_moment(&mut self, joints: &JointMoment, tool: Option<&ToolMoment>, wrench: &Wrench) -> bool {
        self.read(self.path.is_some().then_some(joints), tool, wrench)
    }

    fn read(&mut self, moment: Option<&JointMoment>, tool: Option<&ToolMoment>, wrench: &Wrench) -> bool {
        self.samples += 1;
        // Without contact nothing is a collision, whatever the arm's own weight and motion take and its sensors make of it.
        let touched = wrench.force_magnitude_n() > 0.0;
        let mut read = *wrench;
        if let (Some(chain), Some(tool)) = (&mut self.chain, tool) {
            chain.apply(tool, &mut read);
        }
        match moment {
            None => {
                self.wrench.add_scaled(&read, 1.0);
                touched && read.force_magnitude_n() > self.config.large_force_limit
            }
            Some(moment) => {
                let torques = joint_torques(self.robot, self.effects, moment, &read);
                for (sum, torque) in self.torques_nm.iter_mut().zip(&torques) {
                    *sum += *torque;
                }
                touched && torques.iter().any(|torque| torque.abs() > self.config.large_force_limit)
            }
        }
    }

    /// Mean of what was read, for an arm that ended at `joints_rad`: wrist force (N) and torque (N·m), or joint torques (N·m).
    ///
    /// A wrist turns neither with respect to the base nor to the tool during an action, so that the mean may be taken in base axes.
    pub(crate) fn mean(&self, joints_rad: &[f64]) -> [f64; 6] {
        let share = 1.0 / f64::from(self.samples.max(1));
        match self.config.force {
            ForceSensing::Wrist => {
                let mut mean = Wrench::default();
                mean.add_scaled(&self.wrench, share);
                wrist_reading(self.robot, joints_rad, &mean)
            }
            ForceSensing::JointTorques => self.torques_nm.map(|torque| torque * share),
        }
    }
}

/// What the sensors of an arm read that stands still without contact, as `tool` says.
pub(crate) fn resting_reading(
    robot: &Robot,
    config: &SensorConfig,
    effects: Effects,
    joints_rad: &[f64],
    tool: &ToolMoment,
) -> [f64; 6] {
    let path = ForceSensor::needs_path(config).then(|| JointPath::resting(joints_rad));
    // A filter starts settled, whatever its period.
    let mut sensor = ForceSensor::new(robot, config, effects, 1.0, path);
    sensor.add_stopped(0.0, Some(tool), &Wrench::default());
    sensor.mean(joints_rad)
}

/// Force and torque on the hand in the axes and at the origin of the wrist frame, from a wrench about the tool centre in base axes.
fn wrist_reading(robot: &Robot, joints_rad: &[f64], wrench: &Wrench) -> [f64; 6] {
    let base_from_wrist = robot.base_from_wrist(joints_rad);
    let tool = robot.base_from_tool(joints_rad).translation.vector;
    let force = Vector3::from(wrench.force_n);
    let arm = tool - base_from_wrist.translation.vector;
    let torque = Vector3::from(wrench.torque_nm) + arm.cross(&force);
    let force = base_from_wrist.rotation.inverse_transform_vector(&force);
    let torque = base_from_wrist.rotation.inverse_transform_vector(&torque);
    [force.x, force.y, force.z, torque.x, torque.y, torque.z]
}
