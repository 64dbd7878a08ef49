//! Teachers whose faults are known.

use pomdp::{Rng, Teacher};
use rand::RngExt as _;

use super::gaussian::Gaussian;
use super::{Exact, HEIGHT, Line, log_gaussian};

/// A teacher that is the exact posterior of the start, or is wrong in a known way.
#[derive(Clone)]
pub(crate) struct Guess {
    /// Probability of a second body; that of the prior.
    pub(crate) second: (f64, f64),
    pub(crate) parts: [Gaussian; 2],
    /// Share of the draws that are impossible.
    pub(crate) impossible: f64,
}

impl Guess {
    /// The exact posterior, moved by `shift` standard deviations along one direction, `width` times as wide, with the probability of a second
    /// body `doubt` of the way to the prior's.
    pub(crate) fn wrong(line: &Line, shift: f64, width: f64, doubt: f64) -> Self {
        let exact = Exact::new(line);
        let part = |class: usize| {
            let mut part = Gaussian::of(&exact.parts[class], 2 + class, [1.0, 1.0, HEIGHT]);
            for i in 0..part.size {
                part.mean[i] += shift * part.factor[i][0];
                part.factor[i].iter_mut().for_each(|value| *value *= width);
            }
            part
        };
        let second = (1.0 - doubt) * exact.second + doubt * line.second();
        Self { second: (second, line.second()), parts: [part(0), part(1)], impossible: 0.0 }
    }

    pub(crate) fn exact(line: &Line) -> Self {
        Self::wrong(line, 0.0, 1.0, 0.0)
    }

    pub(crate) fn prior(line: &Line) -> Self {
        Self::exact(&Line::new(line.q, line.r, line.second()))
    }
}

impl Teacher for Guess {
    fn draw(&self, rng: &mut Rng) -> Option<(Vec<usize>, Vec<f64>)> {
        let class = usize::from(rng.random::<f64>() < self.second.0);
        if rng.random::<f64>() < self.impossible {
            return None;
        }
        Some((vec![class], self.parts[class].draw(rng)))
    }

    fn log_ratio(&self, classes: &[usize], start: &[f64]) -> f64 {
        let class = classes[0];
        let z = [start[0], start[1], if class == 1 { start[2] } else { 0.0 }];
        let probability = |second: f64| if class == 1 { second } else { 1.0 - second };
        let prior: f64 = z[..2 + class].iter().map(|z| log_gaussian(*z, 1.0)).sum();
        let class_ratio = probability(self.second.0) / probability(self.second.1);
        (class_ratio * (1.0 - self.impossible)).ln() + self.parts[class].log_density(z) - prior
    }
}
