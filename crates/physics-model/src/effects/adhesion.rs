//! Adhesion of the tool to the object: tape, a suction cup, a wet finger.
//!
//! F(d) = F₀ for surfaces that touch (d ≤ 0), F₀ (1 − d / δ) up to the range δ = 1 mm, and none beyond.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | F₀ | `pull_off_n` | N | 0.1 to 3 | engineering judgement |
//!
//! Shows when the tool moves back: the object follows it, and the force pulls.
//!
//! Acts as a pair of forces (F) at the nearest points of tool and object. In contact it adds to the normal force of the two, and so to their
//! friction; what the wrist feels is the sum. The range stands for what a film or lip stretches before it lets go, and is wide enough for the
//! first steps of a retreat to lie in it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter, parametric};
use crate::effect::{Effect, Hooks};

/// Range δ, m, after which the two are apart.
const RANGE_M: f64 = 0.001;

/// Tool and object stick together; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adhesion {
    /// F₀, N.
    pub pull_off_n: f64,
}

parametric!(Adhesion, "adhesion", {
    pull_off_n: Parameter::new("N", [0.1, 3.0], [0.0, 100.0], Neutral::Value(0.0)),
});

impl Effect for Adhesion {
    fn hooks(&self) -> Hooks {
        Hooks::ATTRACTION.when(self.pull_off_n != 0.0)
    }

    fn attraction(&self, gap_m: f64) -> f64 {
        self.pull_off_n * (1.0 - gap_m / RANGE_M).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_work_of_a_separation_is_half_the_pull_off_force_times_the_range() {
        let effect = Adhesion { pull_off_n: 1.2 };
        assert_eq!(effect.attraction(-0.001), 1.2);
        let steps = 10_000;
        let step_m = 2.0 * RANGE_M / f64::from(steps);
        let work: f64 = (0..steps).map(|i| effect.attraction((f64::from(i) + 0.5) * step_m) * step_m).sum();
        assert!((work - 0.5 * 1.2 * RANGE_M).abs() < 1e-9, "{work}");
    }
}
