//! The resolved scenario: every key of a run, none with a hidden default.

use std::collections::BTreeMap;
use std::path::Path;

use physics_model::config::{ArmConfig, ObstacleMobility, WorldConfig};
use physics_model::effect::EffectConfig;
use physics_model::robot::RobotConfig;
use push_task::WorldDistribution;
use push_task::config::{PerturbConfig, PushConfig, SensorConfig, TaskConfig, TransitionNoise};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// Version of the scenario format that this crate reads and writes.
pub const VERSION: u32 = 1;

/// A resolved scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Format version.
    pub version: u32,
    /// Name of the domain, as in tables.
    pub name: String,
    /// Name of the preset of belief, planner and agent.
    pub preset: String,
    /// The arm.
    pub robot: RobotConfig,
    /// Time base, contacts, materials.
    pub world: WorldConfig,
    /// Arms of the true world and of the model, apart.
    pub arm: ArmsConfig,
    /// Effects of the true world and of the model, apart.
    pub effects: EffectsConfig,
    /// Task.
    pub task: TaskConfig,
    /// Sensors.
    pub sensor: SensorConfig,
    /// Noise of reinvigoration.
    pub perturb: PerturbConfig,
    /// Noise of the transition, in the true world and in the model.
    pub transition_noise: TransitionNoise,
    /// Worlds.
    pub distribution: WorldDistribution,
    /// What the robot believes at first.
    pub initial_belief: InitialBeliefConfig,
    /// Particle filter.
    pub belief: BeliefConfig,
    /// Search.
    pub planner: planner::Config,
    /// The loop around them.
    pub agent: AgentConfig,
    /// Training data.
    pub data: DataConfig,
    /// Trials.
    pub evaluation: EvaluationConfig,
}

/// How the arm follows its commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArmsConfig {
    /// In the true world.
    pub truth: ArmConfig,
    /// In the model that plans and filters.
    pub model: ArmConfig,
}

/// Effects beyond rigid bodies with Coulomb friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EffectsConfig {
    /// In the true world.
    pub truth: Vec<EffectConfig>,
    /// In the model that plans and filters.
    pub model: Vec<EffectConfig>,
}

/// Which filter keeps the belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// As published: [rejection](belief::RejectionFilter) of particles.
    Rejection,
    /// [In steps](belief::BridgeFilter) from the network's estimate to the exact posterior.
    Bridge,
}

impl Filter {
    /// Name in scenarios.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rejection => "rejection",
            Self::Bridge => "bridge",
        }
    }
}

/// Filters of the belief. All have settings; `filter` says which one runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BeliefConfig {
    /// The one that is used.
    pub filter: Filter,
    /// Rejection filter.
    pub rejection: belief::RejectionConfig,
    /// Bridge filter.
    pub bridge: belief::BridgeConfig,
}

impl Scenario {
    /// Name of the folder of the network for this scenario. The bridge filter's are trained on worlds with the transition's noise and one mobility of
    /// the obstacle.
    #[must_use]
    pub fn prior_name(&self) -> String {
        let robot = &self.robot.name;
        let mobility = match self.world.obstacle_mobility {
            ObstacleMobility::Fixed => "fixed",
            ObstacleMobility::Movable => "movable",
        };
        match self.belief.filter {
            Filter::Rejection => robot.clone(),
            Filter::Bridge => format!("{robot}-{mobility}"),
        }
    }
}

/// What the initial belief says about the obstacle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InitialObstacle {
    /// The domain's distribution.
    AsDistributed,
    /// No particle has one.
    None,
}

/// What the robot believes before it has acted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InitialBeliefConfig {
    /// Obstacle.
    pub obstacle: InitialObstacle,
}

/// The loop around belief, planner and prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AgentConfig {
    /// Draws from the network after each action, for the rejection filter.
    pub proposals: usize,
    /// Default policy of the search's simulations.
    pub rollouts: Rollouts,
    /// Time steps of the worlds that the search simulates. Without this key they are those of `world`, by which the belief is updated. So they are where the
    /// model's arm does not follow its commands exactly: a dynamic arm, effects on commands, effects of unknown strength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search_steps: Option<SearchSteps>,
}

/// In which steps the search simulates an action, which lasts as long as in `world`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SearchSteps {
    /// Control steps of `world` that one of the search takes the place of, as long as that takes 0.1 s at most.
    #[schemars(range(min = 1, max = 100))]
    pub world_steps: u32,
    /// Solver iterations (substeps) in a control step of the search.
    #[schemars(range(min = 1, max = 1000))]
    pub solver_iterations: u32,
}

/// Longest control step, s: that of `world.control_period_secs`, too.
pub(crate) const LONGEST_PERIOD_SECS: f64 = 0.1;

impl SearchSteps {
    /// The time base of a world, in these steps.
    pub(crate) fn of(self, world: &WorldConfig) -> WorldConfig {
        let duration_secs = world.control_period_secs * f64::from(world.control_steps);
        let least = (duration_secs / LONGEST_PERIOD_SECS - 1e-9).ceil().max(1.0) as u32;
        world.in_steps(world.control_steps.div_ceil(self.world_steps).max(least), self.solver_iterations)
    }
}

/// Default policy of simulations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rollouts {
    /// The tool goes to the object's centre, as published. What follows a cut rollout counts as 0.
    Heuristic,
    /// [Pushes to the goal](push_task::GoalPolicy), past the obstacle of its particle. What follows a cut rollout
    /// counts as the policy's leaf value.
    Goal,
}

/// Training data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// Share of the episodes in which the obstacle can move.
    pub movable_share: f64,
    /// Actions in an episode; fewer if the world diverges. Reaching the goal does not end it.
    pub episode_actions: usize,
    /// Share of the episodes played by [a policy that pushes to the goal](push_task::GoalPolicy), the others by the heuristic policy.
    pub goal_share: f64,
    /// Share of uniformly random actions in every episode.
    pub exploration_share: f64,
    /// Whether policies act in a world that they imagine, drawn from the distribution, with the object where it is seen. Otherwise they know the
    /// true world, and their actions tell a network what no sensor could (Ortega et al., "Shaking the foundations: delusions in sequence models",
    /// 2021).
    pub imagined_worlds: bool,
}

/// A published success rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Successes.
    pub successes: u32,
    /// Trials.
    pub trials: u32,
}

/// Trials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EvaluationConfig {
    /// Trials a method.
    pub trials: u32,
    /// Published results by method.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub published: BTreeMap<String, Published>,
}

impl Scenario {
    /// Everything that turns (s, Θ, action) into a transition, with the given arm and effects.
    #[must_use]
    pub fn push_config(&self, arm: &ArmConfig, effects: &[EffectConfig]) -> PushConfig {
        PushConfig {
            world: self.world.clone(),
            arm: arm.clone(),
            task: self.task.clone(),
            sensor: self.sensor.clone(),
            perturb: self.perturb.clone(),
            transition_noise: self.transition_noise,
            effects: effects.to_vec(),
        }
    }

    /// The scenario as TOML, loadable again.
    ///
    /// # Panics
    ///
    /// Never for values that were loaded: all of them have a TOML form.
    #[must_use]
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a scenario holds only what TOML can express")
    }

    /// Hash of the resolved scenario without its `evaluation`, which does not change what happens in a trial.
    #[must_use]
    pub fn hash(&self) -> String {
        let evaluation = EvaluationConfig { trials: 1, published: BTreeMap::new() };
        let decisive = Self { evaluation, ..self.clone() };
        blake3::hash(decisive.to_toml().as_bytes()).to_hex().to_string()
    }

    /// Hash of the arm's URDF file, below `root`.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] where it cannot be read.
    pub fn urdf_hash(&self, root: &Path) -> Result<String, Error> {
        let file = root.join(&self.robot.urdf);
        let bytes = std::fs::read(&file).map_err(|source| Error::Read { file, source })?;
        Ok(blake3::hash(&bytes).to_hex().to_string())
    }

    /// The scenario with another mobility of the obstacle.
    #[must_use]
    pub fn with_mobility(mut self, mobility: ObstacleMobility) -> Self {
        self.world.obstacle_mobility = mobility;
        self
    }
}
