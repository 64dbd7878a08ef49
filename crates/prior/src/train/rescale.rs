//! One factor on the stated spread of each target, fitted on held-out episodes. A network stopped at its best
//! likelihood is still overconfident.

use rayon::prelude::*;

use super::Trainer;
use crate::fused::{Batch, Workspace};
use crate::parameters::Parameters;

/// Steps of expectation and maximisation; the factors move by less than a thousandth after the third.
const ROUNDS: usize = 4;

impl Trainer {
    /// `parameters` with the spread of each target, the same factor in all components, at the maximum of the held-out
    /// likelihood. The factors go into the bias of the log-deviations, so that no other part has to know about them.
    #[must_use]
    pub(super) fn rescaled(&self, parameters: &Parameters<f32>) -> Parameters<f32> {
        let (sizes, mut rescaled) = (&self.dimensions, parameters.clone());
        let head =
            sizes.heads().iter().position(|(name, _)| *name == "log_stddevs").expect("every network has this head");
        let bias = 3 * sizes.hidden.len() + 2 * head + 1;
        for _ in 0..ROUNDS {
            let moments = |batch: Batch<f32>| Workspace::new(sizes).moments(&rescaled, &batch);
            let parts: Vec<(Vec<f64>, Vec<f64>)> = self.held_out_batches().map(moments).collect();
            for target in 0..sizes.continuous {
                let squares: f64 = parts.iter().map(|(squares, _)| squares[target]).sum();
                let count: f64 = parts.iter().map(|(_, counts)| counts[target]).sum();
                if squares > 0.0 && count >= 1.0 {
                    let log_factor = 0.5 * (squares / count).ln();
                    for component in 0..sizes.components {
                        rescaled.tensors[bias][component * sizes.continuous + target] += log_factor as f32;
                    }
                }
            }
        }
        rescaled
    }
}
