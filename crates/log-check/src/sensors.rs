//! What each sensor reads, and when.

use measured_log::{Axis, Channel, Component, Episode, Log};
use serde::Serialize;

use crate::arrival::Followed;
use crate::clipped::{clipped, dead_axes};
use crate::suspicion::{Kind, Suspicion};

/// Rows after which a sensor that never changes is dead, if others do.
pub(crate) const DEAD_ROWS: usize = 50;
/// A spike is this many times larger than what its neighbours, and nine in ten of all readings, differ from each other by.
const SPIKE: f64 = 8.0;
/// Rows in which a reading can be away and come back.
const MOST_AWAY: usize = 5;
/// Longest time, s, that it is away, whatever it does there.
const AWAY_SECS: f64 = 0.1;
/// Longest time, s, from the reading before to the one after where it jumps away, rests there, jumps back and rests. What tips, or hangs on a spring, comes back too,
/// but not without a way there and back; and a hand is slower.
const AWAY_RESTING_SECS: f64 = 0.5;
/// Neighbours are so far apart at most, s: what was hidden from the sensor for longer may have gone there and back.
const HIDDEN_SECS: f64 = 0.25;
/// How much higher than a free flight between two readings an object is seen at most.
const HOP_MARGIN: f64 = 1.5;
/// A force is beyond what contacts do if it is so many times larger than all others but a few.
const BEYOND: f64 = 10.0;
const FEW: usize = 10;
/// Rows that an episode has at least if it can be a copy.
const COPY_ROWS: usize = 10;
/// Rates may differ by this share from the header's.
const RATE_SHARE: f64 = 0.004;
/// A sensor whose rate differs by more than this has one of its own.
const NEAR_RATE: f64 = 0.15;
/// Nobody reads so many ticks apart, or so often a tick: that is another unit.
const OTHER_UNIT: f64 = 50.0;
/// Episodes whose lengths tell how well a rate is known.
const MANY_EPISODES: usize = 5;
/// Distances of rows that scatter by this share of their mean may be those of arrival.
const JITTER_SHARE: f64 = 0.05;

/// A sensor: columns that belong together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensor {
    /// Name of its first column.
    pub column: String,
    /// Rows in which it was read.
    pub read: usize,
    /// Rows of the log.
    pub rows: usize,
    /// Readings a second, in the median of the distances between them.
    pub rate_hz: Option<f64>,
    /// Longest time without a reading between two of an episode, s.
    pub longest_gap_secs: f64,
    /// Smallest step between readings that follow each other: the resolution, in the column's unit.
    pub smallest_step: Option<f64>,
    /// Smallest and largest reading of its columns.
    pub range: [f64; 2],
}

/// When a sensor is read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Clock {
    /// Its first column.
    pub column: String,
    /// Mean distance between readings, lost ones counted, s.
    pub period_secs: f64,
    /// Standard error of it, s.
    pub error_secs: f64,
    /// Standard deviation of the distances, s.
    pub jitter_secs: f64,
    /// Distances in which readings were lost.
    pub gaps: usize,
}

impl Clock {
    /// Share by which its rate may differ from the header's.
    #[must_use]
    pub fn margin(&self) -> f64 {
        RATE_SHARE + 4.0 * self.error_secs / self.period_secs
    }
}

/// Groups of columns that a sensor gives together.
fn groups(log: &Log) -> Vec<Vec<Channel>> {
    let vector = |make: fn(Axis) -> Channel| Axis::ALL.map(make).to_vec();
    let joints = |make: fn(u8) -> Channel| (0..log.header.robot.joints()).map(make).collect::<Vec<_>>();
    let all = vec![
        vector(Channel::Command),
        vector(Channel::Tool),
        joints(Channel::Joint),
        vector(Channel::WristForce),
        vector(Channel::WristTorque),
        joints(Channel::JointTorque),
        vector(Channel::ObjectPosition),
        Component::ALL.map(Channel::ObjectOrientation).to_vec(),
        vector(Channel::ObjectVelocity),
        vector(Channel::ObjectSpin),
        vec![Channel::AddedMass],
    ];
    all.into_iter().filter(|group| group.first().is_some_and(|channel| log.has(*channel))).collect()
}

/// Readings of a column with the indices of their rows.
pub(crate) fn readings(episode: &Episode, channel: Channel) -> impl Iterator<Item = (usize, f64)> + '_ {
    episode
        .channels
        .get(&channel)
        .into_iter()
        .flat_map(|cells| cells.iter().enumerate().filter_map(|(row, value)| Some((row, value?))))
}

/// All sensors of a log.
pub(crate) fn sensors(log: &Log) -> Vec<Sensor> {
    groups(log).into_iter().map(|group| sensor(log, &group)).collect()
}

fn sensor(log: &Log, group: &[Channel]) -> Sensor {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let (mut read, mut gaps, mut smallest) = (0, Vec::new(), f64::INFINITY);
    for episode in &log.episodes {
        for (index, channel) in group.iter().enumerate() {
            let all: Vec<(usize, f64)> = readings(episode, *channel).collect();
            for (_, value) in &all {
                range = [range[0].min(*value), range[1].max(*value)];
            }
            for pair in all.windows(2) {
                let step = (pair[1].1 - pair[0].1).abs();
                smallest = if step > 0.0 { smallest.min(step) } else { smallest };
            }
            if index == 0 {
                read += all.len();
                gaps.extend(all.windows(2).map(|pair| episode.time_secs[pair[1].0] - episode.time_secs[pair[0].0]));
            }
        }
    }
    let longest_gap_secs = gaps.iter().copied().fold(0.0, f64::max);
    Sensor {
        column: group[0].name(),
        read,
        rows: log.episodes.iter().map(Episode::rows).sum(),
        rate_hz: statistics::quantile(&mut gaps, 0.5).map(f64::recip),
        longest_gap_secs,
        smallest_step: smallest.is_finite().then_some(smallest),
        range: if range[0] <= range[1] { range } else { [0.0; 2] },
    }
}

/// When rows come, by the sensor that comes nearest to the header's period; `None` where no sensor was read twice in an episode.
pub(crate) fn clock(log: &Log) -> Option<Clock> {
    let sensed = groups(log).into_iter().filter(|group| group[0] != Channel::AddedMass);
    let clocks = sensed.filter_map(|group| sensor_clock(log, group[0]));
    let off = |clock: &Clock| (clock.period_secs / log.header.period_secs).ln().abs();
    clocks.min_by(|a, b| off(a).total_cmp(&off(b)))
}

fn sensor_clock(log: &Log, channel: Channel) -> Option<Clock> {
    let of_episode = |episode: &Episode| -> Vec<f64> {
        let times: Vec<f64> = readings(episode, channel).map(|(row, _)| episode.time_secs[row]).collect();
        times.windows(2).map(|pair| pair[1] - pair[0]).collect()
    };
    let episodes: Vec<Vec<f64>> = log.episodes.iter().map(of_episode).filter(|steps| !steps.is_empty()).collect();
    let mut steps: Vec<f64> = episodes.iter().flatten().copied().collect();
    let median = statistics::quantile(&mut steps, 0.5)?;
    // Whole numbers of readings, some of which were lost: without these the mean is not that of the sensor.
    let ticks = |step: f64| (step / median).round().max(1.0);
    let whole = || steps.iter().filter(|step| ticks(**step) == 1.0);
    let jitter_secs = (whole().map(|step| (step - median).powi(2)).sum::<f64>() / whole().count().max(1) as f64).sqrt();
    let spans: Vec<(f64, f64)> =
        episodes.iter().map(|steps| (steps.iter().sum(), steps.iter().map(|step| ticks(*step)).sum())).collect();
    let count: f64 = spans.iter().map(|(_, count)| count).sum();
    let period_secs = spans.iter().map(|(secs, _)| secs).sum::<f64>() / count;
    Some(Clock {
        column: channel.name(),
        period_secs,
        error_secs: rate_error(&spans, period_secs).unwrap_or(jitter_secs / (steps.len() as f64).sqrt()),
        jitter_secs,
        gaps: steps.len() - whole().count(),
    })
}

/// Standard error of the mean distance between readings, from how far whole episodes, of (seconds, distances) each, are from it. What makes stamps uneven
/// may add up over an episode or not: that shows between episodes and not within. `None` for fewer than [`MANY_EPISODES`].
fn rate_error(spans: &[(f64, f64)], period_secs: f64) -> Option<f64> {
    let n = spans.len() as f64;
    let count: f64 = spans.iter().map(|(_, count)| count).sum();
    let squares: f64 = spans.iter().map(|(secs, count)| (secs - period_secs * count).powi(2)).sum();
    (spans.len() >= MANY_EPISODES).then(|| (squares * n / (n - 1.0)).sqrt() / count)
}

/// What looks wrong with rows and sensors.
pub(crate) fn suspicions(
    log: &Log,
    sensors: &[Sensor],
    clock: Option<&Clock>,
    followed: Option<&Followed>,
    blow: &dyn Fn(usize, f64, f64) -> bool,
) -> Vec<Suspicion> {
    let mut all: Vec<Suspicion> = dead(log).into_iter().map(|group| {
        let column = group[0].name();
        let value = sensors.iter().find(|sensor| sensor.column == column).map_or(0.0, |sensor| sensor.range[0]);
        Suspicion::new(
            Kind::DeadSensor,
            format!("{column} and its neighbours read exactly {value} in all rows: the sensor is dead or was not connected."),
            if group.iter().any(|channel| matches!(channel, Channel::Tool(_) | Channel::Joint(_))) {
                "Take these columns out."
            } else {
                "Take these columns out; a diagnosis leaves them out."
            },
        )
    }).collect();
    all.extend(dead_axes(log));
    all.extend(clipped(log));
    all.extend(clock.and_then(|clock| of_clock(log, clock, followed)));
    all.extend(groups(log).iter().filter_map(|group| spikes(log, group, blow)));
    all.extend(repeated(log));
    all
}

fn of_clock(log: &Log, clock: &Clock, followed: Option<&Followed>) -> Option<Suspicion> {
    let period_secs = log.header.period_secs;
    let ms = |secs: f64| 1e3 * secs;
    if clock.jitter_secs > JITTER_SHARE * clock.period_secs
        && let Some(followed) = followed.filter(|followed| followed.is_of_arrival())
    {
        let found = format!(
            "Readings come every {:.2} ms, give or take {:.2} ms, and motion follows {:.0} ± {:.0} % of that unevenness: times are those of arrival, not of \
             measurement.",
            ms(clock.period_secs),
            ms(clock.jitter_secs),
            1e2 * followed.share,
            1e2 * followed.error
        );
        return Some(Suspicion::new(
            Kind::Jitter,
            found,
            "Use the sensors' own stamps, or the number of the row times period_secs.",
        ));
    }
    let off = clock.period_secs / period_secs;
    if !(OTHER_UNIT.recip()..=OTHER_UNIT).contains(&off) {
        let found =
            format!("{} comes every {:.4} s, period_secs says {period_secs} s.", clock.column, clock.period_secs);
        return Some(Suspicion::new(
            Kind::Rate,
            found,
            "Are time_secs and period_secs both in seconds, and not in ms or ns?",
        ));
    }
    // Several readings a tick, and several ticks a reading, are allowed.
    let whole = if off > 1.0 { off / off.round() } else { off * off.recip().round() };
    ((whole - 1.0).abs() > clock.margin() && (off - 1.0).abs() < NEAR_RATE).then(|| {
        let found = format!(
            "{} comes every {:.3} ms, period_secs says {:.3} ms, and no sensor comes nearer.",
            clock.column,
            ms(clock.period_secs),
            ms(period_secs)
        );
        Suspicion::new(Kind::Rate, found, "Check which of the two is right.")
    })
}

/// Groups of columns that never change where others do.
fn dead(log: &Log) -> Vec<Vec<Channel>> {
    let sensed = |channel: &Channel| !matches!(channel, Channel::Command(_) | Channel::AddedMass);
    let count =
        |group: &[Channel]| log.episodes.iter().map(|episode| readings(episode, group[0]).count()).sum::<usize>();
    let constant = |group: &[Channel]| {
        group.iter().all(|channel| {
            let mut values =
                log.episodes.iter().flat_map(|episode| readings(episode, *channel)).map(|(_, value)| value);
            values.next().is_none_or(|first| values.all(|value| value == first))
        })
    };
    let found: Vec<Vec<Channel>> = groups(log)
        .into_iter()
        .filter(|group| sensed(&group[0]) && count(group) >= DEAD_ROWS && constant(group))
        .collect();
    let object = |group: &Vec<Channel>| matches!(group[0], Channel::ObjectPosition(_) | Channel::ObjectOrientation(_));
    // An object that nothing moves has dead sensors of nothing.
    if found.iter().any(object) { Vec::new() } else { found }
}

/// The log without the columns of dead sensors of force, torque and velocity.
#[must_use]
pub fn without_dead(log: &Log) -> Option<Log> {
    let columns: Vec<Channel> = dead(log)
        .into_iter()
        .flatten()
        .filter(|channel| !matches!(channel, Channel::Tool(_) | Channel::Joint(_)))
        .collect();
    (!columns.is_empty()).then(|| {
        let mut log = log.clone();
        log.episodes.iter_mut().for_each(|episode| episode.channels.retain(|channel, _| !columns.contains(channel)));
        log
    })
}

/// The noise that the header states of a column.
fn stated(log: &Log, channel: Channel) -> Option<f64> {
    let noise = &log.header.noise;
    match channel {
        Channel::WristForce(_) => noise.wrist_force_n,
        Channel::Tool(_) => noise.tool_position_m,
        Channel::Joint(_) => noise.joint_position_rad,
        Channel::ObjectPosition(_) => noise.object_position_m,
        _ => None,
    }
}

/// What neighbours usually differ by.
fn usual_step(log: &Log, group: &[Channel]) -> Option<f64> {
    // Nine in ten of all neighbours differ by less.
    let of_channel = |episode: &Episode, channel: Channel| -> Vec<f64> {
        let read: Vec<f64> = readings(episode, channel).map(|(_, value)| value).collect();
        read.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect()
    };
    let all =
        log.episodes.iter().flat_map(|episode| group.iter().flat_map(move |channel| of_channel(episode, *channel)));
    let steps: Vec<f64> = all.collect();
    let usual = statistics::nearest_rank(steps.iter().copied(), 0.9)?.max(stated(log, group[0]).unwrap_or(0.0));
    // Of what hardly moves and is rounded, the last digit.
    let digit = || steps.iter().copied().filter(|step| *step > 0.0).reduce(f64::min);
    if usual > 0.0 { Some(usual) } else { digit() }
}

/// Single readings, and of places up to [`MOST_AWAY`] in a row, that stand out from those before and after by far more than these from each other.
///
/// Of places, which cannot go there and back; of forces only far beyond all others, and not where they may be a blow, which is as short. `blow`: whether one is
/// possible in an episode, by its index, at a time, s, with a force, N.
fn spikes(log: &Log, group: &[Channel], blow: &dyn Fn(usize, f64, f64) -> bool) -> Option<Suspicion> {
    let forces = matches!(group[0], Channel::WristForce(_));
    if !forces && !matches!(group[0], Channel::Tool(_) | Channel::Joint(_) | Channel::ObjectPosition(_)) {
        return None;
    }
    let sizes = log.episodes.iter().flat_map(|episode| group.iter().flat_map(|channel| readings(episode, *channel)));
    let mut sizes: Vec<f64> = sizes.map(|(_, value)| value.abs()).collect();
    sizes.sort_by(|a, b| b.total_cmp(a));
    // But for a few.
    let beyond = BEYOND * sizes.get(FEW).copied()?;
    let usual = usual_step(log, group)?;
    let mut far: Vec<(f64, u64, f64, Channel, f64, usize)> = Vec::new();
    for (index, episode) in log.episodes.iter().enumerate() {
        for channel in group {
            let read: Vec<(usize, f64)> = readings(episode, *channel).collect();
            for (burst, rows) in
                (1..=if forces { 1 } else { MOST_AWAY }).flat_map(|n| read.windows(n + 6).map(move |rows| (n, rows)))
            {
                let value = |i: usize| rows[i].1;
                let secs = episode.time_secs[rows[3].0];
                let apart = |a: usize, b: usize| episode.time_secs[rows[b].0] - episode.time_secs[rows[a].0];
                let long = burst > 1 && apart(3, 2 + burst) > AWAY_SECS;
                let gone_secs = apart(2, 3 + burst);
                let along = matches!(channel, Channel::ObjectPosition(Axis::X | Axis::Y));
                if long && !along || !forces && gone_secs > AWAY_RESTING_SECS {
                    continue;
                }
                // What was hidden before or after.
                if (2..3 + burst).any(|i| apart(i, i + 1) > HIDDEN_SECS) {
                    continue;
                }
                let (before, after) = (value(2), value(3 + burst));
                // All of them, of the way from one side to the other.
                let away =
                    (3..3 + burst).map(|i| (value(i) - 0.5 * (before + after)).abs()).fold(f64::INFINITY, f64::min);
                let alone = away - 0.5 * (after - before).abs();
                // A bounce has a corner too, but neighbours that go as far.
                let near =
                    [(0, 1), (1, 2), (3, 4), (4, 5)].map(|(a, b)| if a < 2 { (a, b) } else { (a + burst, b + burst) });
                let near = near.map(|(a, b)| (value(b) - value(a)).abs());
                let limit = SPIKE * near.into_iter().fold(usual, f64::max);
                let rests = (3..2 + burst).all(|i| SPIKE * (value(i + 1) - value(i)).abs() < alone);
                // It rises and falls freely in that time.
                let hops = matches!(channel, Channel::ObjectPosition(Axis::Z))
                    && alone < HOP_MARGIN * log.header.gravity_mps2 * gone_secs.powi(2) / 8.0;
                if long && !rests || hops {
                    continue;
                }
                if alone > limit && (!forces || (value(3).abs() > beyond && !blow(index, secs, value(3).abs()))) {
                    far.push((alone / usual, episode.id, secs, *channel, value(3), burst));
                }
            }
        }
    }
    let worst = far.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let count = match far.len() {
        1 => String::new(),
        many => format!(" So do {} other readings.", many - 1),
    };
    let rows = if worst.5 == 1 { "one row".into() } else { format!("{} rows", worst.5) };
    let found = format!("{} reads {:.4} in {rows}, and not before or after.{count}", worst.3.name(), worst.4);
    let mut suspicion = Suspicion::new(Kind::Outliers, found, "Leave such cells empty.");
    suspicion.shown_at = Some((worst.1, worst.2));
    Some(suspicion)
}

/// Episodes that are copies of earlier ones.
fn repeated(log: &Log) -> Option<Suspicion> {
    let measured = |episode: &Episode| -> Vec<Channel> {
        episode.channels.keys().copied().filter(|c| !matches!(c, Channel::Command(_) | Channel::AddedMass)).collect()
    };
    let same = |a: &Episode, b: &Episode| {
        a.rows() >= COPY_ROWS
            && a.rows() == b.rows()
            && measured(a).iter().all(|channel| a.channels.get(channel) == b.channels.get(channel))
    };
    let moves = |episode: &Episode| {
        measured(episode).iter().any(|channel| {
            let mut values = readings(episode, *channel).map(|(_, value)| value);
            values.next().is_some_and(|first| values.any(|value| value != first))
        })
    };
    let copies: Vec<(u64, u64)> = log
        .episodes
        .iter()
        .enumerate()
        .filter_map(|(i, episode)| {
            let original = log.episodes[..i].iter().find(|earlier| same(earlier, episode) && moves(episode))?;
            Some((episode.id, original.id))
        })
        .collect();
    let (copy, original) = copies.first()?;
    let others = match copies.len() {
        1 => String::new(),
        many => format!(" So do {} other episodes.", many - 1),
    };
    let found = format!("Episode {copy} repeats the readings of episode {original}.{others}");
    Some(Suspicion::new(
        Kind::Repeated,
        found,
        "Take the copies out: they would count twice, and be fitted and held out at once.",
    ))
}
