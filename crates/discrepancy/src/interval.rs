//! Intervals of fitted parameters, by a bootstrap over episodes.
//!
//! Each resample takes as many episodes as there are, with replacement, draws the prior's mean from the prior, and makes one Gauss–Newton step
//! from the fit. Laplace's intervals are too narrow where residuals are not as white as they should be; episodes are independent whatever happens
//! within them. The drawn mean stands for what no episode tells (the errors of the engine, which are the same in all): for a linear model the
//! resamples are then as wide as the posterior (randomize-then-optimize: Bardsley et al., SIAM J. Sci. Comput. 36, 2014).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use pomdp::{Purpose, Seed};
use rand_distr::{Distribution as _, StandardNormal, Uniform};

use crate::fit::Fit;
use crate::likelihood::{product, weights};

/// Resamples.
const RESAMPLES: usize = 500;

/// Coordinates of the resamples, each as long as the fit's; `None` for a fit that failed, or without coordinates or episodes. `groups`: places of the
/// pieces of each episode.
#[must_use]
pub fn bootstrap(fit: &Fit, groups: &[Range<usize>], seed: u64) -> Option<Vec<Vec<f64>>> {
    let (n, episodes) = (fit.x.len(), groups.len());
    if n == 0 || episodes == 0 || fit.log_evidence() == f64::NEG_INFINITY {
        return None;
    }
    let weights = weights(&fit.residuals);
    let column = |i: usize, t: usize| &fit.jacobian[i][t];
    let sum = |group: &Range<usize>, of: &dyn Fn(usize) -> f64| group.clone().map(of).sum::<f64>();
    let grams: Vec<DMatrix<f64>> = (groups.iter())
        .map(|group| DMatrix::from_fn(n, n, |i, j| sum(group, &|t| product(column(i, t), column(j, t), &weights[t]))))
        .collect();
    let slopes: Vec<DVector<f64>> = groups
        .iter()
        .map(|group| DVector::from_fn(n, |i, _| sum(group, &|t| product(column(i, t), &fit.residuals[t], &weights[t]))))
        .collect();
    // What is left of the slope at the optimum is the solver's grain, not the data's.
    let mean: DVector<f64> = slopes.iter().sum::<DVector<f64>>() + DVector::from_column_slice(&fit.x);
    let mut rng = Seed(seed).stream(Purpose::Statistics, 0);
    let pick = Uniform::new(0, episodes).ok()?;
    (0..RESAMPLES)
        .map(|_| {
            let (mut gram, mut slope) = (DMatrix::identity(n, n), -&mean);
            slope += DVector::from_column_slice(&fit.x);
            for _ in 0..episodes {
                let t = pick.sample(&mut rng);
                gram += &grams[t];
                slope += &slopes[t];
            }
            for i in 0..n {
                let z: f64 = StandardNormal.sample(&mut rng);
                slope[i] -= z;
            }
            let delta = gram.cholesky()?.solve(&slope);
            Some(fit.x.iter().zip(delta.iter()).map(|(x, d)| x - d).collect())
        })
        .collect()
}

/// A model of contacts is not known better than this share of an effect, however many episodes there are.
const SYSTEMATIC_SHARE: f64 = 0.01;
/// Half widths of 90 % of true values, in those of the bootstrap: what the engine does wrong is the same in all episodes, which no resampling sees.
/// 1.7 was measured on 97 intervals of the benchmark's seeds 102 (designed) and 103 (passive), with one scale an episode; with one a cell, one of
/// the recorded logs' intervals missed by a fiftieth of its width. To be measured again.
const TOO_NARROW: f64 = 2.0;

/// The middle 90 % of a normal distribution reach so many standard deviations to either side.
const NORMAL_90: f64 = 1.645;

/// Moves resamples of a fit away from it, so that their spread covers what a bootstrap cannot see. Systematic errors are a share of the strengths of
/// each effect: one standard deviation is `share`, by which the model is still off where the object goes, or what the engine is never better than.
/// All of it times `width`, which is learnt from logs of other engines (see [`crate::decision::Decision::width`]).
pub fn widen(samples: &mut [Vec<f64>], fit: &Fit, share: f64, width: f64) {
    let share = SYSTEMATIC_SHARE.max(NORMAL_90 * share);
    let model = &fit.model;
    let mut systematic = vec![0.0; fit.x.len()];
    let mut first = model.tunables + model.errors;
    for part in &model.parts {
        let strengths = || part.strengths().map(|index| first + index);
        let size = strengths().map(|index| fit.x[index].powi(2)).sum::<f64>().sqrt();
        strengths().for_each(|index| systematic[index] = share * size);
        first += part.coordinates.len();
    }
    for (index, (x, systematic)) in fit.x.iter().zip(systematic).enumerate() {
        let [low, high] = middle_90(samples.iter().map(|sample| sample[index]).collect());
        let half = 0.5 * (high - low);
        if half > 0.0 {
            let by = width * TOO_NARROW.hypot(systematic / half);
            samples.iter_mut().for_each(|sample| sample[index] = x + by * (sample[index] - x));
        }
    }
}

/// The middle 90 % of values; everything where there are none.
#[must_use]
pub fn middle_90(mut values: Vec<f64>) -> [f64; 2] {
    if values.is_empty() {
        return [f64::NEG_INFINITY, f64::INFINITY];
    }
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
    [at(0.05), at(0.95)]
}

/// Decimals at which an interval still shows two digits of its half-width.
#[must_use]
pub fn decimals(interval: [f64; 2], value: f64) -> usize {
    let half = 0.5 * (interval[1] - interval[0]).abs();
    let size = if half > 0.0 && half.is_finite() { half } else { 0.1 * value.abs() };
    if size > 0.0 && size.is_finite() { (1 - size.log10().floor() as i32).clamp(0, 8) as usize } else { 2 }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;
    use crate::model::Model;

    /// r = noise − s x for one tunable: what an exact fit of a linear model leaves.
    fn linear(episodes: usize, seed: u64) -> (Fit, f64) {
        let mut rng = Seed(seed).stream(Purpose::Test, 0);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let slopes: Vec<DVector<f64>> = (0..episodes).map(|_| DVector::from_fn(20, |_, _| normal())).collect();
        let noise: Vec<DVector<f64>> = (0..episodes).map(|_| DVector::from_fn(20, |_, _| normal())).collect();
        let information = 1.0 + slopes.iter().map(DVector::norm_squared).sum::<f64>();
        let x = -slopes.iter().zip(&noise).map(|(s, n)| s.dot(n)).sum::<f64>() / information;
        let residuals = slopes.iter().zip(&noise).map(|(s, n)| n + s * x).collect();
        let fit = Fit::new(Model::nominal(1, 0), vec![x], Vec::new(), residuals, vec![slopes.into()]);
        (fit, information.recip().sqrt())
    }

    fn each(fit: &Fit) -> Vec<Range<usize>> {
        (0..fit.residuals.len()).map(|t| t..t + 1).collect()
    }

    #[test]
    fn intervals_are_as_wide_as_the_exact_ones_and_cover_the_truth() {
        let (mut covered, mut width) = (0, 0.0);
        for seed in 0..200 {
            let (fit, stddev) = linear(27, seed);
            let [low, high] =
                middle_90(bootstrap(&fit, &each(&fit), seed).unwrap().into_iter().map(|x| x[0]).collect());
            covered += u32::from(low < 0.0 && 0.0 < high);
            width += (high - low) / (2.0 * 1.645 * stddev) / 200.0;
        }
        // Binomial with 200 and 0.9: standard deviation 4.2. 27 episodes make the bootstrap a little narrow.
        assert!((165..=195).contains(&covered), "{covered}");
        assert!((0.9..1.05).contains(&width), "{width}");
    }

    #[test]
    fn a_fit_that_failed_has_no_resamples() {
        for broken in [f64::NAN, f64::INFINITY] {
            let (Fit { model, x, residuals, mut jacobian, .. }, _) = linear(5, 1);
            jacobian[0][2][3] = broken;
            let fit = Fit::new(model, x, Vec::new(), residuals, jacobian);
            assert!(bootstrap(&fit, &each(&fit), 3).is_none());
        }
    }

    #[test]
    fn widened_resamples_keep_their_place() {
        let (fit, _) = linear(27, 3);
        let samples = bootstrap(&fit, &each(&fit), 3).unwrap();
        let mut wide = samples.clone();
        widen(&mut wide, &fit, 0.0, 1.5);
        for (sample, wide) in samples.iter().zip(&wide) {
            assert!((wide[0] - fit.x[0] - 1.5 * TOO_NARROW * (sample[0] - fit.x[0])).abs() < 1e-12);
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_resamples() {
        let (fit, _) = linear(5, 1);
        assert_eq!(bootstrap(&fit, &each(&fit), 3), bootstrap(&fit, &each(&fit), 3));
        assert_ne!(bootstrap(&fit, &each(&fit), 3), bootstrap(&fit, &each(&fit), 4));
        assert_eq!(middle_90((0..101).map(f64::from).collect()), [5.0, 95.0]);
    }
}
