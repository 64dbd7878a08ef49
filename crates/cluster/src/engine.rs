//! What can be asked of an engine.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

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

/// An array as it is submitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Submission<'a> {
    /// Name of the job.
    pub(crate) name: &'a str,
    /// Script that makes the shard of its index.
    pub(crate) script: &'a Path,
    /// Folder of the logs.
    pub(crate) logs: &'a Path,
    /// Indices.
    pub(crate) shards: &'a [u32],
    /// Processors of each task.
    pub(crate) processors: u32,
}

/// A job that is queued or running.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Active {
    /// Number of the job.
    pub(crate) job: String,
    /// Tasks at work.
    pub(crate) running: usize,
    /// Tasks that wait.
    pub(crate) pending: usize,
    /// Why one of them waits, in the engine's words.
    pub(crate) reason: Option<String>,
}

impl fmt::Display for Active {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "job {}: {} running, {} waiting", self.job, self.running, self.pending)?;
        self.reason.as_ref().map_or(Ok(()), |reason| write!(f, " ({reason})"))
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

/// Sorted indices as both engines write them: `0-3,7`.
pub(crate) fn ranges(shards: &[u32]) -> String {
    let mut ranges: Vec<(u32, u32)> = Vec::new();
    for &shard in shards {
        match ranges.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(shard) => *last = shard,
            _ => ranges.push((shard, shard)),
        }
    }
    let text = |(first, last): &(u32, u32)| if first == last { first.to_string() } else { format!("{first}-{last}") };
    ranges.iter().map(text).collect::<Vec<_>>().join(",")
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

    #[test]
    fn neighbouring_indices_become_ranges() {
        for (shards, text) in
            [(&[] as &[u32], ""), (&[4], "4"), (&[0, 1, 2, 3], "0-3"), (&[0, 2, 3, 7, 9, 10], "0,2-3,7,9-10")]
        {
            assert_eq!(ranges(shards), text);
        }
        assert_eq!(ranges(&[u32::MAX - 1, u32::MAX]), "4294967294-4294967295");
    }
}
