//! Settings of a search. Every key is required: a scenario states what it runs.

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::ucb::ReturnRange;

/// Settings of [`crate::Pomcp`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Work per decision.
    pub budget: Budget,
    /// Constant c of UCB1.
    pub exploration: Exploration,
    /// Horizon of one simulation, in actions from the root. The paper cuts where γ^depth < ε; this is that cut, stated directly.
    pub depth: usize,
    /// Length of the rollout below a new leaf.
    pub rollout_depth: RolloutDepth,
}

/// Work per decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Budget {
    /// Exactly this many simulations.
    Simulations(usize),
    /// At most this many transitions of the model. A simulation that could overrun the budget is not started, so up to
    /// `depth` − 1 transitions stay unused: cutting the last simulation short would bias the value it contributes to.
    Transitions(usize),
}

/// Constant c of UCB1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Exploration {
    /// This value, in units of reward.
    Fixed(f64),
    /// This factor times the range of the returns seen at the root, so that one setting serves problems of any scale. The range
    /// grows during a search; it starts from the mean returns that a pruned tree brings along.
    ReturnRange(f64),
}

/// Length of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RolloutDepth {
    /// To the horizon of the simulation, as published.
    Full,
    /// At most this many actions; what would follow counts as zero.
    Actions(usize),
}

impl Config {
    /// Checks every value against its limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] with the key, its value and the limit.
    pub fn validate(&self) -> Result<(), Error> {
        let depth = self.depth;
        require(depth >= 1, "depth", &depth, "at least 1")?;
        match self.budget {
            Budget::Simulations(n) => require(n >= 1, "budget.simulations", &n, "at least 1"),
            // Below this not even one simulation fits, and there would be nothing to choose from.
            Budget::Transitions(n) => {
                require(n >= depth, "budget.transitions", &n, format!("at least depth = {depth}"))
            }
        }?;
        let (key, value) = match self.exploration {
            Exploration::Fixed(c) => ("exploration.fixed", c),
            Exploration::ReturnRange(factor) => ("exploration.return_range", factor),
        };
        require(value.is_finite() && value >= 0.0, key, &value, "finite and not negative")
    }
}

fn require(holds: bool, key: &'static str, value: &dyn ToString, limit: impl Into<String>) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::Config { key, value: value.to_string(), limit: limit.into() }) }
}

impl Budget {
    /// Whether one more simulation of at most `depth` transitions fits.
    pub(crate) fn affords(self, simulations: usize, transitions: usize, depth: usize) -> bool {
        match self {
            Self::Simulations(n) => simulations < n,
            Self::Transitions(n) => transitions + depth <= n,
        }
    }
}

impl Exploration {
    pub(crate) fn constant(self, returns: ReturnRange) -> f64 {
        match self {
            Self::Fixed(c) => c,
            Self::ReturnRange(factor) => factor * returns.width(),
        }
    }
}

impl RolloutDepth {
    /// Actions of a rollout that has `left` actions until the horizon of its simulation.
    pub(crate) fn actions(self, left: usize) -> usize {
        match self {
            Self::Full => left,
            Self::Actions(n) => n.min(left),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "
        budget = { transitions = 20000 }
        exploration = { return_range = 1.0 }
        depth = 30
        rollout_depth = \"full\"
    ";

    fn config() -> Config {
        toml::from_str(TEXT).unwrap()
    }

    #[test]
    fn a_scenario_file_sets_every_key() {
        let expected = Config {
            budget: Budget::Transitions(20_000),
            exploration: Exploration::ReturnRange(1.0),
            depth: 30,
            rollout_depth: RolloutDepth::Full,
        };
        assert_eq!(config(), expected);
        let other = TEXT.replace("\"full\"", "{ actions = 4 }").replace("{ return_range = 1.0 }", "{ fixed = 20.0 }");
        let other: Config = toml::from_str(&other).unwrap();
        assert_eq!((other.rollout_depth, other.exploration), (RolloutDepth::Actions(4), Exploration::Fixed(20.0)));
    }

    #[test]
    fn a_config_survives_writing_and_reading() {
        assert_eq!(toml::from_str::<Config>(&toml::to_string(&config()).unwrap()).unwrap(), config());
    }

    #[test]
    fn a_misspelt_or_missing_key_is_named() {
        let misspelt = toml::from_str::<Config>(&format!("{TEXT}\ndetph = 3")).unwrap_err().to_string();
        assert!(misspelt.contains("detph"), "{misspelt}");
        let unit = toml::from_str::<Config>(&TEXT.replace("transitions", "transition")).unwrap_err().to_string();
        assert!(unit.contains("unknown variant `transition`"), "{unit}");
        let missing = toml::from_str::<Config>(&TEXT.replace("depth = 30", "")).unwrap_err().to_string();
        assert!(missing.contains("missing field `depth`"), "{missing}");
    }

    #[test]
    fn values_outside_their_limits_name_key_value_and_limit() {
        let message = |change: fn(&mut Config)| {
            let mut config = config();
            change(&mut config);
            config.validate().unwrap_err().to_string()
        };
        assert_eq!(config().validate(), Ok(()));
        assert_eq!(message(|c| c.depth = 0), "planner: `depth` is 0, but must be at least 1");
        assert_eq!(
            message(|c| c.budget = Budget::Transitions(29)),
            "planner: `budget.transitions` is 29, but must be at least depth = 30"
        );
        assert_eq!(
            message(|c| c.budget = Budget::Simulations(0)),
            "planner: `budget.simulations` is 0, but must be at least 1"
        );
        assert_eq!(
            message(|c| c.exploration = Exploration::Fixed(f64::NAN)),
            "planner: `exploration.fixed` is NaN, but must be finite and not negative"
        );
        assert_eq!(
            message(|c| c.exploration = Exploration::ReturnRange(-1.0)),
            "planner: `exploration.return_range` is -1, but must be finite and not negative"
        );
    }

    #[test]
    fn a_rollout_never_passes_the_horizon() {
        assert_eq!(RolloutDepth::Full.actions(7), 7);
        assert_eq!(RolloutDepth::Actions(3).actions(7), 3);
        assert_eq!(RolloutDepth::Actions(9).actions(7), 7);
    }
}
