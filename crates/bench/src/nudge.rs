//! How far the next reading moves where the object is moved by a hair: what no filter can know of a push.

use std::path::Path;

use anyhow::{Context as _, Result, anyhow};
use physics_model::BodyState;
use pomdp::{Outcome, Purpose, Seed};
use push_task::Action;
use push_task::config::NoiseConfig;
use push_task::sensor::Readings;
use scenario::{Problem, Selection};
use serde_json::{Map, Value, json};

/// Most bytes of recorded trials.
const MOST_BYTES: u64 = 1 << 28;
/// Kinds of steps: what the tool and the object touched.
const KINDS: [&str; 3] = ["nothing", "object", "obstacle"];
/// Kinds of readings.
const READINGS: [&str; 4] = ["force", "torque", "position", "yaw"];

/// What to run.
#[derive(Clone, Debug)]
pub struct Task {
    /// Domain or scenario file.
    pub domain: String,
    /// How far the object is moved along y, m.
    pub nudge_m: f64,
    /// Scenario entries, key=value.
    pub set: Vec<String>,
}

/// Replays the trials in `trials` (a `trials.jsonl` of `eval`, in the same domain), and compares each step with the same step from an object that
/// was moved.
///
/// # Errors
///
/// A scenario that does not load, and a file that holds no trials.
pub fn run(root: &Path, task: &Task, trials: &Path) -> Result<Value> {
    let set = task.set.clone();
    let selection = Selection { domain: task.domain.clone(), preset: "surmise".into(), set, ..Selection::new(root) };
    let problem = Problem::assemble(&selection.load()?, root)?;
    let (model, noise) = (&problem.truth, &problem.scenario.sensor.noise);
    let bytes = whole_file::read(trials, MOST_BYTES)?;
    let text = String::from_utf8(bytes).with_context(|| format!("{}: expected text", trials.display()))?;
    let mut found: [Vec<[f64; 4]>; 3] = Default::default();
    for (number, line) in text.lines().enumerate() {
        let place = || format!("{}, line {}: expected a trial of `eval`", trials.display(), number + 1);
        let trial: Value = serde_json::from_str(line).map_err(|_| anyhow!("{}, found no JSON", place()))?;
        let seed = Seed(trial["seed"].as_u64().with_context(place)?);
        let mut particle = problem.sample_world(&mut seed.stream(Purpose::World, 0))?;
        let mut rng = seed.stream(Purpose::Truth, 0);
        model.initial_observation(&mut particle, &mut rng);
        for action in trial["actions"].as_array().with_context(place)? {
            let index = action.as_u64().with_context(place)? as usize;
            let action = *Action::ALL.get(index).with_context(place)?;
            let mut moved = particle.clone();
            moved.state.object.position_m[1] += task.nudge_m;
            // The same noise for both.
            model.act(&mut moved, action, &mut rng.clone());
            let (step, report) = model.act(&mut particle, action, &mut rng);
            let kind = if report.obstacle_touched { 2 } else { usize::from(report.tool_touched) };
            found[kind].push(differences(&model.readings(&particle), &model.readings(&moved), noise));
            if step.outcome != Outcome::Continue {
                break;
            }
        }
    }
    let kinds: Map<String, Value> =
        KINDS.iter().zip(&found).map(|(kind, steps)| ((*kind).into(), figures(steps))).collect();
    Ok(json!({ "domain": task.domain, "nudge_m": task.nudge_m, "set": task.set, "touching": kinds }))
}

/// Steps, those in which a reading moves by more than a standard deviation of its sensor, and quantiles of each reading in such units.
fn figures(steps: &[[f64; 4]]) -> Value {
    let jumps = steps.iter().filter(|step| step.iter().any(|moved| *moved > 1.0)).count();
    let readings: Map<String, Value> = READINGS
        .iter()
        .enumerate()
        .map(|(index, name)| {
            let mut values: Vec<f64> = steps.iter().map(|step| step[index]).collect();
            let over = values.iter().filter(|moved| **moved > 1.0).count();
            let [half, most, all] = [0.5, 0.95, 1.0].map(|level| statistics::quantile(&mut values, level));
            ((*name).into(), json!({ "over_1": over, "q50": half, "q95": most, "max": all }))
        })
        .collect();
    json!({ "steps": steps.len(), "over_1": jumps, "readings": readings })
}

/// Largest difference of each kind of reading, in standard deviations of its sensor.
fn differences(a: &Readings, b: &Readings, noise: &NoiseConfig) -> [f64; 4] {
    let largest = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    let yaw = |body: &BodyState| body.yaw_rad();
    let turn = (yaw(&a.object) - yaw(&b.object)).sin().abs();
    [
        largest(&a.force[..3], &b.force[..3]) / noise.force_n,
        largest(&a.force[3..], &b.force[3..]) / noise.torque_nm,
        largest(&a.object.position_m, &b.object.position_m) / noise.position_m,
        turn / noise.orientation_rad,
    ]
}
