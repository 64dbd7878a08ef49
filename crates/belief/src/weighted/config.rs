//! Settings of the weighted filter. Every key is required: a scenario states what it runs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::config::{MOST_ATTEMPTS, MOST_PARTICLES, require};

/// Settings of [`crate::WeightedFilter`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WeightedConfig {
    /// Fewest particles of a resampled belief.
    pub particles_min: usize,
    /// Most particles of a belief.
    pub particles_max: usize,
    /// Allowed error ε of the Kullback–Leibler divergence that decides how many particles lie between the two (Fox 2003).
    pub kld_error: f64,
    /// Standard normal quantile of the probability with which that error holds: 2.326 for 99 %.
    pub kld_quantile: f64,
    /// Most transitions that one update may simulate, restarts apart.
    pub max_transitions: usize,
    /// Share of the particles below which the effective sample size makes the filter resample, in [0, 1]. 1 resamples in every update.
    pub resample_share: f64,
    /// Share of the particles below which the effective sample size makes it temper, and which bridges then hold; at most
    /// `resample_share`. 0 never tempers.
    pub tempering_share: f64,
    /// Most bridges of a tempered update.
    pub max_bridges: usize,
    /// Discount δ of Liu and West (2001) for static parameters, in (1/3, 1]: 0.95 to 0.99 in the literature, 1 moves nothing.
    pub smoothing_discount: f64,
    /// Particles that a likely structure keeps when the belief is resampled. Quotas take at most half of the particles.
    pub structure_quota: usize,
    /// Probability above which a structure is a likely one, in [0, 1].
    pub structure_threshold: f64,
    /// Largest share of the simulated particles that outside proposals make up, in [0, 1). 0 ignores them.
    pub proposal_share: f64,
    /// Most steps that the filter remembers for a restart. In a longer episode there is none.
    pub history_limit: usize,
    /// Transitions that a restart may simulate. 0 forbids restarts.
    pub restart_transitions: usize,
    /// Surprise above which the belief is taken for lost, nats (see [`pomdp::UpdateReport::surprise`]). Positive.
    pub restart_surprise: f64,
}

impl WeightedConfig {
    /// Checks every value against its limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] with the key, its value and the limit.
    pub fn validate(&self) -> Result<(), Error> {
        let c = self;
        require(c.particles_min >= 1, "particles_min", &c.particles_min, "at least 1")?;
        let limit = format!("at least particles_min = {}", c.particles_min);
        require(c.particles_max >= c.particles_min, "particles_max", &c.particles_max, limit)?;
        let limit = format!("at most {MOST_PARTICLES}");
        require(c.particles_max <= MOST_PARTICLES, "particles_max", &c.particles_max, limit)?;
        require(c.kld_error > 0.0, "kld_error", &c.kld_error, "above 0")?;
        require(c.kld_quantile >= 0.0 && c.kld_quantile <= 10.0, "kld_quantile", &c.kld_quantile, "in [0, 10]")?;
        let limit = format!("at least particles_max = {}", c.particles_max);
        require(c.max_transitions >= c.particles_max, "max_transitions", &c.max_transitions, limit)?;
        let limit = format!("at most {MOST_ATTEMPTS}");
        require(c.max_transitions <= MOST_ATTEMPTS, "max_transitions", &c.max_transitions, limit)?;
        require((0.0..=1.0).contains(&c.resample_share), "resample_share", &c.resample_share, "in [0, 1]")?;
        let limit = format!("in [0, resample_share = {}]", c.resample_share);
        let within = (0.0..=c.resample_share).contains(&c.tempering_share);
        require(within, "tempering_share", &c.tempering_share, limit)?;
        let discount = c.smoothing_discount;
        require(discount > 1.0 / 3.0 && discount <= 1.0, "smoothing_discount", &discount, "in (1/3, 1]")?;
        let threshold = &c.structure_threshold;
        require((0.0..=1.0).contains(threshold), "structure_threshold", threshold, "in [0, 1]")?;
        require((0.0..1.0).contains(&c.proposal_share), "proposal_share", &c.proposal_share, "in [0, 1)")?;
        require(c.restart_surprise > 0.0, "restart_surprise", &c.restart_surprise, "above 0")
    }

    /// Shrinkage a = (3δ − 1) / (2δ) and width h = √(1 − a²) of the kernel (Liu and West 2001).
    pub(crate) fn shrinkage(&self) -> (f64, f64) {
        let a = (3.0 * self.smoothing_discount - 1.0) / (2.0 * self.smoothing_discount);
        (a, (1.0 - a * a).max(0.0).sqrt())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    const TEXT: &str = "
        particles_min = 100
        particles_max = 1000
        kld_error = 0.05
        kld_quantile = 2.326
        max_transitions = 10000
        resample_share = 0.5
        tempering_share = 0.2
        max_bridges = 10
        smoothing_discount = 0.98
        structure_quota = 20
        structure_threshold = 0.001
        proposal_share = 0.2
        history_limit = 50
        restart_transitions = 50000
        restart_surprise = 50.0
    ";

    pub(crate) fn config() -> WeightedConfig {
        toml::from_str(TEXT).unwrap()
    }

    #[test]
    fn a_scenario_file_sets_every_key_and_a_misspelt_or_missing_one_is_named() {
        assert_eq!(toml::from_str::<WeightedConfig>(&toml::to_string(&config()).unwrap()).unwrap(), config());
        let misspelt = toml::from_str::<WeightedConfig>(&format!("{TEXT}\nquota = 3")).unwrap_err().to_string();
        assert!(misspelt.contains("unknown field `quota`"), "{misspelt}");
        let missing = toml::from_str::<WeightedConfig>(&TEXT.replace("max_bridges = 10", "")).unwrap_err().to_string();
        assert!(missing.contains("missing field `max_bridges`"), "{missing}");
    }

    #[test]
    fn values_outside_their_limits_name_key_value_and_limit() {
        let message = |change: fn(&mut WeightedConfig)| {
            let mut config = config();
            change(&mut config);
            config.validate().unwrap_err().to_string()
        };
        assert_eq!(config().validate(), Ok(()));
        type Change = fn(&mut WeightedConfig);
        let cases: [(Change, &str); 13] = [
            (|c| c.particles_min = 0, "`particles_min` is 0, but must be at least 1"),
            (|c| c.particles_max = 99, "`particles_max` is 99, but must be at least particles_min = 100"),
            (|c| c.kld_error = 0.0, "`kld_error` is 0, but must be above 0"),
            (|c| c.kld_quantile = f64::NAN, "`kld_quantile` is NaN, but must be in [0, 10]"),
            (|c| c.max_transitions = 999, "`max_transitions` is 999, but must be at least particles_max = 1000"),
            (|c| c.resample_share = 1.1, "`resample_share` is 1.1, but must be in [0, 1]"),
            (|c| c.tempering_share = 0.6, "`tempering_share` is 0.6, but must be in [0, resample_share = 0.5]"),
            (|c| c.smoothing_discount = 0.3, "`smoothing_discount` is 0.3, but must be in (1/3, 1]"),
            (|c| c.smoothing_discount = 1.01, "`smoothing_discount` is 1.01, but must be in (1/3, 1]"),
            (|c| c.structure_threshold = -0.1, "`structure_threshold` is -0.1, but must be in [0, 1]"),
            (|c| c.proposal_share = 1.0, "`proposal_share` is 1, but must be in [0, 1)"),
            (|c| c.restart_surprise = 0.0, "`restart_surprise` is 0, but must be above 0"),
            (|c| c.restart_surprise = f64::NAN, "`restart_surprise` is NaN, but must be above 0"),
        ];
        for (change, expected) in cases {
            assert_eq!(message(change), format!("belief: {expected}"));
        }
    }

    #[test]
    fn shrinkage_keeps_the_variance() {
        // δ = 0.98: a = 1.94 / 1.96, and a² + h² = 1.
        let (a, h) = config().shrinkage();
        assert!((a - 1.94 / 1.96).abs() < 1e-15 && (a * a + h * h - 1.0).abs() < 1e-15);
        assert_eq!(WeightedConfig { smoothing_discount: 1.0, ..config() }.shrinkage(), (1.0, 0.0));
    }
}
