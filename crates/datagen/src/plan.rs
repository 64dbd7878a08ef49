//! What a dataset holds and how it is cut into shards.

use dataset::{Plan, Schema};
use physics_model::theta::{CLASS_TARGETS, THETA_NAMES};
use push_task::sensor::observation_names;
use push_task::state::State;
use scenario::Scenario;

/// Columns of a dataset of this scenario's robot.
#[must_use]
pub fn schema(scenario: &Scenario) -> Schema {
    let joints = scenario.robot.actuated_joints.len();
    Schema {
        robot: scenario.robot.name.clone(),
        observation: observation_names(scenario.sensor.force, joints),
        action_count: push_task::action::ACTION_COUNT,
        state: State::names(joints),
        theta: THETA_NAMES.map(String::from).to_vec(),
        classes: CLASS_TARGETS.map(|(name, _)| name.to_string()).to_vec(),
        events: crate::generate::EVENTS.map(|(name, _)| name.to_string()).to_vec(),
    }
}

/// Episodes that hold at least `transitions` transitions, if no world diverges.
#[must_use]
pub fn episodes(scenario: &Scenario, transitions: u64) -> u64 {
    transitions.div_ceil(scenario.data.episode_actions as u64)
}

/// Plan of a dataset of at least `transitions` transitions, if no world diverges, in `shards` shards.
#[must_use]
pub fn plan(scenario: &Scenario, commit: String, transitions: u64, seed: u64, shards: u32) -> Plan {
    let episodes = episodes(scenario, transitions);
    Plan {
        version: dataset::VERSION,
        schema: schema(scenario),
        scenario_hash: scenario.hash(),
        config: serde_json::json!({
            "scenario": scenario.name,
            "classes": CLASS_TARGETS,
            "data": scenario.data,
        }),
        seed,
        commit,
        shards,
        episodes_per_shard: episodes.div_ceil(u64::from(shards)),
    }
}
