//! A log as places and turns: what the checks look at.

use measured_log::{Axis, Channel, Episode, Log, Shape};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// What has not moved in so many readings, and for so long, rests: what slides freely does not.
const REST_ROWS: usize = 5;
const REST_SECS: f64 = 0.15;
/// What a pose has to move by at rest, in scatters of its readings, to have set out.
const SIGMAS: f64 = 6.0;
/// And in itself: m for each metre of the object, and rad.
const LEAST_SHARE: f64 = 0.015;
const LEAST_RAD: f64 = 0.02;

/// A row with a whole pose of the object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// Row in its episode.
    pub(crate) row: usize,
    /// Since the episode began, s.
    pub(crate) secs: f64,
    /// Where the object was read to be; without turn where the log has none.
    pub(crate) pose: Isometry3<f64>,
    /// Tool centre, by interpolation where it was read in other rows.
    pub(crate) tool: Option<Vector3<f64>>,
}

/// An episode.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// Its number.
    pub(crate) id: u64,
    pub(crate) seen: Vec<Seen>,
    /// Indices in `seen` at which the object sets out from rest.
    pub(crate) onsets: Vec<usize>,
    /// Indices in `seen` at which it rests.
    pub(crate) rests: Vec<usize>,
}

/// All episodes, and how far the object's readings scatter.
#[derive(Clone, Debug)]
pub(crate) struct Motions {
    pub(crate) episodes: Vec<Motion>,
    /// Of a coordinate of the position, m.
    pub(crate) position_m: f64,
    /// Whether turns of the object were read.
    pub(crate) turns: bool,
    /// By places alone, where an episode has turns in few of the rows that have places: in one, read by a person, for example.
    placed: Option<Vec<Motion>>,
}

/// Hard bodies of some hundred grams touch about so long (Hertz), and no engine's step is much shorter.
const BLOW_SECS: f64 = 0.001;
/// Before and after a blow an object's velocity is taken over so long.
const BLOW_SIDE_SECS: f64 = 0.1;
/// How far an impulse may be above what velocities and mass say of it: the object rubs on the table, and a stiff contact may be over sooner.
const BLOW_MARGIN: f64 = 5.0;

impl Motions {
    /// Of a log whose object is `size_m` wide. `tool` gives the tool centre of a row.
    pub(crate) fn new(log: &Log, size_m: f64, tool: impl Fn(&Episode, usize) -> Option<[f64; 3]>) -> Self {
        let turned = count(log, Channel::ObjectOrientation(measured_log::Component::W));
        let placed = count(log, Channel::ObjectPosition(Axis::X));
        // Of a ball, whose turns say nothing of where it is, in most rows.
        let ball = matches!(log.header.object.shape, Shape::Sphere { .. });
        let turns = turned > 0 && (!ball || 2 * turned > placed);
        let paths = |turns: bool| -> Vec<(u64, Vec<Seen>)> {
            log.episodes.iter().map(|episode| (episode.id, seen(episode, turns, &tool))).collect()
        };
        let all = paths(turns);
        let steps = |all: &[(u64, Vec<Seen>)], size: fn(&Seen, &Seen) -> f64| {
            let steps = all.iter().flat_map(|(_, seen)| seen.windows(2).map(move |two| size(&two[0], &two[1])));
            scatter(steps.collect())
        };
        let way = |a: &Seen, b: &Seen| (b.pose.translation.vector - a.pose.translation.vector).norm();
        let motions = |all: Vec<(u64, Vec<Seen>)>, position_m: f64| -> Vec<Motion> {
            let turn_rad = steps(&all, |a, b| a.pose.rotation.angle_to(&b.pose.rotation));
            let far = [(SIGMAS * position_m).max(LEAST_SHARE * size_m), (SIGMAS * turn_rad).max(LEAST_RAD)];
            let one = |(id, seen): (u64, Vec<Seen>)| {
                let (onsets, rests) = onsets(&seen, far);
                Motion { id, seen, onsets, rests }
            };
            all.into_iter().map(one).collect()
        };
        let few = log.episodes.iter().zip(&all).any(|(episode, (_, seen))| 2 * seen.len() < places(episode));
        let placed = few.then(|| paths(false));
        let position_m = steps(placed.as_ref().unwrap_or(&all), way);
        let placed = placed.map(|all| motions(all, position_m));
        let episodes = motions(all, position_m);
        Self { episodes, position_m, turns, placed }
    }

    /// Whether a force for a moment, N, can be a blow on an object of this mass in an episode, by its index, at a time, s.
    ///
    /// A blow lasts [`BLOW_SECS`] or longer, and its impulse is the mass times what the object's velocity changes by: where it sets out from rest at most twice its
    /// largest speed about then, else what is seen before and after, if that is more than noise.
    pub(crate) fn is_blow(&self, index: usize, secs: f64, force_n: f64, mass_kg: f64) -> bool {
        let motion = &self.placed.as_ref().unwrap_or(&self.episodes)[index];
        let way = |a: &Seen, b: &Seen| b.pose.translation.vector - a.pose.translation.vector;
        let possible = |change_mps: f64| force_n * BLOW_SECS <= BLOW_MARGIN * mass_kg * change_mps;
        let about = |seen: &Seen| (seen.secs - secs).abs() < BLOW_SIDE_SECS;
        if motion.onsets.iter().any(|onset| about(&motion.seen[*onset])) {
            let moving =
                motion.seen.windows(2).filter(|two| (about(&two[0]) || about(&two[1])) && two[1].secs > two[0].secs);
            let speeds = moving.map(|two| way(&two[0], &two[1]).norm() / (two[1].secs - two[0].secs));
            // It may be thrown back as fast as it came.
            return speeds.reduce(f64::max).is_none_or(|fastest| possible(2.0 * fastest));
        }
        // Of what a slow or hidden camera saw longer ago, the two readings that are nearest.
        let velocity = |seen: &[Seen]| -> Option<Vector3<f64>> {
            let (first, last) = (seen.first()?, seen.last()?);
            (last.secs > first.secs).then(|| way(first, last) / (last.secs - first.secs))
        };
        let seen = &motion.seen;
        let now = seen.partition_point(|seen| seen.secs < secs);
        let from = seen.partition_point(|seen| seen.secs < secs - BLOW_SIDE_SECS).min(now.saturating_sub(2));
        let to = seen.partition_point(|seen| seen.secs <= secs + BLOW_SIDE_SECS).max((now + 2).min(seen.len()));
        // Nothing is known of an object that was not seen.
        let (Some(before), Some(after)) = (velocity(&seen[from..now]), velocity(&seen[now..to])) else {
            return !seen.is_empty();
        };
        let change_mps = (after - before).norm();
        change_mps > SIGMAS * 2.0 * self.position_m / BLOW_SIDE_SECS && possible(change_mps)
    }

    /// Whether the object is a ball, or a cylinder that is seen to lie, or not seen to stand.
    pub(crate) fn may_roll(&self, shape: &Shape) -> bool {
        let lies = |seen: &Seen| (seen.pose.rotation * Vector3::z()).z.abs() < 0.7;
        match shape {
            Shape::Sphere { .. } => true,
            Shape::Cylinder { .. } => !self.turns || self.episodes.iter().flat_map(|motion| &motion.seen).any(lies),
            Shape::Box { .. } | Shape::Prism { .. } => false,
        }
    }
}

/// How often a channel was read.
fn count(log: &Log, channel: Channel) -> usize {
    log.episodes.iter().filter_map(|episode| episode.channels.get(&channel)).map(measured_log::Readings::count).sum()
}

/// Rows of an episode with a place of the object.
fn places(episode: &Episode) -> usize {
    (0..episode.rows()).filter(|row| episode.vector(Channel::ObjectPosition, *row).is_some()).count()
}

/// Standard deviation of a component of readings of which these are the steps' lengths: the lower quartile, which motion leaves alone.
fn scatter(mut lengths: Vec<f64>) -> f64 {
    lengths.retain(|length| *length > 0.0);
    lengths.sort_by(f64::total_cmp);
    // Of a vector of three normal differences the lower quartile of the length is 1.10 √2 standard deviations.
    lengths.get(lengths.len() / 4).map_or(0.0, |length| length / (1.10 * std::f64::consts::SQRT_2))
}

/// The rotation of a quaternion x, y, z, w.
pub(crate) fn rotation([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

fn seen(episode: &Episode, turns: bool, tool: impl Fn(&Episode, usize) -> Option<[f64; 3]>) -> Vec<Seen> {
    let tools: Vec<(f64, Vector3<f64>)> = (0..episode.rows())
        .filter_map(|row| Some((episode.time_secs[row], Vector3::from(tool(episode, row)?))))
        .collect();
    (0..episode.rows())
        .filter_map(|row| {
            let place = Vector3::from(episode.vector(Channel::ObjectPosition, row)?);
            let turn = if turns { rotation(episode.orientation(row)?) } else { UnitQuaternion::identity() };
            let secs = episode.time_secs[row];
            let pose = Isometry3::from_parts(Translation3::from(place), turn);
            Some(Seen { row, secs, pose, tool: at(&tools, secs) })
        })
        .collect()
}

/// A path at a time, between its points; `None` before and after it.
fn at(path: &[(f64, Vector3<f64>)], secs: f64) -> Option<Vector3<f64>> {
    let after = path.partition_point(|(time, _)| *time < secs);
    let next = path.get(after)?;
    if next.0 == secs || after == 0 {
        return (next.0 == secs).then_some(next.1);
    }
    let last = path[after - 1];
    Some(last.1.lerp(&next.1, (secs - last.0) / (next.0 - last.0)))
}

/// Where a path of poses leaves rest, and where it rests.
fn onsets(seen: &[Seen], far: [f64; 2]) -> (Vec<usize>, Vec<usize>) {
    let away = |a: usize, b: usize| {
        let (a, b) = (&seen[a].pose, &seen[b].pose);
        (a.translation.vector - b.translation.vector).norm() > far[0] || a.rotation.angle_to(&b.rotation) > far[1]
    };
    let rested = |since: usize, now: usize| now - since >= REST_ROWS && seen[now].secs - seen[since].secs >= REST_SECS;
    let (mut onsets, mut rests) = (Vec::new(), Vec::new());
    // The first of the readings that have been near each other since.
    let mut since = 0;
    for now in 1..seen.len() {
        if !away(since, now) {
            if rested(since, now) {
                rests.push(now);
            }
            continue;
        }
        // One reading alone may be an outlier.
        if seen.get(now + 1).is_some() && !away(since, now + 1) {
            continue;
        }
        if rested(since, now) {
            onsets.push(now);
        }
        since = now;
    }
    (onsets, rests)
}

/// The three components of a channel in a row.
pub(crate) fn vector(episode: &Episode, make: fn(Axis) -> Channel, row: usize) -> Option<Vector3<f64>> {
    episode.vector(make, row).map(Vector3::from)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use measured_log::Component;

    use super::*;

    fn motions(log: &Log) -> Motions {
        Motions::new(log, 0.08, |episode: &Episode, row: usize| episode.vector(Channel::Tool, row))
    }

    /// In which rows of some episodes a force may be a blow.
    fn blows(log: &Log, episodes: std::ops::Range<usize>) -> Vec<bool> {
        let motions = motions(log);
        let rows = log.episodes.iter().enumerate().filter(|(index, _)| episodes.contains(index));
        rows.flat_map(|(index, episode)| episode.time_secs.iter().map(move |secs| (index, *secs)))
            .map(|(index, secs)| motions.is_blow(index, secs, 100.0, 0.5))
            .collect()
    }

    #[test]
    fn blows_are_known_where_a_turn_was_read_once_an_episode() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs/set-001");
        let log = measured_log::read(&folder).unwrap();
        assert!(matches!(log.header.object.shape, Shape::Box { .. }) && motions(&log).placed.is_none());
        // In the second half of the episodes alone.
        let half = log.episodes.len() / 2..log.episodes.len();
        let all = blows(&log, half.clone());
        let mut few = log;
        for episode in &mut few.episodes[half.clone()] {
            for component in Component::ALL {
                let cells = episode.channels.get_mut(&Channel::ObjectOrientation(component)).unwrap();
                *cells = (0..cells.len()).map(|row| cells.get(row).filter(|_| row == 0)).collect();
            }
        }
        assert!(motions(&few).placed.is_some());
        let few = blows(&few, half);
        let possible = all.iter().filter(|blow| **blow).count();
        let same = all.iter().zip(&few).filter(|(a, b)| **a && **b).count();
        assert!(possible > 20 && 10 * same > 8 * possible, "{same} of {possible} of {}", all.len());
        assert!(few.iter().filter(|blow| **blow).count() < 2 * possible, "{few:?}");
    }
}
