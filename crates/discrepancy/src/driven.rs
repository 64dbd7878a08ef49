//! What an arm did, from its joints where nothing else says it.

use std::borrow::Cow;

use measured_log::{Axis, Channel, Episode, Log, Readings};
use physics_model::rig::RigTool;
use physics_model::robot::Robot;

use crate::error::Error;
use crate::nominal::Nominal;

/// A log whose arm is sent to where its joints say that its tool was, if it has neither commands nor places of the tool.
///
/// # Errors
///
/// [`Error::Unfit`] for an arm's log that has no joints either.
pub(crate) fn driven<'a>(log: &'a Log, name: &str, nominal: &Nominal) -> Result<Cow<'a, Log>, Error> {
    let RigTool::Arm(robot) = nominal.tool() else { return Ok(Cow::Borrowed(log)) };
    let has = |channel: Channel| {
        let read = |episode: &Episode| episode.channels.get(&channel).is_some_and(|readings| readings.count() > 0);
        log.episodes.iter().any(read)
    };
    if has(Channel::Command(Axis::X)) || has(Channel::Tool(Axis::X)) {
        return Ok(Cow::Borrowed(log));
    }
    if !has(Channel::Joint(0)) {
        let reason = "expected columns `command_x_m` …, `tool_x_m` … or `joint_0_rad` …, found none of them: `action` alone does not say where the \
                      arm went"
            .into();
        return Err(Error::Unfit { log: name.into(), reason });
    }
    let mut log = log.clone();
    for episode in &mut log.episodes {
        let places: Vec<Option<[f64; 3]>> = (0..episode.rows()).map(|row| place(episode, row, robot)).collect();
        for (index, axis) in Axis::ALL.into_iter().enumerate() {
            let readings: Readings = places.iter().map(|place| place.map(|place| place[index])).collect();
            episode.channels.insert(Channel::Command(axis), readings);
        }
    }
    Ok(Cow::Owned(log))
}

/// Centre of the tool in a row, m, base frame, by forward kinematics.
fn place(episode: &Episode, row: usize, robot: &Robot) -> Option<[f64; 3]> {
    let joints: Option<Vec<f64>> =
        (0..robot.joint_count()).map(|joint| episode.get(Channel::Joint(joint as u8), row)).collect();
    Some(robot.base_from_tool(&joints?).translation.vector.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tool_is_sent_to_where_the_joints_have_it() {
        const JOINTS: [f64; 7] = [-0.3222, -0.7935, 0.0381, 1.9327, -0.0638, 0.4328, 3.079];
        let mut header = crate::nominal::tests::uncertain_mass().header().clone();
        header.robot = measured_log::Robot::Sawyer;
        let mut episode = Episode { id: 3, time_secs: vec![0.0, 0.02], ..Episode::default() };
        for (joint, value) in JOINTS.into_iter().enumerate() {
            let readings: Readings = [Some(value), None].into_iter().collect();
            episode.channels.insert(Channel::Joint(joint as u8), readings);
        }
        let log = Log { header: header.clone(), episodes: vec![episode] };
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let nominal = Nominal::new(&header, crate::rig_tool(&log, Some(&root)).unwrap()).unwrap();
        let RigTool::Arm(robot) = nominal.tool() else { panic!("an arm") };
        let sent = driven(&log, "log", &nominal).unwrap();
        let expected: [f64; 3] = robot.base_from_tool(&JOINTS).translation.vector.into();
        assert_eq!(sent.episodes[0].vector(Channel::Command, 0), Some(expected));
        assert_eq!(sent.episodes[0].vector(Channel::Command, 1), None);
        // What is commanded stays.
        let again = driven(&sent, "log", &nominal).unwrap();
        assert!(matches!(again, Cow::Borrowed(_)));
    }
}
