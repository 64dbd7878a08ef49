//! The columns of a dataset, where it comes from, and one row of it.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::Error;

/// Named tallies of a shard or dataset, such as `diverged` episodes; a dataset's are the sums over its shards.
pub type Counts = BTreeMap<String, u64>;

/// Names of the columns. Each name carries its unit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schema {
    /// The robot.
    pub robot: String,
    /// Values of one observation.
    pub observation: Vec<String>,
    /// Number of discrete actions, at most 127; a row's action is below it.
    pub action_count: usize,
    /// Values of the state without Θ.
    pub state: Vec<String>,
    /// Continuous values of Θ.
    pub theta: Vec<String>,
    /// Discrete values of Θ.
    pub classes: Vec<String>,
    /// What a row says did happen (1) or did not (0) in the action that led there, such as `tool_touched`.
    pub events: Vec<String>,
}

impl Schema {
    /// Checks that the columns can be written and told apart.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let most = usize::from(i8::MAX.unsigned_abs());
        if !(1..=most).contains(&self.action_count) {
            let reason = format!("expected 1 to {most} actions, found {}", self.action_count);
            return Err(Error::plan("schema.action_count", reason));
        }
        if self.observation.is_empty() {
            return Err(Error::plan("schema.observation", "expected at least one name, found none"));
        }
        for (key, names) in self.lists() {
            let mut seen = BTreeSet::new();
            for name in names {
                if !seen.insert(name) {
                    return Err(Error::plan(format!("schema.{key}"), format!("the name `{name}` appears twice")));
                }
            }
        }
        Ok(())
    }

    /// The vector columns with the names of their values, in file order.
    pub(crate) fn lists(&self) -> [(&'static str, &[String]); 5] {
        [
            ("observation", &self.observation),
            ("state", &self.state),
            ("theta", &self.theta),
            ("classes", &self.classes),
            ("events", &self.events),
        ]
    }
}

/// Where a shard comes from; stored in each file. Made by [`crate::Plan::provenance`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Hash of the plan: [`crate::Plan::hash`].
    pub plan_hash: String,
    /// Hash of the scenario's text.
    pub scenario_hash: String,
    /// Root seed.
    pub seed: u64,
    /// Commit of the program that makes the data.
    pub commit: String,
}

/// One row: what was done, what was seen, and the truth behind it.
///
/// The first row of an episode holds the initial observation, before any action.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Episode, unique in the dataset; ascending in a shard.
    pub episode: u64,
    /// Row of the episode, from 0.
    pub step: u32,
    /// The action that led here; −1 in the first row of an episode.
    pub action: i8,
    /// Reward of that action; 0 in the first row by convention.
    pub reward: f32,
    /// 0 while the episode goes on; in its last row, and only there, how it ended: any other number, given by the caller.
    pub outcome: u8,
    /// Observation after the action.
    pub observation: Vec<f32>,
    /// State after the action, without Θ.
    pub state: Vec<f64>,
    /// Continuous values of Θ; the same in all rows of an episode.
    pub theta: Vec<f64>,
    /// Discrete values of Θ; the same in all rows of an episode.
    pub classes: Vec<u8>,
    /// 1 for what happened in the action that led here, else 0; all 0 in the first row.
    pub events: Vec<u8>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schema_that_cannot_be_written_is_refused_by_key() {
        let names = |n: &[&str]| n.iter().map(ToString::to_string).collect::<Vec<_>>();
        let good = Schema {
            robot: "arm".into(),
            observation: names(&["a"]),
            action_count: 127,
            state: names(&["a", "b"]),
            theta: vec![],
            classes: vec![],
            events: vec![],
        };
        assert!(good.check().is_ok());
        let twice = Schema { state: names(&["a", "a"]), ..good.clone() }.check().unwrap_err().to_string();
        assert!(twice.contains("schema.state") && twice.contains("`a`"), "{twice}");
        let many = Schema { action_count: 128, ..good }.check().unwrap_err().to_string();
        assert!(many.contains("schema.action_count") && many.contains("128"), "{many}");
    }
}
