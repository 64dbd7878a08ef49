//! What can be chosen for a row: of the search, of the belief, of the actions.

use anyhow::{Context as _, Result};
use planner::{ActionPriors, Backup, Budget, Config, Exploration, Observations, RolloutDepth};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a new leaf of a search is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Leaf {
    /// What its state is worth to somebody who knows it: value iteration.
    FullInformation,
    /// What a random policy returns.
    Random,
    /// What the problem's heuristic returns.
    Heuristic,
    /// RockSample: the expected return of a plan for what is known.
    Plan,
}

/// What takes a decision in place of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decide {
    /// Finite problems: the action that is best where the state is known after it.
    Qmdp,
    /// Finite problems: one exact step, with so many draws of an observation for each action.
    ExactStep(usize),
    /// RockSample: a new plan for what is known.
    Plan,
    /// RockSample: so many exact steps before the plan.
    PlanAfter(usize),
}

/// Options of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// The search.
    pub planner: Config,
    /// What its leaves are worth.
    pub leaf: Leaf,
    /// Price of a nat that a belief leaves open, in units of reward: a leaf with [`Leaf::FullInformation`] is worth so much less. Needs branches that start
    /// with states.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub price_of_uncertainty: f64,
    /// What decides in place of the search; the search where this is not set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decide: Option<Decide>,
    /// Most actions of an episode.
    pub horizon: usize,
    /// Particles of a belief; 0 where the belief is exact.
    pub particles: usize,
    /// VDP Tag: directions around the circle among the actions; 0 where the actions are those of the problem.
    pub directions: usize,
    /// VDP Tag: actions that make for where a particle of the belief will be.
    pub aims: usize,
}

fn is_zero(price: &f64) -> bool {
    *price == 0.0
}

impl Options {
    /// Widening with the value of full information at the leaves, and an exact belief.
    pub(super) fn widening(simulations: usize, exploration: f64, depth: usize, factor: f64, exponent: f64) -> Self {
        let planner = Config {
            budget: Budget::Simulations(simulations),
            exploration: Exploration::Fixed(exploration),
            depth,
            rollout_depth: RolloutDepth::Actions(0),
            action_priors: ActionPriors::Off,
            observations: Observations::Widening { factor, exponent },
            backup: Backup::Mean,
            nodes: 1 << 24,
            ..Config::default()
        };
        Self {
            planner,
            leaf: Leaf::FullInformation,
            price_of_uncertainty: 0.0,
            decide: None,
            horizon: 100,
            particles: 0,
            directions: 0,
            aims: 0,
        }
    }

    /// With the entry `key` (dots lead into tables) set to a TOML value.
    ///
    /// # Errors
    ///
    /// An unknown key, or a value that does not fit.
    pub(super) fn with(&self, key: &str, value: &str) -> Result<Self> {
        // The parser's own words speak of a file that nobody wrote.
        let given: toml::Table = toml::from_str(&format!("value = {value}")).map_err(|_| {
            anyhow::anyhow!("{key}: expected a number or another TOML value (text in quotes), found {value}")
        })?;
        let mut options = serde_json::to_value(self)?;
        let mut at = &mut options;
        let unknown = || format!("there is no option {key}");
        for part in key.split('.') {
            // Some are not written where they have their default.
            at = at.as_object_mut().with_context(unknown)?.entry(part).or_insert(Value::Null);
        }
        *at = serde_json::to_value(&given["value"])?;
        serde_json::from_value(options).map_err(|error| {
            let is_unknown = error.to_string().starts_with("unknown field");
            let context = if is_unknown { unknown() } else { format!("{key} cannot be {value}") };
            anyhow::Error::from(error).context(context)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_set_by_their_path_and_others_refused() {
        let options = Options::widening(1000, 90.0, 20, 5.0, 0.1);
        let changed =
            options.with("planner.exploration", "{ fixed = 30.0 }").unwrap().with("leaf", "\"random\"").unwrap();
        assert_eq!(changed.planner.exploration, Exploration::Fixed(30.0));
        assert_eq!((changed.leaf, changed.planner.depth), (Leaf::Random, 20));
        let states = options.with("planner.branch_states", "5").unwrap().planner.branch_states;
        assert_eq!(states, 5, "an option that is not written at its default can be set");
        let unknown = options.with("planner.deep", "3").unwrap_err().to_string();
        assert!(unknown.starts_with("there is no option planner.deep"), "{unknown}");
        assert_eq!(options.with("particles", "-3").unwrap_err().to_string(), "particles cannot be -3");
        assert_eq!(
            options.with("leaf", "no").unwrap_err().to_string(),
            "leaf: expected a number or another TOML value (text in quotes), found no"
        );
    }
}
