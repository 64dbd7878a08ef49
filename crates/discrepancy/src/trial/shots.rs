//! What a free body does, in short pieces.
//!
//! An impact makes a small error of the start a large one: of a whole toss, all but the beginning is chance. Pieces that each begin from where the
//! object was measured to be (multiple shooting) say how it falls, meets the table and slides, one by one.

use measured_log::{Channel, Episode, Log};

use super::{Trial, start};
use crate::noise::NoiseLevels;

/// Duration of a piece, s.
const SHOT_SECS: f64 = 0.15;
/// Rows, at least.
const LEAST_ROWS: usize = 6;
/// A start whose rows leave more than this of a parabola, as a mean square in variances of the sensor, lies in an impact.
const SMOOTH: f64 = 4.0;
/// Rows to the next start that is tried after such a one.
const NEXT: usize = 2;

/// The pieces of an episode; nothing where no row of it is a start.
pub(super) fn shots(log: &Log, episode: &Episode, noise: &NoiseLevels) -> Vec<Trial> {
    let mut found = Vec::new();
    let mut first = 0;
    while first + LEAST_ROWS <= episode.rows() {
        let end_secs = episode.time_secs[first] + SHOT_SECS;
        // Of a slow camera as many rows as a start needs.
        let end = episode.time_secs.partition_point(|time| *time <= end_secs).max(first + LEAST_ROWS);
        let piece = piece(episode, first, end);
        // A spin that was measured says how often it has turned between two rows.
        let spin = episode.vector(Channel::ObjectSpin, first);
        let smooth = start::moving(&piece, noise, spin).filter(|(.., left)| *left < SMOOTH);
        match smooth.and_then(|(body, stddev, _)| Trial::begun(log, &piece, noise, false, (body, stddev))) {
            Some(trial) => {
                found.push(trial);
                first = end - 1;
            }
            None => first += NEXT,
        }
    }
    found
}

/// Some rows of an episode, without the velocities that a sensor derived from them.
fn piece(episode: &Episode, first: usize, end: usize) -> Episode {
    let mut piece = episode.part(first..end);
    piece.channels.retain(|channel, _| !matches!(channel, Channel::ObjectVelocity(_) | Channel::ObjectSpin(_)));
    piece
}
