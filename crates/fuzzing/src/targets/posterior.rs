//! The network of a bridge filter: `posterior.json` and its weights.

use std::sync::OnceLock;

use pomdp::{Purpose, Seed};
use prior::posterior::{FILE, PAIRS, PosteriorNetwork};
use push_task::Observation;
use push_task::coordinates::START;
use push_task::sensor::observation_names;
use scenario::{Problem, Selection};
use serde_json::{Map, Value, json};

use super::checkpoint::{matching, named};
use crate::Verdict;
use crate::parts::{join, split};
use crate::verdict::{asset, folder, put, refused, root};

/// Name of the weights where `posterior.json` names none that is a plain file.
const WEIGHTS: &str = "weights.safetensors";

/// Loads the two files as they are, and once more with the recorded size and hash put right. What is accepted takes a step, its probabilities sum to one, and
/// what it draws has a density.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn posterior(data: &[u8]) -> Verdict {
    let [manifest, weights] = split::<2>(data);
    let verdict = load(manifest, weights);
    if let Some(manifest) = matching(manifest, weights)
        && verdict == Verdict::Refused
    {
        return load(&manifest, weights);
    }
    verdict
}

fn load(manifest: &[u8], weights: &[u8]) -> Verdict {
    let folder = folder();
    let dir = folder.path();
    put(&dir.join(FILE), manifest);
    put(&dir.join(named(manifest).as_deref().unwrap_or(WEIGHTS)), weights);
    let problem = problem();
    let mut network = match PosteriorNetwork::load(dir, "sawyer", &problem.model) {
        Ok(network) => network,
        Err(error) => return refused(&error, &[&dir.display().to_string()]),
    };
    // Upright on the table, no force.
    let names = observation_names(problem.scenario.sensor.force, problem.model.joint_count());
    let mut values = vec![0.0; names.len() - 7];
    values.extend([0.6, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0]);
    network.observe(&problem.model, None, &Observation(values), &problem.start_joints_rad);
    let density = network.density().unwrap_or_else(|| panic!("it has taken in an observation"));
    let sum: f64 = density.pairs().iter().sum();
    assert!((sum - 1.0).abs() < 1e-3, "probabilities sum to {sum}");
    let drawn = density.draw(0, &mut Seed(1).stream(Purpose::Suggestion, 0));
    let log_ratio = density.log_ratio(0, &drawn);
    assert!(drawn.iter().all(|value| value.is_finite()) && !log_ratio.is_nan(), "{drawn:?} {log_ratio}");
    Verdict::Accepted
}

fn problem() -> &'static Problem {
    static PROBLEM: OnceLock<Problem> = OnceLock::new();
    PROBLEM.get_or_init(|| {
        let selection = Selection { domain: "D4".into(), ..Selection::new(root()) };
        let problem = selection.load().and_then(|scenario| Problem::assemble(&scenario, &root()));
        problem.unwrap_or_else(|error| panic!("{error}"))
    })
}

/// The shipped network with a layer of two units: its true weights would take nearly all changes.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let manifest: Value =
        serde_json::from_slice(&asset("assets/priors/sawyer-fixed/posterior.json")).unwrap_or_else(|e| panic!("{e}"));
    [(vec![2], 0.1_f32), (vec![2, 3], -0.3)].map(|(hidden, value)| small(manifest.clone(), &hidden, value)).to_vec()
}

/// All weights are `value`, but for the spread of the inputs.
fn small(mut manifest: Value, hidden: &[usize], value: f32) -> Vec<u8> {
    let (units, components) = (2, 2);
    for (key, small) in [("hidden", json!(hidden)), ("units", json!(units)), ("components", json!(components))] {
        manifest[key] = small;
    }
    let inputs = prior::posterior::INPUTS;
    let (top, all) = (hidden[hidden.len() - 1], START * units);
    let mut shapes = vec![("input.mean".to_owned(), vec![inputs]), ("input.stddev".to_owned(), vec![inputs])];
    let mut below = inputs;
    for (layer, &width) in hidden.iter().enumerate() {
        shapes.push((format!("layers.{layer}.weights"), vec![below + width, 4 * width]));
        shapes.push((format!("layers.{layer}.bias"), vec![4 * width]));
        below = width;
    }
    let head = [
        ("pairs.weights", vec![top, PAIRS]),
        ("pairs.bias", vec![PAIRS]),
        ("context.weights", vec![top, all]),
        ("context.bias", vec![all]),
        ("of_pair", vec![PAIRS, all]),
        ("of_coordinate", vec![START, all]),
        ("out.weights", vec![START, units, 3 * components]),
        ("out.bias", vec![START, 3 * components]),
    ];
    shapes.extend(head.map(|(name, shape)| (name.to_owned(), shape)));
    let (mut header, mut data) = (Map::new(), Vec::new());
    for (name, shape) in shapes {
        let begin = data.len();
        let value = if name == "input.stddev" { 1.0 } else { value };
        (0..shape.iter().product::<usize>()).for_each(|_| data.extend_from_slice(&value.to_le_bytes()));
        header.insert(name, json!({ "dtype": "F32", "shape": shape, "data_offsets": [begin, data.len()] }));
    }
    let mut header = Value::Object(header).to_string();
    // The data begin at a multiple of eight bytes.
    header += &" ".repeat(header.len().next_multiple_of(8) - header.len());
    let mut weights = (header.len() as u64).to_le_bytes().to_vec();
    weights.extend(header.as_bytes());
    weights.extend(data);
    manifest["weights"]["name"] = WEIGHTS.into();
    let manifest = matching(manifest.to_string().as_bytes(), &weights).unwrap_or_else(|| panic!("it names weights"));
    join(&[&manifest, &weights])
}
