//! The tick of a log as its stamps have it.
//!
//! A camera of 49.5 Hz in a log of 50 Hz stamps what it sees rightly, but every reading lies between two ticks of the stated period. What is
//! simulated tick by tick meets its readings if the tick is that of the stamps.

use measured_log::Log;

/// Stamps that differ from the stated period by a share between these say what the tick is: less is rounding, more is no clock's error.
const SHARES: [f64; 2] = [0.001, 0.1];

/// Period of the ticks, s: the median time between rows, or its part where there are several ticks between two.
pub(crate) fn period_secs(log: &Log) -> f64 {
    let stated_secs = log.header.period_secs;
    let Some(median_secs) = usual_step_secs(log) else { return stated_secs };
    let found_secs = median_secs / (median_secs / stated_secs).round().max(1.0);
    let off = (found_secs / stated_secs - 1.0).abs();
    if (SHARES[0]..SHARES[1]).contains(&off) { found_secs } else { stated_secs }
}

/// Median time between rows, s; `None` without two rows in an episode.
pub(crate) fn usual_step_secs(log: &Log) -> Option<f64> {
    let steps = log.episodes.iter().flat_map(|episode| episode.time_secs.windows(2).map(|two| two[1] - two[0]));
    let mut steps: Vec<f64> = steps.collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use measured_log::Episode;

    use super::*;

    #[test]
    fn stamps_say_what_a_tick_is_whatever_rows_are_missing() {
        let header = crate::nominal::tests::uncertain_mass().header().clone();
        let stated_secs = header.period_secs;
        let of = |step_secs: f64, every: usize| {
            let time_secs = (0..100).filter(|row| row % 7 != 3).map(|row| step_secs * (every * row) as f64).collect();
            let log = Log { header: header.clone(), episodes: vec![Episode { time_secs, ..Episode::default() }] };
            period_secs(&log)
        };
        assert!((of(1.01 * stated_secs, 1) / stated_secs - 1.01).abs() < 1e-9);
        assert!((of(0.99 * stated_secs, 3) / stated_secs - 0.99).abs() < 1e-9);
        assert_eq!(of(1.0001 * stated_secs, 1), stated_secs);
        assert_eq!(of(1.3 * stated_secs, 1), stated_secs);
    }
}
