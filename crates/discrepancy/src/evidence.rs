//! What shows the gap to the eye: the worst held-out episode, and what the residuals of all of them look like, before and after.
//!
//! Before is the re-tuned nominal model, after the accepted one, both with the errors of the accepted one. Numbers of plots are
//! rounded. [`ChannelError`] is of residuals as they are: neither white nor with the engine's errors, so that it may go the other way.

use serde::Serialize;

use crate::fit::Fit;
use crate::likelihood::Stack;
use crate::simulator::Nudge;
use crate::study::Study;
use crate::trial::{Compared, Kind, Trial};
use crate::units::Units;

/// Points of a course, at most.
const POINTS: usize = 80;
/// Bins of the histogram, between −`REACH` and `REACH` standard deviations; what is farther counts in the outermost.
pub const BINS: usize = 24;
/// See [`BINS`].
pub const REACH: f64 = 6.0;
/// Lags of the autocorrelation, in blocks.
pub const LAGS: usize = 12;

/// Plots' data.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Evidence {
    /// The held-out episode that the re-tuned nominal model explains worst: its number in the log.
    pub episode: Option<u64>,
    /// The object from above: x and y, m.
    pub path: Path,
    /// One channel over time: the force that the re-tuned nominal model explains worst; without forces a component of the object's position.
    pub course: Option<Course>,
    /// Distribution and whiteness of the held-out residuals.
    pub residuals: Residuals,
    /// How far all held-out episodes lie from what was measured, by channel.
    pub errors: Vec<ChannelError>,
}

/// Size of (measured − simulated) in a channel's own unit, over components and blocks of rows; orientations as rotation vectors. Before: re-tuned
/// nominal model; after: accepted one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelError {
    /// Channel.
    pub channel: Kind,
    /// Its unit.
    pub unit: &'static str,
    /// Root mean square.
    pub before: f64,
    /// The same.
    pub after: f64,
    /// Median of the size: what it is where nothing has gone another way.
    pub median_before: f64,
    /// The same.
    pub median_after: f64,
}

/// The object from above.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Path {
    /// As read, m.
    pub measured: Vec<[f64; 2]>,
    /// Re-tuned nominal model.
    pub before: Vec<[f64; 2]>,
    /// Accepted model.
    pub after: Vec<[f64; 2]>,
}

/// A component over time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Course {
    /// Channel.
    pub channel: Kind,
    /// Component.
    pub component: usize,
    /// Time, s.
    pub time_secs: Vec<f64>,
    /// As read.
    pub measured: Vec<f64>,
    /// Re-tuned nominal model.
    pub before: Vec<f64>,
    /// Accepted model.
    pub after: Vec<f64>,
}

/// White residuals of the held-out episodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Residuals {
    /// Number of residuals.
    pub count: usize,
    /// Histogram over [`BINS`] equal bins, as shares: before, after.
    pub histogram: [Vec<f64>; 2],
    /// Autocorrelation within channels of an episode at lags of 1, 2, … blocks: before, after.
    pub autocorrelation: [Vec<f64>; 2],
    /// What white residuals stay below, of 20 lags 19.
    pub white_below: f64,
}

impl Evidence {
    /// In units of which `units` says how much one of today's is.
    pub(crate) fn in_units(mut self, units: &Units) -> Self {
        let scale = |values: &mut Vec<f64>, factor: f64| {
            values.iter_mut().filter(|_| factor != 1.0).for_each(|value| *value = rounded(factor * *value));
        };
        let length = units.factor("m");
        for path in [&mut self.path.measured, &mut self.path.before, &mut self.path.after] {
            path.iter_mut().flatten().filter(|_| length != 1.0).for_each(|value| *value = rounded(length * *value));
        }
        if let Some(course) = &mut self.course {
            let factor = units.factor(course.channel.unit());
            [&mut course.measured, &mut course.before, &mut course.after]
                .into_iter()
                .for_each(|all| scale(all, factor));
        }
        for error in &mut self.errors {
            let factor = units.factor(error.unit);
            let sizes = [&mut error.before, &mut error.after, &mut error.median_before, &mut error.median_after];
            sizes.into_iter().for_each(|size| *size *= factor);
        }
        self
    }

    /// Of the held-out episodes.
    #[must_use]
    pub fn new(kept: &Study, null: &Fit, accepted: &Fit) -> Self {
        let raw = [null, accepted].map(|fit| kept.raw(&fit.model.hypothesis(&fit.x)));
        let [before, after] =
            [(null, &raw[0]), (accepted, &raw[1])].map(|(fit, raw)| kept.white(raw, fit.model.engine_errors(&fit.x)));
        let trials: Vec<&Trial> = kept.chosen.iter().map(|index| &kept.simulator.trials[*index]).collect();
        let mean_square = |place: &usize| before[*place].norm_squared() / before[*place].len().max(1) as f64;
        let worst = (0..trials.len()).max_by(|a, b| mean_square(a).total_cmp(&mean_square(b)));
        let residuals = Residuals::new(&trials, [&before, &after]);
        let mut evidence = Self { residuals, errors: errors(&trials, &raw), ..Self::default() };
        let Some(place) = worst else { return evidence };
        let trial = trials[place];
        evidence.episode = Some(trial.id);
        let simulated = [null, accepted].map(|fit| {
            let hypothesis = fit.model.hypothesis(&fit.x);
            kept.simulator.readings(&hypothesis, &kept.engine, Nudge::default(), trial)
        });
        let compared = |kind, component| {
            [0, 1].map(|i| {
                let (start, readings) = &simulated[i];
                trial.compared(kind, component, start, readings)
            })
        };
        let [x, y] = [0, 1].map(|component| compared(Kind::ObjectPosition, component));
        evidence.path = Path {
            measured: thin(&pairs(&x[0], &y[0], |row| row.measured)),
            before: thin(&pairs(&x[0], &y[0], |row| row.simulated)),
            after: thin(&pairs(&x[1], &y[1], |row| row.simulated)),
        };
        let channel = worst_component(trial, before[place].as_slice(), Kind::is_force)
            .or_else(|| worst_component(trial, before[place].as_slice(), |kind| kind == Kind::ObjectPosition));
        evidence.course = channel.map(|(channel, component)| {
            let [before, after] = compared(channel, component);
            let column = |rows: &[Compared], pick: fn(&Compared) -> f64| {
                thin(&rows.iter().map(|row| rounded(pick(row))).collect::<Vec<_>>())
            };
            Course {
                channel,
                component,
                time_secs: column(&before, |row| row.time_secs),
                measured: column(&before, |row| row.measured),
                before: column(&before, |row| row.simulated),
                after: column(&after, |row| row.simulated),
            }
        });
        evidence
    }
}

impl Residuals {
    fn new(trials: &[&Trial], stacks: [&Stack; 2]) -> Self {
        let count: usize = trials.iter().map(|trial| trial.blocks.len()).sum();
        let histogram = stacks.map(|stack| {
            let mut bins = [0_usize; BINS];
            for value in stack.iter().flat_map(|vector| vector.iter()).filter(|value| value.is_finite()) {
                let place = (value + REACH) / (2.0 * REACH) * BINS as f64;
                bins[place.clamp(0.0, BINS as f64 - 1.0) as usize] += 1;
            }
            bins.iter().map(|n| rounded(*n as f64 / count.max(1) as f64)).collect()
        });
        let autocorrelation =
            stacks.map(|stack| (1..=LAGS).map(|lag| rounded(autocorrelation(trials, stack, lag))).collect());
        let white_below = rounded(1.96 / (count.max(1) as f64).sqrt());
        Self { count, histogram, autocorrelation, white_below }
    }
}

/// Of the channels that the log has: raw residuals before and after.
fn errors(trials: &[&Trial], raw: &[Vec<Vec<f64>>; 2]) -> Vec<ChannelError> {
    let [before, after] = raw
        .each_ref()
        .map(|raw| -> Vec<(Kind, f64)> { trials.iter().zip(raw).flat_map(|(trial, raw)| trial.errors(raw)).collect() });
    // Root mean square and median.
    let sizes = |errors: &[(Kind, f64)], channel: Kind| -> [f64; 2] {
        let mut sizes: Vec<f64> = errors.iter().filter(|(kind, _)| *kind == channel).map(|(_, e)| e.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let squares: f64 = sizes.iter().map(|size| size * size).sum();
        [(squares / sizes.len().max(1) as f64).sqrt(), sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)]
    };
    (Kind::ALL.into_iter().filter(|channel| before.iter().any(|(kind, _)| kind == channel)))
        .map(|channel| {
            let [[before, median_before], [after, median_after]] = [&before, &after].map(|list| sizes(list, channel));
            ChannelError { channel, unit: channel.unit(), before, after, median_before, median_after }
        })
        .collect()
}

/// Σ r(t) r(t + lag) over Σ r², each channel of each episode by itself.
fn autocorrelation(trials: &[&Trial], stack: &Stack, lag: usize) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (trial, residuals) in trials.iter().zip(stack.iter()) {
        let finite = |place: usize| Some(residuals[place]).filter(|value: &f64| value.is_finite()).unwrap_or(0.0);
        for (place, block) in trial.blocks.iter().enumerate() {
            squares += finite(place).powi(2);
            let later = trial.blocks.get(place + lag);
            if later.is_some_and(|later| (later.kind, later.component) == (block.kind, block.component)) {
                products += finite(place) * finite(place + lag);
            }
        }
    }
    if squares > 0.0 { products / squares } else { 0.0 }
}

/// The component, of the kinds asked for, with the largest mean square.
fn worst_component(trial: &Trial, residuals: &[f64], wanted: impl Fn(Kind) -> bool) -> Option<(Kind, usize)> {
    let mut sums: std::collections::BTreeMap<(Kind, usize), (f64, usize)> = std::collections::BTreeMap::new();
    for (block, residual) in trial.blocks.iter().zip(residuals).filter(|(block, _)| wanted(block.kind)) {
        let sum = sums.entry((block.kind, block.component)).or_default();
        *sum = (sum.0 + residual * residual, sum.1 + 1);
    }
    let mean = |sum: &(f64, usize)| sum.0 / sum.1 as f64;
    sums.iter().max_by(|a, b| mean(a.1).total_cmp(&mean(b.1))).map(|(component, _)| *component)
}

/// Where both components were read at the same time.
fn pairs(x: &[Compared], y: &[Compared], pick: fn(&Compared) -> f64) -> Vec<[f64; 2]> {
    let mut rest = y.iter().peekable();
    x.iter()
        .filter_map(|x| {
            while rest.next_if(|y| y.time_secs < x.time_secs).is_some() {}
            let y = rest.next_if(|y| y.time_secs == x.time_secs)?;
            Some([rounded(pick(x)), rounded(pick(y))])
        })
        .collect()
}

/// At most [`POINTS`] of them, the first and the last among them.
fn thin<T: Clone>(all: &[T]) -> Vec<T> {
    if all.len() <= POINTS {
        return all.to_vec();
    }
    (0..POINTS).map(|i| all[i * (all.len() - 1) / (POINTS - 1)].clone()).collect()
}

/// To a ten-thousandth, or four digits where that is less: what a plot can show.
fn rounded(value: f64) -> f64 {
    if !value.is_finite() {
        return 0.0;
    }
    let digits = if value.abs() < 100.0 { 1e4 } else { 1e1 };
    (value * digits).round() / digits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_thinned_keeps_its_ends() {
        let all: Vec<usize> = (0..1001).collect();
        let thinned = thin(&all);
        assert_eq!((thinned.len(), thinned[0], thinned[POINTS - 1]), (POINTS, 0, 1000));
        assert_eq!(thin(&[1, 2]), [1, 2]);
    }

    #[test]
    fn positions_meet_at_equal_times_only() {
        let at = |time_secs, measured| Compared { time_secs, measured, simulated: 0.0 };
        let x = [at(0.0, 1.0), at(1.0, 2.0), at(2.0, 3.0)];
        let y = [at(0.5, 9.0), at(1.0, 5.0), at(2.0, f64::NAN)];
        assert_eq!(pairs(&x, &y, |row| row.measured), [[2.0, 5.0], [3.0, 0.0]]);
    }
}
