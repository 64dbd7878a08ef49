//! What the sensors of a rig with a known world write into a log.

use std::collections::BTreeMap;

use measured_log::{Axis, Channel, Component, Episode, Header, Log, Readings};
use nalgebra::{UnitQuaternion, Vector3};
use physics_model::BodyState;
use physics_model::effect::Effect;
use physics_model::rig::{Rig, RigError, RigObject, RigReading, RigStart};
use physics_model::state::unit_quaternion;
use pomdp::{Purpose, Seed};
use rand_distr::{Distribution as _, StandardNormal};

use crate::actions::Script;

/// Force, N, at which an arm stops by itself: the rest of the episode is not recorded.
const STOP_N: f64 = 40.0;
/// Rows that an episode keeps at least.
const LEAST_ROWS: usize = 30;

/// Why there is no log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The arm cannot be read.
    #[error(transparent)]
    Tool(#[from] discrepancy::Error),
    /// A scenario that has no world to record.
    #[error("{0}")]
    Scenario(String),
    /// The true world goes where no log does.
    #[error("episode {episode}: {source}")]
    World {
        /// Which.
        episode: usize,
        /// Why.
        source: Box<RigError>,
    },
}

/// A known world.
pub struct Recording {
    /// Rig.
    pub rig: Rig,
    /// Object, without the known weights of the scripts.
    pub object: RigObject,
    /// Effects.
    pub effects: Vec<Box<dyn Effect>>,
    /// Height of the object's centre at rest, m.
    pub height_m: f64,
    /// Seed of the noise.
    pub seed: Seed,
}

impl Recording {
    /// The log of scripts with their numbers. `header`: what the log says of itself, its noise that of the sensors.
    ///
    /// # Errors
    ///
    /// [`RecordError::World`] for a world that goes where no log does.
    pub fn log<'a>(
        &self,
        header: Header,
        scripts: impl Iterator<Item = (usize, &'a Script)>,
    ) -> Result<Log, RecordError> {
        let episodes = scripts.map(|(index, script)| self.episode(&header, index, script)).collect::<Result<_, _>>()?;
        Ok(Log { header, episodes })
    }

    fn episode(&self, header: &Header, index: usize, script: &Script) -> Result<Episode, RecordError> {
        let object = RigObject { added_mass_kg: script.added_mass_kg, ..self.object.clone() };
        let [x, y] = script.place_m;
        let body = BodyState::at_rest([x, y, self.height_m + script.lift_m], script.yaw_rad);
        let seen = physics_model::effect::signal::read(&self.effects, &body);
        let start = RigStart::of_episode(seen, Some(script.commands[0]));
        let readings = (self.rig.run(&object, &self.effects, &start, &script.commands[1..]))
            .map_err(|source| RecordError::World { episode: index, source: Box::new(source) })?;
        let mut rng = self.seed.stream(Purpose::Truth, index as u64);
        Ok(record(index as u64, header, script, seen, &readings, &mut rng))
    }
}

/// What the sensors say.
fn record(
    id: u64,
    header: &Header,
    script: &Script,
    seen: BodyState,
    readings: &[RigReading],
    rng: &mut pomdp::Rng,
) -> Episode {
    let noise = &header.noise;
    let mut normal = |stddev: Option<f64>| {
        let z: f64 = StandardNormal.sample(rng);
        z * stddev.unwrap_or(0.0)
    };
    let stopped = readings.iter().position(|reading| reading.wrench.force_magnitude_n() > STOP_N);
    let rows = stopped.map_or(script.commands.len(), |tick| (tick + 1).max(LEAST_ROWS).min(script.commands.len()));
    let mut channels: BTreeMap<Channel, Readings> = BTreeMap::new();
    let mut push = |channel: Channel, value: Option<f64>| channels.entry(channel).or_default().push(value);
    for (row, command) in script.commands[..rows].iter().enumerate() {
        let reading = row.checked_sub(1).map(|row| &readings[row]);
        let (object, tool) = reading.map_or((seen, *command), |r| (r.object, r.tool_m.unwrap_or(*command)));
        let turn = Vector3::from_fn(|_, _| normal(noise.object_orientation_rad));
        let q = UnitQuaternion::from_scaled_axis(turn) * unit_quaternion(object.orientation);
        for (i, axis) in Axis::ALL.into_iter().enumerate() {
            push(Channel::Command(axis), Some(command[i]));
            push(Channel::Tool(axis), Some(tool[i] + normal(noise.tool_position_m)));
            let wrench = reading.map(|r| (r.wrench.force_n[i], r.wrench.torque_nm[i]));
            push(Channel::WristForce(axis), wrench.map(|w| w.0 + normal(noise.wrist_force_n)));
            push(Channel::WristTorque(axis), wrench.map(|w| w.1 + normal(noise.wrist_torque_nm)));
            push(Channel::ObjectPosition(axis), Some(object.position_m[i] + normal(noise.object_position_m)));
        }
        for joint in 0..header.robot.joints() {
            let place = usize::from(joint);
            let read = reading.map(|r| (r.joints_rad[place], r.joint_torque_nm[place]));
            push(Channel::Joint(joint), read.map(|r| r.0 + normal(noise.joint_position_rad)));
            push(Channel::JointTorque(joint), read.map(|r| r.1 + normal(noise.joint_torque_nm)));
        }
        for (component, value) in Component::ALL.into_iter().zip([q.i, q.j, q.k, q.w]) {
            push(Channel::ObjectOrientation(component), Some(value));
        }
        push(Channel::AddedMass, Some(script.added_mass_kg));
    }
    let time_secs = (0..rows).map(|row| row as f64 * header.period_secs).collect();
    Episode { id, time_secs, action: None, channels }
}
