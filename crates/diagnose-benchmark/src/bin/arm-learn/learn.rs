//! From logs whose truth is known to how the diagnosis of arms decides.

use std::collections::BTreeMap;

use arm_diagnosis::{
    Decision, EFFECT_FEATURES, FORM_FEATURES, LOG_FEATURES, Logistic, effect_features, form_features, log_features,
};
use diagnose_benchmark::choice::{self, Choice};
use nalgebra::DVector;

use crate::Case;

/// Prior variance of an offset: hardly any prior. Those of weights are 1, in units of the features' standard deviations.
const OFFSET: f64 = 1e6;

/// All regressions, and the widths of intervals.
pub(crate) fn learn<'a>(cases: impl Iterator<Item = &'a Case> + Clone, learnt_from: Vec<String>) -> Decision {
    let effects = cases.clone().flat_map(|case| {
        let left = &case.answer.leftover;
        case.answer.considered.iter().map(move |one| (effect_features(&one.findings, left), case.truth.is_kin(one)))
    });
    let right = logistic(&EFFECT_FEATURES, &effects.collect::<Vec<_>>());
    let forms = cases.clone().filter(|case| case.truth.is_friction()).flat_map(|case| {
        let left = &case.answer.leftover;
        let kin = case.answer.considered.iter().filter(|one| case.truth.is_kin(one));
        kin.map(move |one| (form_features(&one.findings, &one.name, left), case.truth.is(one)))
    });
    let form = logistic(&FORM_FEATURES, &forms.collect::<Vec<_>>());
    // Where an effect of the catalogue is hidden nothing can be learnt about others; and what does not show is nothing.
    let logs = cases.clone().filter(|case| case.truth.is_none() || (case.truth.is_outside() && case.truth.shows()));
    let missing = logs.map(|case| (log_features(&case.answer.leftover), case.truth.is_outside()));
    let missing = logistic(&LOG_FEATURES, &missing.collect::<Vec<_>>());
    let off = cases.flat_map(|case| case.answer.off.values().map(|off| (case.truth.effect.clone(), off.abs())));
    Decision { learnt_from, right, form, widen: widths(off), missing }
}

/// A logistic regression: a choice between an alternative with features and one without.
fn logistic(names: &[&str], examples: &[(Vec<f64>, bool)]) -> Logistic {
    let count = examples.len().max(1) as f64;
    let mean = |i: usize| examples.iter().map(|(row, _)| row[i]).sum::<f64>() / count;
    let center: Vec<f64> = (0..names.len()).map(mean).collect();
    let spread = (0..names.len()).map(|i| {
        let squares = examples.iter().map(|(row, _)| (row[i] - center[i]).powi(2)).sum::<f64>();
        (squares / count).sqrt().max(1e-3)
    });
    let spread = spread.collect();
    let mut fitted =
        Logistic { features: names.iter().map(ToString::to_string).collect(), spread, center, weights: Vec::new() };
    let choice = |(features, is): &(Vec<f64>, bool)| {
        let row = DVector::from_vec(fitted.row(features));
        let none = DVector::zeros(row.len());
        Choice { alternatives: vec![row, none], chosen: vec![usize::from(!is)], weight: 1.0 }
    };
    let choices: Vec<Choice> = examples.iter().map(choice).collect();
    let mut priors = vec![(0.0, 1.0); names.len() + 1];
    priors[0].1 = OFFSET;
    fitted.weights = choice::fit(&choices, &priors).as_slice().to_vec();
    fitted
}

/// Factors for which nine in ten of the values lie within, from how far off values were in halves of their intervals (split conformal prediction, Vovk et al.
/// 2005): by effect where there are enough of them.
fn widths(off: impl Iterator<Item = (String, f64)>) -> BTreeMap<String, f64> {
    /// Fewer do not tell the ninth of ten.
    const ENOUGH: usize = 10;
    let mut by: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (effect, off) in off.filter(|(_, off)| off.is_finite()) {
        by.entry(effect).or_default().push(off);
        by.entry("all".into()).or_default().push(off);
    }
    by.retain(|_, off| off.len() >= ENOUGH);
    let ninth = |mut off: Vec<f64>| {
        off.sort_by(f64::total_cmp);
        let place = (0.9 * (off.len() + 1) as f64).ceil() as usize;
        off[place.min(off.len()) - 1].max(0.5)
    };
    by.into_iter().map(|(effect, off)| (effect, ninth(off))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_logistic_regression_finds_the_odds_of_two_groups() {
        // 30 of 40 on one side, 10 of 40 on the other: odds of three and a third, less what the prior takes.
        let example = |x: f64, yes: usize| (0..40).map(move |i| (vec![x], i < yes));
        let examples: Vec<(Vec<f64>, bool)> = example(1.0, 30).chain(example(-1.0, 10)).collect();
        let fitted = logistic(&["x"], &examples);
        let (up, down) = (fitted.probability(&[1.0]), fitted.probability(&[-1.0]));
        assert!((up - 0.75).abs() < 0.02 && (down - 0.25).abs() < 0.02, "{up} {down}");
    }
}
