//! Conditional logit with a Gaussian prior (McFadden, "Conditional logit analysis of qualitative choice behavior", 1974).
//!
//! Alternative a of choice i has the score xᵢₐ · θ and is chosen with probability softmaxₐ(xᵢₐ · θ). Where several would have been right, the probability is
//! that of all of them together.

use nalgebra::{DMatrix, DVector};

/// Steps of Newton's method. The cost is convex where each choice has one right alternative. Where one has several, the curvature leaves out the negative part,
/// the covariance among those, so that steps, halved where they have to be, go down to a local minimum.
const STEPS: usize = 100;

/// What there was to choose from.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Features of each alternative.
    pub alternatives: Vec<DVector<f64>>,
    /// Places of those that were right, at least one: which of them was meant is not known.
    pub chosen: Vec<usize>,
    /// How often it counts.
    pub weight: f64,
}

impl Choice {
    fn scores(&self, theta: &DVector<f64>) -> Vec<f64> {
        self.alternatives.iter().map(|x| x.dot(theta)).collect()
    }

    fn of_chosen(&self, scores: &[f64]) -> Vec<f64> {
        self.chosen.iter().map(|place| scores[*place]).collect()
    }

    /// −ln of the probability of all that were right.
    fn cost(&self, theta: &DVector<f64>) -> f64 {
        let scores = self.scores(theta);
        log_sum(&scores) - log_sum(&self.of_chosen(&scores))
    }
}

/// ln Σ exp.
fn log_sum(scores: &[f64]) -> f64 {
    let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most + scores.iter().map(|score| (score - most).exp()).sum::<f64>().ln()
}

fn softmax(scores: &[f64]) -> Vec<f64> {
    let all = log_sum(scores);
    scores.iter().map(|score| (score - all).exp()).collect()
}

/// Mean and variance of the normal prior of a component of θ.
pub type Prior = (f64, f64);

/// Maximum a posteriori θ, by damped Newton steps.
#[must_use]
pub fn fit(choices: &[Choice], priors: &[Prior]) -> DVector<f64> {
    let size = priors.len();
    let precision = DVector::from_iterator(size, priors.iter().map(|(_, variance)| variance.recip()));
    let begin = DVector::from_iterator(size, priors.iter().map(|(mean, _)| *mean));
    let cost = |theta: &DVector<f64>| -> f64 {
        let away = theta - &begin;
        let prior: f64 = away.iter().zip(&precision).map(|(x, precision)| 0.5 * precision * x * x).sum();
        prior + choices.iter().map(|choice| choice.weight * choice.cost(theta)).sum::<f64>()
    };
    let mut theta = begin.clone();
    let mut now = cost(&theta);
    for _ in 0..STEPS {
        let mut slope = (&theta - &begin).component_mul(&precision);
        let mut curvature = DMatrix::from_diagonal(&precision);
        for choice in choices {
            let scores = choice.scores(&theta);
            let shares = softmax(&scores);
            let mut mean = DVector::zeros(size);
            for (x, share) in choice.alternatives.iter().zip(&shares) {
                mean.axpy(*share, x, 1.0);
                curvature.ger(choice.weight * share, x, x, 1.0);
            }
            slope.axpy(choice.weight, &mean, 1.0);
            for (&place, share) in choice.chosen.iter().zip(softmax(&choice.of_chosen(&scores))) {
                slope.axpy(-choice.weight * share, &choice.alternatives[place], 1.0);
            }
            curvature.ger(-choice.weight, &mean, &mean, 1.0);
        }
        let Some(step) = curvature.cholesky().map(|cholesky| cholesky.solve(&slope)) else { break };
        let mut length = 1.0;
        let next = loop {
            let next = &theta - length * &step;
            let found = cost(&next);
            if found < now || length < 1e-6 {
                break (next, found);
            }
            length *= 0.5;
        };
        let gained = now - next.1;
        if gained > 0.0 {
            (theta, now) = next;
        }
        if gained < 1e-10 {
            break;
        }
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(size: usize, place: usize) -> DVector<f64> {
        DVector::from_fn(size, |row, _| f64::from(u8::from(row == place)))
    }

    #[test]
    fn with_an_offset_each_scores_are_the_logarithms_of_the_frequencies() {
        let alternatives = || (0..3).map(|place| unit(3, place)).collect();
        let choices: Vec<Choice> = [0, 0, 0, 0, 0, 0, 1, 1, 1, 2]
            .map(|chosen| Choice { alternatives: alternatives(), chosen: vec![chosen], weight: 1.0 })
            .to_vec();
        let found = fit(&choices, &[(0.0, 100.0); 3]);
        // The prior of the offsets draws them together by less than a hundredth.
        assert!((found[0] - found[1] - 2.0_f64.ln()).abs() < 0.02, "{found}");
        assert!((found[1] - found[2] - 3.0_f64.ln()).abs() < 0.05, "{found}");
    }

    #[test]
    fn which_of_two_was_meant_is_shared_as_others_say() {
        let choice = |chosen: &[usize], weight| {
            let alternatives = (0..3).map(|place| unit(3, place)).collect();
            Choice { alternatives, chosen: chosen.to_vec(), weight }
        };
        // Nine of a or b, of which the others were a twice as often as b: as six more of a, and three of b.
        let choices = [choice(&[0], 2.0), choice(&[1], 1.0), choice(&[2], 3.0), choice(&[0, 1], 9.0)];
        let found = fit(&choices, &[(0.0, 1000.0); 3]);
        assert!((found[0] - found[1] - 2.0_f64.ln()).abs() < 0.01, "{found}");
        assert!((found[0] - found[2] - (8.0_f64 / 3.0).ln()).abs() < 0.01, "{found}");
    }

    #[test]
    fn one_that_counts_twice_is_two() {
        let choice =
            |chosen, weight| Choice { alternatives: vec![unit(2, 0), unit(2, 1)], chosen: vec![chosen], weight };
        let twice = fit(&[choice(0, 2.0), choice(1, 1.0)], &[(0.0, 1.0); 2]);
        let two = fit(&[choice(0, 1.0), choice(0, 1.0), choice(1, 1.0)], &[(0.0, 1.0); 2]);
        assert!((twice - two).norm() < 1e-9);
    }

    #[test]
    fn at_the_optimum_what_was_chosen_and_what_was_expected_differ_by_the_prior() {
        // Choices among two to four alternatives with one feature.
        let choices: Vec<Choice> = (0..40_usize)
            .map(|i| {
                let alternatives =
                    (0..2 + i % 3).map(|a| DVector::from_element(1, ((7 * i + 5 * a) % 11) as f64 / 5.0));
                Choice { alternatives: alternatives.collect(), chosen: vec![usize::from(i % 5 == 0)], weight: 1.0 }
            })
            .collect();
        let (variance, found) = (0.5, fit(&choices, &[(0.0, 0.5)]));
        let slope: f64 = choices
            .iter()
            .map(|choice| {
                let expected: f64 =
                    choice.alternatives.iter().zip(softmax(&choice.scores(&found))).map(|(x, p)| p * x[0]).sum();
                choice.alternatives[choice.chosen[0]][0] - expected
            })
            .sum();
        assert!(found[0] != 0.0 && (slope - found[0] / variance).abs() < 1e-6, "{slope} {found}");
    }

    #[test]
    fn what_is_hopeless_has_a_finite_cost() {
        let alternatives = (0..3).map(|place| 1e4 * unit(3, place)).collect();
        let choice = Choice { alternatives, chosen: vec![0, 1], weight: 1.0 };
        assert_eq!(choice.cost(&DVector::from_vec(vec![0.0, 0.0, 1.0])), 1e4 - 2.0_f64.ln());
        let found = fit(std::slice::from_ref(&choice), &[(0.0, 1.0), (0.0, 1.0), (1.0, 1.0)]);
        assert!(choice.cost(&found) < 10.0 && found.iter().all(|weight| weight.abs() < 2.0), "{found}");
    }

    #[test]
    fn what_nothing_is_learnt_of_stays_where_it_began() {
        let alternatives = vec![unit(3, 0), unit(3, 1)];
        let found =
            fit(&[Choice { alternatives, chosen: vec![0], weight: 1.0 }], &[(0.5, 0.1), (-0.5, 1e-9), (7.0, 1.0)]);
        assert!(found[0] > 0.5 && (found[1] + 0.5).abs() < 1e-6 && found[2] == 7.0, "{found}");
    }

    #[test]
    fn what_is_always_chosen_leaves_finite_weights() {
        let alternatives = vec![DVector::from_element(1, 1.0), DVector::from_element(1, -1.0)];
        let found = fit(&vec![Choice { alternatives, chosen: vec![0], weight: 1.0 }; 4], &[(0.0, 1.0)]);
        assert!(found[0] > 0.3 && found[0] < 3.0, "{found}");
    }
}
