//! What a log says of the coefficients of its model, for values and intervals.
//!
//! Standard deviations are the larger of the model's own and of a sandwich over pieces (Liang and Zeger 1986), as rows of a piece err alike. The model's own
//! are averaged over how wrong the masses of the file may be (Hoeting et al. 1999): what the log does not say of that, it does not say of a payload either.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::fit::Fit;
use crate::masses::{MassFactors, stddevs};
use crate::prepared::Prepared;
use crate::search::Found;

/// What is known of the coefficients of a fit, in the order of its columns.
pub(crate) struct Estimate {
    pub(crate) mean: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
    /// Coefficients that would be negative and cannot be: place, and the 95 % quantile above 0. Their mean is 0.
    pub(crate) at_zero: AtZero,
}

/// A number that cannot be negative and would be, with its 95 % quantile above 0.
type AtZero = Vec<(usize, f64)>;

impl Estimate {
    /// Of the model that was found. None where nothing can be fitted.
    pub(crate) fn new(prepared: &Prepared, found: &Found) -> Option<Self> {
        let count = found.fit.columns.len();
        let model = found.fit.covariance(&stddevs(&found.catalogue, &found.fit.columns, &found.mass_factors));
        let sandwich = sandwich(prepared, found, &found.fit, &model);
        let wider = DVector::from_fn(count, |i, _| (sandwich[(i, i)] / model[(i, i)].max(1e-300)).max(1.0).sqrt());
        let (kept, at_zero) = non_negative(found, &wider)?;
        let (own_mean, own) = averaged(found, &kept)?;
        let mut mean = DVector::zeros(count);
        let mut covariance = DMatrix::zeros(count, count);
        let place = |column: &usize| found.fit.columns.iter().position(|other| other == column).unwrap_or(0);
        let places: Vec<usize> = kept.iter().map(place).collect();
        for (i, a) in places.iter().enumerate() {
            mean[*a] = own_mean[i];
            for (j, b) in places.iter().enumerate() {
                covariance[(*a, *b)] = own[(i, j)] * wider[*a] * wider[*b];
            }
        }
        let at_zero = at_zero.into_iter().map(|(column, most)| (place(&column), most)).collect();
        Some(Self { mean, covariance, at_zero })
    }
}

/// Prior standard deviations. A payload may be as heavy as any: the size that makes it most probable would draw its mass towards that size.
fn spreads(found: &Found, columns: &[usize], factors: &MassFactors) -> Vec<f64> {
    let narrow = stddevs(&found.catalogue, columns, factors).into_iter().zip(columns);
    narrow.map(|(stddev, column)| stddev * found.catalogue.wider(*column)).collect()
}

/// The columns without those whose coefficient would be negative and cannot be, and these with a 95 % quantile above 0, given that the others that are left out are 0.
/// One leaves at a time, the most negative one, and comes back where the others that left no longer ask for it to be negative.
fn non_negative(found: &Found, wider: &DVector<f64>) -> Option<(Vec<usize>, AtZero)> {
    /// Steps; each set of columns explains more than the one before, so this is never reached.
    const MOST: usize = 200;
    let all = &found.fit.columns;
    let positive = |column: usize| found.catalogue.features[column].positive;
    let mut kept = all.clone();
    for _ in 0..MOST {
        let own = spreads(found, &kept, &found.mass_factors);
        let fit = Fit::new(&found.all, kept.clone(), &own)?;
        let covariance = fit.covariance(&own);
        let distance = |place: usize| fit.coefficients[place] / covariance[(place, place)].sqrt();
        let worst = (0..kept.len())
            .filter(|place| positive(kept[*place]) && fit.coefficients[*place] < 0.0)
            .min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        if let Some(place) = worst {
            kept.remove(place);
            continue;
        }
        let mut at_zero = AtZero::new();
        let mut back = None;
        for (place, column) in all.iter().enumerate().filter(|(_, column)| !kept.contains(column)) {
            let spread = spreads(found, &[*column], &found.mass_factors)[0];
            let (_, alone) = fit.gain(&found.all, &own, &[(*column, spread)])?;
            let [mean, stddev] = alone[0];
            if mean > 1e-9 * spread && back.is_none_or(|(_, best)| mean / stddev > best) {
                back = Some((*column, mean / stddev));
            }
            at_zero.push((*column, above_zero(mean, stddev * wider[place])));
        }
        match back {
            // In the order of the fit, so that the way here leaves no trace.
            Some((column, _)) => {
                kept = all.iter().copied().filter(|other| *other == column || kept.contains(other)).collect();
            }
            None => return Some((kept, at_zero)),
        }
    }
    None
}

/// 95 % quantile of a normal distribution cut off at 0.
fn above_zero(mean: f64, stddev: f64) -> f64 {
    /// Standard deviations below 0 beyond which the tail is no number any more.
    const FAR: f64 = 30.0;
    const REST: f64 = 0.05;
    let z = (mean / stddev).max(-FAR);
    stddev * (z - Normal::standard().inverse_cdf(REST * Normal::standard().cdf(z)))
}

/// Means and covariance over all factors of masses, each as probable as the log and the prior say.
fn averaged(found: &Found, columns: &[usize]) -> Option<(DVector<f64>, DMatrix<f64>)> {
    /// In ln: what is less probable than that is left out.
    const NEXT_TO_NOTHING: f64 = 7.0;
    let all: Vec<MassFactors> = MassFactors::all().collect();
    let fits: Vec<(f64, MassFactors, Fit)> = all
        .into_par_iter()
        .filter_map(|factors| {
            let fit = Fit::new(&found.all, columns.to_vec(), &spreads(found, columns, &factors))?;
            Some((fit.log_evidence + factors.log_prior(), factors, fit))
        })
        .collect();
    let most = fits.iter().map(|(log, _, _)| *log).max_by(f64::total_cmp)?;
    let (mut total, mut mean) = (0.0, DVector::zeros(columns.len()));
    let mut square: DMatrix<f64> = DMatrix::zeros(columns.len(), columns.len());
    for (log, factors, fit) in fits.iter().filter(|(log, _, _)| most - log < NEXT_TO_NOTHING) {
        let weight = (log - most).exp();
        total += weight;
        mean += &fit.coefficients * weight;
        let own = fit.covariance(&spreads(found, columns, factors));
        square += (own + &fit.coefficients * fit.coefficients.transpose()) * weight;
    }
    mean /= total;
    let covariance = square / total - &mean * mean.transpose();
    Some((mean, covariance))
}

fn sandwich(prepared: &Prepared, found: &Found, fit: &Fit, model: &DMatrix<f64>) -> DMatrix<f64> {
    let rows = &found.design.fitted;
    let left = fit.left(&found.all, rows);
    let mut scores: DMatrix<f64> = DMatrix::zeros(fit.columns.len(), prepared.pieces);
    for (i, column) in fit.columns.iter().enumerate() {
        let white = &found.all.white[*column];
        let start = white.joint.map_or(0, |joint| rows.of(joint).start);
        for (k, value) in white.values.iter().enumerate() {
            let row = &rows.rows[start + k];
            scores[(i, prepared.piece[row.window])] += value * left[start + k];
        }
    }
    let pieces = (0..prepared.pieces).filter(|piece| scores.column(*piece).amax() > 0.0).count() as f64;
    let outer = &scores * scores.transpose() * (pieces / (pieces - 1.0).max(1.0));
    model * outer * model
}

#[cfg(test)]
mod tests {
    use super::above_zero;

    #[test]
    fn the_quantile_above_zero_is_that_of_a_half_normal_distribution_and_that_of_an_exponential_one_far_out() {
        // Half-normal: erf(q / √2) = 0.95. Far below 0 the rest is nearly exponential, of mean s / |z|.
        assert!((above_zero(0.0, 2.0) - 2.0 * 1.959_964).abs() < 1e-5);
        assert!((above_zero(100.0, 2.0) - (100.0 + 2.0 * 1.644_854)).abs() < 1e-5);
        assert!((above_zero(-40.0, 2.0) / (20.0_f64.ln() * 2.0 / 20.0) - 1.0).abs() < 0.01);
        assert!((above_zero(-10.0, 2.0) - 1.098_8).abs() < 1e-4);
    }
}
