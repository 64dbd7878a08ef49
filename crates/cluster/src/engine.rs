//! What can be asked of an engine.

use std::fmt;
use std::str::FromStr;

use crate::job::{Active, Submission};
use crate::{Error, hq, slurm};

/// Who makes the shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Executor {
    /// Threads of this program.
    Local,
    /// An engine, in other processes.
    Engine(Engine),
}

/// A queue of tasks that somebody else runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Slurm: `sbatch`, `squeue`, `scancel`.
    Slurm,
    /// HyperQueue: `hq`, with a server that runs.
    Hq,
}

impl fmt::Display for Executor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Local => "local",
            Self::Engine(engine) => engine.name(),
        })
    }
}

impl FromStr for Executor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "local" => Ok(Self::Local),
            "slurm" => Ok(Self::Engine(Engine::Slurm)),
            "hq" => Ok(Self::Engine(Engine::Hq)),
            _ => Err(format!("expected local, slurm or hq, found `{text}`")),
        }
    }
}

impl Engine {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Slurm => "slurm",
            Self::Hq => "hq",
        }
    }

    /// Checks that the engine is installed and answers: to be called before anything is written.
    ///
    /// # Errors
    ///
    /// [`Error::NoProgram`] and [`Error::Refused`].
    pub fn check(self) -> Result<(), Error> {
        self.active("surmise-none").map(|_| ())
    }

    /// The variable that holds a task's index.
    pub(crate) fn index_variable(self) -> &'static str {
        match self {
            Self::Slurm => "SLURM_ARRAY_TASK_ID",
            Self::Hq => "HQ_TASK_ID",
        }
    }

    /// The job of this name that is queued or running.
    pub(crate) fn active(self, name: &str) -> Result<Option<Active>, Error> {
        match self {
            Self::Slurm => slurm::active(name),
            Self::Hq => hq::active(name),
        }
    }

    /// Queues an array and returns the number of its job.
    pub(crate) fn submit(self, submission: &Submission<'_>) -> Result<String, Error> {
        match self {
            Self::Slurm => slurm::submit(submission),
            Self::Hq => hq::submit(submission),
        }
    }

    /// Ends a job.
    pub(crate) fn cancel(self, job: &str) -> Result<(), Error> {
        match self {
            Self::Slurm => slurm::cancel(job),
            Self::Hq => hq::cancel(job),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn executors_are_read_as_they_are_written_and_others_are_named() {
        for name in ["local", "slurm", "hq"] {
            assert_eq!(name.parse::<Executor>().unwrap().to_string(), name);
        }
        let message = "pbs".parse::<Executor>().unwrap_err();
        assert_eq!(message, "expected local, slurm or hq, found `pbs`");
    }
}
