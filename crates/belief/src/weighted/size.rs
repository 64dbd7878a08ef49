//! How many particles a belief needs.

use std::collections::BTreeSet;

use pomdp::Rng;
use rand::RngExt as _;

use super::config::WeightedConfig;

/// Particles needed where `bins` cells are occupied (Fox 2003, equation 12). They keep the Kullback–Leibler divergence
/// to the binned distribution below `error`, with the probability of the normal quantile `quantile`. It is the χ²
/// quantile of Wilson and Hilferty over 2ε.
pub(crate) fn kld_bound(bins: usize, error: f64, quantile: f64) -> f64 {
    if bins < 2 {
        return 1.0;
    }
    let k = (bins - 1) as f64;
    let c = 2.0 / (9.0 * k);
    k / (2.0 * error) * (1.0 - c + c.sqrt() * quantile).powi(3)
}

/// Number of particles for the distribution `weights` over the cells `cell(i)`: draws from it until their number exceeds the bound for the
/// cells that they fell into.
pub(crate) fn wanted<C: Ord>(
    config: &WeightedConfig,
    weights: &[f64],
    cell: impl Fn(usize) -> C,
    rng: &mut Rng,
) -> usize {
    let mut cumulative = Vec::with_capacity(weights.len());
    let mut total = 0.0;
    for w in weights {
        total += w;
        cumulative.push(total);
    }
    let last = cumulative.partition_point(|&sum| sum < total);
    let mut cells = BTreeSet::new();
    let mut seen = vec![false; weights.len()];
    let mut bound = 1.0;
    for drawn in 1..=config.particles_max {
        let draw = rng.random::<f64>() * total;
        let index = cumulative.partition_point(|&sum| sum <= draw).min(last);
        if !std::mem::replace(&mut seen[index], true) && cells.insert(cell(index)) {
            bound = kld_bound(cells.len(), config.kld_error, config.kld_quantile);
        }
        if drawn >= config.particles_min && drawn as f64 >= bound {
            return drawn;
        }
    }
    config.particles_max
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};

    use super::*;
    use crate::weighted::config::tests::config;

    #[test]
    fn the_bound_is_the_chi_squared_quantile() {
        // χ² with 10 degrees of freedom exceeds 23.209 with probability 0.01; Wilson and Hilferty are within 0.2 %.
        assert!((kld_bound(11, 0.05, 2.326_348) / (23.209 / 0.1) - 1.0).abs() < 2e-3);
        assert_eq!(kld_bound(1, 0.05, 2.3), 1.0);
    }

    #[test]
    fn the_number_grows_with_the_cells_and_keeps_its_limits() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let config = WeightedConfig { particles_min: 50, particles_max: 2000, ..config() };
        let weights = vec![1e-3; 1000];
        let mut count = |cells: usize| wanted(&config, &weights, |i| i % cells, &mut rng);
        assert_eq!(count(1), 50);
        // Once all 11 cells are occupied, which takes far fewer draws, the bound for 11 decides.
        assert_eq!(count(11), kld_bound(11, 0.05, 2.326).ceil() as usize);
        assert!((count(50) as f64 / kld_bound(50, 0.05, 2.326) - 1.0).abs() < 0.1);
        assert_eq!(count(1000), 2000);
    }
}
