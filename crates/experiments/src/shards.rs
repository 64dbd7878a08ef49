//! Trials that workers play: a log for each attempt at a shard, merged by the program that holds the folder.
//!
//! Two attempts at a shard may overlap, where an engine starts a task again that it only thought lost. So each writes a file of its own,
//! and a trial counts once, whoever played it: all but its time is a function of the run's identity.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::log::{Trials, parse_trials, read_log};

/// One of a number of shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 0.
    pub index: u32,
    /// How many there are.
    pub of: u32,
}

impl Shard {
    /// The shard, below `of`, that plays trial `trial` of method number `method` of `methods`. Trials go round the
    /// shards, and each method starts at another one. So each shard gets the same share of slow and fast methods, also
    /// with few trials.
    pub(crate) fn of_item(trial: u32, method: usize, methods: usize, of: u32) -> Self {
        let start = method as u64 * (of as usize).div_ceil(methods.max(1)) as u64;
        Self { index: ((u64::from(trial) + start) % u64::from(of.max(1))) as u32, of }
    }
}

/// Adds what workers have played to `trials`. A last line without its line feed, of a worker that is at it or was killed, is left out.
pub(crate) fn add(folder: &Path, trials: &mut Trials, same_everywhere: bool) -> Result<(), Error> {
    for file in logs(folder)? {
        // One that is gone has been merged by now.
        for (item, record) in parse_trials(&file, &read_log(&file)?)? {
            let kept = trials.entry(item).or_insert_with(|| record.clone());
            let same = (&kept.actions, kept.reason) == (&record.actions, record.reason);
            if same_everywhere && !same {
                let (method, trial) = (item.0.name(), item.1);
                return Err(Error::Disagreement { file, method, trial });
            }
        }
    }
    Ok(())
}

/// Removes the workers' logs, once their trials are in the folder's own.
pub(crate) fn remove(folder: &Path) -> Result<(), Error> {
    for file in logs(folder)? {
        std::fs::remove_file(&file).map_err(|source| Error::File { file, action: "removing", source })?;
    }
    // A worker that was thought lost may just begin a log: its trials are played already, and merged when the folder is opened next.
    let _ = std::fs::remove_dir(folder.join("shards"));
    Ok(())
}

/// The workers' logs, in the order of their names.
fn logs(folder: &Path) -> Result<BTreeSet<PathBuf>, Error> {
    let folder = folder.join("shards");
    let failed = |source| Error::File { file: folder.clone(), action: "listing", source };
    let entries = match std::fs::read_dir(&folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeSet::new()),
        entries => entries.map_err(failed)?,
    };
    let paths: Result<BTreeSet<PathBuf>, _> = entries.map(|entry| entry.map(|entry| entry.path())).collect();
    let mut paths = paths.map_err(failed)?;
    paths.retain(|path| path.extension().is_some_and(|end| end == "jsonl"));
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use agent::Method;

    use super::*;
    use crate::TrialRecord;
    use crate::log::Log;

    #[test]
    fn shards_get_the_same_share_of_every_method() {
        for (trials, methods, of) in [(30, 3, 6), (30, 3, 7), (30, 3, 90), (3, 2, 20), (31, 5, 4), (5, 1, 1)] {
            let mut shares = vec![vec![0; methods]; of as usize];
            for (trial, method) in (0..trials).flat_map(|trial| (0..methods).map(move |method| (trial, method))) {
                shares[Shard::of_item(trial, method, methods, of).index as usize][method] += 1;
            }
            let spread = |numbers: Vec<usize>| numbers.iter().max().unwrap() - numbers.iter().min().unwrap();
            for method in 0..methods {
                assert!(spread(shares.iter().map(|s| s[method]).collect()) <= 1, "{trials} {methods} {of}: {shares:?}");
            }
            let sums = shares.iter().map(|s| s.iter().sum()).collect();
            assert!(spread(sums) <= 2, "{trials} {methods} {of}: {shares:?}");
        }
    }

    #[test]
    fn attempts_write_files_of_their_own_and_what_a_kill_left_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let line = |trial: u32| {
            let record = TrialRecord { trial, ..crate::run::tests::record(Method::NoRnn, trial, true) };
            serde_json::to_string(&record).unwrap() + "\n"
        };
        let attempt = || Log::Attempt(folder.path().to_path_buf(), 0);
        let (mut first, mut second, idle) = (attempt(), attempt(), attempt());
        first.append(&line(0)).unwrap();
        second.append(&line(0)).unwrap();
        second.append(&line(1)).unwrap();
        second.append(&line(2)[..40]).unwrap();
        drop(idle);
        assert_eq!(logs(folder.path()).unwrap().len(), 2);
        let mut trials = Trials::new();
        add(folder.path(), &mut trials, true).unwrap();
        assert_eq!(trials.len(), 2);
        remove(folder.path()).unwrap();
        assert!(!folder.path().join("shards").exists());
        // Somebody who was thought lost goes on.
        first.append(&line(3)).unwrap();
        add(folder.path(), &mut Trials::new(), true).unwrap();
    }

    #[test]
    fn attempts_that_differ_are_an_error_in_worlds_of_our_own() {
        let folder = tempfile::tempdir().unwrap();
        let mut log = Log::Attempt(folder.path().to_path_buf(), 3);
        let record = crate::run::tests::record(Method::NoRnn, 5, true);
        let other = TrialRecord { actions: vec![1], ..record.clone() };
        log.append(&(serde_json::to_string(&other).unwrap() + "\n")).unwrap();
        let mut trials = Trials::from([((Method::NoRnn, 5), record.clone())]);
        let message = add(folder.path(), &mut trials, true).unwrap_err().to_string();
        assert!(message.contains("00003-") && message.contains("trial 5 of no-rnn"), "{message}");
        add(folder.path(), &mut trials, false).unwrap();
        assert_eq!(trials[&(Method::NoRnn, 5)], record, "the first counts");
    }
}
