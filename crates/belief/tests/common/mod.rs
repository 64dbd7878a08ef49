//! What the tests of the weighted filter share.

#![allow(dead_code, reason = "each test program uses a part of it")]

use belief::{Particles, Trackable, WeightedConfig, WeightedFilter};
use pomdp::{Proposals, Rng, UpdateReport, Updater as _};

/// A fixed number of particles, plain settings: no tempering, no proposals, no restarts.
pub(crate) fn config(particles: usize) -> WeightedConfig {
    WeightedConfig {
        particles_min: particles,
        particles_max: particles,
        kld_error: 0.05,
        kld_quantile: 2.326,
        max_transitions: 100 * particles,
        resample_share: 0.5,
        tempering_share: 0.0,
        max_bridges: 0,
        smoothing_discount: 0.98,
        structure_quota: 0,
        structure_threshold: 0.0,
        proposal_share: 0.0,
        history_limit: 0,
        restart_transitions: 0,
        restart_surprise: 1e9,
    }
}

/// One belief led through a history without proposals.
pub(crate) fn track<M>(
    filter: &mut WeightedFilter<'_, M>,
    model: &M,
    start: Vec<M::State>,
    history: &[(M::Action, M::Observation)],
    rng: &mut Rng,
) -> (Particles<M::State>, Vec<UpdateReport>)
where
    M: Trackable,
{
    let mut belief = Particles::uniform(start).unwrap();
    let mut reports = Vec::new();
    filter.reset();
    for (action, observation) in history {
        let (next, report) = filter.update(model, belief, action, observation, Proposals::none(), rng).unwrap();
        belief = next;
        reports.push(report);
    }
    (belief, reports)
}

/// Mean and its standard error.
pub(crate) fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Fails where the mean of `values` is more than `most` standard errors from `expected`.
pub(crate) fn assert_mean(values: &[f64], expected: f64, most: f64, what: &str) {
    let (mean, error) = mean_and_error(values);
    println!("{what}: {mean} ± {error} for {expected} (n = {})", values.len());
    assert!((mean - expected).abs() <= most * error, "{what}: {mean} ± {error} instead of {expected}");
}

/// Weighted mean and variance of `value` over a belief.
pub(crate) fn moments<S>(belief: &Particles<S>, value: impl Fn(&S) -> Option<f64>) -> (f64, f64) {
    let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
    for (state, w) in belief.iter() {
        if let Some(x) = value(state) {
            (total, first, second) = (total + w, first + w * x, second + w * x * x);
        }
    }
    let mean = first / total;
    (mean, second / total - mean * mean)
}
