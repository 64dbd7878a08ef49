//! What the network suggests: a mixture over (s, Θ) in original units.

use pomdp::{Density, Rng};
use rand::RngExt as _;
use rand_distr::StandardNormal;

use crate::fused::HALF_LOG_TAU;

/// p(y, c) = Σₖ αₖ Πᵈ N(yᵈ | μₖᵈ, σₖᵈ) Πʲ Catⱼ(cʲ | k): every component is a joint hypothesis about values and classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixture {
    /// Values per component.
    continuous: usize,
    /// Labels of each class target.
    sizes: Vec<usize>,
    /// `[components]`.
    pub(crate) log_weights: Vec<f64>,
    /// `[components]`.
    pub(crate) weights: Vec<f64>,
    /// `[components, continuous]`.
    pub(crate) means: Vec<f64>,
    /// `[components, continuous]`.
    pub(crate) stddevs: Vec<f64>,
    /// `[components, labels]`.
    pub(crate) log_classes: Vec<f64>,
}

/// One draw of (s, Θ).
#[derive(Clone, Debug, PartialEq)]
pub struct Draw {
    /// Continuous targets in original units, in the order of the layout.
    pub values: Vec<f64>,
    /// Label of each class target.
    pub classes: Vec<usize>,
    /// Component that it came from.
    pub component: usize,
}

impl Mixture {
    /// A mixture from its parts in original units.
    ///
    /// # Shapes
    ///
    /// - `weights`: `[components]`, normalised here
    /// - `means`, `stddevs`: `[components, continuous]`
    /// - `classes`: `[components, Σ sizes]`, probabilities, one block per class target
    ///
    /// # Panics
    ///
    /// If the lengths disagree, or a weight or stddev is not positive.
    #[must_use]
    pub fn new(weights: &[f64], means: Vec<f64>, stddevs: Vec<f64>, sizes: Vec<usize>, classes: &[f64]) -> Self {
        let components = weights.len();
        let labels: usize = sizes.iter().sum();
        assert_eq!(means.len() % components, 0, "{} means for {components} components", means.len());
        assert_eq!(
            (means.len(), components * labels),
            (stddevs.len(), classes.len()),
            "lengths of the mixture's parts"
        );
        assert!(weights.iter().chain(&stddevs).all(|&value| value > 0.0), "weights {weights:?}, stddevs {stddevs:?}");
        let total: f64 = weights.iter().sum();
        let weights: Vec<f64> = weights.iter().map(|weight| weight / total).collect();
        let log_weights = weights.iter().map(|weight| weight.ln()).collect();
        let log_classes = classes.iter().map(|probability| probability.ln()).collect();
        Self { continuous: means.len() / components, sizes, log_weights, weights, means, stddevs, log_classes }
    }

    /// Room for `components` components, filled by `Inference`.
    pub(crate) fn blank(components: usize, continuous: usize, sizes: Vec<usize>) -> Self {
        let labels: usize = sizes.iter().sum();
        Self {
            continuous,
            log_weights: vec![0.0; components],
            weights: vec![0.0; components],
            means: vec![0.0; components * continuous],
            stddevs: vec![0.0; components * continuous],
            log_classes: vec![0.0; components * labels],
            sizes,
        }
    }

    /// Number of components.
    #[must_use]
    pub fn components(&self) -> usize {
        self.weights.len()
    }

    /// Weight of each component; they sum to 1.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Means of component `component`.
    #[must_use]
    pub fn means(&self, component: usize) -> &[f64] {
        &self.means[component * self.continuous..(component + 1) * self.continuous]
    }

    /// Standard deviations of component `component`.
    #[must_use]
    pub fn stddevs(&self, component: usize) -> &[f64] {
        &self.stddevs[component * self.continuous..(component + 1) * self.continuous]
    }

    /// ln of the probability of each label of class target `target` under component `component`.
    #[must_use]
    pub fn log_classes(&self, component: usize, target: usize) -> &[f64] {
        let labels: usize = self.sizes.iter().sum();
        let first = component * labels + self.sizes[..target].iter().sum::<usize>();
        &self.log_classes[first..first + self.sizes[target]]
    }

    /// Probability of each label of class target `target`, over all components.
    #[must_use]
    pub fn class_probabilities(&self, target: usize) -> Vec<f64> {
        let mut probabilities = vec![0.0; self.sizes[target]];
        for (component, weight) in self.weights.iter().enumerate() {
            for (probability, log) in probabilities.iter_mut().zip(self.log_classes(component, target)) {
                *probability += weight * log.exp();
            }
        }
        probabilities
    }

    /// ln p(values, classes). Values with mask false are integrated out.
    ///
    /// # Panics
    ///
    /// If a length differs from the layout.
    #[must_use]
    pub fn log_density_masked(&self, values: &[f64], mask: &[bool], classes: &[usize]) -> f64 {
        assert_eq!((values.len(), mask.len(), classes.len()), (self.continuous, self.continuous, self.sizes.len()));
        log_sum_exp(self.joint(classes).enumerate().map(|(component, log_joint)| {
            let gaussians = self.means(component).iter().zip(self.stddevs(component));
            let terms = values.iter().zip(mask).zip(gaussians).filter(|((_, applies), _)| **applies);
            log_joint
                + terms
                    .map(|((value, _), (mean, stddev))| {
                        let standard = (value - mean) / stddev;
                        -0.5 * standard * standard - stddev.ln() - HALF_LOG_TAU
                    })
                    .sum::<f64>()
        }))
    }

    /// P(target ≤ value), given that each class target has one of its `labels` (`[class targets][labels]`); all of them ask for the
    /// marginal.
    ///
    /// # Panics
    ///
    /// If `target` is not a continuous target.
    #[must_use]
    pub fn cumulative(&self, target: usize, value: f64, labels: &[Vec<bool>]) -> f64 {
        let each = self.given(labels).into_iter().enumerate().map(|(component, weight)| {
            let (mean, stddev) = (self.means(component)[target], self.stddevs(component)[target]);
            weight * normal_cumulative((value - mean) / stddev)
        });
        each.sum()
    }

    /// Standard deviation of continuous target `target`, given the same.
    ///
    /// # Panics
    ///
    /// If `target` is not a continuous target.
    #[must_use]
    pub fn stddev(&self, target: usize, labels: &[Vec<bool>]) -> f64 {
        let (mut mean, mut square) = (0.0, 0.0);
        for (component, weight) in self.given(labels).into_iter().enumerate() {
            let (m, s) = (self.means(component)[target], self.stddevs(component)[target]);
            (mean, square) = (mean + weight * m, square + weight * (m * m + s * s));
        }
        (square - mean * mean).max(0.0).sqrt()
    }

    /// Weights of the components given that each class target has one of its `labels`.
    fn given(&self, labels: &[Vec<bool>]) -> Vec<f64> {
        let probability = |component: usize, target: usize| -> f64 {
            let logs = self.log_classes(component, target).iter().zip(&labels[target]);
            logs.filter(|(_, allowed)| **allowed).map(|(log, _)| log.exp()).sum()
        };
        let joint = |(component, weight): (usize, &f64)| {
            weight * (0..self.sizes.len()).map(|target| probability(component, target)).product::<f64>()
        };
        let joint: Vec<f64> = self.weights.iter().enumerate().map(joint).collect();
        let total: f64 = joint.iter().sum();
        joint.into_iter().map(|weight| weight / total.max(f64::MIN_POSITIVE)).collect()
    }

    /// One draw.
    #[must_use]
    pub fn sample(&self, rng: &mut Rng) -> Draw {
        let component = pick(self.weights.iter().copied(), rng);
        let values = self.values(component, rng);
        let targets = 0..self.sizes.len();
        let classes = targets.map(|target| pick(self.log_classes(component, target).iter().map(|log| log.exp()), rng));
        Draw { values, classes: classes.collect(), component }
    }

    /// Continuous values drawn from a component.
    fn values(&self, component: usize, rng: &mut Rng) -> Vec<f64> {
        let gaussians = self.means(component).iter().zip(self.stddevs(component));
        gaussians.map(|(mean, stddev)| mean + stddev * rng.sample::<f64, _>(StandardNormal)).collect()
    }

    /// Means and most likely classes of the component with the largest weight.
    #[must_use]
    pub fn strongest(&self) -> Draw {
        let component = largest(&self.weights);
        let classes = (0..self.sizes.len()).map(|target| largest(self.log_classes(component, target))).collect();
        Draw { values: self.means(component).to_vec(), classes, component }
    }

    /// ln (αₖ Πʲ Catⱼ(cʲ | k)) of each component.
    fn joint<'a>(&'a self, classes: &'a [usize]) -> impl Iterator<Item = f64> + Clone + 'a {
        self.log_weights.iter().enumerate().map(move |(component, log_weight)| {
            let each = classes.iter().enumerate().map(|(target, &class)| self.log_classes(component, target)[class]);
            log_weight + each.sum::<f64>()
        })
    }
}

impl Density for Mixture {
    type Value = Draw;

    fn sample(&self, rng: &mut Rng) -> Draw {
        self.sample(rng)
    }

    /// Of values and classes, whichever component they came from; every continuous target counts.
    fn log_density(&self, draw: &Draw) -> f64 {
        self.log_density_masked(&draw.values, &vec![true; draw.values.len()], &draw.classes)
    }
}

/// ln Σ exp; −∞ if all are −∞.
pub(crate) fn log_sum_exp(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + values.map(|value| (value - largest).exp()).sum::<f64>().ln()
}

/// Index of the largest value; the first of equals.
pub(crate) fn largest(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, index| if values[index] > values[best] { index } else { best })
}

/// Index drawn with these probabilities.
fn pick(probabilities: impl ExactSizeIterator<Item = f64>, rng: &mut Rng) -> usize {
    let last = probabilities.len() - 1;
    let mut left = rng.random::<f64>();
    for (index, probability) in probabilities.enumerate() {
        left -= probability;
        if left < 0.0 {
            return index;
        }
    }
    last
}

/// Φ, by the complementary error function of Numerical Recipes (relative error below 1.2e-7).
#[must_use]
pub fn normal_cumulative(standard: f64) -> f64 {
    let x = standard.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.5 * x);
    let series = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let exponent = series.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient);
    let tail = 0.5 * t * (exponent - x * x).exp();
    if standard < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pomdp::{Purpose, Seed};

    fn mixture() -> Mixture {
        let means = vec![-1.0, 0.5, 2.0, -1.5];
        let stddevs = vec![0.5, 1.0, 0.8, 0.3];
        Mixture::new(&[1.0, 3.0], means, stddevs, vec![2, 3], &[0.9, 0.1, 0.2, 0.3, 0.5, 0.4, 0.6, 0.7, 0.2, 0.1])
    }

    #[test]
    fn density_integrates_to_one_and_its_parts_to_the_masked_density() {
        let mixture = mixture();
        let (step, mut total, mut slice) = (0.05, 0.0, 0.0);
        for i in -160..160 {
            for j in -160..160 {
                let values = [f64::from(i) * step, f64::from(j) * step];
                for shape in 0..2 {
                    for obstacle in 0..3 {
                        let draw = Draw { values: values.to_vec(), classes: vec![shape, obstacle], component: 0 };
                        total += mixture.log_density(&draw).exp() * step * step;
                    }
                }
                if i == 10 {
                    slice += mixture.log_density_masked(&values, &[true, true], &[1, 2]).exp() * step;
                }
            }
        }
        assert!((total - 1.0).abs() < 1e-9, "{total}");
        let masked = mixture.log_density_masked(&[0.5, f64::NAN], &[true, false], &[1, 2]).exp();
        assert!((slice - masked).abs() < 1e-9, "{slice} {masked}");
    }

    #[test]
    fn density_has_the_value_worked_out_by_hand() {
        let normal = |z: f64, stddev: f64| (-0.5 * z * z).exp() / (stddev * (2.0 * std::f64::consts::PI).sqrt());
        let first = 0.25 * normal(2.0, 0.5) * normal(-0.5, 1.0) * 0.9 * 0.3;
        let second = 0.75 * normal(-2.5, 0.8) * normal(5.0, 0.3) * 0.4 * 0.2;
        let log_density = mixture().log_density_masked(&[0.0, 0.0], &[true, true], &[0, 1]);
        assert!((log_density - (first + second).ln()).abs() < 1e-12, "{log_density}");
    }

    #[test]
    fn draws_follow_the_density() {
        let mixture = mixture();
        let (mut rng, count) = (Seed(3).stream(Purpose::Test, 0), 40_000);
        let draws: Vec<Draw> = (0..count).map(|_| mixture.sample(&mut rng)).collect();
        let share =
            |test: &dyn Fn(&Draw) -> bool| draws.iter().filter(|draw| test(draw)).count() as f64 / f64::from(count);
        // Tolerance: 5 standard errors of a share.
        let tolerance = 5.0 * 0.5 / f64::from(count).sqrt();
        assert!((share(&|d| d.component == 1) - 0.75).abs() < tolerance);
        assert!((share(&|d| d.classes[1] == 2) - mixture.class_probabilities(1)[2]).abs() < tolerance);
        assert!((mixture.class_probabilities(1)[2] - (0.25 * 0.5 + 0.75 * 0.1)).abs() < 1e-12);
        assert!(
            (share(&|d| d.values[0] <= 1.0) - mixture.cumulative(0, 1.0, &[vec![true; 2], vec![true; 3]])).abs()
                < tolerance
        );
        let given = [vec![false, true], vec![true, false, true]];
        let matching: Vec<&Draw> = draws.iter().filter(|draw| draw.classes[0] == 1 && draw.classes[1] != 1).collect();
        let below = matching.iter().filter(|draw| draw.values[0] <= 1.0).count() as f64 / matching.len() as f64;
        let tolerance = 5.0 * 0.5 / (matching.len() as f64).sqrt();
        assert!((below - mixture.cumulative(0, 1.0, &given)).abs() < tolerance, "{below}");
        let mean = matching.iter().map(|draw| draw.values[0]).sum::<f64>() / matching.len() as f64;
        let variance = matching.iter().map(|draw| (draw.values[0] - mean).powi(2)).sum::<f64>() / matching.len() as f64;
        // The standard error of the spread of some 16,000 draws is below 1 %.
        assert!((mixture.stddev(0, &given) / variance.sqrt() - 1.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn strongest_is_the_mean_of_the_heaviest_component() {
        let strongest = mixture().strongest();
        assert_eq!(strongest, Draw { values: vec![2.0, -1.5], classes: vec![1, 0], component: 1 });
    }

    #[test]
    fn normal_cumulative_has_tabulated_values() {
        for (z, exact) in
            [(0.0, 0.5), (1.0, 0.841_344_746_068_543), (-1.959_963_984_540_054, 0.025), (6.0, 1.0 - 9.866e-10)]
        {
            assert!((normal_cumulative(z) - exact).abs() < 1.2e-7, "{z}");
        }
    }
}
