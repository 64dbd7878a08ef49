//! An array on its way through an engine.

use std::fmt;
use std::path::Path;

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
    fn neighbouring_indices_become_ranges() {
        for (shards, text) in
            [(&[] as &[u32], ""), (&[4], "4"), (&[0, 1, 2, 3], "0-3"), (&[0, 2, 3, 7, 9, 10], "0,2-3,7,9-10")]
        {
            assert_eq!(ranges(shards), text);
        }
        assert_eq!(ranges(&[u32::MAX - 1, u32::MAX]), "4294967294-4294967295");
    }
}
