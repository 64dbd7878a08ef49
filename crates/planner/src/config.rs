//! Settings of a search.

use crate::{Choice, EarlyStop, Error};

/// Settings of [`crate::Pomcp`] and [`crate::Pomcpow`].
///
/// Start from [`Config::default`] and change what your problem needs. [`crate::Planner::new`] checks every value. With the feature `serde` a
/// file of settings has to name every key but `backup`, `choice`, `branch_states` and `early_stop`: another missing key is an error and does not fall back to the default.
///
/// # Defaults
///
/// | field | default | why |
/// |---|---|---|
/// | `budget` | 1024 simulations | With good rollouts RockSample(7, 8) then earns 18 of the 21 possible. A count gives the same result on every machine. |
/// | `exploration` | 1.0 × range of returns | UCB1 is derived for returns in [0, 1]; the factor carries that to any scale of rewards. |
/// | `depth` | 90 actions | With γ = 0.95 what comes later counts 1 %. Raise it for a larger γ, lower it for short tasks. |
/// | `rollout_depth` | `Full` | As published; needs no leaf value. |
/// | `action_priors` | `Full` | What your policy knows is used. A policy that says nothing changes nothing. |
/// | `observations` | `Classes` | One branch per class, as in POMCP. [`Config::with_widening`] is for continuous observations. |
/// | `backup` | `Mean` | As published, and the better one where rollouts are informative. |
/// | `choice` | `HighestMean` | As published for POMCP. `MostVisits` is safer where returns are noisy. |
/// | `branch_states` | 0 | As published for POMCPOW. Some make rollouts believable where a policy knows what to do with a belief. |
/// | `early_stop` | none | The whole budget is spent, so that runs compare at equal work. |
/// | `nodes` | 1,000,000 | About 16 MB per action of the model. More than a budget of some thousand simulations ever fills. |
/// | `trees` | 1 | One tree learns most from a given budget; more trees pay where they run on threads of their own. |
/// | `threads` | 1 | The caller decides how many cores are its own. |
///
/// # Example
///
/// ```
/// use planner::{Budget, Config, Error, Pomcp};
/// # use pomdp::{Discretise, GenerativeModel};
/// # fn check<M: GenerativeModel + Discretise>() -> Result<(), Error> where M::Key: Send {
/// let config = Config::default().with_budget(Budget::Milliseconds(50)).with_depth(40).with_trees(4, 4);
/// let planner = Pomcp::<M>::new(config)?; // checks every value
/// # Ok(())
/// # }
/// assert_eq!(
///     Config::default().with_depth(0).validate().unwrap_err().to_string(),
///     "planner: `depth` is 0, but must be at least 1"
/// );
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[cfg_attr(
    feature = "schemars",
    schemars(rename = "PlannerConfig", description = "Settings of `Pomcp` and `Pomcpow`.")
)]
pub struct Config {
    /// Work per decision.
    pub budget: Budget,
    /// Constant c of UCB1.
    pub exploration: Exploration,
    /// Horizon of one simulation, in actions from the root. The paper cuts where γ^depth < ε; this states that cut directly.
    pub depth: usize,
    /// Length of the rollout below a new leaf.
    pub rollout_depth: RolloutDepth,
    /// What [the policy of the problem](pomdp::Policy::priors) says of the actions of a new node.
    pub action_priors: ActionPriors,
    /// How observations branch the tree.
    pub observations: Observations,
    /// What an action learns from a simulation that explores below it. A file without this key means the mean.
    #[cfg_attr(feature = "serde", serde(default))]
    pub backup: Backup,
    /// Which action is executed. A file without this key means the one with the highest mean.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_default"))]
    pub choice: Choice,
    /// States that a new branch of progressive widening starts with: so many are drawn at its parent, stepped, and weighted by
    /// the branch's observation. Rollouts then act on [what an agent with these states would believe](pomdp::Policy::belief_action). At 0, which a file
    /// without this key means, a branch starts with the state of its simulation, and rollouts see the state.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_default"))]
    pub branch_states: usize,
    /// When a search may end before its budget is spent. Without this key it never does.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "is_default"))]
    pub early_stop: Option<EarlyStop>,
    /// Most nodes of all trees together, at least one per tree. States stored by progressive widening count as nodes.
    /// When the nodes are used up, the tree stops growing: simulations that leave it continue as rollouts, and
    /// [are counted](crate::SearchReport::unexpanded). Pruning frees nodes.
    pub nodes: usize,
    /// Independent trees (root parallelism) that share the budget evenly. Each has its own random stream, drawn from
    /// the caller's generator; a single tree uses that generator itself. The merged statistics of their roots choose
    /// the action.
    pub trees: usize,
    /// Threads that simulate the trees, the caller's included. The number does not change the result, unless the budget
    /// is a time.
    pub threads: usize,
}

/// Work per decision, of all trees together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum Budget {
    /// Exactly this many simulations.
    Simulations(usize),
    /// At most this many transitions of the model. A simulation that could overrun the budget is not started, because
    /// cutting it short would bias its value. So up to `depth` − 1 transitions per tree stay unused.
    Transitions(usize),
    /// Wall-clock time, ms. No simulation starts later, and every tree makes at least one. For live use only: the same
    /// seed may give another result.
    Milliseconds(u64),
}

/// Constant c of UCB1.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum Exploration {
    /// This value, in units of reward.
    Fixed(f64),
    /// This factor times the range of the returns seen at the root, so that one setting serves problems of any scale.
    /// The range grows during a search. After pruning it starts from the mean returns that were kept.
    ReturnRange(f64),
}

/// Length of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum RolloutDepth {
    /// To the horizon of the simulation, as published.
    Full,
    /// At most this many actions; the rest counts as [the value that the policy gives a leaf](pomdp::Policy::leaf_value).
    Actions(usize),
}

/// What a policy is asked for at a new node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum ActionPriors {
    /// Nothing: every action is legal and unvisited.
    Off,
    /// Which actions are legal.
    Legal,
    /// Legal actions, with initial visits and values.
    Full,
}

/// How observations branch the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
pub enum Observations {
    /// One branch per class of observations ([`pomdp::Discretise`]): [`crate::Pomcp`].
    Classes,
    /// Progressive widening, for [`crate::Pomcpow`]. An action with N visits gets a new branch, with the observation
    /// just simulated, while it has at most `factor` · N^`exponent` of them. Nodes hold states weighted by the
    /// likelihood of their observation ([`pomdp::ObservationModel`]).
    Widening {
        /// k_o, positive.
        factor: f64,
        /// α_o in [0, 1].
        exponent: f64,
    },
}

/// What goes up from a node to the action that led there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Backup {
    /// The return of the simulation, as published: V(ha) is the mean return of simulations that explore.
    #[default]
    Mean,
    /// The return where the simulation took the best action known at the node; elsewhere the value of that best action.
    /// So a return is cut where the simulation explored. This is Q(λ) of Watkins ("Learning from delayed rewards",
    /// 1989; Sutton and Barto 2018, section 12.10) with λ = 1 and a step size of 1/N(ha). Khandelwal, Liebman, Niekum
    /// and Stone ("On the analysis of complex backup strategies in Monte Carlo tree search", ICML 2016) compare such
    /// backups. Use it where one wrong action costs much more than good actions differ by.
    Watkins,
}

#[cfg(feature = "serde")]
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Default for Config {
    /// The values of the table above.
    fn default() -> Self {
        Self {
            budget: Budget::Simulations(1024),
            exploration: Exploration::ReturnRange(1.0),
            depth: 90,
            rollout_depth: RolloutDepth::Full,
            action_priors: ActionPriors::Full,
            observations: Observations::Classes,
            backup: Backup::Mean,
            choice: Choice::HighestMean,
            branch_states: 0,
            early_stop: None,
            nodes: 1_000_000,
            trees: 1,
            threads: 1,
        }
    }
}

/// The same settings with one of them changed. Values are checked by [`Config::validate`], which [`crate::Planner::new`] calls.
impl Config {
    /// Work per decision.
    #[must_use]
    pub fn with_budget(self, budget: Budget) -> Self {
        Self { budget, ..self }
    }

    /// Constant c of UCB1.
    #[must_use]
    pub fn with_exploration(self, exploration: Exploration) -> Self {
        Self { exploration, ..self }
    }

    /// Horizon of one simulation, in actions. At least 1.
    #[must_use]
    pub fn with_depth(self, depth: usize) -> Self {
        Self { depth, ..self }
    }

    /// Length of the rollout below a new leaf.
    #[must_use]
    pub fn with_rollout_depth(self, rollout_depth: RolloutDepth) -> Self {
        Self { rollout_depth, ..self }
    }

    /// What [`pomdp::Policy::priors`] is asked for.
    #[must_use]
    pub fn with_action_priors(self, action_priors: ActionPriors) -> Self {
        Self { action_priors, ..self }
    }

    /// Progressive widening over continuous observations, for [`crate::Pomcpow`]: an action with N visits has at most `factor` · N^`exponent`
    /// branches. `factor` is positive, `exponent` lies in [0, 1]. Start with 4.0 and 0.2: 4 branches at first, 16 after a thousand visits.
    #[must_use]
    pub fn with_widening(self, factor: f64, exponent: f64) -> Self {
        Self { observations: Observations::Widening { factor, exponent }, ..self }
    }

    /// What an action learns from a simulation that explores below it.
    #[must_use]
    pub fn with_backup(self, backup: Backup) -> Self {
        Self { backup, ..self }
    }

    /// Which action is executed.
    #[must_use]
    pub fn with_choice(self, choice: Choice) -> Self {
        Self { choice, ..self }
    }

    /// States that a new branch of progressive widening starts with.
    #[must_use]
    pub fn with_branch_states(self, branch_states: usize) -> Self {
        Self { branch_states, ..self }
    }

    /// Most nodes of all trees together. At least one a tree.
    #[must_use]
    pub fn with_nodes(self, nodes: usize) -> Self {
        Self { nodes, ..self }
    }

    /// Independent trees, and the threads that simulate them. At least one of each.
    #[must_use]
    pub fn with_trees(self, trees: usize, threads: usize) -> Self {
        Self { trees, threads, ..self }
    }
}

/// More threads than any machine has: a number that was not meant.
const MOST_THREADS: usize = 1024;

impl Config {
    /// Checks every value against its limits.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] with the key, its value and the limit.
    pub fn validate(&self) -> Result<(), Error> {
        let (depth, trees) = (self.depth, self.trees);
        require(depth >= 1, "depth", &depth, "at least 1")?;
        require(trees >= 1, "trees", &trees, "at least 1")?;
        require((1..=MOST_THREADS).contains(&self.threads), "threads", &self.threads, "between 1 and 1024")?;
        match self.budget {
            Budget::Simulations(n) => {
                // Visits are counted in 32 bits, kept ones included.
                let limit = format!("at least trees = {trees}, at most 2³⁰");
                require((trees..=1 << 30).contains(&n), "budget.simulations", &n, limit)
            }
            // Below this not even one simulation a tree fits, and there would be nothing to choose from.
            Budget::Transitions(n) => {
                let limit = format!("at least depth × trees = {}", depth.saturating_mul(trees));
                require(n / trees >= depth, "budget.transitions", &n, limit)?;
                require(n <= 1 << 30, "budget.transitions", &n, "at most 2³⁰")
            }
            Budget::Milliseconds(n) => {
                require(n >= 1, "budget.milliseconds", &n, "at least 1")?;
                require(n <= 1 << 30, "budget.milliseconds", &n, "at most 2³⁰")
            }
        }?;
        let nodes = self.nodes;
        let limit = format!("at least trees = {trees}, at most 2³²");
        require(nodes >= trees && nodes as u64 <= 1 << 32, "nodes", &nodes, limit)?;
        self.early_stop.map_or(Ok(()), EarlyStop::validate)?;
        if let Observations::Widening { factor, exponent } = self.observations {
            let positive = factor.is_finite() && factor > 0.0;
            require(positive, "observations.widening.factor", &factor, "finite and positive")?;
            let share = (0.0..=1.0).contains(&exponent);
            require(share, "observations.widening.exponent", &exponent, "between 0 and 1")?;
        }
        let (key, value) = match self.exploration {
            Exploration::Fixed(c) => ("exploration.fixed", c),
            Exploration::ReturnRange(factor) => ("exploration.return_range", factor),
        };
        require(value.is_finite() && value >= 0.0, key, &value, "finite and not negative")
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

/// The part of `total` that tree number `index` of `trees` gets: as even as possible, the first trees one more.
pub(crate) fn share(total: usize, trees: usize, index: usize) -> usize {
    total / trees + usize::from(index < total % trees)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "
        budget = { transitions = 20000 }
        exploration = { return_range = 1.0 }
        depth = 30
        rollout_depth = \"full\"
        action_priors = \"off\"
        observations = \"classes\"
        nodes = 1000000
        trees = 1
        threads = 1
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
            action_priors: ActionPriors::Off,
            observations: Observations::Classes,
            backup: Backup::Mean,
            nodes: 1_000_000,
            trees: 1,
            threads: 1,
            ..Config::default()
        };
        assert_eq!(config(), expected);
        let other = TEXT
            .replace("\"full\"", "{ actions = 4 }")
            .replace("{ return_range = 1.0 }", "{ fixed = 20.0 }")
            .replace("{ transitions = 20000 }", "{ milliseconds = 50 }")
            .replace("\"off\"", "\"full\"")
            .replace("\"classes\"", "{ widening = { factor = 4.0, exponent = 0.3 } }");
        let other: Config = toml::from_str(&format!("{other}\nbackup = \"watkins\"")).unwrap();
        let expected = Config {
            budget: Budget::Milliseconds(50),
            exploration: Exploration::Fixed(20.0),
            rollout_depth: RolloutDepth::Actions(4),
            action_priors: ActionPriors::Full,
            observations: Observations::Widening { factor: 4.0, exponent: 0.3 },
            backup: Backup::Watkins,
            ..expected
        };
        assert_eq!(other, expected);
    }

    #[test]
    fn a_config_survives_writing_and_reading() {
        let early_stop = Some(EarlyStop { rounds: 4, price: 2.5 });
        let other = Config { choice: Choice::MostVisits, branch_states: 7, early_stop, ..config() };
        for config in [config(), other] {
            assert_eq!(toml::from_str::<Config>(&toml::to_string(&config).unwrap()).unwrap(), config);
        }
        // What has its default is not written: files that were written before these keys came stay as they are.
        let text = toml::to_string(&config()).unwrap();
        assert!(!["choice", "branch_states", "early_stop"].iter().any(|key| text.contains(key)), "{text}");
    }

    #[test]
    fn a_misspelt_or_missing_key_is_named() {
        let misspelt = toml::from_str::<Config>(&format!("{TEXT}\ndetph = 3")).unwrap_err().to_string();
        assert!(misspelt.contains("detph"), "{misspelt}");
        let unit = toml::from_str::<Config>(&TEXT.replace("transitions", "transition")).unwrap_err().to_string();
        assert!(unit.contains("unknown variant `transition`"), "{unit}");
        for line in TEXT.lines().filter(|l| l.contains('=')) {
            let key = line.split_whitespace().next().unwrap();
            let missing = toml::from_str::<Config>(&TEXT.replace(line, "")).unwrap_err().to_string();
            assert!(missing.contains(&format!("missing field `{key}`")), "{missing}");
        }
    }

    #[test]
    fn values_outside_their_limits_name_key_value_and_limit() {
        let message = |change: fn(&mut Config)| {
            let mut config = config();
            change(&mut config);
            config.validate().unwrap_err().to_string()
        };
        assert_eq!(config().validate(), Ok(()));
        type Change = fn(&mut Config);
        let expected: [(Change, &str); 11] = [
            (|c| c.depth = 0, "`depth` is 0, but must be at least 1"),
            (|c| c.trees = 0, "`trees` is 0, but must be at least 1"),
            (|c| c.threads = 0, "`threads` is 0, but must be between 1 and 1024"),
            (
                |c| c.budget = Budget::Transitions(29),
                "`budget.transitions` is 29, but must be at least depth × trees = 30",
            ),
            (
                |c| (c.budget, c.trees) = (Budget::Transitions(119), 4),
                "`budget.transitions` is 119, but must be at least depth × trees = 120",
            ),
            (
                |c| (c.budget, c.trees) = (Budget::Simulations(1), 2),
                "`budget.simulations` is 1, but must be at least trees = 2, at most 2³⁰",
            ),
            (|c| c.budget = Budget::Milliseconds(0), "`budget.milliseconds` is 0, but must be at least 1"),
            (|c| (c.nodes, c.trees) = (1, 2), "`nodes` is 1, but must be at least trees = 2, at most 2³²"),
            (
                |c| c.observations = Observations::Widening { factor: 0.0, exponent: 0.5 },
                "`observations.widening.factor` is 0, but must be finite and positive",
            ),
            (
                |c| c.observations = Observations::Widening { factor: 1.0, exponent: 1.5 },
                "`observations.widening.exponent` is 1.5, but must be between 0 and 1",
            ),
            (
                |c| c.exploration = Exploration::Fixed(f64::NAN),
                "`exploration.fixed` is NaN, but must be finite and not negative",
            ),
        ];
        for (change, text) in expected {
            assert_eq!(message(change), format!("planner: {text}"));
        }
        assert_eq!(
            message(|c| c.exploration = Exploration::ReturnRange(-1.0)),
            "planner: `exploration.return_range` is -1, but must be finite and not negative"
        );
    }

    #[test]
    fn defaults_are_valid_and_each_builder_changes_its_own_field() {
        let d = Config::default;
        assert_eq!(d().validate(), Ok(()));
        let (budget, exploration) = (Budget::Transitions(9000), Exploration::Fixed(3.0));
        let observations = Observations::Widening { factor: 4.0, exponent: 0.2 };
        let (rollout_depth, action_priors) = (RolloutDepth::Actions(2), ActionPriors::Off);
        assert_eq!(d().with_budget(budget), Config { budget, ..d() });
        assert_eq!(d().with_exploration(exploration), Config { exploration, ..d() });
        assert_eq!(d().with_depth(7), Config { depth: 7, ..d() });
        assert_eq!(d().with_rollout_depth(rollout_depth), Config { rollout_depth, ..d() });
        assert_eq!(d().with_action_priors(action_priors), Config { action_priors, ..d() });
        assert_eq!(d().with_widening(4.0, 0.2), Config { observations, ..d() });
        assert_eq!(d().with_backup(Backup::Watkins), Config { backup: Backup::Watkins, ..d() });
        assert_eq!(d().with_choice(Choice::MostVisits), Config { choice: Choice::MostVisits, ..d() });
        assert_eq!(d().with_branch_states(9), Config { branch_states: 9, ..d() });
        let early_stop = Some(EarlyStop { rounds: 6, price: 3.0 });
        assert_eq!(d().with_early_stop(6, 3.0), Config { early_stop, ..d() });
        assert_eq!(d().with_nodes(50), Config { nodes: 50, ..d() });
        assert_eq!(d().with_trees(4, 2), Config { trees: 4, threads: 2, ..d() });
    }

    #[test]
    fn shares_add_up_and_differ_by_one_at_most() {
        let shares: Vec<usize> = (0..4).map(|index| share(10, 4, index)).collect();
        assert_eq!(shares, [3, 3, 2, 2]);
    }
}
