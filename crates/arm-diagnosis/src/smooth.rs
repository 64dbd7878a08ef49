//! Positions, rates and accelerations of a joint from its readings: a Kalman smoother (Rauch, Tung and Striebel 1965) whose jerk is driven by white
//! snap. How much snap, and how much noise, is what makes the readings most likely.

use nalgebra::{Matrix4, Vector4};

use crate::log::median;

/// Length of a window, s. What is computed for each tick is averaged over one, so that only what is quicker is lost.
pub(crate) const WINDOW_SECS: f64 = 0.04;

/// Median of the square of a standard normal number.
pub(crate) const MEDIAN_SQUARE: f64 = 0.455;

/// A motion, a value a tick.
#[derive(Debug, Default)]
pub(crate) struct Smooth {
    /// rad.
    pub(crate) position: Vec<f64>,
    /// rad/s.
    pub(crate) rate: Vec<f64>,
    /// rad/s².
    pub(crate) acceleration: Vec<f64>,
    /// Standard deviation of the rate, rad/s: the median over the log.
    pub(crate) rate_stddev: f64,
    /// Standard deviation of the mean acceleration of a window where errors of readings are independent, rad/s².
    pub(crate) acceleration_stddev: f64,
    /// That of the acceleration of a tick as the smoother has it, rad/s²: the median over the log.
    pub(crate) tick_acceleration_stddev: f64,
    /// Standard deviation of position readings, rad.
    pub(crate) noise: f64,
    /// ln of the density of all readings, but for a constant.
    pub(crate) log_likelihood: f64,
}

/// Readings of one joint; `velocity` may be empty.
pub(crate) struct Readings<'a> {
    pub(crate) spans: &'a [std::ops::Range<usize>],
    pub(crate) time_secs: &'a [f64],
    pub(crate) position: &'a [f64],
    pub(crate) velocity: &'a [f64],
}

/// ln of: density of snap, rad²/s⁷; variance of position readings, rad²; variance of velocity readings, rad²/s².
#[derive(Clone, Copy, Debug)]
struct Spread {
    snap: f64,
    position: f64,
    velocity: f64,
}

impl Readings<'_> {
    /// The smoothed motion. `position_stddev` (rad) and `velocity_stddev` (rad/s) are the noise of a tick, where it is known.
    pub(crate) fn smooth(&self, position_stddev: Option<f64>, velocity_stddev: Option<f64>) -> Smooth {
        let mut spread = Spread {
            snap: 1e4_f64.ln(),
            position: 2.0 * position_stddev.unwrap_or_else(|| self.scatter(self.position)).ln(),
            velocity: 2.0 * velocity_stddev.unwrap_or_else(|| self.scatter(self.velocity)).ln(),
        };
        for _ in 0..2 {
            spread.snap = best(spread.snap, -8.0, 28.0, |snap| self.log_likelihood(&Spread { snap, ..spread }));
            if position_stddev.is_none() {
                let start = spread.position;
                spread.position = best(start, start - 5.0, start + 5.0, |position| {
                    self.log_likelihood(&Spread { position, ..spread })
                });
            }
            if velocity_stddev.is_none() && !self.velocity.is_empty() {
                let start = spread.velocity;
                // A simulator's rates can be half a step ahead of its positions, which their scatter does not show.
                spread.velocity = best(start, start - 5.0, start + 16.0, |velocity| {
                    self.log_likelihood(&Spread { velocity, ..spread })
                });
            }
        }
        Smooth { acceleration_stddev: self.acceleration_noise(&spread), ..self.smoothed(&spread) }
    }

    /// Standard deviation of the mean acceleration of a window as far as noise of readings makes it, rad/s²: the motion by every second reading is
    /// compared with that by the others, of which the motion by all is about the mean. The smoother's own covariance would say more, as motions
    /// of arms are smoother than white snap.
    fn acceleration_noise(&self, spread: &Spread) -> f64 {
        let half = |odd: usize| {
            let every_second = |values: &[f64]| -> Vec<f64> {
                values.iter().enumerate().map(|(tick, v)| if tick % 2 == odd { *v } else { f64::NAN }).collect()
            };
            let (position, velocity) = (every_second(self.position), every_second(self.velocity));
            Readings { position: &position, velocity: &velocity, ..*self }.smoothed(spread).acceleration
        };
        let (even, odd) = (half(0), half(1));
        let mut squares = Vec::new();
        for span in self.spans {
            let mut start = span.start;
            for tick in span.clone() {
                if self.time_secs[tick] - self.time_secs[start] > 0.999 * WINDOW_SECS {
                    let difference: f64 = (start..tick).map(|tick| even[tick] - odd[tick]).sum();
                    squares.push((difference / (tick - start) as f64).powi(2) / 4.0);
                    start = tick;
                }
            }
        }
        if squares.is_empty() { 0.0 } else { (median(squares) / MEDIAN_SQUARE).sqrt() }
    }

    /// Standard deviation of noise by third differences, to which a smooth motion adds little; no less than what rounding makes.
    fn scatter(&self, values: &[f64]) -> f64 {
        /// Where the search for the noise of exact readings begins: a good encoder's, rad or rad/s.
        const LEAST: f64 = 1e-6;
        if values.is_empty() {
            return 1.0;
        }
        let (mut squares, mut count, mut step) = (0.0, 0.0, f64::INFINITY);
        for span in self.spans {
            let values = &values[span.clone()];
            for four in values.windows(4) {
                let third = four[3] - 3.0 * four[2] + 3.0 * four[1] - four[0];
                if third.is_finite() {
                    squares += third * third;
                    count += 1.0;
                }
            }
            for two in values.windows(2) {
                let difference = (two[1] - two[0]).abs();
                if difference > 1e-12 {
                    step = step.min(difference);
                }
            }
        }
        let rounding = if step.is_finite() { step / 12.0_f64.sqrt() } else { 0.0 };
        // The squares of the binomial coefficients 1, 3, 3, 1.
        (squares / f64::max(count, 1.0) / 20.0).sqrt().max(rounding).max(LEAST)
    }

    fn log_likelihood(&self, spread: &Spread) -> f64 {
        self.spans.iter().map(|span| self.filter(span, spread, |_, _, _, _, _| ())).sum()
    }

    /// Runs forward; calls `seen` with the prediction, its covariance, the update, its covariance and the step at each tick. The ln likelihood.
    fn filter(
        &self,
        span: &std::ops::Range<usize>,
        spread: &Spread,
        mut seen: impl FnMut(Vector4<f64>, Matrix4<f64>, Vector4<f64>, Matrix4<f64>, Matrix4<f64>),
    ) -> f64 {
        /// Variance of a reading, at least: beside one that is smaller the first state's own is all there is in floating point.
        const LEAST: f64 = 1e-16;
        let (snap, noise) = (spread.snap.exp(), [spread.position, spread.velocity].map(|noise| noise.exp().max(LEAST)));
        let first = self.position[span.clone()].iter().copied().find(|value| value.is_finite()).unwrap_or(0.0);
        let mut state = Vector4::new(first, 0.0, 0.0, 0.0);
        let mut covariance = Matrix4::from_diagonal(&Vector4::new(1.0, 10.0, 1e3, 1e5));
        let (mut last, mut log_likelihood) = (self.time_secs[span.start], 0.0);
        for tick in span.clone() {
            let step = transition(self.time_secs[tick] - last);
            if tick > span.start {
                state = step * state;
                covariance = step * covariance * step.transpose() + driven(self.time_secs[tick] - last, snap);
            }
            last = self.time_secs[tick];
            let (predicted, before) = (state, covariance);
            let readings = [Some(self.position[tick]), self.velocity.get(tick).copied()];
            for (which, reading) in readings.into_iter().enumerate() {
                let Some(reading) = reading.filter(|reading| reading.is_finite()) else { continue };
                let variance = covariance[(which, which)] + noise[which];
                let surprise = reading - state[which];
                let gain: Vector4<f64> = covariance.column(which) / variance;
                state += gain * surprise;
                // Joseph's form (Bucy and Joseph 1968): a difference would lose what next to exact readings leave.
                let mut kept = Matrix4::identity();
                kept.column_mut(which).axpy(-1.0, &gain, 1.0);
                covariance = kept * covariance * kept.transpose() + gain * gain.transpose() * noise[which];
                log_likelihood -= 0.5 * (surprise * surprise / variance + variance.ln());
            }
            seen(predicted, before, state, covariance, step);
        }
        log_likelihood
    }

    fn smoothed(&self, spread: &Spread) -> Smooth {
        let count = self.time_secs.len();
        let mut smooth = Smooth {
            position: vec![0.0; count],
            rate: vec![0.0; count],
            acceleration: vec![0.0; count],
            noise: (0.5 * spread.position).exp(),
            ..Smooth::default()
        };
        let (mut rates, mut accelerations) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for span in self.spans {
            let mut passes = Vec::with_capacity(span.len());
            smooth.log_likelihood += self.filter(span, spread, |predicted, before, state, covariance, step| {
                passes.push((predicted, before, state, covariance, step));
            });
            let Some(&(_, _, mut state, mut covariance, _)) = passes.last() else { continue };
            for index in (0..passes.len()).rev() {
                if index + 1 < passes.len() {
                    let (predicted, before, _, _, step) = passes[index + 1];
                    let (_, _, filtered, own, _) = passes[index];
                    (state, covariance) = match inverted(&before) {
                        Some(inverse) => {
                            let gain = own * step.transpose() * inverse;
                            let wider = own + gain * (covariance - before) * gain.transpose();
                            (filtered + gain * (state - predicted), wider)
                        }
                        // No digit is left of the step between: what was before it stands alone.
                        None => (filtered, own),
                    };
                }
                let tick = span.start + index;
                smooth.position[tick] = state[0];
                smooth.rate[tick] = state[1];
                smooth.acceleration[tick] = state[2];
                rates.push(covariance[(1, 1)].max(0.0));
                accelerations.push(covariance[(2, 2)].max(0.0));
            }
        }
        smooth.rate_stddev = median(rates).sqrt();
        smooth.tick_acceleration_stddev = median(accelerations).sqrt();
        smooth
    }
}

/// Inverse of a covariance, by Cholesky in units of its standard deviations. Where readings have next to no noise, cofactors of the matrix as it stands have
/// no digit left.
fn inverted(covariance: &Matrix4<f64>) -> Option<Matrix4<f64>> {
    let units = Matrix4::from_diagonal(&covariance.diagonal().map(|variance| variance.sqrt().recip()));
    Some(units * (units * covariance * units).cholesky()?.inverse() * units)
}

fn transition(secs: f64) -> Matrix4<f64> {
    Matrix4::from_fn(
        |row, column| if column < row { 0.0 } else { secs.powi((column - row) as i32) / factorial(column - row) },
    )
}

/// What white snap of density `snap` adds in a time: ∫ t^(3−i) t^(3−j) / ((3−i)! (3−j)!) dt.
fn driven(secs: f64, snap: f64) -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| {
        let power = 7 - i - j;
        snap * secs.powi(power as i32) / (factorial(3 - i) * factorial(3 - j) * power as f64)
    })
}

fn factorial(n: usize) -> f64 {
    [1.0, 1.0, 2.0, 6.0][n]
}

/// Where a function that has one maximum between two values has it: golden sections.
fn best(start: f64, low: f64, high: f64, function: impl Fn(f64) -> f64) -> f64 {
    const TIMES: usize = 16;
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (low, high);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_a, mut at_b) = (function(a), function(b));
    for _ in 0..TIMES {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - golden * (high - low);
            at_a = function(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + golden * (high - low);
            at_b = function(b);
        }
    }
    let found = 0.5 * (low + high);
    if function(found) >= function(start) { found } else { start }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise without a generator of its own: sums of sines that no motion follows.
    fn noise(tick: usize) -> f64 {
        let x = (tick as f64 * 12.9898).sin() * 43_758.545_3;
        (x - x.floor() - 0.5) * 12.0_f64.sqrt()
    }

    #[test]
    fn mean_acceleration_of_a_swing_is_as_far_off_as_it_says() {
        let time_secs: Vec<f64> = (0..2500).map(|i| f64::from(i) * 0.004).collect();
        let position: Vec<f64> = time_secs.iter().enumerate().map(|(i, t)| (2.0 * t).sin() + 1e-4 * noise(i)).collect();
        let spans = [0..1000, 1000..2500];
        let readings = Readings { spans: &spans, time_secs: &time_secs, position: &position, velocity: &[] };
        let smooth = readings.smooth(None, None);
        assert!((smooth.noise / 1e-4).ln().abs() < 0.3, "{}", smooth.noise);
        let errors = (50..950).map(|i| smooth.acceleration[i] + 4.0 * (2.0 * time_secs[i]).sin());
        let means: Vec<f64> = errors.collect::<Vec<_>>().chunks(10).map(|ten| ten.iter().sum::<f64>() / 10.0).collect();
        let error = (means.iter().map(|mean| mean * mean).sum::<f64>() / 90.0).sqrt();
        let ratio = error / smooth.acceleration_stddev;
        assert!((0.7..1.4).contains(&ratio) && error < 0.2, "{error} {}", smooth.acceleration_stddev);
    }

    #[test]
    fn readings_without_noise_give_the_acceleration_from_the_first_to_the_last() {
        for (period, size) in [(0.01, 0.5), (0.004, 0.1), (0.002, 0.5), (0.002, 2.0)] {
            let mut time_secs: Vec<f64> = (0..2000).map(|i| f64::from(i) * period).collect();
            // A stamp that is given twice says nothing new.
            time_secs[700] = time_secs[699];
            let position: Vec<f64> =
                time_secs.iter().map(|t| size * ((2.0 * t).sin() + 0.6 * (0.7 * t + 1.0).sin())).collect();
            let spans = std::slice::from_ref(&(0..2000));
            let readings = Readings { spans, time_secs: &time_secs, position: &position, velocity: &[] };
            // Half a percent of the largest: after the last reading there is none to tell what it was.
            let most = 0.005 * size * (4.0 + 0.6 * 0.49);
            for stated in [None, Some(1e-12)] {
                let smooth = readings.smooth(stated, None);
                for (tick, (t, found)) in time_secs.iter().zip(&smooth.acceleration).enumerate() {
                    let error = found + size * (4.0 * (2.0 * t).sin() + 0.6 * 0.49 * (0.7 * t + 1.0).sin());
                    assert!(error.abs() < most, "{period} {size} {stated:?}, tick {tick}: {error}");
                }
            }
        }
    }
}
