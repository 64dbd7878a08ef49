//! Search on the standard problems: simulations a second, returns beside published ones, exact values, threads.
//!
//! [`classic`](self) rows are RockSample(7, 8), RockSample(11, 11), Tag and Tiger with POMCP. The rows of [`contest`] are larger or continuous problems with the
//! settings that suit each, beside the best that was published.

use anyhow::Result;
use serde_json::{Map, Value};

mod classic;
pub mod contest;
mod options;
mod play;
mod results;
mod table;

pub use options::{Leaf, Options};
pub use results::{NAME, Results};
pub use table::table;

/// How long to measure.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Episodes with 2^10 simulations a move of the classic rows; half as many with 2^13, a quarter with 2^15.
    pub episodes: u32,
    /// Only 2^10 simulations.
    pub quick: bool,
}

/// What to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// How long to measure.
    pub effort: Effort,
    /// Root seed of the rows of [`contest`]. The classic ones always take 1.
    pub seed: u64,
    /// Rows of [`contest`] to play alone; empty for all rows.
    pub only: Vec<String>,
    /// Options that differ from a row's own: row.key=value.
    pub set: Vec<String>,
}

/// Runs everything and gives one JSON object with a row a problem.
///
/// Rows of [`contest`] that `results` has with the same task are taken from there, and new ones are added to it as soon as they are done.
///
/// # Errors
///
/// Where one and several threads disagree, for an unknown row or option, and where the results cannot be written.
pub fn run(task: &Task, results: Option<&Results>, mut note: impl FnMut(&str)) -> Result<Value> {
    let rows = contest::rows(task)?;
    let mut result = Map::new();
    if task.only.is_empty() {
        classic::run(task.effort, &mut result, &mut note)?;
    }
    for row in rows {
        let name = row.name();
        let done = results.map(|results| results.of(&row)).transpose()?.flatten();
        note(&format!("{name}{}", if done.is_some() { ": already there" } else { "" }));
        let value = match done {
            Some(value) => value,
            None => {
                let value = row.play(&mut note)?;
                results.map(|results| results.add(&row, &value)).transpose()?;
                value
            }
        };
        result.insert(name.into(), value);
    }
    let result = Value::Object(result);
    if let Some(results) = results {
        results.finish(&result)?;
    }
    Ok(result)
}
