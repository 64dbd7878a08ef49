//! An object that loses mass: a leaking bottle, sand running out.
//!
//! m(t) = m (1 − λ t), t: time since the episode began, down to 5 % of m.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | λ | `rate_ps` | 1/s | 0.001 to 0.02 | engineering judgement |
//!
//! Shows in the force late in an episode: the same push takes less and less.
//!
//! Acts on the object's mass (N), before each control step; the inertia follows in proportion, the centre of mass stays.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};

/// Share of the mass that never leaks.
const LEAST: f64 = 0.05;

/// The object loses mass; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MassLeak {
    /// λ, 1/s.
    pub rate_ps: f64,
}

parametric!(MassLeak, "mass_leak", {
    rate_ps: Parameter::new("1/s", [0.001, 0.02], [-1.0, 1.0], Neutral::Value(0.0)),
});

impl Effect for MassLeak {
    fn hooks(&self) -> Hooks {
        Hooks::MASS.and(Hooks::MEMORY).when(self.rate_ps != 0.0)
    }

    fn mass_share(&self, time_secs: f64) -> f64 {
        (1.0 - self.rate_ps * time_secs).max(LEAST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mass_falls_in_proportion_to_the_time() {
        let effect = MassLeak { rate_ps: 0.01 };
        assert!((effect.mass_share(10.0) - 0.9).abs() < 1e-12);
        assert_eq!(effect.mass_share(1000.0), 0.05);
    }
}
