//! Multinomial logistic regression with a normal prior of the weights.

use nalgebra::{DMatrix, DVector};

/// Offset and weights of each class.
pub type Classes = Vec<(f64, Vec<f64>)>;

/// Steps of Newton's method: the cost is convex.
const STEPS: usize = 100;
/// Variance of the offsets: hardly any prior.
const OFFSETS: f64 = 100.0;

/// Maximum a posteriori offsets and weights of `classes` classes. `rows`: features of each example, standardised; `labels`: its class. The prior of a
/// weight is N(0, `variance`).
///
/// −ln posterior is Σ ln Σ exp(b + W f) − (b + W f) of the label + Σ W² / (2 variance); its optimum is found by damped Newton steps.
#[must_use]
pub fn fit(rows: &[Vec<f64>], labels: &[usize], classes: usize, variance: f64) -> Classes {
    let features = rows.first().map_or(0, Vec::len) + 1;
    let design: Vec<DVector<f64>> = (rows.iter())
        .map(|row| DVector::from_iterator(features, std::iter::once(1.0).chain(row.iter().copied())))
        .collect();
    let precision = |index: usize| if index.is_multiple_of(features) { 1.0 / OFFSETS } else { 1.0 / variance };
    let size = classes * features;
    let cost = |x: &DVector<f64>| -> f64 {
        let prior: f64 = (0..size).map(|index| 0.5 * precision(index) * x[index] * x[index]).sum();
        let one = |(row, label): (&DVector<f64>, &usize)| -shares(x, row, classes)[*label].ln();
        prior + design.iter().zip(labels).map(one).sum::<f64>()
    };
    let mut x = DVector::zeros(size);
    let mut now = cost(&x);
    for _ in 0..STEPS {
        let mut slope = DVector::from_fn(size, |index, _| precision(index) * x[index]);
        let mut curvature = DMatrix::from_diagonal(&DVector::from_fn(size, |index, _| precision(index)));
        for (row, label) in design.iter().zip(labels) {
            let shares = shares(&x, row, classes);
            for a in 0..classes {
                let error = shares[a] - f64::from(u8::from(a == *label));
                for i in 0..features {
                    slope[a * features + i] += error * row[i];
                }
                for b in 0..classes {
                    let both = shares[a] * (f64::from(u8::from(a == b)) - shares[b]);
                    for (i, j) in (0..features).flat_map(|i| (0..features).map(move |j| (i, j))) {
                        curvature[(a * features + i, b * features + j)] += both * row[i] * row[j];
                    }
                }
            }
        }
        let Some(step) = curvature.cholesky().map(|c| c.solve(&slope)) else { break };
        let mut length = 1.0;
        let next = loop {
            let next = &x - length * &step;
            let found = cost(&next);
            if found < now || length < 1e-6 {
                break (next, found);
            }
            length *= 0.5;
        };
        let gained = now - next.1;
        if gained > 0.0 {
            (x, now) = next;
        }
        if gained < 1e-10 {
            break;
        }
    }
    (0..classes)
        .map(|class| {
            let own: Vec<f64> = x.iter().skip(class * features).take(features).copied().collect();
            (own[0], own[1..].to_vec())
        })
        .collect()
}

fn shares(x: &DVector<f64>, row: &DVector<f64>, classes: usize) -> Vec<f64> {
    let features = row.len();
    let score = |class: usize| (0..features).map(|i| x[class * features + i] * row[i]).sum::<f64>();
    let scores: Vec<f64> = (0..classes).map(score).collect();
    let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let exponentials: Vec<f64> = scores.iter().map(|score| (score - most).exp()).collect();
    let sum: f64 = exponentials.iter().sum();
    exponentials.into_iter().map(|share| share / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_features_the_offsets_are_the_logarithms_of_the_frequencies() {
        let labels = [0, 0, 0, 0, 0, 0, 1, 1, 1, 2];
        let found = fit(&vec![Vec::new(); 10], &labels, 3, 1.0);
        // The prior of the offsets draws them together by less than a hundredth.
        assert!((found[0].0 - found[1].0 - 2.0_f64.ln()).abs() < 0.02);
        assert!((found[1].0 - found[2].0 - 3.0_f64.ln()).abs() < 0.05);
    }

    #[test]
    fn two_classes_are_a_logistic_regression_with_half_the_weight_each() {
        // At the optimum of f: Σ (label − p) f = w / variance, w the weight of either class.
        let rows: Vec<Vec<f64>> = (0..40).map(|i| vec![f64::from(i) / 10.0 - 2.0]).collect();
        let labels: Vec<usize> = (0..40).map(|i| usize::from(i * 7 % 40 < i)).collect();
        let found = fit(&rows, &labels, 2, 1.0);
        assert!((found[0].1[0] + found[1].1[0]).abs() < 1e-6);
        let score = |row: &[f64]| found[1].0 - found[0].0 + (found[1].1[0] - found[0].1[0]) * row[0];
        let slope: f64 = (rows.iter().zip(&labels))
            .map(|(row, label)| (*label as f64 - 1.0 / (1.0 + (-score(row)).exp())) * row[0])
            .sum();
        assert!((slope - found[1].1[0]).abs() < 1e-6, "{slope}");
    }

    #[test]
    fn classes_that_are_apart_leave_finite_weights() {
        let rows = vec![vec![-1.0], vec![-1.0], vec![1.0], vec![1.0]];
        let found = fit(&rows, &[0, 0, 1, 1], 2, 1.0);
        assert!(found[1].1[0] > 0.3 && found[1].1[0] < 3.0, "{found:?}");
    }
}
