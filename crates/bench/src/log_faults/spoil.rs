//! What spoils a log.

use log_check::Reading;
use measured_log::{Channel, Log, Readings, Shape};

/// Whether a log has what a reading changes.
pub(super) fn has_part(log: &Log, reading: &Reading) -> bool {
    let has = |channel: Channel| log.has(channel);
    let shape = &log.header.object.shape;
    match reading {
        Reading::Conjugate | Reading::RealLast | Reading::BodyTurned(_) => {
            has(Channel::ObjectOrientation(measured_log::Component::W))
        }
        Reading::LengthsSwapped(..) => matches!(shape, Shape::Box { .. }),
        Reading::RadiusScaled(_) => matches!(shape, Shape::Cylinder { .. }),
        Reading::ToolRadiusScaled(_) => log.header.tool_radius_m.is_some(),
        Reading::Wrench(_) | Reading::ForceScaled(_) => has(Channel::WristForce(measured_log::Axis::X)),
        Reading::TorqueAbout(_) => has(Channel::WristTorque(measured_log::Axis::X)),
        Reading::AddedMassScaled(_) => log.episodes.iter().any(|episode| {
            episode.channels.get(&Channel::AddedMass).is_some_and(|cells| cells.iter().flatten().any(|mass| mass > 0.0))
        }),
        _ => true,
    }
}

/// One force of 1000 N.
pub(super) fn glitch(spoilt: &mut Log) -> Option<()> {
    let force = Channel::WristForce(measured_log::Axis::X);
    let middle = spoilt.episodes.len() / 2;
    let episode = &mut spoilt.episodes[middle];
    let cells = episode.channels.get(&force)?;
    let row = (cells.len() / 2..cells.len()).find(|row| cells.get(*row).is_some())?;
    let new: Readings =
        cells.iter().enumerate().map(|(i, value)| if i == row { Some(1000.0) } else { value }).collect();
    episode.channels.insert(force, new);
    Some(())
}

/// The largest 3 % of forces cut off.
pub(super) fn clip(spoilt: &mut Log) -> Option<()> {
    let axes = measured_log::Axis::ALL.map(Channel::WristForce);
    let cells = |axis| spoilt.episodes.iter().filter_map(move |episode| episode.channels.get(&axis));
    let all = axes.into_iter().flat_map(cells).flat_map(Readings::iter).flatten();
    let limit = statistics::nearest_rank(all.map(f64::abs), 0.97)?;
    change(
        spoilt,
        |channel, _, value| {
            if matches!(channel, Channel::WristForce(_)) { value.clamp(-limit, limit) } else { value }
        },
    );
    Some(())
}

/// The object away for three rows.
pub(super) fn away(spoilt: &mut Log) -> Option<()> {
    let x = Channel::ObjectPosition(measured_log::Axis::X);
    let middle = spoilt.episodes.len() / 2;
    let cells = spoilt.episodes[middle].channels.get(&x)?;
    let read: Vec<usize> = (0..cells.len()).filter(|row| cells.get(*row).is_some()).collect();
    let away = read.get(read.len() / 3..read.len() / 3 + 3)?.to_vec();
    let new: Readings = cells
        .iter()
        .enumerate()
        .map(|(row, value)| value.map(|value| if away.contains(&row) { value + 0.2 } else { value }))
        .collect();
    spoilt.episodes[middle].channels.insert(x, new);
    Some(())
}

/// One episode in which the object can tell, in a frame that is turned.
pub(super) fn turn_one(spoilt: &mut Log) -> Option<()> {
    let mut turned = Reading::TrackerTurned(1).apply(spoilt);
    // Near the origin a turn changes little.
    let far = |a: &measured_log::Episode, b: &measured_log::Episode| {
        place(a).zip(place(b)).is_some_and(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) > 0.1)
    };
    let moved = |index: &usize| {
        far(&spoilt.episodes[*index], &turned.episodes[*index])
            && way_m(&spoilt.episodes[*index]).is_some_and(|way_m| way_m > 0.01)
            && rests_first(&spoilt.episodes[*index])
    };
    let index = (spoilt.episodes.len() / 2..spoilt.episodes.len()).find(moved)?;
    spoilt.episodes[index] = turned.episodes.swap_remove(index);
    Some(())
}

/// Times of arrival.
pub(super) fn jitter(spoilt: &mut Log) -> Option<()> {
    let late_secs = 0.33 * log_check::check(spoilt, None).clock?.period_secs;
    for (number, episode) in spoilt.episodes.iter_mut().enumerate() {
        for (row, secs) in episode.time_secs.iter_mut().enumerate().skip(1) {
            // Without a generator: the fractional parts of a row's multiples of the golden section are uniform.
            *secs += late_secs * (0.618_034 * (row + 37 * number) as f64).fract();
        }
        let increasing = episode.time_secs.windows(2).all(|pair| pair[0] < pair[1]);
        increasing.then_some(())?;
    }
    Some(())
}

/// Whether an object stays where it is at first for 0.3 s, to 2 mm.
fn rests_first(episode: &measured_log::Episode) -> bool {
    let Some(first) = place(episode) else { return false };
    let begun = episode.time_secs[0];
    let rows = (0..episode.rows()).take_while(|row| episode.time_secs[*row] - begun < 0.3);
    let mut places = rows.filter_map(|row| episode.vector(Channel::ObjectPosition, row));
    places.all(|place| (place[0] - first[0]).hypot(place[1] - first[1]) < 0.002)
}

/// Where an object is at first, m.
fn place(episode: &measured_log::Episode) -> Option<[f64; 3]> {
    (0..episode.rows()).find_map(|row| episode.vector(Channel::ObjectPosition, row))
}

/// How far an object comes in an episode, along x and y together, m.
fn way_m(episode: &measured_log::Episode) -> Option<f64> {
    let mut places = (0..episode.rows()).filter_map(|row| episode.vector(Channel::ObjectPosition, row));
    let first = places.next()?;
    let last = places.next_back()?;
    Some((last[0] - first[0]).hypot(last[1] - first[1]))
}

/// Makes a new reading of each.
pub(super) fn change(log: &mut Log, new: impl Fn(Channel, usize, f64) -> f64) {
    for episode in &mut log.episodes {
        for (channel, cells) in &mut episode.channels {
            *cells =
                cells.iter().enumerate().map(|(row, value)| value.map(|value| new(*channel, row, value))).collect();
        }
    }
}
