//! Negative log-likelihood of the mixture head and its gradient, row by row (Bishop 1994, with categorical factors).
//!
//! p(y, c) = Σₖ αₖ Πᵈ N(yᵈ | μₖᵈ, σₖᵈ) Πʲ Catⱼ(cʲ | k); a target whose mask is 0 drops out of its product.

use super::Real;
use crate::parameters::Dimensions;

/// Lower and upper limit of ln σ in normalised units.
pub const LOG_STDDEV_LIMITS: (f64, f64) = (-5.0, 3.0);

/// ½ ln 2π.
pub(crate) const HALF_LOG_TAU: f64 = 0.918_938_533_204_672_8;

/// Buffers of one row.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row<T> {
    /// (y − μ)/σ, `[components, continuous]`.
    standard: Vec<T>,
    /// 1/σ, `[components, continuous]`.
    inverse: Vec<T>,
    /// Terms of a sum over targets, `[continuous]`.
    terms: Vec<T>,
    /// ln of the joint density per component, `[components]`.
    joint: Vec<T>,
    /// softmax of the mixture logits, `[components]`.
    share: Vec<T>,
    /// Class probabilities, `[components, labels]`.
    classes: Vec<T>,
}

impl<T: Real> Row<T> {
    pub(crate) fn new(dimensions: &Dimensions) -> Self {
        let (k, d) = (dimensions.components, dimensions.continuous);
        Self {
            standard: vec![T::ZERO; k * d],
            inverse: vec![T::ZERO; k * d],
            terms: vec![T::ZERO; d],
            joint: vec![T::ZERO; k],
            share: vec![T::ZERO; k],
            classes: vec![T::ZERO; k * dimensions.labels()],
        }
    }

    /// −ln p(targets, classes) under the raw output row `outputs`; keeps what [`Row::gradient`] needs.
    ///
    /// # Shapes
    ///
    /// - `outputs`: `[components | components × continuous | components × continuous | components × labels]`
    /// - `targets`, `mask`: `[continuous]`; `classes`: `[class targets]`
    #[inline(always)]
    pub(crate) fn loss(&mut self, sizes: &Dimensions, outputs: &[T], targets: &[T], mask: &[T], classes: &[u8]) -> f64 {
        let (k, d, labels) = (sizes.components, sizes.continuous, sizes.labels());
        let (logits, rest) = outputs.split_at(k);
        let (means, rest) = rest.split_at(k * d);
        let (log_stddevs, labelled) = rest.split_at(k * d);
        let (low, high) = (T::from_f64(LOG_STDDEV_LIMITS.0), T::from_f64(LOG_STDDEV_LIMITS.1));
        let half = T::from_f64(0.5);
        // Slices of length d, so that the compiler sees that no index leaves them, and vectorises.
        let (targets, mask, terms) = (&targets[..d], &mask[..d], &mut self.terms[..d]);
        softmax(logits, &mut self.share);
        let normaliser = log_sum_exp(logits);
        for component in 0..k {
            let at = component * d..(component + 1) * d;
            let (means, log_stddevs) = (&means[at.clone()][..d], &log_stddevs[at.clone()][..d]);
            let (standard, inverse) = (&mut self.standard[at.clone()][..d], &mut self.inverse[at][..d]);
            for (inverse, &log_stddev) in inverse.iter_mut().zip(log_stddevs) {
                *inverse = (-log_stddev.limit(low, high)).exp();
            }
            for index in 0..d {
                standard[index] = (targets[index] - means[index]) * inverse[index];
                let log_stddev = log_stddevs[index].limit(low, high);
                terms[index] = -mask[index] * (half * standard[index] * standard[index] + log_stddev);
            }
            let mut joint = logits[component].to_f64() - normaliser + sum(terms).to_f64();
            let mut first = component * labels;
            for (&count, &class) in sizes.classes.iter().zip(classes) {
                let logits = &labelled[first..first + count];
                softmax(logits, &mut self.classes[first..first + count]);
                joint += logits[usize::from(class)].to_f64() - log_sum_exp(logits);
                first += count;
            }
            self.joint[component] = T::from_f64(joint);
        }
        let applying = sum(mask).to_f64();
        HALF_LOG_TAU * applying - log_sum_exp(&self.joint)
    }

    /// Of the [`Row::loss`] call before: adds to each target its squared standardised errors and their number, both weighted by the
    /// components' responsibilities.
    pub(crate) fn add_moments(&mut self, sizes: &Dimensions, mask: &[T], squares: &mut [f64], counts: &mut [f64]) {
        softmax(&self.joint, &mut self.share);
        for (component, share) in self.share.iter().enumerate() {
            let at = component * sizes.continuous..(component + 1) * sizes.continuous;
            for (index, (standard, mask)) in self.standard[at].iter().zip(mask).enumerate() {
                let weight = share.to_f64() * mask.to_f64();
                squares[index] += weight * standard.to_f64() * standard.to_f64();
                counts[index] += weight;
            }
        }
    }

    /// Replaces `outputs` by `scale` times the gradient of the loss of the [`Row::loss`] call before.
    #[inline(always)]
    pub(crate) fn gradient(&mut self, sizes: &Dimensions, outputs: &mut [T], mask: &[T], classes: &[u8], scale: T) {
        let (k, d, labels) = (sizes.components, sizes.continuous, sizes.labels());
        let (logits, rest) = outputs.split_at_mut(k);
        let (means, rest) = rest.split_at_mut(k * d);
        let (log_stddevs, labelled) = rest.split_at_mut(k * d);
        let (low, high) = (T::from_f64(LOG_STDDEV_LIMITS.0), T::from_f64(LOG_STDDEV_LIMITS.1));
        let mask = &mask[..d];
        // Logits become the responsibilities p(k | targets, classes), then the gradient.
        softmax(&self.joint, logits);
        for (component, logit) in logits.iter_mut().enumerate() {
            let responsibility = (scale * *logit).flush();
            *logit = scale * self.share[component] - responsibility;
            let at = component * d..(component + 1) * d;
            let (means, log_stddevs) = (&mut means[at.clone()][..d], &mut log_stddevs[at.clone()][..d]);
            let (standard, inverse) = (&self.standard[at.clone()][..d], &self.inverse[at][..d]);
            for index in 0..d {
                let weight = responsibility * mask[index];
                let standard = standard[index];
                means[index] = (-(weight * standard * inverse[index])).flush();
                let raw = log_stddevs[index];
                let inside = if raw >= low && raw <= high { T::ONE } else { T::ZERO };
                log_stddevs[index] = (weight * (T::ONE - standard * standard) * inside).flush();
            }
            let mut first = component * labels;
            for (&count, &class) in sizes.classes.iter().zip(classes) {
                for label in 0..count {
                    let hit = if label == usize::from(class) { T::ONE } else { T::ZERO };
                    labelled[first + label] = (responsibility * (self.classes[first + label] - hit)).flush();
                }
                first += count;
            }
        }
    }
}

/// Σ values, in eight interleaved partial sums so that it vectorises with a fixed order.
#[inline(always)]
fn sum<T: Real>(values: &[T]) -> T {
    let mut lanes = [T::ZERO; 8];
    let chunks = values.chunks_exact(8);
    let mut rest = T::ZERO;
    chunks.remainder().iter().for_each(|&value| rest += value);
    for chunk in chunks {
        for (lane, &value) in lanes.iter_mut().zip(chunk) {
            *lane += value;
        }
    }
    lanes.iter().for_each(|&lane| rest += lane);
    rest
}

/// ln Σ exp, safe for any finite values.
#[inline(always)]
fn log_sum_exp<T: Real>(values: &[T]) -> f64 {
    let largest = values.iter().fold(f64::NEG_INFINITY, |largest, value| largest.max(value.to_f64()));
    largest + values.iter().map(|value| (value.to_f64() - largest).exp()).sum::<f64>().ln()
}

/// exp(values) / Σ exp(values).
#[inline(always)]
fn softmax<T: Real>(values: &[T], target: &mut [T]) {
    let largest =
        values.iter().copied().fold(values[0], |largest, value| if value > largest { value } else { largest });
    let mut total = T::ZERO;
    for (target, &value) in target.iter_mut().zip(values) {
        *target = (value - largest).exp();
        total += *target;
    }
    target.iter_mut().for_each(|value| *value = (*value / total).flush());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::tests::dimensions;

    #[test]
    fn loss_of_one_component_is_the_textbook_value() {
        let sizes = dimensions(1, 2, &[2], &[1], 1);
        let mut row = Row::<f64>::new(&sizes);
        // μ = (1, 0), ln σ = (ln 2, 0), class logits (ln 3, 0): p(class 0) = 3/4.
        let outputs = [0.7, 1.0, 0.0, 2.0_f64.ln(), 0.0, 3.0_f64.ln(), 0.0];
        let loss = row.loss(&sizes, &outputs, &[3.0, 5.0], &[1.0, 0.0], &[0]);
        let exact = 0.5 + 2.0_f64.ln() + HALF_LOG_TAU - 0.75_f64.ln();
        assert!((loss - exact).abs() < 1e-12, "{loss} {exact}");
    }

    #[test]
    fn far_targets_and_wild_scales_stay_finite() {
        let sizes = dimensions(1, 1, &[], &[1], 2);
        let mut row = Row::<f32>::new(&sizes);
        let mut outputs = [80.0, -80.0, 0.0, 1e4, -1e6, 1e6];
        let loss = row.loss(&sizes, &outputs, &[1e4], &[1.0], &[]);
        // Component 0 is 1e4·e⁵ standard deviations away, component 1 has weight e⁻¹⁶⁰ and σ = e³.
        assert!((loss - (160.0 + 3.0 + HALF_LOG_TAU)).abs() < 1e-3, "{loss}");
        row.gradient(&sizes, &mut outputs, &[1.0], &[], 1.0);
        assert!(outputs.iter().all(|value| value.is_finite()), "{outputs:?}");
    }
}
