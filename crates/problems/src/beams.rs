//! Eight beams of 45° that measure with normal noise: the sensor of Sub Hunt and of VDP Tag.

use std::f64::consts::TAU;

use pomdp::Rng;
use rand_distr::{Distribution as _, StandardNormal};

/// Number of beams.
pub const BEAMS: usize = 8;

/// What the beams read, m or cells.
pub type Reading = [f64; BEAMS];

/// Distribution of a reading: independent normal distributions, one of them different where something is in that beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beams {
    /// Beam that sees something.
    pub active: Option<usize>,
    /// Mean and standard deviation of that beam.
    pub seen: (f64, f64),
    /// Mean and standard deviation of the others.
    pub others: (f64, f64),
}

impl Beams {
    fn of(&self, beam: usize) -> (f64, f64) {
        if self.active == Some(beam) { self.seen } else { self.others }
    }

    /// Draws a reading.
    #[must_use]
    pub fn sample(&self, rng: &mut Rng) -> Reading {
        std::array::from_fn(|beam| {
            let (mean, stddev) = self.of(beam);
            let deviation: f64 = StandardNormal.sample(rng);
            mean + stddev * deviation
        })
    }

    /// ln of the density of a reading.
    #[must_use]
    pub fn log_density(&self, reading: &Reading) -> f64 {
        let squares = |beam: usize| {
            let (mean, stddev) = self.of(beam);
            ((reading[beam] - mean) / stddev).powi(2)
        };
        let active = if self.active.is_some() { 1.0 } else { 0.0 };
        let logs = active * self.seen.1.ln() + (BEAMS as f64 - active) * self.others.1.ln();
        -0.5 * (0..BEAMS).map(squares).sum::<f64>() - logs - 0.5 * BEAMS as f64 * TAU.ln()
    }
}

/// Beam in which (x, y) lies. Beam i covers angles above 45° · i up to 45° · (i + 1), from the x axis to the y axis; the origin lies in the last.
#[must_use]
pub fn beam_of([x, y]: [f64; 2]) -> usize {
    let angle = y.atan2(x);
    let angle = if angle <= 0.0 { angle + TAU } else { angle };
    ((BEAMS as f64 * angle / TAU).ceil() as usize).clamp(1, BEAMS) - 1
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;

    #[test]
    fn beams_are_octants_that_hold_their_upper_edge() {
        let eastward =
            [(1.0, 0.5), (1.0, 1.0), (0.5, 1.0), (0.0, 1.0), (-0.5, 1.0), (-1.0, 0.5), (-1.0, 0.0), (-1.0, -0.5)];
        let found: Vec<usize> = eastward.iter().map(|&(x, y)| beam_of([x, y])).collect();
        assert_eq!(found, [0, 0, 1, 1, 2, 3, 3, 4]);
        assert_eq!([[-0.5, -1.0], [0.5, -1.0], [1.0, -0.5], [1.0, 0.0], [0.0, 0.0]].map(beam_of), [5, 6, 7, 7, 7]);
    }

    #[test]
    fn densities_are_products_of_normal_ones() {
        let beams = Beams { active: Some(2), seen: (3.0, 0.5), others: (1.0, 2.0) };
        let reading = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -7.0];
        let normal = |x: f64, (m, s): (f64, f64)| (-0.5 * ((x - m) / s).powi(2)).exp() / (s * TAU.sqrt());
        let product: f64 =
            reading.iter().enumerate().map(|(i, &x)| normal(x, if i == 2 { (3.0, 0.5) } else { (1.0, 2.0) })).product();
        assert!((beams.log_density(&reading) - product.ln()).abs() < 1e-12);
    }

    #[test]
    fn readings_have_the_stated_moments() {
        // n = 4000; tolerance 4 standard errors of mean and standard deviation.
        let beams = Beams { active: Some(2), seen: (3.0, 0.5), others: (1.0, 2.0) };
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let n = 4000.0_f64;
        let readings: Vec<Reading> = (0..4000).map(|_| beams.sample(&mut rng)).collect();
        for beam in 0..BEAMS {
            let (mean, stddev) = beams.of(beam);
            let found = readings.iter().map(|r| r[beam]).sum::<f64>() / n;
            let spread = (readings.iter().map(|r| (r[beam] - mean).powi(2)).sum::<f64>() / n).sqrt();
            assert!((found - mean).abs() < 4.0 * stddev / n.sqrt(), "{beam}: {found}");
            assert!((spread - stddev).abs() < 4.0 * stddev / (2.0 * n).sqrt(), "{beam}: {spread}");
        }
    }
}
