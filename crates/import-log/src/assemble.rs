//! From readings to the episodes of a log.

use std::path::Path;

use measured_log::{Axis, Channel, Component, Episode, MAX_ROWS, Readings};

use crate::Error;
use crate::cut::{Piece, cut};
use crate::mapping::{Axes, Mapping, Sampling};
use crate::plan::{Plan, Quantity};
use crate::rigid::{Quaternion, Vec3, add, cross, multiply, rotate};
use crate::sample::Sampler;
use crate::store::{Store, Stream};

/// Appends the episodes of `store`, which was read from `source`.
pub(crate) fn episodes(
    mapping: &Mapping,
    plan: &Plan,
    mut store: Store,
    source: &Path,
    episodes: &mut Vec<Episode>,
) -> Result<(), Error> {
    let keep_rows = plan.sample == Sampling::Rows;
    if !keep_rows {
        store.sort();
    }
    let pieces = cut(mapping, plan, &store, keep_rows)?;
    check_clocks(mapping, plan, &store, pieces.len())?;
    let ids = ids(&pieces, episodes.len() as u64);
    let mut rows: usize = episodes.iter().map(Episode::rows).sum();
    for (piece, id) in pieces.iter().zip(ids) {
        let times = if keep_rows {
            piece.rows.clone().filter_map(|row| first_stream(plan, &store)?.times.get(row).copied()).collect()
        } else {
            grid(mapping, plan, &store, piece, rows)?
        };
        let Some(start) = times.first().copied() else { continue };
        rows += times.len();
        if rows > MAX_ROWS {
            return Err(too_many(source, rows));
        }
        let moments = Moments { plan, store: &store, times, first_row: piece.rows.start, keep_rows };
        let mut episode = Episode { id, ..Episode::default() };
        for row in 0..moments.times.len() {
            let time = if keep_rows { moments.times[row] - start } else { row as f64 * mapping.header.period_secs };
            episode.time_secs.push(time);
            moments.append(row, &mut episode).map_err(|reason| {
                let place = format!("episode {id}, {time} s");
                Error::source(source, place, &reason.0, reason.1)
            })?;
        }
        episodes.push(episode);
    }
    Ok(())
}

/// Refuses a clock that stands still: of each episode one reading would be left.
fn check_clocks(mapping: &Mapping, plan: &Plan, store: &Store, episodes: usize) -> Result<(), Error> {
    for (track, stream) in plan.tracks.iter().zip(&store.streams) {
        // These hold until they change.
        let lasts = matches!(track.quantity, Quantity::AddedMass | Quantity::Action | Quantity::Label);
        let times = stream.times.len();
        if !lasts && stream.replaced > 0 && times <= episodes.max(1) {
            let found = times + stream.replaced;
            let reason = format!(
                "expected a clock that goes on, found {times} times in {found} readings: another stamp, such as log, may do"
            );
            return Err(mapping.wrong(format!("{}.stamp", track.quantity.key()), reason));
        }
    }
    Ok(())
}

fn too_many(source: &Path, found: usize) -> Error {
    Error::TooLarge { path: source.to_owned(), what: "rows of a log", limit: MAX_ROWS as u64, found: found as u64 }
}

/// Readings of any track but the label and those that never change.
fn first_stream<'a>(plan: &Plan, store: &'a Store) -> Option<&'a Stream> {
    let read = |index: &usize| plan.tracks[*index].fixed().is_none();
    (0..plan.tracks.len()).find(read).map(|index| &store.streams[index])
}

/// The labels, where they are whole numbers that ascend; else a count from `first`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded first")]
fn ids(pieces: &[Piece], first: u64) -> Vec<u64> {
    let whole = |label: f64| (label.fract() == 0.0 && (0.0..=9e15).contains(&label)).then_some(label as u64);
    let named: Option<Vec<u64>> = pieces.iter().map(|piece| piece.label.and_then(whole)).collect();
    match named {
        Some(ids) if first == 0 && ids.is_sorted_by(|a, b| a < b) => ids,
        _ => (first..).take(pieces.len()).collect(),
    }
}

/// The moments of the rows of an episode: from its first reading to its last.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded first")]
fn grid(mapping: &Mapping, plan: &Plan, store: &Store, piece: &Piece, before: usize) -> Result<Vec<f64>, Error> {
    let period_secs = mapping.header.period_secs;
    let (mut start, mut end) = (f64::INFINITY, f64::NEG_INFINITY);
    for (track, stream) in plan.tracks.iter().zip(&store.streams) {
        if track.quantity == Quantity::Label {
            continue;
        }
        let from = stream.times.partition_point(|t| *t < piece.from_secs);
        let to = stream.times.partition_point(|t| *t < piece.to_secs);
        if from < to {
            start = start.min(stream.times[from]);
            end = end.max(stream.times[to - 1]);
        }
    }
    if start > end {
        return Ok(Vec::new());
    }
    let steps = (end - start) / period_secs + 1e-3;
    if steps >= (MAX_ROWS - before.min(MAX_ROWS)) as f64 {
        let reason = format!(
            "expected an episode of at most {} rows after those before it, found one of {:.3e} s, which has {steps:.3e} rows of {period_secs} s: \
             another unit, another cut or a longer log.period_secs",
            MAX_ROWS - before.min(MAX_ROWS),
            end - start
        );
        return Err(mapping.wrong("clock.unit", reason));
    }
    Ok((0..=steps as usize).map(|step| start + step as f64 * period_secs).collect())
}

/// The rows of an episode.
struct Moments<'a> {
    plan: &'a Plan,
    store: &'a Store,
    times: Vec<f64>,
    first_row: usize,
    keep_rows: bool,
}

/// What was expected, and what was found.
type Wrong = (String, String);

impl Moments<'_> {
    /// The numbers of a quantity in a row; NaN where nothing was read.
    fn read(&self, quantity: Quantity, row: usize) -> Option<Vec<f64>> {
        let index = self.plan.index(quantity)?;
        let track = &self.plan.tracks[index];
        if let Some(values) = track.fixed() {
            return Some(values);
        }
        let stream = &self.store.streams[index];
        if self.keep_rows {
            return Some(stream.get(self.first_row + row).to_vec());
        }
        let mut values = vec![f64::NAN; stream.width];
        let pose = matches!(quantity, Quantity::Command | Quantity::Tool | Quantity::Object) && stream.width == 7;
        let rotation = pose.then_some(3);
        let (how, near_secs, time) = match quantity {
            // The weight of an episode is one number, an action lasts until the next.
            Quantity::AddedMass => (Sampling::Nearest, f64::INFINITY, self.times[0]),
            Quantity::Action => (Sampling::Hold, f64::INFINITY, self.times[row]),
            _ => (self.plan.sample, self.plan.near_secs, self.times[row]),
        };
        Sampler { how, near_secs, rotation }.at(stream, time, &mut values);
        Some(values)
    }

    /// Position and orientation of a quantity in the world, of the point that a log holds; and the orientation as measured, body to world,
    /// without the mount.
    fn pose(&self, quantity: Quantity, row: usize) -> Option<(Vec3, Option<Quaternion>, Option<Quaternion>)> {
        let values = self.read(quantity, row)?;
        let geometry = self.plan.poses.get(&quantity).copied().unwrap_or_default();
        let mut position = [values[0], values[1], values[2]];
        let mut orientation = (values.len() == 7).then(|| [values[3], values[4], values[5], values[6]]);
        if let Some(frame) = geometry.frame {
            position = frame.point(position);
            orientation = orientation.map(|q| multiply(frame.rotation, q));
        }
        let measured = orientation;
        if let (Some(mount), Some(q)) = (geometry.mount, orientation) {
            position = add(position, rotate(q, mount.translation_m));
            orientation = Some(multiply(q, mount.rotation));
        }
        Some((position, orientation, measured))
    }

    /// Force and torque of the world on the tool at its centre, world axes.
    fn wrench(&self, row: usize) -> Option<Vec<f64>> {
        let values = self.read(Quantity::Wrench, row)?;
        let geometry = self.plan.wrench?;
        let turn = match geometry.axes {
            Axes::World => geometry.frame.map(|frame| frame.rotation),
            // The mount is a pose in the frame of the tool at its centre.
            Axes::Tool | Axes::Sensor => {
                let q = self.pose(Quantity::Tool, row)?.1.unwrap_or([f64::NAN; 4]);
                Some(geometry.mount.map_or(q, |mount| multiply(q, mount.rotation)))
            }
        };
        let Some(turn) = turn else { return Some(values) };
        let force = rotate(turn, [values[0], values[1], values[2]]);
        let mut wrench = force.to_vec();
        if values.len() == 6 {
            let mut torque = rotate(turn, [values[3], values[4], values[5]]);
            if let (Some(mount), Some((_, Some(q), _))) = (geometry.mount, self.pose(Quantity::Tool, row)) {
                torque = add(torque, cross(rotate(q, mount.translation_m), force));
            }
            wrench.extend(torque);
        }
        Some(wrench)
    }

    fn rate(&self, quantity: Quantity, row: usize) -> Option<Vec3> {
        let values = self.read(quantity, row)?;
        let value = [values[0], values[1], values[2]];
        let geometry = self.plan.rates.get(&quantity)?;
        if geometry.in_object_axes {
            let q = self.pose(Quantity::Object, row)?.2.unwrap_or([f64::NAN; 4]);
            return Some(rotate(q, value));
        }
        Some(geometry.frame.map_or(value, |frame| rotate(frame.rotation, value)))
    }

    /// Appends the cells of a row.
    fn append(&self, row: usize, episode: &mut Episode) -> Result<(), Wrong> {
        let channels = &mut episode.channels;
        let mut put = |channel: Channel, value: f64| {
            if value.is_infinite() {
                return Err((format!("a finite number for {}", channel.name()), value.to_string()));
            }
            let readings: &mut Readings = channels.entry(channel).or_default();
            readings.push(Some(value).filter(|value| !value.is_nan()));
            Ok(())
        };
        let mut vector = |make: fn(Axis) -> Channel, values: &[f64]| {
            Axis::ALL.into_iter().zip(values).try_for_each(|(axis, value)| put(make(axis), *value))
        };
        for (quantity, make) in
            [(Quantity::Command, Channel::Command as fn(Axis) -> Channel), (Quantity::Tool, Channel::Tool)]
        {
            if let Some((position, ..)) = self.pose(quantity, row) {
                vector(make, &position)?;
            }
        }
        let object = self.pose(Quantity::Object, row);
        if let Some((position, ..)) = object {
            vector(Channel::ObjectPosition, &position)?;
        }
        if let Some(wrench) = self.wrench(row) {
            vector(Channel::WristForce, &wrench[..3])?;
            if wrench.len() == 6 {
                vector(Channel::WristTorque, &wrench[3..])?;
            }
        }
        for (quantity, make) in [
            (Quantity::ObjectVelocity, Channel::ObjectVelocity as fn(Axis) -> Channel),
            (Quantity::ObjectSpin, Channel::ObjectSpin),
        ] {
            if let Some(value) = self.rate(quantity, row) {
                vector(make, &value)?;
            }
        }
        if let Some((_, Some(q), _)) = object {
            Component::ALL.into_iter().zip(q).try_for_each(|(c, value)| put(Channel::ObjectOrientation(c), value))?;
        }
        for (quantity, make) in
            [(Quantity::Joints, Channel::Joint as fn(u8) -> Channel), (Quantity::JointTorques, Channel::JointTorque)]
        {
            if let Some(values) = self.read(quantity, row) {
                (0..).zip(values).try_for_each(|(joint, value)| put(make(joint), value))?;
            }
        }
        if let Some(mass) = self.read(Quantity::AddedMass, row) {
            put(Channel::AddedMass, mass[0])?;
        }
        if let Some(action) = self.read(Quantity::Action, row) {
            episode.action.get_or_insert_default().push(self::action(action[0])?);
        }
        Ok(())
    }
}

/// A discrete action; none while it is missing or negative.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded first")]
fn action(value: f64) -> Result<Option<u8>, Wrong> {
    if value.is_nan() || value < 0.0 {
        return Ok(None);
    }
    if value.fract() == 0.0 && value <= 9.0 {
        return Ok(Some(value as u8));
    }
    Err(("an action of 0 to 9, or a negative number for none".into(), value.to_string()))
}
