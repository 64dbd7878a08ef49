//! Settings of the weighted filter.

use crate::Error;
use crate::config::{MOST_ATTEMPTS, MOST_PARTICLES, require};

/// Settings of [`crate::WeightedFilter`].
///
/// Start from [`WeightedConfig::default`] and change what your problem needs. [`crate::WeightedFilter::new`] checks every value. With the
/// feature `serde` a file of settings has to name every key: a missing key is an error and does not fall back to the default.
///
/// # Defaults
///
/// | field | default | why |
/// |---|---|---|
/// | `particles_min` | 200 | Enough for mean and variance of a few parameters. |
/// | `particles_max` | 2000 | Where the belief is broad, error falls with the root of this and cost rises with it. |
/// | `kld_error`, `kld_quantile` | 0.05, 2.326 | Fox (2003): divergence of the belief at most 0.05 with probability 99 %. |
/// | `max_transitions` | 20,000 | Ten times `particles_max`: one step, a guided second one and some eight moves. |
/// | `resample_share` | 0.5 | The usual threshold: resample when half of the particles are lost. |
/// | `tempering_share` | 0.2 | Tempering costs several steps of all particles, so it starts later than resampling. |
/// | `max_bridges` | 20 | `max_transitions` ends a tempered update before. |
/// | `smoothing_discount` | 0.98 | Liu and West (2001) advise 0.95 to 0.99: each resampling moves a parameter by a seventh of its spread. |
/// | `structure_quota` | 20 | Ten likely structures then take at most a tenth of `particles_max`. |
/// | `structure_threshold` | 0.001 | A structure less likely than one in a thousand gets no protection. |
/// | `proposal_share` | 0.2 | Wrong proposals then cost a fifth of the work. |
/// | `history_limit` | 100 | A restart replays every step, so it is meant for short episodes. |
/// | `restart_transitions` | 50,000 | Replays 100 steps with 250 particles. Without [`crate::WeightedFilter::with_restart`] nothing restarts. |
/// | `restart_surprise` | 50 nats | Far beyond chance: for a Gaussian sensor of d values surprise scatters by about √(d / 2). |
///
/// # Example
///
/// ```
/// use belief::WeightedConfig;
/// let config = WeightedConfig::default().with_particles(100, 500).with_proposals(0.0);
/// assert_eq!(config.validate(), Ok(()));
/// assert_eq!(
///     config.with_smoothing(0.3).validate().unwrap_err().to_string(),
///     "belief: `smoothing_discount` is 0.3, but must be in (1/3, 1]"
/// );
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schemars", schemars(description = "Settings of `WeightedFilter`."))]
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
    /// Share of the particles below which the effective sample size makes the filter temper. The bridges then keep it
    /// there. At most `resample_share`; 0 never tempers.
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
    /// Most steps that the filter remembers for a restart. A longer episode has no restart.
    pub history_limit: usize,
    /// Transitions that a restart may simulate. 0 forbids restarts.
    pub restart_transitions: usize,
    /// Surprise above which the belief counts as lost, nats (see [`pomdp::UpdateReport::surprise`]). Positive.
    pub restart_surprise: f64,
}

impl Default for WeightedConfig {
    /// The values of the table above.
    fn default() -> Self {
        Self {
            particles_min: 200,
            particles_max: 2000,
            kld_error: 0.05,
            kld_quantile: 2.326,
            max_transitions: 20_000,
            resample_share: 0.5,
            tempering_share: 0.2,
            max_bridges: 20,
            smoothing_discount: 0.98,
            structure_quota: 20,
            structure_threshold: 0.001,
            proposal_share: 0.2,
            history_limit: 100,
            restart_transitions: 50_000,
            restart_surprise: 50.0,
        }
    }
}

/// The same settings with what belongs together changed. Values are checked by [`WeightedConfig::validate`], which
/// [`crate::WeightedFilter::new`] calls.
impl WeightedConfig {
    /// Fewest and most particles of a belief. At least 1 and 1.
    #[must_use]
    pub fn with_particles(self, particles_min: usize, particles_max: usize) -> Self {
        Self { particles_min, particles_max, ..self }
    }

    /// Error ε of the Kullback–Leibler divergence, and the normal quantile of the probability with which it holds (Fox 2003). They decide
    /// how many particles there are between the fewest and the most.
    #[must_use]
    pub fn with_kld(self, kld_error: f64, kld_quantile: f64) -> Self {
        Self { kld_error, kld_quantile, ..self }
    }

    /// Most transitions that one update may simulate. At least as many as the most particles.
    #[must_use]
    pub fn with_max_transitions(self, max_transitions: usize) -> Self {
        Self { max_transitions, ..self }
    }

    /// Share of the particles below which the effective sample size makes the filter resample, in [0, 1].
    #[must_use]
    pub fn with_resampling(self, resample_share: f64) -> Self {
        Self { resample_share, ..self }
    }

    /// Share of the particles below which the effective sample size makes the filter temper, and the most bridges. The share is at most
    /// that of resampling; 0 switches tempering off.
    #[must_use]
    pub fn with_tempering(self, tempering_share: f64, max_bridges: usize) -> Self {
        Self { tempering_share, max_bridges, ..self }
    }

    /// Discount δ of Liu and West (2001), in (1/3, 1]. 1 switches smoothing off.
    #[must_use]
    pub fn with_smoothing(self, smoothing_discount: f64) -> Self {
        Self { smoothing_discount, ..self }
    }

    /// Particles that a structure keeps while it is more likely than `structure_threshold`, which lies in [0, 1].
    #[must_use]
    pub fn with_structures(self, structure_quota: usize, structure_threshold: f64) -> Self {
        Self { structure_quota, structure_threshold, ..self }
    }

    /// Largest share of the simulated particles that are outside proposals, in [0, 1). 0 ignores them.
    #[must_use]
    pub fn with_proposals(self, proposal_share: f64) -> Self {
        Self { proposal_share, ..self }
    }

    /// Most steps that are remembered for a restart, the transitions that it may simulate, and the surprise above which a belief is taken
    /// for lost, nats.
    #[must_use]
    pub fn with_restarts(self, history_limit: usize, restart_transitions: usize, restart_surprise: f64) -> Self {
        Self { history_limit, restart_transitions, restart_surprise, ..self }
    }
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
    fn defaults_are_valid_and_each_builder_changes_its_own_fields() {
        let d = WeightedConfig::default;
        assert_eq!(d().validate(), Ok(()));
        assert_eq!(d().with_particles(7, 8), WeightedConfig { particles_min: 7, particles_max: 8, ..d() });
        assert_eq!(d().with_kld(0.1, 1.0), WeightedConfig { kld_error: 0.1, kld_quantile: 1.0, ..d() });
        assert_eq!(d().with_max_transitions(7), WeightedConfig { max_transitions: 7, ..d() });
        assert_eq!(d().with_resampling(0.7), WeightedConfig { resample_share: 0.7, ..d() });
        assert_eq!(d().with_tempering(0.1, 3), WeightedConfig { tempering_share: 0.1, max_bridges: 3, ..d() });
        assert_eq!(d().with_smoothing(0.9), WeightedConfig { smoothing_discount: 0.9, ..d() });
        let quotas = WeightedConfig { structure_quota: 7, structure_threshold: 0.1, ..d() };
        assert_eq!(d().with_structures(7, 0.1), quotas);
        assert_eq!(d().with_proposals(0.1), WeightedConfig { proposal_share: 0.1, ..d() });
        let restarts = WeightedConfig { history_limit: 7, restart_transitions: 8, restart_surprise: 9.0, ..d() };
        assert_eq!(d().with_restarts(7, 8, 9.0), restarts);
    }

    #[test]
    fn shrinkage_keeps_the_variance() {
        // δ = 0.98: a = 1.94 / 1.96, and a² + h² = 1.
        let (a, h) = config().shrinkage();
        assert!((a - 1.94 / 1.96).abs() < 1e-15 && (a * a + h * h - 1.0).abs() < 1e-15);
        assert_eq!(WeightedConfig { smoothing_discount: 1.0, ..config() }.shrinkage(), (1.0, 0.0));
    }
}
