//! Whether stamps are those of the measurement or of arrival.
//!
//! A place between two others lies on the line between them where the time says. If its stamp is early or late by δ against the middle, it is off the middle by
//! v δ where the stamp is that of the measurement, and not at all where the reading was taken at an even distance and only arrived late. So the slope
//! of the one on the other is 1 or 0. The speed v is itself measured, and its noise would pull the slope towards 0. The speed between the readings before
//! and after these three is free of their noise: the slope is that of instrumental variables (Wright 1928).

use measured_log::{Axis, Channel, Episode, Log};
use serde::Serialize;

/// Readings that stand in a row.
const READINGS: usize = 5;
/// Standard errors by which a share is below one half.
const SURE: f64 = 4.0;
/// Standard errors that a normal variable is below in 19 of 20 cases.
const NINETEEN_IN_TWENTY: f64 = 1.645;

/// Which share of the unevenness of its stamps a motion follows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Followed {
    /// 1 where places were measured when the stamps say, 0 where at even distances.
    pub share: f64,
    /// Standard error.
    pub error: f64,
}

impl Followed {
    /// Whether a motion that truly follows this share would be found to follow less than half, in 19 of 20 logs with this error.
    #[must_use]
    pub fn tells(&self, share: f64) -> bool {
        share + (SURE + NINETEEN_IN_TWENTY) * self.error < 0.5
    }

    /// Whether the motion follows less than half.
    pub(crate) fn is_of_arrival(&self) -> bool {
        self.share + SURE * self.error < 0.5
    }
}

/// Of the tool, else of the object. `None` where nothing moves, or stamps are even.
pub(crate) fn stamps_followed(log: &Log) -> Option<Followed> {
    let place: fn(Axis) -> Channel =
        if log.has(Channel::Tool(Axis::X)) { Channel::Tool } else { Channel::ObjectPosition };
    let read = |episode: &Episode| -> Vec<(f64, [f64; 3])> {
        (0..episode.rows()).filter_map(|row| Some((episode.time_secs[row], episode.vector(place, row)?))).collect()
    };
    of_episodes(&log.episodes.iter().map(read).collect::<Vec<_>>())
}

/// Of places with their stamps.
fn of_episodes(episodes: &[Vec<(f64, [f64; 3])>]) -> Option<Followed> {
    let mut steps: Vec<f64> =
        episodes.iter().flat_map(|read| read.windows(2).map(|pair| pair[1].0 - pair[0].0)).collect();
    let median = statistics::quantile(&mut steps, 0.5)?;
    // Of each episode: instrument, off the middle, speed times δ.
    let terms: Vec<Vec<[f64; 3]>> = episodes.iter().map(|read| terms(read, 1.5 * median)).collect();
    let sum = |term: &dyn Fn(&[f64; 3]) -> f64| terms.iter().flatten().map(term).sum::<f64>();
    let power = sum(&|[instrument, _, expected]| instrument * expected);
    if power <= 0.0 {
        return None;
    }
    let share = sum(&|[instrument, off, _]| instrument * off) / power;
    let score = |[instrument, off, expected]: &[f64; 3]| instrument * (off - share * expected);
    // Neighbours share readings: what they add up to over an episode counts, where that is more.
    let alone = sum(&|term| score(term).powi(2));
    let together: f64 = terms.iter().map(|terms| terms.iter().map(score).sum::<f64>().powi(2)).sum();
    Some(Followed { share, error: alone.max(together).sqrt() / power })
}

/// What three readings in the middle of five say, where none was lost between them.
fn terms(read: &[(f64, [f64; 3])], longest_secs: f64) -> Vec<[f64; 3]> {
    let whole = |five: &&[(f64, [f64; 3])]| five.windows(2).all(|pair| pair[1].0 - pair[0].0 <= longest_secs);
    let of_axis = |five: &[(f64, [f64; 3])], axis: usize| {
        let (secs, x) = (|i: usize| five[i].0, |i: usize| five[i].1[axis]);
        let late = secs(2) - 0.5 * (secs(1) + secs(3));
        let around = (x(4) - x(0)) / (secs(4) - secs(0));
        let between = (x(3) - x(1)) / (secs(3) - secs(1));
        [around * late, x(2) - 0.5 * (x(1) + x(3)), between * late]
    };
    let fives = read.windows(READINGS).filter(whole);
    fives.flat_map(|five| (0..3).map(move |axis| of_axis(five, axis))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tool that swings, read with noise every 20 ms give or take some, stamped when it was read or at even distances.
    fn followed(stamped: bool, noise_m: f64) -> Followed {
        let mut rng = noise();
        let mut read = Vec::new();
        for row in 0..400 {
            let even = 0.02 * f64::from(row);
            let uneven = even + 0.006 * rng();
            let measured = if stamped { uneven } else { even };
            read.push((uneven, [0.1 * (2.0 * measured).sin() + noise_m * rng(), 0.0, 0.0]));
        }
        of_episodes(&[read]).unwrap()
    }

    /// Uniform from −1 to 1: fractional parts of multiples of the golden section, shuffled by squaring.
    fn noise() -> impl FnMut() -> f64 {
        let mut at = 0_u64;
        move || {
            at += 1;
            2.0 * (0.618_033_988_75 * ((at * at) % 10_007) as f64).fract() - 1.0
        }
    }

    #[test]
    fn stamps_of_measurement_and_of_arrival_are_told_apart() {
        for noise_m in [0.0, 2e-4] {
            let (measured, arrived) = (followed(true, noise_m), followed(false, noise_m));
            assert!((measured.share - 1.0).abs() < 5.0 * measured.error.max(0.01), "{measured:?}");
            assert!(arrived.share.abs() < 5.0 * arrived.error.max(0.01), "{arrived:?}");
            assert!(arrived.is_of_arrival() && !measured.is_of_arrival(), "{arrived:?} {measured:?}");
        }
    }

    #[test]
    fn what_it_could_tell_is_what_it_would_find_in_nineteen_of_twenty() {
        // Where none is followed the error may be 0.5 / 5.645 at most; where more than half is, none is small enough.
        for (share, error, tells) in
            [(0.0, 0.088, true), (0.0, 0.089, false), (0.3, 0.035, true), (0.3, 0.036, false), (0.6, 1e-9, false)]
        {
            assert_eq!(Followed { share: 1.0, error }.tells(share), tells, "{share} {error}");
        }
        assert!(followed(true, 2e-4).tells(0.0) && !followed(true, 0.02).tells(0.0));
    }

    #[test]
    fn noise_that_hides_the_motion_is_no_suspicion() {
        let hidden = followed(false, 0.02);
        assert!(hidden.error > 0.2 && !hidden.is_of_arrival(), "{hidden:?}");
    }
}
