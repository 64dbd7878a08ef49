//! The network of a bridge filter: `posterior.json` and its weights.

use std::sync::OnceLock;

use pomdp::{Purpose, Seed};
use prior::posterior::{FILE, PosteriorNetwork};
use push_task::Observation;
use push_task::sensor::observation_names;
use scenario::{Problem, Selection};

use super::checkpoint::{WEIGHTS, named, once_more_with_its_hash};
use crate::Verdict;
use crate::parts::join;
use crate::verdict::{asset, folder, put, refused, root};

/// Loads the two files, and once more with true size and hash (see [`checkpoint`](super::checkpoint)). What is accepted takes a step, its probabilities sum to one,
/// and what it draws has a density.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn posterior(data: &[u8]) -> Verdict {
    once_more_with_its_hash(data, load)
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

/// The small network that the tests of its reader have: true weights would take nearly all changes.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let file = |name: &str| asset(&format!("crates/prior/tests/data/posterior/{name}"));
    let manifest = file(FILE);
    let weights = file(&named(&manifest).unwrap_or_else(|| panic!("it names its weights")));
    vec![join(&[&manifest, &weights])]
}
