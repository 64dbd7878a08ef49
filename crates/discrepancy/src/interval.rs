//! Intervals of fitted parameters, by a bootstrap over episodes.
//!
//! Each resample takes as many episodes as there are, with replacement, draws the prior's mean from the prior, and makes one Newton step
//! from the fit, as if residuals were linear. Laplace's intervals are too narrow where residuals are not as white as they should be; episodes are independent
//! whatever happens within them. The drawn mean stands for what no episode tells (the errors of the engine, which are the same in all): for a linear model the
//! resamples are then as wide as the posterior (randomize-then-optimize: Bardsley et al., SIAM J. Sci. Comput. 36, 2014).

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use pomdp::{Purpose, Seed};
use rand_distr::{Distribution as _, StandardNormal, Uniform};

use crate::fit::Fit;
use crate::linear::Linear;

/// Resamples.
const RESAMPLES: usize = 500;
/// How many times as far a step may go as one of least squares. Where cells are far from explained that one goes half of the way.
const LONGEST: f64 = 4.0;

/// Coordinates of the resamples, each as long as the fit's; `None` for a fit that failed, or without coordinates or episodes. `groups`: places of the
/// pieces of each episode.
#[must_use]
pub fn bootstrap(fit: &Fit, groups: &[Range<usize>], seed: u64) -> Option<Vec<Vec<f64>>> {
    let (n, episodes) = (fit.x.len(), groups.len());
    if n == 0 || episodes == 0 || fit.log_evidence() == f64::NEG_INFINITY {
        return None;
    }
    let pieces = Linear::new(&fit.residuals, &fit.jacobian.iter().collect::<Vec<_>>()).by_piece(fit.residuals.len());
    // At the optimum it balances the prior: a resample moves by how far its own differs.
    let whole: DVector<f64> = pieces.iter().map(|piece| &piece.slope).sum();
    let mut rng = Seed(seed).stream(Purpose::Statistics, 0);
    let pick = Uniform::new(0, episodes).ok()?;
    (0..RESAMPLES)
        .map(|_| {
            let (mut gram, mut hessian) = (DMatrix::identity(n, n), DMatrix::identity(n, n));
            let mut slope = -&whole;
            for _ in 0..episodes {
                for piece in &pieces[groups[pick.sample(&mut rng)].clone()] {
                    gram += &piece.gram;
                    hessian += &piece.hessian;
                    slope += &piece.slope;
                }
            }
            for slope in &mut slope {
                let z: f64 = StandardNormal.sample(&mut rng);
                *slope -= z;
            }
            let delta = bounded(&gram, &hessian)?.solve(&slope);
            Some(fit.x.iter().zip(delta.iter()).map(|(x, d)| x - d).collect())
        })
        .collect()
}

/// As much of the change of weights as leaves a step at most `LONGEST` times as long as one without: far from its own optimum a resample may bend the other way.
fn bounded(gram: &DMatrix<f64>, hessian: &DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let part = |share: f64| gram * (1.0 - share) + hessian * share;
    let bends = |share: &f64| (part(*share) - gram / LONGEST).cholesky().is_some();
    part([1.0, 0.75, 0.5, 0.25].into_iter().find(bends).unwrap_or(0.0)).cholesky()
}

/// A model of contacts is not known better than this share of an effect, however many episodes there are.
const SYSTEMATIC_SHARE: f64 = 0.01;
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
            let by = width * half.hypot(systematic) / half;
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
    use std::sync::Arc;

    use pomdp::{Purpose, Seed};

    use super::*;
    use crate::cells::Cells;
    use crate::likelihood::Stack;
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
    fn pieces_of_an_episode_are_drawn_together() {
        let (fit, _) = linear(12, 5);
        let pairs: Vec<Range<usize>> = (0..6).map(|t| 2 * t..2 * t + 2).collect();
        let both = |stack: &Stack| -> Stack {
            let joined = |pair: &Range<usize>| {
                let values = stack[pair.clone()].iter().flat_map(|piece| piece.iter().copied());
                DVector::from_iterator(40, values)
            };
            let cells = Arc::new(Cells { of: (0..40).map(|row| row / 20).collect(), count: 2, ..Cells::default() });
            Stack::new(pairs.iter().map(joined).collect(), vec![cells; 6])
        };
        let Fit { model, x, residuals, jacobian, .. } = fit.clone();
        let joined = Fit::new(model, x, Vec::new(), both(&residuals), jacobian.iter().map(both).collect());
        let [a, b] = [bootstrap(&fit, &pairs, 3).unwrap(), bootstrap(&joined, &each(&joined), 3).unwrap()];
        for (a, b) in a.iter().zip(&b) {
            assert!((a[0] - b[0]).abs() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn a_step_goes_as_far_as_the_change_of_weights_says_and_no_farther_than_is_bounded() {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let step = |hessian: f64| 1.0 / bounded(&one(1.0), &one(hessian)).unwrap().l()[(0, 0)].powi(2);
        assert!((step(0.5) - 2.0).abs() < 1e-12);
        for hessian in [0.2, 0.01, 0.0, -0.5, -100.0] {
            assert!((1.0..=LONGEST).contains(&step(hessian)), "{hessian}: {}", step(hessian));
        }
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
            assert!((wide[0] - fit.x[0] - 1.5 * (sample[0] - fit.x[0])).abs() < 1e-12);
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
