//! The menu: one verb, one release program. It builds what it runs, and never links it.

mod built;
mod ci;
mod completions;
mod describe;
mod doctor;
mod groups;

use std::process::ExitCode;

use built::{become_program, become_viewer};
use clap::{FromArgMatches as _, Parser, Subcommand};

/// Commands of the project.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", version)]
struct Menu {
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Generates training data.
    #[command(disable_help_flag = true)]
    Datagen(Rest),
    /// Trains the prior.
    #[command(disable_help_flag = true)]
    Train(Rest),
    /// Writes a dataset as arrays for training/posterior.py.
    #[command(disable_help_flag = true)]
    PosteriorData(Rest),
    /// Compares what the prior says of held-out episodes with the truth.
    #[command(disable_help_flag = true)]
    Calibrate(Rest),
    /// Plays trials of methods on a domain and prints the table.
    #[command(disable_help_flag = true)]
    Eval(Rest),
    /// Plays one episode to look at: in the terminal, as a picture, as a page.
    #[command(disable_help_flag = true)]
    Demo(Rest),
    /// Makes a page of a run, of all tables, or of an episode.
    #[command(disable_help_flag = true)]
    Report(Rest),
    /// Makes a recording of an episode for the Rerun viewer; its first build takes long.
    #[command(
        disable_help_flag = true,
        override_usage = "cargo xtask rerun [OPTIONS] <EPISODE>",
        after_help = "\
<EPISODE>     Folder of the episode, or its trace.json
--out <FILE>  The recording [default: episode.rrd beside trace.json]

Examples:
  cargo xtask rerun runs/demo/D4-sawyer-surmise-mixture"
    )]
    Rerun(Rest),
    /// Turns a recording or published measurements into a log that can be diagnosed.
    #[command(disable_help_flag = true)]
    ImportLog(Rest),
    /// Records a log in the true world of a scenario, to rehearse a diagnosis.
    #[command(disable_help_flag = true)]
    RecordLog(Rest),
    /// Shows what a URDF file says about an arm and what looks wrong, and writes motions that show what it lacks.
    #[command(disable_help_flag = true)]
    Robot(Rest),
    /// Looks at a log before anything is concluded from it: units, frames, sizes, clocks, sensors.
    #[command(disable_help_flag = true)]
    Log(Rest),
    /// Finds where a measured log and the simulation disagree, and names the missing effect.
    #[command(disable_help_flag = true)]
    Diagnose(Rest),
    /// Scores diagnose on generated logs whose hidden effect it cannot know.
    #[command(disable_help_flag = true)]
    DiagnoseBenchmark(Rest),
    /// Learns how diagnose decides from logs of other engines, and judges it on the engine left out.
    #[command(disable_help_flag = true)]
    DiagnoseLearn(Rest),
    /// Learns how the diagnosis of arms decides from simulated logs of joints, and judges it on the engine left out.
    #[command(disable_help_flag = true)]
    ArmLearn(Rest),
    /// Measures time and accuracy, beside other programs where those are installed.
    #[command(disable_help_flag = true)]
    Bench(Rest),
    /// Explains and checks every key of a scenario; prints the format's schema for editors.
    #[command(disable_help_flag = true)]
    Scenario(Rest),
    /// Builds the book and the API docs into one folder.
    #[command(disable_help_flag = true)]
    Docs(Rest),
    /// Checks that this machine has what the project needs, before anything is built.
    Doctor(doctor::Options),
    /// Prints a script that completes these commands in a shell.
    Completions(completions::Options),
    /// Prints all commands with their options as JSON, for the page of commands.
    #[command(hide = true)]
    Describe,
    /// Runs exactly what CI runs: formatting, lints, all tests; says which were skipped and which are slow.
    #[command(after_help = "Examples:\n  cargo xtask ci\n  cargo xtask ci --all-features")]
    Ci(ci::Options),
}

#[derive(Debug, clap::Args)]
struct Rest {
    /// Options of the program.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

fn main() -> ExitCode {
    let mut menu = groups::menu();
    let chosen = Menu::from_arg_matches(&menu.get_matches_mut()).unwrap_or_else(|error| error.exit());
    let Some(verb) = chosen.verb else {
        // Who asks for nothing wants to see what there is.
        program::show(&menu.render_help().to_string());
        return ExitCode::SUCCESS;
    };
    let result = match verb {
        Verb::Datagen(rest) => become_program("datagen", &rest.arguments),
        Verb::Train(rest) => become_program("train", &rest.arguments),
        Verb::PosteriorData(rest) => become_program("posterior-data", &rest.arguments),
        Verb::Calibrate(rest) => become_program("calibrate", &rest.arguments),
        Verb::Eval(rest) => become_program("eval", &rest.arguments),
        Verb::Demo(rest) => become_program("demo", &rest.arguments),
        Verb::Report(rest) => become_program("report", &rest.arguments),
        Verb::Rerun(rest) => become_viewer(&rest.arguments),
        Verb::ImportLog(rest) => become_program("import-log", &rest.arguments),
        Verb::RecordLog(rest) => become_program("record-log", &rest.arguments),
        Verb::Log(rest) => become_program("log", &rest.arguments),
        Verb::Diagnose(rest) => become_program("diagnose", &rest.arguments),
        Verb::DiagnoseBenchmark(rest) => become_program("diagnose-benchmark", &rest.arguments),
        Verb::DiagnoseLearn(rest) => become_program("diagnose-learn", &rest.arguments),
        Verb::ArmLearn(rest) => become_program("arm-learn", &rest.arguments),
        Verb::Robot(rest) => become_program("robot", &rest.arguments),
        Verb::Bench(rest) => become_program("bench", &rest.arguments),
        Verb::Scenario(rest) => become_program("scenario", &rest.arguments),
        Verb::Docs(rest) => become_program("docs", &rest.arguments),
        Verb::Doctor(options) => doctor::run(&options),
        Verb::Completions(options) => completions::run(&options),
        Verb::Describe => describe::run(),
        Verb::Ci(options) => ci::run(&options),
    };
    result.unwrap_or_else(|error| {
        program::complain(&error);
        ExitCode::FAILURE
    })
}
