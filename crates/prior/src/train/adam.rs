//! Adam (Kingma and Ba 2015) with decoupled weight decay (AdamW: Loshchilov and Hutter 2019).

use crate::parameters::{Dimensions, Parameters};

/// Decay of the first moment a step, as published.
const BETA_1: f32 = 0.9;
/// Decay of the second moment a step, as published.
const BETA_2: f32 = 0.999;
/// Added to the root of the second moment, as published.
const EPSILON: f32 = 1e-8;

/// Running moments of the gradient, one value for each weight.
///
/// A step is θ ← (1 − η λ) θ − η m̂ / (√v̂ + ε) with m̂ = m / (1 − β₁ᵗ) and v̂ = v / (1 − β₂ᵗ), where η is the learning rate, λ the weight decay and t
/// counts steps from 1. Both sides of the fraction are multiplied by √(1 − β₂ᵗ), which saves a division a weight.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Adam {
    /// Mean of the gradient, m.
    pub(super) first: Parameters<f32>,
    /// Mean of its square, v.
    pub(super) second: Parameters<f32>,
}

impl Adam {
    /// Moments before the first step.
    pub(super) fn new(dimensions: &Dimensions) -> Self {
        Self { first: Parameters::zeros(dimensions), second: Parameters::zeros(dimensions) }
    }

    /// Step number `step`, counted from 1.
    pub(super) fn step(
        &mut self,
        parameters: &mut Parameters<f32>,
        gradient: &Parameters<f32>,
        step: u64,
        rate: f64,
        decay: f64,
    ) {
        let power = i32::try_from(step).unwrap_or(i32::MAX);
        let root = (1.0 - BETA_2.powi(power)).sqrt();
        let (factor, epsilon) = (root / (1.0 - BETA_1.powi(power)), EPSILON * root);
        let (rate, kept) = (rate as f32, (1.0 - rate * decay) as f32);
        let weights = parameters.tensors.iter_mut().flatten();
        let moments = self.first.tensors.iter_mut().flatten().zip(self.second.tensors.iter_mut().flatten());
        for ((weight, &slope), (first, second)) in weights.zip(gradient.tensors.iter().flatten()).zip(moments) {
            *first = *first * BETA_1 + slope * (1.0 - BETA_1);
            *second = *second * BETA_2 + slope * slope * (1.0 - BETA_2);
            let change = *first * factor / (second.sqrt() + epsilon);
            *weight = *weight * kept - change * rate;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::tests::dimensions;

    /// Weights after steps of PyTorch's Adam and AdamW in f64, written by `tests/peers/pytorch_prior.py --optimiser`.
    #[derive(serde::Deserialize)]
    struct Recorded {
        rates: Vec<f64>,
        weight_decay: f64,
        start: Vec<f64>,
        gradients: Vec<Vec<f64>>,
        adam: Vec<Vec<f64>>,
        adamw: Vec<Vec<f64>>,
    }

    #[test]
    fn steps_are_those_that_pytorch_recorded() {
        let recorded: Recorded = serde_json::from_str(include_str!("../../tests/data/pytorch_adam.json")).unwrap();
        let narrow = |values: &[f64]| Parameters { tensors: vec![values.iter().map(|&value| value as f32).collect()] };
        for (decay, expected) in [(0.0, &recorded.adam), (recorded.weight_decay, &recorded.adamw)] {
            let mut weights = narrow(&recorded.start);
            let moments = narrow(&vec![0.0; recorded.start.len()]);
            let mut adam = Adam { first: moments.clone(), second: moments };
            for (index, (gradient, expected)) in recorded.gradients.iter().zip(expected).enumerate() {
                adam.step(&mut weights, &narrow(gradient), index as u64 + 1, recorded.rates[index], decay);
                for (ours, theirs) in weights.tensors[0].iter().zip(expected) {
                    let difference = (f64::from(*ours) - theirs).abs();
                    assert!(difference < 2e-6 * (1.0 + theirs.abs()), "step {index}: {ours} {theirs}");
                }
            }
            let moved =
                weights.tensors[0].iter().zip(&recorded.start).map(|(now, start)| (f64::from(*now) - start).abs());
            assert!(moved.fold(f64::INFINITY, f64::min) > 1e-3, "weights that stay compare nothing");
        }
        assert_ne!(recorded.adam, recorded.adamw);
    }

    #[test]
    fn there_is_a_moment_for_every_weight() {
        let sizes = dimensions(5, 6, &[3, 4], &[7, 9], 3);
        let adam = Adam::new(&sizes);
        let lengths = |parameters: &Parameters<f32>| parameters.tensors.iter().map(Vec::len).collect::<Vec<_>>();
        let expected: Vec<usize> = sizes.tensors().iter().map(crate::parameters::TensorSpec::len).collect();
        assert_eq!((lengths(&adam.first), lengths(&adam.second)), (expected.clone(), expected));
    }
}
