//! A log as densely read as the physics needs.
//!
//! What a push or a toss does shows at some hundred readings a second. A log of 10,000 would take as many engine steps, and says no more. So several
//! rows become one, and none is thrown away:
//!
//! - Places, angles and velocities: the mean over a tick about the time of the row, moved along the slope to its neighbours where the readings lie to one
//!   side. A bounce that changes a velocity by v moves one such mean by v · tick / 8.
//! - Forces and torques: the mean over the tick that ends with the row, which is what a simulated reading is.
//! - Commands: as sent at the time of the row.
//!
//! White noise of such means is smaller by the root of how many readings they have, that of a real sensor by less: it is scaled by what the readings scatter by,
//! before and after.
//!
//! Of a log with very many ticks a part of the episodes is simulated, drawn by the seed.

use std::borrow::Cow;

use measured_log::{Channel, Component, Episode, Log, Noise, Readings};
use serde::Serialize;

use crate::noise::NoiseLevels;
use crate::stamps::usual_step_secs;
use crate::trial::Kind;

/// Ticks of what is pushed, s, at least: a push at 0.3 m/s goes 1.5 mm in one.
const PUSHED_SECS: f64 = 0.005;
/// The same of what is thrown: a bounce takes milliseconds, and the engine's step is shorter anyway.
const THROWN_SECS: f64 = 0.002;
/// Ticks of a log, at most: five times those of 40 pushes at 50 Hz; some two minutes on two cores.
const MOST_TICKS: usize = 30_000;
/// Readings further apart say nothing of the slope between them, s.
const NEIGHBOURS_SECS: f64 = 0.2;
/// Episodes that are kept whatever they last.
const LEAST_EPISODES: usize = 40;

/// What of a log is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Thinned {
    /// Rows of the log that one simulated tick stands for; 1: each.
    pub rows_per_tick: usize,
    /// Tick, s.
    pub period_secs: f64,
    /// Episodes, and how many the log has.
    pub episodes: [usize; 2],
}

impl Thinned {
    /// In words; nothing where all is simulated.
    #[must_use]
    pub fn sentence(&self) -> Option<String> {
        let [kept, all] = self.episodes;
        let rate = (self.rows_per_tick > 1).then(|| {
            format!(
                "{} rows of the log were taken together to ticks of {:.1} ms, which is what the physics needs",
                self.rows_per_tick,
                1e3 * self.period_secs
            )
        });
        let part = (kept < all).then(|| format!("{kept} of {all} episodes were drawn, as the log is long"));
        let all: Vec<String> = rate.into_iter().chain(part).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }
}

/// A log as it is simulated. `has_tool`: whether something moves by command.
pub(crate) fn thinned(log: &Log, has_tool: bool, seed: u64) -> (Cow<'_, Log>, Thinned) {
    let (coarse, rows_per_tick) = at_rate(log, has_tool);
    let all = coarse.episodes.len();
    let kept = chosen(&coarse, seed);
    let part = if kept.len() < all {
        let episodes = kept.iter().map(|index| coarse.episodes[*index].clone()).collect();
        Cow::Owned(Log { header: coarse.header.clone(), episodes })
    } else {
        coarse
    };
    let thinned = Thinned { rows_per_tick, period_secs: part.header.period_secs, episodes: [kept.len(), all] };
    (part, thinned)
}

/// Places of the episodes that are simulated, ascending.
fn chosen(log: &Log, seed: u64) -> Vec<usize> {
    let ticks = |index: &usize| {
        let time_secs = &log.episodes[*index].time_secs;
        let lasts_secs = time_secs.last().copied().unwrap_or(0.0) - time_secs.first().copied().unwrap_or(0.0);
        (lasts_secs / log.header.period_secs) as usize
    };
    let (mut kept, mut sum) = (Vec::new(), 0_usize);
    for index in log.shuffled(seed) {
        sum = sum.saturating_add(ticks(&index));
        if sum > MOST_TICKS && kept.len() >= LEAST_EPISODES {
            break;
        }
        kept.push(index);
    }
    kept.sort_unstable();
    kept
}

/// The log in ticks that are long enough, and how many rows each stands for.
fn at_rate(log: &Log, has_tool: bool) -> (Cow<'_, Log>, usize) {
    let shortest_secs = if has_tool { PUSHED_SECS } else { THROWN_SECS };
    let period_secs = log.header.period_secs;
    // Rows that come more slowly than the header says are not dense.
    let rows = (shortest_secs / period_secs.max(usual_step_secs(log).unwrap_or(f64::INFINITY)) + 1e-6).floor() as usize;
    if rows < 2 {
        return (Cow::Borrowed(log), 1);
    }
    let tick_secs = (shortest_secs / period_secs + 1e-6).floor() * period_secs;
    let episodes = log.episodes.iter().map(|episode| coarse(episode, tick_secs)).collect();
    let mut coarse = Log { header: log.header.clone(), episodes };
    coarse.header.period_secs = tick_secs;
    coarse.header.noise = scaled(log, &coarse);
    (Cow::Owned(coarse), rows)
}

/// What `log.toml` says of the noise, for means.
fn scaled(log: &Log, coarse: &Log) -> Noise {
    let [fine, mean] = [log, coarse].map(|log| {
        let mut log = Cow::Borrowed(log);
        log.to_mut().header.noise = Noise::default();
        NoiseLevels::of_log(&log)
    });
    let scale = |kind: Kind, given: Option<f64>| {
        let scatter = |levels: &NoiseLevels| levels.all().find(|noise| noise.channel == kind)?.scatter;
        // Of what does not scatter nothing is known.
        let ratio = scatter(&mean).zip(scatter(&fine)).map_or(1.0, |(mean, fine)| mean / fine);
        let white = (new_readings(log, kind) / readings(coarse, kind)).max(1.0).sqrt().recip();
        Some(given? * ratio.clamp(white, 1.0))
    };
    let noise = &log.header.noise;
    Noise {
        object_position_m: scale(Kind::ObjectPosition, noise.object_position_m),
        object_orientation_rad: scale(Kind::ObjectOrientation, noise.object_orientation_rad),
        object_velocity_mps: scale(Kind::ObjectVelocity, noise.object_velocity_mps),
        object_spin_rps: scale(Kind::ObjectSpin, noise.object_spin_rps),
        tool_position_m: scale(Kind::ToolPosition, noise.tool_position_m),
        joint_position_rad: scale(Kind::JointPosition, noise.joint_position_rad),
        wrist_force_n: scale(Kind::WristForce, noise.wrist_force_n),
        wrist_torque_nm: scale(Kind::WristTorque, noise.wrist_torque_nm),
        joint_torque_nm: scale(Kind::JointTorque, noise.joint_torque_nm),
    }
}

/// Readings of a kind; the first of its columns speaks for all.
fn readings(log: &Log, kind: Kind) -> f64 {
    columns(log, kind).map(|cells| cells.count() as f64).sum::<f64>().max(1.0)
}

/// The same that differ from the one before: what is held is no new reading.
fn new_readings(log: &Log, kind: Kind) -> f64 {
    let new = |cells: &Readings| {
        let read: Vec<f64> = cells.iter().flatten().collect();
        1 + read.windows(2).filter(|two| two[0] != two[1]).count()
    };
    columns(log, kind).map(|cells| new(cells) as f64).sum()
}

fn columns(log: &Log, kind: Kind) -> impl Iterator<Item = &Readings> {
    let first = match kind {
        Kind::ObjectOrientation => Some(Channel::ObjectOrientation(Component::X)),
        _ => kind.channels(usize::from(log.header.robot.joints())).into_iter().next(),
    };
    log.episodes.iter().filter_map(move |episode| episode.channels.get(&first?))
}

/// Readings of a row of the coarse log: their mean, and the mean of their times.
type Mean = Option<(f64, f64)>;

/// An episode in ticks of `tick_secs`, as far as there are rows about them.
fn coarse(episode: &Episode, tick_secs: f64) -> Episode {
    let (Some(begin_secs), Some(end_secs)) = (episode.time_secs.first(), episode.time_secs.last()) else {
        return episode.clone();
    };
    let tick = |time_secs: f64, offset: f64| ((time_secs - begin_secs) / tick_secs + offset).max(0.0) as usize;
    // A last half tick has no row about its end.
    let last = tick(*end_secs, 1e-6);
    // The tick about whose end a row lies.
    let about: Vec<usize> = episode.time_secs.iter().map(|time| tick(*time, 0.5)).collect();
    let mut ticks: Vec<usize> = about.iter().copied().filter(|tick| *tick <= last).collect();
    ticks.dedup();
    let place = |tick: usize| ticks.binary_search(&tick).ok();
    let about: Vec<Option<usize>> = about.into_iter().map(place).collect();
    // And the one that it lies in.
    let within: Vec<Option<usize>> = episode.time_secs.iter().map(|time| place(tick(*time, 1.0 - 1e-6))).collect();
    let secs: Vec<f64> = ticks.iter().map(|tick| begin_secs + *tick as f64 * tick_secs).collect();
    let means = |readings: &Readings, of: &[Option<usize>]| -> Vec<Mean> {
        let mut sums = vec![(0.0, 0.0, 0_u32); ticks.len()];
        for ((reading, time), place) in readings.iter().zip(&episode.time_secs).zip(of) {
            if let (Some(value), Some(place)) = (reading, place) {
                let sum = &mut sums[*place];
                *sum = (sum.0 + value, sum.1 + time, sum.2 + 1);
            }
        }
        let mean = |(value, time, count): (f64, f64, u32)| {
            (count > 0).then(|| (value / f64::from(count), time / f64::from(count)))
        };
        sums.into_iter().map(mean).collect()
    };
    let nearest: Vec<usize> = secs.iter().map(|secs| nearest_row(&episode.time_secs, *secs)).collect();
    let turned = continuous(episode);
    let cells = |channel: &Channel, readings: &Readings| -> Readings {
        match channel {
            Channel::WristForce(_) | Channel::WristTorque(_) | Channel::JointTorque(_) => {
                means(readings, &within).into_iter().map(|mean| mean.map(|(value, _)| value)).collect()
            }
            Channel::Command(_) => {
                let read = means(readings, &about);
                let one = |(mean, secs): (&Mean, &f64)| mean.and_then(|_| sent(readings, &episode.time_secs, *secs));
                read.iter().zip(&secs).map(one).collect()
            }
            Channel::AddedMass => nearest.iter().map(|row| readings.get(*row)).collect(),
            _ => {
                let readings = turned.iter().find(|(of, _)| of == channel).map_or(readings, |(_, readings)| readings);
                moved(&means(readings, &about), &secs).into_iter().collect()
            }
        }
    };
    let channels = episode.channels.iter().map(|(channel, readings)| (*channel, cells(channel, readings))).collect();
    let action = episode.action.as_ref().map(|action| nearest.iter().map(|row| action[*row]).collect());
    let mut coarse = Episode { id: episode.id, time_secs: secs.clone(), action, channels };
    to_unit_length(&mut coarse);
    coarse
}

/// The row that is nearest to a time.
fn nearest_row(time_secs: &[f64], at_secs: f64) -> usize {
    let next = time_secs.partition_point(|time| *time < at_secs).min(time_secs.len() - 1);
    let before = next.saturating_sub(1);
    if at_secs - time_secs[before] < time_secs[next] - at_secs { before } else { next }
}

/// What was sent at a time, by linear interpolation.
fn sent(readings: &Readings, time_secs: &[f64], at_secs: f64) -> Option<f64> {
    let next = time_secs.partition_point(|time| *time < at_secs - 1e-9);
    let read = |row: usize| Some((time_secs[row], readings.get(row)?));
    let after = (next..time_secs.len()).find_map(read);
    let before = (0..next).rev().find_map(read);
    match (before, after) {
        (Some((t0, a)), Some((t1, b))) if t1 > at_secs + 1e-9 && a != b => {
            Some(a + (at_secs - t0) / (t1 - t0) * (b - a))
        }
        (_, Some((_, value))) | (Some((_, value)), None) => Some(value),
        (None, None) => None,
    }
}

/// Means moved to the times of their ticks, along the slope between the means before and after.
fn moved(means: &[Mean], secs: &[f64]) -> Vec<Option<f64>> {
    let read: Vec<(usize, (f64, f64))> =
        means.iter().enumerate().filter_map(|(place, mean)| Some((place, (*mean)?))).collect();
    let mut moved = vec![None; means.len()];
    for (index, (place, (value, time))) in read.iter().enumerate() {
        let (_, (a, t0)) = read[index.saturating_sub(1)];
        let (_, (b, t1)) = read[(index + 1).min(read.len() - 1)];
        let slope = if t1 > t0 && t1 - t0 < NEIGHBOURS_SECS { (b - a) / (t1 - t0) } else { 0.0 };
        moved[*place] = Some(value + slope * (secs[*place] - time));
    }
    moved
}

/// The components of the object's orientation with the sign of each quaternion as of the one before: q and −q are one rotation, whose mean is none.
fn continuous(episode: &Episode) -> Vec<(Channel, Readings)> {
    let mut last: Option<[f64; 4]> = None;
    let turns: Vec<Option<[f64; 4]>> = (0..episode.rows())
        .map(|row| {
            let read = episode.orientation(row)?;
            let along: f64 = last.unwrap_or(read).iter().zip(&read).map(|(a, b)| a * b).sum();
            let turn = if along < 0.0 { read.map(|value| -value) } else { read };
            last = Some(turn);
            Some(turn)
        })
        .collect();
    let column = |(index, component)| {
        (
            Channel::ObjectOrientation(component),
            turns.iter().map(|turn| turn.map(|turn: [f64; 4]| turn[index])).collect(),
        )
    };
    Component::ALL.into_iter().enumerate().map(column).collect()
}

/// Means of unit quaternions are a little shorter.
fn to_unit_length(episode: &mut Episode) {
    let turns: Vec<Option<[f64; 4]>> = (0..episode.rows())
        .map(|row| {
            let turn = episode.orientation(row)?;
            let length = turn.iter().map(|value| value * value).sum::<f64>().sqrt();
            (length > 0.5).then(|| turn.map(|value| value / length))
        })
        .collect();
    for (index, component) in Component::ALL.into_iter().enumerate() {
        if let Some(cells) = episode.channels.get_mut(&Channel::ObjectOrientation(component)) {
            *cells = turns.iter().map(|turn| turn.map(|turn| turn[index])).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use measured_log::Axis;
    use pomdp::{Purpose, Seed};
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    const PERIOD_SECS: f64 = 0.0005;

    /// `count` episodes of a second at 2 kHz: at x the place, as force the time; every `every`-th row has them.
    fn dense(count: u64, every: usize, noise: f64, x: impl Fn(f64) -> f64) -> Log {
        let mut header = crate::nominal::tests::uncertain_mass().header().clone();
        header.period_secs = PERIOD_SECS;
        header.noise.object_position_m = Some(noise);
        let mut rng = Seed(3).stream(Purpose::Test, 0);
        let episodes = (0..count)
            .map(|id| {
                let time_secs: Vec<f64> = (0..=2000).map(|row| PERIOD_SECS * f64::from(row)).collect();
                let mut episode = Episode { id, time_secs: time_secs.clone(), ..Episode::default() };
                let rows = || time_secs.iter().enumerate().map(|(row, time)| (row % every == 0).then_some(*time));
                for axis in Axis::ALL {
                    let mut read = |time: f64| {
                        let unit: f64 = StandardNormal.sample(&mut rng);
                        x(time) + noise * unit
                    };
                    let cells = rows().map(|time| time.map(&mut read)).collect();
                    episode.channels.insert(Channel::ObjectPosition(axis), cells);
                }
                episode.channels.insert(Channel::WristForce(Axis::X), rows().collect());
                episode.channels.insert(Channel::Command(Axis::X), time_secs.iter().copied().collect());
                for (i, component) in Component::ALL.into_iter().enumerate() {
                    // A turn of 2 rad/s about the vertical, the sign of the quaternion at random.
                    let turn = |(row, time): (usize, f64)| {
                        let sign = if row % 7 < 3 { -1.0 } else { 1.0 };
                        sign * [0.0, 0.0, time.sin(), time.cos()][i]
                    };
                    let cells = rows().enumerate().map(|(row, time)| time.map(|time| turn((row, time)))).collect();
                    episode.channels.insert(Channel::ObjectOrientation(component), cells);
                }
                episode
            })
            .collect();
        Log { header, episodes }
    }

    #[test]
    fn a_row_says_what_was_read_about_its_time_whichever_rows_have_readings() {
        let way = |time: f64| 0.3 * time + 0.5 * time * time;
        for every in [1, 3, 8] {
            let log = dense(1, every, 0.0, way);
            let (found, thinned) = thinned(&log, true, 1);
            assert_eq!((thinned.rows_per_tick, thinned.period_secs, thinned.episodes), (10, 0.005, [1, 1]));
            let episode = &found.episodes[0];
            assert_eq!(episode.rows(), 201);
            for (row, time) in episode.time_secs.iter().enumerate() {
                assert!((time - 0.005 * row as f64).abs() < 1e-12);
                let Some(place) = episode.get(Channel::ObjectPosition(Axis::Y), row) else {
                    // Readings 4 ms apart do not lie in each window of 5 ms about a tick, at its ends alone.
                    assert!(every == 8, "{every} {row}");
                    continue;
                };
                // A mean over 5 ms of a motion of 1 m/s², and at the ends half of one: a²T²/24 and more.
                assert!((place - way(*time)).abs() < 1.5e-5, "{every} {row}: {place}, {}", way(*time));
                assert!((episode.get(Channel::Command(Axis::X), row).unwrap() - time).abs() < 1e-9);
                let [.., z, w] = episode.orientation(row).unwrap();
                let turned = (z * time.cos() - w * time.sin()).abs();
                assert!(turned < 1e-4, "{every} {row}: {turned}");
                // The mean of what was read in the tick before; the first row is before any.
                let force = episode.get(Channel::WristForce(Axis::X), row).unwrap();
                let lag = time - force;
                assert!(row == 0 || (0.0..0.005).contains(&lag), "{every} {row}: {lag}");
                assert!(row == 0 || every > 1 || (lag - 0.00225).abs() < 1e-9, "{row}: {lag}");
            }
        }
    }

    #[test]
    fn noise_shrinks_as_far_as_it_is_white() {
        let log = dense(2, 1, 1e-3, |time| time);
        let noise = thinned(&log, true, 1).0.header.noise.object_position_m.unwrap();
        // Of ten readings, by what 400 third differences scatter by.
        assert!((noise / 1e-3 - 0.1_f64.sqrt()).abs() < 0.06, "{noise}");
        // Held for ten rows it is no smaller.
        let mut held = log.clone();
        for episode in &mut held.episodes {
            for axis in Axis::ALL {
                let cells = &episode.channels[&Channel::ObjectPosition(axis)];
                let cells: Readings = (0..cells.len()).map(|row| cells.get(row - row % 10)).collect();
                episode.channels.insert(Channel::ObjectPosition(axis), cells);
            }
        }
        let noise = thinned(&held, true, 1).0.header.noise.object_position_m.unwrap();
        assert!(noise > 0.6e-3, "{noise}");
    }

    #[test]
    fn what_is_slow_and_short_stays_as_it_is_and_a_part_of_what_is_long_is_drawn() {
        let mut slow = dense(3, 1, 1e-3, |time| time);
        slow.header.period_secs = 0.003;
        let (same, none) = thinned(&slow, true, 1);
        assert!(matches!(same, Cow::Borrowed(_)) && none.sentence().is_none(), "{none:?}");
        let long = dense(300, 50, 0.0, |time| time);
        let (part, thinned_to) = thinned(&long, true, 1);
        let [kept, all] = thinned_to.episodes;
        assert!(all == 300 && part.episodes.len() == kept && (145..=155).contains(&kept), "{thinned_to:?}");
        assert!(part.episodes.windows(2).all(|two| two[0].id < two[1].id));
        assert_ne!(part.episodes, thinned(&long, true, 2).0.episodes, "another seed draws others");
        assert!(thinned_to.sentence().unwrap().contains("of 300 episodes were drawn"));
    }

    #[test]
    fn gaps_and_a_header_that_is_wrong_make_no_rows() {
        let mut log = dense(1, 1, 0.0, |time| time);
        for time in &mut log.episodes[0].time_secs[1000..] {
            *time += 80_000.0;
        }
        let (found, _) = thinned(&log, true, 1);
        assert!((195..=205).contains(&found.episodes[0].rows()), "{}", found.episodes[0].rows());
        // Of slow rows whose header says that they are fast nothing is taken together.
        let mut slow = dense(1, 1, 0.0, |time| time);
        slow.episodes[0].time_secs.iter_mut().for_each(|time| *time *= 40.0);
        slow.header.period_secs = 1e-9;
        assert!(matches!(thinned(&slow, true, 1), (Cow::Borrowed(_), Thinned { rows_per_tick: 1, .. })));
    }

    #[test]
    fn readings_of_a_slow_camera_are_moved_to_their_ticks() {
        let log = dense(1, 41, 0.0, |time| 0.3 * time);
        let (found, _) = thinned(&log, true, 1);
        let episode = &found.episodes[0];
        let read: Vec<(f64, f64)> = (0..episode.rows())
            .filter_map(|row| Some((episode.time_secs[row], episode.get(Channel::ObjectPosition(Axis::X), row)?)))
            .collect();
        assert!(read.len() > 40);
        assert!(read.iter().all(|(time, place)| (place - 0.3 * time).abs() < 1e-9), "{read:?}");
    }
}
