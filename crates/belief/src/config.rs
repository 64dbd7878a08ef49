//! Settings of the rejection filter.

use crate::Error;

/// Limits against typing errors: more would take all memory, or all night.
pub(crate) const MOST_PARTICLES: usize = 1_000_000;
pub(crate) const MOST_ATTEMPTS: usize = 100_000_000;

/// Settings of [`crate::RejectionFilter`].
///
/// Start from [`RejectionConfig::default`] and change what your problem needs. [`crate::RejectionFilter::new`] checks every value. With the
/// feature `serde` a file of settings has to name every key: a missing key is an error and does not fall back to the default.
///
/// # Defaults
///
/// | field | default | why |
/// |---|---|---|
/// | `particles` | 1000 | A probability of one half then has a standard error of 1.6 %. |
/// | `max_attempts` | 20,000 | The belief stays full down to an acceptance of one attempt in 15. |
/// | `noise_share` | 0.25 | Most attempts draw from the belief itself; noise adds variety only where these run out. |
/// | `proposal_share` | 0.5 | Proposals can be wrong, so at least half of the belief comes from simulation. |
///
/// # Example
///
/// ```
/// use belief::RejectionConfig;
/// let config = RejectionConfig::default().with_particles(500).with_proposals(0.0);
/// assert_eq!(config.validate(), Ok(()));
/// assert_eq!(
///     config.with_particles(0).validate().unwrap_err().to_string(),
///     "belief: `particles` is 0, but must be at least 1"
/// );
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(feature = "schemars", schemars(description = "Settings of `RejectionFilter`."))]
pub struct RejectionConfig {
    /// Particles of a belief: N.
    pub particles: usize,
    /// Most transitions that one update may simulate.
    pub max_attempts: usize,
    /// Share of `max_attempts` that is kept for perturbed particles, in [0, 1). Zero means no reinvigoration by noise.
    pub noise_share: f64,
    /// Largest share of a belief that comes from outside proposals while simulation accepts anything, in [0, 1). Zero
    /// ignores proposals, even if nothing else explains the observation.
    pub proposal_share: f64,
}

impl Default for RejectionConfig {
    /// The values of the table above.
    fn default() -> Self {
        Self { particles: 1000, max_attempts: 20_000, noise_share: 0.25, proposal_share: 0.5 }
    }
}

/// The same settings with one of them changed. Values are checked by [`RejectionConfig::validate`], which
/// [`crate::RejectionFilter::new`] calls.
impl RejectionConfig {
    /// Particles of a belief. At least 1.
    #[must_use]
    pub fn with_particles(self, particles: usize) -> Self {
        Self { particles, ..self }
    }

    /// Most transitions that one update may simulate. At least as many as there are particles.
    #[must_use]
    pub fn with_max_attempts(self, max_attempts: usize) -> Self {
        Self { max_attempts, ..self }
    }

    /// Share of the attempts that is kept for particles moved by noise, in [0, 1). 0 switches noise off.
    #[must_use]
    pub fn with_noise(self, noise_share: f64) -> Self {
        Self { noise_share, ..self }
    }

    /// Largest share of a belief that comes from outside proposals, in [0, 1). 0 ignores them.
    #[must_use]
    pub fn with_proposals(self, proposal_share: f64) -> Self {
        Self { proposal_share, ..self }
    }
}

impl RejectionConfig {
    /// Checks every value against its limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] with the key, its value and the limit.
    pub fn validate(&self) -> Result<(), Error> {
        let Self { particles, max_attempts, noise_share, proposal_share } = self;
        require(*particles >= 1, "particles", particles, "at least 1")?;
        require(*particles <= MOST_PARTICLES, "particles", particles, format!("at most {MOST_PARTICLES}"))?;
        let limit = format!("at least particles = {particles}");
        require(max_attempts >= particles, "max_attempts", max_attempts, limit)?;
        require(*max_attempts <= MOST_ATTEMPTS, "max_attempts", max_attempts, format!("at most {MOST_ATTEMPTS}"))?;
        for (key, share) in [("noise_share", noise_share), ("proposal_share", proposal_share)] {
            require((0.0..1.0).contains(share), key, share, "in [0, 1)")?;
        }
        Ok(())
    }

    /// Attempts of the first phase, in which particles are not perturbed. At least one.
    pub(crate) fn plain_attempts(&self) -> usize {
        // Rounding could otherwise reserve everything where the share is just below one.
        let reserved = (self.noise_share * self.max_attempts as f64) as usize;
        self.max_attempts - reserved.min(self.max_attempts - 1)
    }

    /// Places of the belief that proposals may take. At least one place is left to simulation.
    pub(crate) fn proposal_places(&self) -> usize {
        ((self.proposal_share * self.particles as f64) as usize).min(self.particles - 1)
    }
}

pub(crate) fn require(
    holds: bool,
    key: &'static str,
    value: &dyn ToString,
    limit: impl Into<String>,
) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::Config { key, value: value.to_string(), limit: limit.into() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "
        particles = 1000
        max_attempts = 20000
        noise_share = 0.25
        proposal_share = 0.3
    ";

    fn config() -> RejectionConfig {
        toml::from_str(TEXT).unwrap()
    }

    #[test]
    fn a_scenario_file_sets_every_key() {
        let expected =
            RejectionConfig { particles: 1000, max_attempts: 20_000, noise_share: 0.25, proposal_share: 0.3 };
        assert_eq!(config(), expected);
        assert_eq!(toml::from_str::<RejectionConfig>(&toml::to_string(&expected).unwrap()).unwrap(), expected);
    }

    #[test]
    fn a_misspelt_or_missing_key_is_named() {
        let misspelt = toml::from_str::<RejectionConfig>(&format!("{TEXT}\nparticle = 3")).unwrap_err().to_string();
        assert!(misspelt.contains("unknown field `particle`"), "{misspelt}");
        let missing =
            toml::from_str::<RejectionConfig>(&TEXT.replace("noise_share = 0.25", "")).unwrap_err().to_string();
        assert!(missing.contains("missing field `noise_share`"), "{missing}");
    }

    #[test]
    fn values_outside_their_limits_name_key_value_and_limit() {
        let message = |change: fn(&mut RejectionConfig)| {
            let mut config = config();
            change(&mut config);
            config.validate().unwrap_err().to_string()
        };
        assert_eq!(config().validate(), Ok(()));
        assert_eq!(message(|c| c.particles = 0), "belief: `particles` is 0, but must be at least 1");
        let many = message(|c| (c.particles, c.max_attempts) = (4_000_000_000, 4_000_000_000));
        assert_eq!(many, "belief: `particles` is 4000000000, but must be at most 1000000");
        assert_eq!(
            message(|c| c.max_attempts = 999),
            "belief: `max_attempts` is 999, but must be at least particles = 1000"
        );
        assert_eq!(message(|c| c.noise_share = 1.0), "belief: `noise_share` is 1, but must be in [0, 1)");
        assert_eq!(message(|c| c.noise_share = -0.1), "belief: `noise_share` is -0.1, but must be in [0, 1)");
        assert_eq!(message(|c| c.proposal_share = f64::NAN), "belief: `proposal_share` is NaN, but must be in [0, 1)");
    }

    #[test]
    fn defaults_are_valid_and_each_builder_changes_its_own_field() {
        let d = RejectionConfig::default;
        assert_eq!(d().validate(), Ok(()));
        assert_eq!(d().with_particles(7), RejectionConfig { particles: 7, ..d() });
        assert_eq!(d().with_max_attempts(7), RejectionConfig { max_attempts: 7, ..d() });
        assert_eq!(d().with_noise(0.1), RejectionConfig { noise_share: 0.1, ..d() });
        assert_eq!(d().with_proposals(0.1), RejectionConfig { proposal_share: 0.1, ..d() });
    }

    #[test]
    fn shares_leave_an_attempt_and_a_place_to_plain_simulation() {
        assert_eq!((config().plain_attempts(), config().proposal_places()), (15_000, 300));
        let most = 1.0 - f64::EPSILON / 2.0;
        let extreme = RejectionConfig { particles: 10, max_attempts: 10, noise_share: most, proposal_share: most };
        assert_eq!(extreme.validate(), Ok(()));
        assert_eq!((extreme.plain_attempts(), extreme.proposal_places()), (1, 9));
    }
}
