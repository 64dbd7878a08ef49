//! The resolved scenario: every key of a run, none with a hidden default.

use std::collections::BTreeMap;
use std::path::Path;

use physics_model::WorldDistribution;
use physics_model::config::{
    ArmConfig, ModelErrorConfig, ObstacleMobility, PerturbConfig, PushConfig, SensorConfig, TaskConfig, WorldConfig,
};
use physics_model::effect::{EffectConfig, EffectKind};
use physics_model::robot::RobotConfig;
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
    /// What the model takes to be its own error.
    pub model_error: ModelErrorConfig,
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
    /// As published: [`belief::RejectionFilter`].
    Rejection,
    /// [`belief::WeightedFilter`].
    Weighted,
}

/// Filters of the belief: all are set, one is used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BeliefConfig {
    /// The one that is used.
    pub filter: Filter,
    /// Rejection filter.
    pub rejection: belief::Config,
    /// Weighted filter.
    pub weighted: belief::WeightedConfig,
}

impl BeliefConfig {
    /// Particles of the first belief.
    #[must_use]
    pub fn particles(&self) -> usize {
        match self.filter {
            Filter::Rejection => self.rejection.particles,
            Filter::Weighted => self.weighted.particles_max,
        }
    }

    /// Most transitions that an update simulates, a restart included.
    #[must_use]
    pub fn transitions(&self) -> usize {
        match self.filter {
            Filter::Rejection => self.rejection.max_attempts,
            Filter::Weighted => self.weighted.max_transitions + self.weighted.restart_transitions,
        }
    }
}

/// What the initial belief says of the obstacle.
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
    /// Draws from the learned prior after each action.
    pub proposals: usize,
    /// Share of the belief that is drawn anew from the prior before each update; 0 as published.
    pub birth_share: f64,
    /// Default policy of the search's simulations.
    pub rollouts: Rollouts,
}

/// Default policy of simulations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rollouts {
    /// The tool goes to the object's centre, as published; a cut rollout is worth nothing more.
    Heuristic,
    /// [`physics_model::GoalPolicy`], which pushes to the goal past the obstacle that its particle believes in; a cut rollout is worth what
    /// its leaf value says.
    Goal,
}

/// Training data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// Share of the episodes in which the obstacle can move.
    pub movable_share: f64,
    /// Actions in an episode; fewer where the world diverges. Reaching the goal does not end it.
    pub episode_actions: usize,
    /// Share of the episodes played by [`physics_model::GoalPolicy`], the others by the heuristic policy.
    pub goal_share: f64,
    /// Share of uniformly random actions in every episode.
    pub exploration_share: f64,
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
            model_error: self.model_error,
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

    /// What is wrong with the values, if anything: key and expectation.
    pub(crate) fn problem(&self) -> Option<String> {
        let check = |good: bool, key: &str, expectation: &str, found: &dyn std::fmt::Debug| {
            (!good).then(|| format!("{key}: expected {expectation}, found {found:?}"))
        };
        let (w, t, s, d) = (&self.world, &self.task, &self.sensor, &self.data);
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let share = |v: f64| (0.0..=1.0).contains(&v);
        let reach = [("task.reach.x_m", t.reach.x_m), ("task.reach.y_m", t.reach.y_m), ("task.reach.z_m", t.reach.z_m)];
        let noise = &s.noise;
        let stddevs = [
            ("sensor.noise.joint_rad", noise.joint_rad),
            ("sensor.noise.force_n", noise.force_n),
            ("sensor.noise.torque_nm", noise.torque_nm),
            ("sensor.noise.joint_torque_nm", noise.joint_torque_nm),
            ("sensor.noise.position_m", noise.position_m),
            ("sensor.noise.orientation_rad", noise.orientation_rad),
        ];
        let p = &self.perturb;
        let perturb = [
            ("perturb.position_m", p.position_m),
            ("perturb.yaw_rad", p.yaw_rad),
            ("perturb.linear_mps", p.linear_mps),
            ("perturb.angular_rps", p.angular_rps),
            ("perturb.mass_share", p.mass_share),
            ("perturb.com_m", p.com_m),
            ("perturb.friction", p.friction),
            ("perturb.size_m", p.size_m),
            ("model_error.position_m", self.model_error.position_m),
            ("model_error.yaw_rad", self.model_error.yaw_rad),
            ("model_error.force_share", self.model_error.force_share),
            ("model_error.joint_torque_nm", self.model_error.joint_torque_nm),
        ];
        let rewards =
            [t.reward.step, t.reward.large_force, t.reward.out_of_reach, t.reward.object_moved, t.reward.goal];
        let period = w.control_period_secs;
        let effects = self.effects.truth.iter().chain(&self.effects.model);
        // They become names of folders and parts of messages.
        let plain = |text: &str| {
            (1..=64).contains(&text.len())
                && text.starts_with(|c: char| c.is_ascii_alphanumeric())
                && text.chars().all(|c| c.is_ascii_alphanumeric() || ".-_".contains(c))
        };
        let names = [("name", &self.name), ("preset", &self.preset), ("robot.name", &self.robot.name)];
        let expected = "1 to 64 letters, digits, `.`, `_`, `-`, first a letter or digit";
        check(self.version == VERSION, "version", &format!("{VERSION}"), &self.version)
            .or_else(|| names.iter().find_map(|(key, name)| check(plain(name), key, expected, name)))
            .or_else(|| {
                let urdf = self.robot.urdf.to_string_lossy();
                check(!urdf.contains(char::is_control), "robot.urdf", "a path without control characters", &urdf)
            })
            .or_else(|| {
                // Their ranges are the arm's business; what is no number would not even equal itself.
                let r = &self.robot;
                let numbers = r.home_rad.iter().chain(r.tool_rotation.iter().flatten()).chain(r.locked_joints.values());
                let found = numbers.copied().find(|v| !v.is_finite())?;
                check(false, "robot", "finite numbers in home_rad, tool_rotation and locked_joints", &found)
            })
            .or_else(|| self.arm.truth.problem().map(|p| format!("arm.truth.{p}")))
            .or_else(|| self.arm.model.problem().map(|p| format!("arm.model.{p}")))
            .or_else(|| effects.clone().find_map(|effect| effect.problem().map(|p| format!("effects: {p}"))))
            .or_else(|| {
                check(
                    positive(period) && period <= 0.1,
                    "world.control_period_secs",
                    "above 0 and at most 0.1 s",
                    &period,
                )
            })
            .or_else(|| {
                check((1..=10_000).contains(&w.control_steps), "world.control_steps", "1 to 10000", &w.control_steps)
            })
            .or_else(|| {
                let n = w.solver_iterations;
                check((1..=1000).contains(&n), "world.solver_iterations", "1 to 1000", &n)
            })
            .or_else(|| {
                check(
                    positive(w.contact_frequency_hz),
                    "world.contact_frequency_hz",
                    "above 0 Hz",
                    &w.contact_frequency_hz,
                )
            })
            .or_else(|| {
                check(
                    positive(w.contact_damping_ratio),
                    "world.contact_damping_ratio",
                    "above 0",
                    &w.contact_damping_ratio,
                )
            })
            .or_else(|| {
                let n = w.arm_stiffness_npm;
                check(positive(n), "world.arm_stiffness_npm", "above 0 N/m", &n)
            })
            .or_else(|| check(w.table_height_m.abs() < 10.0, "world.table_height_m", "within 10 m", &w.table_height_m))
            .or_else(|| check(positive(w.gravity_mps2), "world.gravity_mps2", "above 0 m/s²", &w.gravity_mps2))
            .or_else(|| check(share(w.tool_friction), "world.tool_friction", "0 to 1", &w.tool_friction))
            .or_else(|| check(share(w.obstacle_friction), "world.obstacle_friction", "0 to 1", &w.obstacle_friction))
            .or_else(|| check(share(w.restitution), "world.restitution", "0 to 1", &w.restitution))
            .or_else(|| check((1..=10_000).contains(&t.horizon), "task.horizon", "1 to 10000 actions", &t.horizon))
            .or_else(|| check(share(t.discount), "task.discount", "0 to 1", &t.discount))
            .or_else(|| {
                check(positive(t.step_m) && t.step_m <= 0.2, "task.step_m", "above 0 and at most 0.2 m", &t.step_m)
            })
            .or_else(|| reach.iter().find_map(|(key, [a, b])| check(a < b, key, "[low, high] in m", &[a, b])))
            .or_else(|| {
                check(
                    t.reach.contains(t.tool_start_m),
                    "task.tool_start_m",
                    "a point inside task.reach",
                    &t.tool_start_m,
                )
            })
            .or_else(|| {
                let goal = [t.goal.x_m, t.goal.y_m];
                check(goal.iter().all(|v| v.is_finite()), "task.goal", "finite x_m and y_m", &goal)
            })
            .or_else(|| check(positive(t.goal.radius_m), "task.goal.radius_m", "above 0 m", &t.goal.radius_m))
            .or_else(|| check(rewards.iter().all(|r| r.is_finite()), "task.reward", "finite rewards", &rewards))
            .or_else(|| {
                let v = t.reward.moved_threshold_m;
                check(positive(v), "task.reward.moved_threshold_m", "above 0 m", &v)
            })
            .or_else(|| {
                check(positive(s.large_force_limit), "sensor.large_force_limit", "above 0", &s.large_force_limit)
            })
            .or_else(|| stddevs.iter().find_map(|(key, v)| check(positive(*v), key, "a standard deviation above 0", v)))
            .or_else(|| {
                perturb
                    .iter()
                    .find_map(|(key, v)| check(v.is_finite() && *v >= 0.0, key, "a standard deviation, at least 0", v))
            })
            .or_else(|| self.distribution.problem().map(|p| format!("distribution.{p}")))
            .or_else(|| {
                let unlisted = |kind: &&EffectKind| !effects.clone().any(|effect| effect.kind() == **kind);
                let name = self.distribution.effects.keys().find(unlisted)?.name();
                Some(format!("distribution.effects.{name}: expected {name} in effects.truth or effects.model"))
            })
            .or_else(|| check(share(self.agent.birth_share), "agent.birth_share", "0 to 1", &self.agent.birth_share))
            .or_else(|| check(share(d.movable_share), "data.movable_share", "0 to 1", &d.movable_share))
            .or_else(|| check(share(d.goal_share), "data.goal_share", "0 to 1", &d.goal_share))
            .or_else(|| check(share(d.exploration_share), "data.exploration_share", "0 to 1", &d.exploration_share))
            .or_else(|| {
                check(
                    (1..=10_000).contains(&d.episode_actions),
                    "data.episode_actions",
                    "1 to 10000",
                    &d.episode_actions,
                )
            })
            .or_else(|| {
                let n = self.evaluation.trials;
                check((1..=1_000_000).contains(&n), "evaluation.trials", "1 to 1000000", &n)
            })
    }
}
