//! `cargo xtask posterior-data`: a dataset as plain arrays, which `training/posterior.py` trains the posterior network on.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail, ensure};
use clap::Parser;
use dataset::{Episode, Reader};
use physics_model::Theta;
use physics_model::config::ObstacleMobility;
use pomdp::{Purpose, Seed};
use prior_training::starts::{self, FILES};
use program::{Failed, typed};
use push_task::state::State;
use push_task::{Action, Coordinates, Observation, Particle};
use rayon::prelude::*;
use scenario::{Problem, Scenario, Selection};
use serde_json::{Value, json};

/// Writes a dataset as arrays of starts and steps, for training/posterior.py.
#[derive(Debug, Parser)]
#[command(name = "posterior-data", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(flatten)]
    arm: program::Arm,
    /// Folder of the dataset.
    #[arg(long)]
    data: PathBuf,
    /// Scenario that the dataset was made of: what `datagen` was given.
    #[arg(long, default_value = "training")]
    scenario: String,
    #[command(flatten)]
    overrides: program::Overrides,
    /// Folder of the arrays, starts.f32, and of what they are, starts.json.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    work: program::Threads,
    #[command(flatten)]
    project: program::Project,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask posterior-data --data runs/data/sawyer-fixed --set data.movable_share=0.0 --out runs/starts/sawyer-fixed";

/// What went wrong after the input was found to be good.
const FAILED: Failed = Failed::new("the arrays were not written");

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let root = scenario::project_root(arguments.project.root.as_deref())?;
    rayon::ThreadPoolBuilder::new().num_threads(arguments.work.count()).build_global()?;
    let reader = Reader::open(&arguments.data)?;
    let selection = Selection {
        domain: arguments.scenario.clone(),
        robot: arguments.arm.robot.clone(),
        set: arguments.overrides.set.clone(),
        ..Selection::new(&root)
    };
    let scenario = selection.load()?;
    let (found, expected) = (&reader.manifest().scenario_hash, scenario.hash());
    ensure!(
        *found == expected,
        "{}: scenario_hash is {found}, and that of --robot, --scenario and --set is {expected}: give those of datagen",
        arguments.data.join("meta/info.json").display()
    );
    let mobility = mobility(&scenario)?;
    let problem = Problem::assemble(&scenario.with_mobility(mobility), &root)?;
    whole_file::check_owner(&arguments.out, "starts.json")?;
    let [values_file, about_file] = FILES.map(|file| arguments.out.join(file));
    if arguments.out.exists() {
        whole_file::check_own(&about_file, "a description", |text| text.contains("\"step_values\""))?;
        ensure!(
            about_file.exists() || !values_file.exists(),
            "{}: exists without {} beside it: choose another --out",
            values_file.display(),
            FILES[1]
        );
    }

    let (mut values, mut episodes, mut steps) = (Vec::new(), 0, None);
    for shard in 0..reader.manifest().shards.len() {
        let recorded = reader.shard_episodes(shard)?;
        // A world that diverged ends early; the others are as long as each other.
        let length = *steps.get_or_insert(recorded.iter().map(Episode::rows).max().unwrap_or(0));
        let rows: Vec<Option<Vec<f32>>> = recorded
            .par_iter()
            .map(|episode| if episode.rows() == length { row(&problem, episode) } else { None })
            .collect();
        for row in rows.into_iter().flatten() {
            episodes += 1;
            values.extend(row.iter().flat_map(|value| value.to_le_bytes()));
        }
    }
    let about = about(&problem, mobility, &reader, [episodes, steps.unwrap_or(0)]);
    starts::write(&arguments.out, &values, &about).context(FAILED)?;
    let left_out = reader.manifest().episodes - episodes as u64;
    program::out!("{}: {episodes} episodes, {left_out} that diverged are left out", typed(&arguments.out));
    Ok(())
}

/// That of all worlds of the dataset.
fn mobility(scenario: &Scenario) -> Result<ObstacleMobility> {
    match scenario.data.movable_share {
        0.0 => Ok(ObstacleMobility::Fixed),
        1.0 => Ok(ObstacleMobility::Movable),
        share => {
            bail!("data.movable_share is {share}, expected 0.0 or 1.0: a network is for one mobility of the obstacle")
        }
    }
}

/// Classes, coordinates and steps of an episode; `None` where its start is outside the distribution.
fn row(problem: &Problem, episode: &Episode) -> Option<Vec<f32>> {
    let model = &problem.model;
    let joints = model.joint_count();
    let observation = |row: usize| Observation(episode.observation(row).iter().map(|v| f64::from(*v)).collect());
    let theta = episode.theta.as_slice().try_into().ok()?;
    let theta = Theta::from_parts(&theta, [episode.classes[0], episode.classes[1]].map(usize::from));
    let state = State::from_slice(episode.state(0), joints, theta.obstacle.is_some());
    let coordinates = Coordinates::new(model, &problem.beliefs, &problem.start_joints_rad, &observation(0));
    let steps = (0..episode.rows()).map(|step| {
        let action = usize::try_from(episode.action[step]).ok().and_then(|index| Action::ALL.get(index).copied());
        (action, observation(step), &episode.state(step)[..joints])
    });
    let mut rng = Seed(0).stream(Purpose::Resolution, episode.episode);
    starts::values(problem, &coordinates, &Particle::new(state, theta), &mut rng, steps)
}

/// What the arrays are.
fn about(problem: &Problem, mobility: ObstacleMobility, reader: &Reader, size: [usize; 2]) -> Value {
    let manifest = reader.manifest();
    let dataset = json!({
        "plan_hash": manifest.plan_hash, "scenario_hash": manifest.scenario_hash, "seed": manifest.seed,
        "transitions": manifest.transitions, "commit": manifest.commit,
    });
    starts::about(problem, &problem.beliefs, mobility, size, &dataset)
}
