//! Errors of this crate.

use std::path::PathBuf;

use thiserror::Error;

/// Why a run cannot go on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The scenario cannot be used.
    #[error(transparent)]
    Scenario(#[from] scenario::Error),
    /// The prior cannot be used.
    #[error(transparent)]
    Prior(#[from] prior::Error),
    /// A method does not go with the scenario, the prior or the world.
    #[error(transparent)]
    Agent(#[from] agent::Error),
    /// The world cannot be used.
    #[error(transparent)]
    World(#[from] agent::WorldError),
    /// No threads to play on.
    #[error("the threads that play trials cannot be started")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A plan of tables that says what cannot be.
    #[error("{file}: {problem}")]
    Plan {
        /// File.
        file: PathBuf,
        /// Key, expectation and value.
        problem: String,
    },
    /// A name that chooses no run.
    #[error("--only {name}: there is no table or run of this name, expected some of {known}")]
    Only {
        /// What was asked for.
        name: String,
        /// What exists.
        known: String,
    },
    /// A run whose worlds are not those of the runs beside it.
    #[error("{file}: run `{run}` changes the worlds or the task of {domain}: expected overrides of the method alone")]
    OtherWorlds {
        /// The table's file.
        file: PathBuf,
        /// Run.
        run: String,
        /// Domain.
        domain: String,
    },
    /// A picture cannot be drawn.
    #[error("figure {name}")]
    Figure {
        /// Its name.
        name: String,
        /// Cause.
        #[source]
        source: figures::Error,
    },
    /// The folder belongs to another run.
    #[error("{file}: key `{key}` is {found}, this run has {expected}: choose another --out or remove the folder")]
    OtherRun {
        /// `run.json`.
        file: PathBuf,
        /// Key.
        key: String,
        /// Its value there.
        found: String,
        /// Its value here.
        expected: String,
    },
    /// The folder belongs to a run of another scenario.
    #[error("{file}: belongs to a run of another scenario, {differences}: choose another --out or remove the folder")]
    OtherScenario {
        /// `run.json`.
        file: PathBuf,
        /// Keys and their values, there and here.
        differences: String,
    },
    /// Files that no run of ours has left there.
    #[error(
        "{file}: exists without {expected} beside it, so no run of this program wrote it: choose another --out or remove it"
    )]
    Foreign {
        /// What is there.
        file: PathBuf,
        /// What would say where it comes from.
        expected: &'static str,
    },
    /// A file that cannot be read or written.
    #[error("{file}: {action} failed")]
    File {
        /// File.
        file: PathBuf,
        /// What was tried.
        action: &'static str,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// A file that no run of ours can have left.
    #[error("{file}: expected a file of a run, {message}")]
    Archive {
        /// File.
        file: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A record that is not one.
    #[error("{file}: line {line}: expected a trial record, {message}")]
    Record {
        /// File.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What the parser says.
        message: String,
    },
    /// A trial failed.
    #[error("trial {trial} of {method}")]
    Trial {
        /// Trial.
        trial: u32,
        /// Method.
        method: &'static str,
        /// Cause.
        #[source]
        source: agent::Error,
    },
    /// No world to play in.
    #[error("trial {trial} of {method}: no world to play it in")]
    NoWorld {
        /// Trial.
        trial: u32,
        /// Method.
        method: &'static str,
        /// Cause.
        #[source]
        source: agent::WorldError,
    },
    /// A world that was another when the run began.
    #[error("the world says that it is {found}, but it was {expected} when the run began")]
    OtherWorld {
        /// Name and version now.
        found: String,
        /// Name and version then.
        expected: String,
    },
    /// A trial that nobody has played.
    #[error("{file}: trial {trial} of {method} is missing: run the same command again")]
    MissingTrial {
        /// `trials.jsonl`.
        file: PathBuf,
        /// Method.
        method: &'static str,
        /// Trial.
        trial: u32,
    },
    /// Two workers have played a trial and did not do the same.
    #[error(
        "{file}: trial {trial} of {method} went otherwise than in another log: these nodes do not compute alike; remove one of the two"
    )]
    Disagreement {
        /// Log of a worker.
        file: PathBuf,
        /// Method.
        method: &'static str,
        /// Trial.
        trial: u32,
    },
    /// The engine, or the lock of the folder.
    #[error(transparent)]
    Cluster(#[from] cluster::Error),
}
