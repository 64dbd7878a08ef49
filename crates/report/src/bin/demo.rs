//! `cargo xtask demo`: one episode to look at.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use agent::{Method, Network};
use anyhow::{Context as _, Result, ensure};
use clap::Parser;
use experiments::{TrialRecord, play_watched};
use pomdp::Seed;
use program::{Failed, typed};
use recording::{EpisodeTrace, Moment};
use report::{Observer, describe, episode_figure, episode_film, episode_page};
use scenario::{Problem, Scenario, Selection};
use whole_file::Owner;

/// Plays one episode, shows it in the terminal, and leaves a moving picture of it from above, a picture of the whole, a page and a trace.
#[derive(Debug, Parser)]
#[command(name = "demo", version, after_help = EXAMPLES)]
struct Arguments {
    /// Domain: D1 to D5, obstacle, tilted, or a scenario file.
    #[arg(long, default_value = "D4")]
    domain: String,
    #[command(flatten)]
    arm: program::Arm,
    /// Preset of belief and planner: surmise, paper, or a file.
    #[arg(long, default_value = scenario::PRESET)]
    preset: String,
    /// Method: no-rnn, rnn-max, rnn-sampling, mixture, oracle or heuristic [default: mixture with preset surmise, else rnn-sampling].
    #[arg(long)]
    method: Option<Method>,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of the trial, as in `eval` with this seed. In the default one of D4 an obstacle that the robot does not know of stands in
    /// its way.
    #[arg(long, default_value_t = 1)]
    trial: u32,
    #[command(flatten)]
    work: program::Threads,
    /// Small budgets: a glance whose result means nothing.
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    overrides: program::Overrides,
    /// Folder of the trained prior [default: the one trained here with the same --quick, else the shipped one].
    #[arg(long)]
    prior: Option<PathBuf>,
    /// Folder of the results [default: runs/demo/DOMAIN-ROBOT-PRESET-METHOD, with -seed-SEED-trial-TRIAL behind it for another world than the usual one; runs/quick/demo/… with --quick].
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    project: program::Project,
    /// Prints the record of the trial as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask demo
  cargo xtask demo --domain D3 --robot jaco --trial 4 --quick";

/// What went wrong after the input was found to be good.
const FAILED: Failed = Failed::new("the episode was not shown");

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let root = scenario::project_root(arguments.project.root.as_deref())?;
    let selection = Selection {
        root: root.clone(),
        domain: arguments.domain.clone(),
        robot: arguments.arm.robot.clone(),
        preset: arguments.preset.clone(),
        quick: arguments.quick,
        set: arguments.overrides.set.clone(),
        effects: None,
    };
    let scenario = selection.load()?;
    let threads = start_threads(arguments.work).context(FAILED)?;
    let problem = Problem::assemble(&scenario, &root)?.searched_by(threads);
    let method = arguments.method.unwrap_or(match scenario.belief.filter {
        scenario::Filter::Bridge => Method::Mixture,
        scenario::Filter::Rejection => Method::RnnSampling,
    });
    let default = || Network::default_folder(&root, &problem, arguments.quick);
    ensure!(
        method.needs_prior() || arguments.prior.is_none(),
        "--prior: method {} uses no network: leave it out, or choose another --method",
        method.name()
    );
    let folder = method.needs_prior().then(|| arguments.prior.clone().unwrap_or_else(default));
    let prior = folder.map(|folder| Network::load(&folder, &problem)).transpose()?;
    // What the method cannot do is said before a folder is made.
    agent::Agent::new(&problem, method, prior.as_ref())?;
    let out = arguments.out.clone().unwrap_or_else(|| {
        let runs = root.join(if arguments.quick { "runs/quick/demo" } else { "runs/demo" });
        let name = format!("{}-{}-{}-{}", scenario.name, scenario.robot.name, scenario.preset, method.name());
        // Another world than the usual one lies apart.
        let usual = (arguments.seed, arguments.trial) == (1, 1);
        runs.join(if usual { name } else { format!("{name}-seed-{}-trial-{}", arguments.seed, arguments.trial) })
    });
    let owner = Owner { program: "demo", subject: String::new() };
    whole_file::check_owner(&out, "trace.json").and_then(|()| owner.check(&out, &FILES)).map_err(|e| taken(&e))?;
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create {}", out.display()))?;
    let game = Game { arguments, scenario: &scenario, problem: &problem, method, prior: prior.as_ref() };
    // Held until the end: another program that would write there is refused before it plays.
    let claim = owner.claim(&out).map_err(|e| match e.source.kind() {
        ErrorKind::AlreadyExists => taken(&e),
        _ => anyhow::Error::from(e).context(FAILED),
    })?;
    let (record, trace) = match game.play(scenario::commit(&root)) {
        Ok(played) => played,
        Err(error) => {
            claim.give_up();
            return Err(error.context(FAILED));
        }
    };
    write(&trace, &out).context(FAILED)?;
    if arguments.json {
        program::print(&format!("{}\n", serde_json::to_string(&record)?)).context(FAILED)?;
    } else {
        program::print(&describe::summary(&trace, &record)).context(FAILED)?;
        program::say!("written to {}: {}", typed(&out), FILES.join(", "));
        suggest_next(arguments, &out);
    }
    Ok(())
}

/// What is left in the folder.
const FILES: [&str; 5] = ["animation.png", "episode.png", "episode.svg", "episode.html", "trace.json"];

/// A folder that holds something else.
fn taken(error: &whole_file::Error) -> anyhow::Error {
    anyhow::anyhow!("{error}: {}", error.source)
}

/// Starts the threads that simulate particles, and says how many trees are searched at a time.
fn start_threads(asked: program::Threads) -> Result<usize> {
    // What the search does with more threads than it has trees is nothing.
    rayon::ThreadPoolBuilder::new().num_threads(asked.count()).build_global()?;
    Ok(rayon::current_num_threads())
}

/// The same task again, in numbers or step by step.
fn suggest_next(arguments: &Arguments, out: &Path) {
    program::say!("open {} in a browser to see it step by step", typed(&out.join("episode.html")));
    let mut eval: Vec<String> = ["cargo", "xtask", "eval", "--domain", &arguments.domain].map(String::from).to_vec();
    let chosen = [("--robot", &arguments.arm.robot, "sawyer"), ("--preset", &arguments.preset, scenario::PRESET)];
    for (option, value, usual) in chosen {
        if value != usual {
            eval.extend([option.to_string(), value.clone()]);
        }
    }
    if let Some(method) = arguments.method {
        let domain = Path::new(&arguments.domain).file_stem().unwrap_or_default().to_string_lossy();
        let runs = if arguments.quick { "runs/quick/eval" } else { "runs/eval" };
        let apart = format!("{runs}/{domain}-{}", method.name());
        eval.extend(["--methods".into(), method.name().into(), "--out".into(), apart]);
    }
    if let Some(prior) = &arguments.prior {
        eval.extend(["--prior".into(), typed(prior)]);
    }
    eval.extend(arguments.quick.then(|| "--quick".into()));
    eval.extend(arguments.overrides.set.iter().flat_map(|set| ["--set".to_string(), set.clone()]));
    eval.extend(["--trials".to_string(), "10".into()]);
    let rerun = ["cargo".to_string(), "xtask".into(), "rerun".into(), typed(out)];
    program::next(&[
        (eval, "plays more worlds of it, and prints a table"),
        (rerun.to_vec(), "makes a recording for the Rerun viewer; its first build takes a quarter of an hour"),
    ]);
}

/// What is played.
struct Game<'a> {
    arguments: &'a Arguments,
    scenario: &'a Scenario,
    problem: &'a Problem,
    method: Method,
    prior: Option<&'a Network>,
}

impl Game<'_> {
    fn play(&self, commit: String) -> Result<(TrialRecord, EpisodeTrace)> {
        let Self { arguments, scenario, problem, method, prior } = *self;
        let title = format!(
            "{} with {}, preset {}, {}: trial {} of seed {}",
            scenario.name,
            scenario.robot.name,
            scenario.preset,
            method.name(),
            arguments.trial,
            arguments.seed
        );
        program::say(&title);
        let mut count = 0;
        let mut tell = |moment: &Moment| {
            // Whatever becomes of the terminal, the episode is played to its end.
            program::say(&describe::moment(count, moment));
            count += 1;
        };
        let mut observer = Observer::new(&problem.model, &mut tell);
        let (record, episode) =
            play_watched(problem, method, prior, Seed(arguments.seed), arguments.trial, &mut observer)?;
        let task = &scenario.task.goal;
        let trace = EpisodeTrace {
            title,
            domain: scenario.name.clone(),
            robot: scenario.robot.name.clone(),
            preset: scenario.preset.clone(),
            method: method.name().into(),
            seed: arguments.seed,
            trial: arguments.trial,
            commit,
            goal: recording::Goal { center_m: [task.x_m, task.y_m], radius_m: task.radius_m },
            table_height_m: scenario.world.table_height_m,
            tool: report::tool_parts(problem.model.robot()),
            moments: observer.into_moments(),
            reason: record.reason.name().into(),
            success: record.success,
            discounted_return: episode.discounted_return,
            ..EpisodeTrace::default()
        };
        Ok((record, trace))
    }
}

fn write(trace: &EpisodeTrace, out: &Path) -> Result<()> {
    recording::write(trace, &out.join("trace.json"))?;
    let figure = episode_figure(trace);
    figure.save(&out.join("episode"))?;
    let page = episode_page(trace, &figure.svg()?);
    for (name, bytes) in [("animation.png", episode_film(trace)?), ("episode.html", page.into_bytes())] {
        whole_file::write(&out.join(name), &bytes, whole_file::Existing::Replace)
            .map_err(|e| anyhow::anyhow!("cannot write {}: {}", e.path.display(), e.source))?;
    }
    Ok(())
}
