//! A scenario file: a layer or a resolved one.

use pomdp::{Purpose, Seed};
use scenario::{Problem, Scenario, Selection};

use crate::Verdict;
use crate::verdict::{asset, folder, put, refused, root};

/// Loads the bytes as a domain. What is accepted loads again to the same, and gives a problem and a world, or a reason why not.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn scenario_toml(data: &[u8]) -> Verdict {
    let folder = folder();
    let file = folder.path().join("scenario.toml");
    put(&file, data);
    let load = || Selection { domain: file.display().to_string(), ..Selection::new(root()) }.load();
    let scenario = match load() {
        Ok(scenario) => scenario,
        // What a layer lacks is missing in all of them.
        Err(error) => return refused(&error, &["scenario.toml"]),
    };
    put(&file, scenario.to_toml().as_bytes());
    let again = load().unwrap_or_else(|error| panic!("a resolved scenario does not load again: {error}"));
    assert_eq!(again, scenario, "a resolved scenario loads again to the same");
    assembled(&scenario)
}

/// Makes the problem and draws a world.
pub(crate) fn assembled(scenario: &Scenario) -> Verdict {
    let names = ["robot.", "joint ", "link ", "scenario ", "inertia", ".urdf"];
    let problem = match Problem::assemble(scenario, &root()) {
        Ok(problem) => problem,
        Err(error) => return refused(&error, &names),
    };
    let mut rng = Seed(1).stream(Purpose::World, 0);
    match problem.sample_world(&mut rng) {
        Ok(_) => Verdict::Accepted,
        Err(error) => refused(&error, &names),
    }
}

/// All domains, and a resolved scenario.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let domains = ["d1", "d2", "d3", "d4", "d5", "obstacle", "tilted", "training"];
    let mut seeds: Vec<Vec<u8>> = domains.iter().map(|name| asset(&format!("scenarios/{name}.toml"))).collect();
    // Most keys stand in resolved ones.
    for (domain, robot, preset) in
        [("D4", "sawyer", "surmise"), ("obstacle", "jaco", "paper"), ("D1", "sawyer", "paper")]
    {
        let (domain, robot, preset) = (domain.into(), robot.into(), preset.into());
        let resolved = Selection { domain, robot, preset, ..Selection::new(root()) }.load();
        let resolved = resolved.unwrap_or_else(|error| panic!("{error}")).to_toml().into_bytes();
        seeds.extend([resolved.clone(), resolved.clone(), resolved]);
    }
    seeds
}
