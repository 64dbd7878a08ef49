//! Run directories: identity, finished trials, resumption.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use agent::{Method, WorldIdentity};
use cluster::{Array, Engine, Event, Lock, Outcome};
use serde::{Deserialize, Serialize};

use crate::differences::named_keys;
use crate::files::{check_identity, claim, file_error, pretty, write_atomically};
use crate::log::{Log, Trials, cut_broken_line, parse_trials, read_log};
use crate::shards::{self, Shard};
use crate::{Error, Table, TrialRecord};

/// What decides the results of a run. A folder is resumed only by the same run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunIdentity {
    /// Version of this file's format.
    pub version: u32,
    /// Hash of the resolved scenario.
    pub scenario_hash: String,
    /// Root seed.
    pub seed: u64,
    /// Hash of the prior's weights; `None` where no method needs one.
    pub prior_hash: Option<String>,
    /// Hash of the arm's URDF file.
    pub urdf_hash: String,
    /// Commit of the checkout that the program runs in.
    pub commit: String,
    /// The world behind `--world`; `None` for our simulated one.
    pub world: Option<WorldIdentity>,
}

/// Where results come from: the identity of the run and of the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// The run.
    #[serde(flatten)]
    pub run: RunIdentity,
    /// Version of the program.
    pub program: String,
    /// Methods, in the order of the table.
    pub methods: Vec<Method>,
    /// Trials a method.
    pub trials: u32,
}

/// A run directory.
#[derive(Debug)]
pub struct Run {
    folder: PathBuf,
    provenance: Provenance,
    log: Mutex<Log>,
    finished: Trials,
    /// What is played here; everything where `None`.
    shard: Option<Shard>,
    /// Held by all but workers.
    _lock: Option<Lock>,
}

/// What lies in a run directory beside `run.json`.
pub(crate) const OURS: [&str; 6] = ["scenario.toml", "trials.jsonl", "table.json", "table.md", "table.csv", "shards"];

impl Run {
    /// Opens or creates `folder` for a run and holds it; reads the trials that are finished.
    ///
    /// # Errors
    ///
    /// A folder of another run, one that another program holds, an unreadable record, a folder that cannot be written. Nothing is
    /// overwritten.
    pub fn open(folder: &Path, provenance: Provenance, scenario_toml: &str) -> Result<Self, Error> {
        claim(folder, "run.json", &provenance.run, &OURS).map_err(|error| named_keys(error, folder, scenario_toml))?;
        let lock = Lock::take(&folder.join("run.json"))?;
        // After the identity, so that a kill in between leaves a folder that says whose it is.
        let scenario_file = folder.join("scenario.toml");
        if !scenario_file.exists() {
            write_atomically(&scenario_file, scenario_toml.as_bytes())?;
        }
        let log_file = folder.join("trials.jsonl");
        cut_broken_line(&log_file)?;
        let finished = read_trials(folder, &provenance)?;
        let log =
            OpenOptions::new().create(true).append(true).open(&log_file).map_err(file_error(&log_file, "opening"))?;
        let log = Mutex::new(Log::Own(log_file, log));
        Ok(Self { folder: folder.to_path_buf(), provenance, log, finished, shard: None, _lock: Some(lock) })
    }

    /// Opens the folder of a run for one of its workers, which plays a shard and leaves everything but a log of its own alone.
    ///
    /// # Errors
    ///
    /// A folder of another run or of none, an unreadable record.
    pub fn open_worker(folder: &Path, mut provenance: Provenance, shard: Shard) -> Result<Self, Error> {
        let file = folder.join("run.json");
        let text = std::fs::read_to_string(&file).map_err(|source| Error::File {
            file: file.clone(),
            action: "reading",
            source,
        })?;
        if provenance.run.commit == "unknown"
            && let Ok(begun) = serde_json::from_str::<RunIdentity>(&text)
        {
            // A node without git plays what it was sent to play.
            provenance.run.commit = begun.commit;
        }
        check_identity(&file, &text, &provenance.run)?;
        let finished = read_trials(folder, &provenance)?;
        let log = Mutex::new(Log::Attempt(folder.to_path_buf(), shard.index));
        Ok(Self { folder: folder.to_path_buf(), provenance, log, finished, shard: Some(shard), _lock: None })
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// All trials, methods in turn for each, with the shards that play them if there are `of`.
    pub(crate) fn items(&self, of: u32) -> impl Iterator<Item = (Shard, (Method, u32))> {
        let Provenance { methods, trials, .. } = &self.provenance;
        let shard = move |trial, place| Shard::of_item(trial, place, methods.len(), of);
        let row = move |trial| methods.iter().enumerate().map(move |(place, &m)| (shard(trial, place), (m, trial)));
        (0..*trials).flat_map(row)
    }

    /// All trials that are finished by now, whoever played them.
    ///
    /// # Errors
    ///
    /// Where a log cannot be read, or two of them disagree.
    pub fn trials(&self) -> Result<BTreeMap<(Method, u32), TrialRecord>, Error> {
        let mut trials = read_trials(&self.folder, &self.provenance)?;
        trials.retain(|(_, trial), _| *trial < self.provenance.trials);
        Ok(trials)
    }

    /// Trials that are still to be played, methods in turn for each trial.
    #[must_use]
    pub fn missing(&self) -> Vec<(Method, u32)> {
        let ours = |shard| self.shard.is_none_or(|mine| shard == mine);
        self.items(self.shard.map_or(1, |shard| shard.of))
            .filter(|(shard, item)| ours(*shard) && !self.finished.contains_key(item))
            .map(|(_, item)| item)
            .collect()
    }

    /// Number of trials that were finished when the folder was opened.
    #[must_use]
    pub fn resumed(&self) -> usize {
        self.finished.len()
    }

    /// Keeps a finished trial: one line, written at once, so that a kill leaves whole lines and at most one broken last one.
    ///
    /// # Errors
    ///
    /// Where the file cannot be written.
    ///
    /// # Panics
    ///
    /// If another thread panicked while writing.
    pub fn keep(&self, record: &TrialRecord) -> Result<(), Error> {
        let mut line = serde_json::to_string(record).expect("a record is plain data");
        line.push('\n');
        self.log.lock().expect("no thread panics while it writes").append(&line)
    }

    /// Writes the tables from all trials, in order.
    ///
    /// # Errors
    ///
    /// Where a trial is missing, where a file cannot be read or written.
    ///
    /// # Panics
    ///
    /// Never: records and tables are plain data, which has a JSON form.
    pub fn finish(
        &self,
        domain: &str,
        robot: &str,
        preset: &str,
        published: &BTreeMap<String, scenario::Published>,
    ) -> Result<Table, Error> {
        let log_file = self.folder.join("trials.jsonl");
        // Of all that is there, also what was asked for earlier: no trial is thrown away.
        let trials = read_trials(&self.folder, &self.provenance)?;
        if let Some((_, (method, trial))) = self.items(1).find(|(_, item)| !trials.contains_key(item)) {
            return Err(Error::MissingTrial { file: log_file, method: method.name(), trial });
        }
        // In order of method and trial, whatever order they ended in.
        let lines: String = trials
            .values()
            .map(|record| serde_json::to_string(record).expect("a record is plain data") + "\n")
            .collect();
        write_atomically(&log_file, lines.as_bytes())?;
        shards::remove(&self.folder)?;
        let table = Table::new(domain, robot, preset, &self.provenance, &trials, published);
        write_atomically(&self.folder.join("table.json"), pretty(&table).as_bytes())?;
        write_atomically(&self.folder.join("table.md"), table.to_markdown().as_bytes())?;
        write_atomically(&self.folder.join("table.csv"), table.to_csv().as_bytes())?;
        cluster::tidy(&self.folder)?;
        whole_file::sweep(&self.folder).map_err(|e| Error::File {
            file: e.path,
            action: "sweeping",
            source: e.source,
        })?;
        Ok(table)
    }

    /// Plays what is missing in an array of `shards` tasks of an engine, each with `processors` threads.
    ///
    /// # Errors
    ///
    /// Where the engine refuses, where trials are missing in the end, where a log cannot be read.
    pub fn play_on(
        &self,
        engine: Engine,
        shards: u32,
        processors: u32,
        interrupted: &AtomicBool,
        report: &mut dyn FnMut(Event),
    ) -> Result<Outcome, Error> {
        let array = Array { engine, label: "eval", folder: self.folder(), processors };
        array.run(|| self.missing_shards(shards), interrupted, report)
    }

    /// Shards, of `of`, with trials that nobody has finished by now.
    fn missing_shards(&self, of: u32) -> Result<Vec<u32>, Error> {
        let finished = self.trials()?;
        let items = self.items(of).filter(|(_, item)| !finished.contains_key(item));
        let shards: BTreeSet<u32> = items.map(|(shard, _)| shard.index).collect();
        Ok(shards.into_iter().collect())
    }
}

/// The commit that played the run in `folder`, if it is this one in all else and finished.
pub(crate) fn finished_by(folder: &Path, provenance: &Provenance) -> Result<Option<String>, Error> {
    let Ok(text) = std::fs::read_to_string(folder.join("run.json")) else { return Ok(None) };
    let Ok(begun) = serde_json::from_str::<RunIdentity>(&text) else { return Ok(None) };
    let commit = begun.commit.clone();
    if (RunIdentity { commit: provenance.run.commit.clone(), ..begun }) != provenance.run {
        return Ok(None);
    }
    let played = read_trials(folder, provenance)?;
    let all = (0..provenance.trials).all(|trial| provenance.methods.iter().all(|m| played.contains_key(&(*m, trial))));
    Ok(all.then_some(commit))
}

/// Finished trials of a run, its workers' among them.
fn read_trials(folder: &Path, provenance: &Provenance) -> Result<Trials, Error> {
    let file = folder.join("trials.jsonl");
    let mut trials = parse_trials(&file, &read_log(&file)?)?;
    // A world that is another program need not do the same twice.
    shards::add(folder, &mut trials, provenance.run.world.is_none())?;
    Ok(trials)
}

#[cfg(test)]
pub(crate) mod tests {
    use agent::Reason;

    use super::*;

    pub(crate) fn provenance(seed: u64) -> Provenance {
        Provenance {
            run: RunIdentity {
                version: 1,
                scenario_hash: "abc".into(),
                seed,
                prior_hash: None,
                urdf_hash: "def".into(),
                commit: "none".into(),
                world: None,
            },
            program: "test".into(),
            methods: vec![Method::NoRnn, Method::Heuristic],
            trials: 3,
        }
    }

    pub(crate) fn record(method: Method, trial: u32, success: bool) -> TrialRecord {
        let reason = if success { Reason::Goal } else { Reason::Horizon };
        TrialRecord { method, trial, success, reason, ..crate::trial::tests::record() }
    }

    fn finish(run: &Run) -> Table {
        run.finish("D1", "sawyer", "paper", &BTreeMap::new()).unwrap()
    }

    #[test]
    fn a_folder_of_another_scenario_is_refused_with_the_keys_that_differ() {
        let folder = tempfile::tempdir().unwrap();
        drop(
            Run::open(folder.path(), provenance(1), "[planner]\ndepth = 20\nbudget = { transitions = 6000 }\n")
                .unwrap(),
        );
        let mut other = provenance(1);
        other.run.scenario_hash = "other".into();
        let here = "[planner]\ndepth = 20\nbudget = { simulations = 7 }\n";
        let message = Run::open(folder.path(), other, here).err().unwrap().to_string();
        let expected = "belongs to a run of another scenario, `planner.budget.simulations` is missing there and 7 here, \
                        `planner.budget.transitions` is 6000 there and missing here: choose another --out or remove the folder";
        assert!(message.ends_with(expected), "{message}");
    }

    #[test]
    fn a_killed_run_goes_on_and_ends_with_the_same_table() {
        let whole = tempfile::tempdir().unwrap();
        let run = Run::open(whole.path(), provenance(1), "").unwrap();
        for (method, trial) in run.missing() {
            run.keep(&record(method, trial, trial == 1)).unwrap();
        }
        let expected = finish(&run);

        let killed = tempfile::tempdir().unwrap();
        let run = Run::open(killed.path(), provenance(1), "").unwrap();
        let items = run.missing();
        assert_eq!(items.len(), 6);
        // Out of order, and a kill in the middle of a write.
        for &(method, trial) in [&items[4], &items[1]] {
            run.keep(&record(method, trial, trial == 1)).unwrap();
        }
        drop(run);
        let log = killed.path().join("trials.jsonl");
        let mut text = std::fs::read_to_string(&log).unwrap();
        text.push_str("{\"method\":\"no-rnn\",\"tri");
        std::fs::write(&log, text).unwrap();
        let run = Run::open(killed.path(), provenance(1), "").unwrap();
        assert_eq!(run.resumed(), 2);
        for (method, trial) in run.missing() {
            run.keep(&record(method, trial, trial == 1)).unwrap();
        }
        assert_eq!(finish(&run), expected);
        for file in ["trials.jsonl", "table.json", "table.md", "table.csv"] {
            let (a, b) = (std::fs::read(whole.path().join(file)), std::fs::read(killed.path().join(file)));
            assert_eq!(a.unwrap(), b.unwrap(), "{file}");
        }
    }

    #[test]
    fn a_folder_of_another_run_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        drop(Run::open(folder.path(), provenance(1), "first").unwrap());
        let message = Run::open(folder.path(), provenance(2), "second").unwrap_err().to_string();
        assert!(message.contains("run.json") && message.contains("`seed` is 1, this run has 2"), "{message}");
        assert_eq!(std::fs::read_to_string(folder.path().join("scenario.toml")).unwrap(), "first");
    }

    #[test]
    fn a_finished_run_says_which_commit_played_it_and_another_or_half_a_run_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let run = Run::open(folder.path(), provenance(1), "").unwrap();
        let mut newer = provenance(1);
        newer.run.commit = "newer".into();
        let items = run.missing();
        for &(method, trial) in &items {
            assert_eq!(finished_by(folder.path(), &newer).unwrap(), None);
            run.keep(&record(method, trial, true)).unwrap();
        }
        assert_eq!(finished_by(folder.path(), &newer).unwrap(), Some("none".to_string()));
        newer.run.seed = 2;
        assert_eq!(finished_by(folder.path(), &newer).unwrap(), None);
    }

    #[test]
    fn a_folder_of_another_world_is_refused_both_ways() {
        let world = |version: &str| {
            let identity = WorldIdentity { address: "arm".into(), name: "arm".into(), version: version.into() };
            let ours = provenance(1);
            Provenance { run: RunIdentity { world: Some(identity), ..ours.run }, ..ours }
        };
        let runs = [provenance(1), world("1"), world("2")];
        for (first, one) in runs.iter().enumerate() {
            let folder = tempfile::tempdir().unwrap();
            drop(Run::open(folder.path(), one.clone(), "").unwrap());
            for (second, other) in runs.iter().enumerate() {
                let opened = Run::open(folder.path(), other.clone(), "");
                let message = opened.err().map(|error| error.to_string());
                assert_eq!(message.is_none(), first == second, "{message:?}");
                assert!(message.is_none_or(|message| message.contains("`world`")));
            }
        }
    }

    #[test]
    fn a_kill_at_any_point_of_the_start_leaves_a_folder_that_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        drop(Run::open(folder.path(), provenance(1), "resolved").unwrap());
        for last_written in ["trials.jsonl", "scenario.toml"] {
            std::fs::remove_file(folder.path().join(last_written)).unwrap();
        }
        drop(Run::open(folder.path(), provenance(1), "resolved").unwrap());
        assert_eq!(std::fs::read_to_string(folder.path().join("scenario.toml")).unwrap(), "resolved");
    }

    #[test]
    fn more_trials_go_on_where_fewer_ended() {
        let folder = tempfile::tempdir().unwrap();
        let few = Provenance { trials: 1, ..provenance(1) };
        let run = Run::open(folder.path(), few, "").unwrap();
        for (method, trial) in run.missing() {
            run.keep(&record(method, trial, true)).unwrap();
        }
        assert_eq!(finish(&run).rows[0].trials, 1);
        let message = Run::open(folder.path(), provenance(1), "").unwrap_err().to_string();
        assert!(message.contains("another program is at work"), "{message}");
        drop(run);
        let run = Run::open(folder.path(), provenance(1), "").unwrap();
        assert_eq!((run.resumed(), run.missing().len()), (2, 4));
    }

    #[test]
    fn shards_of_workers_make_the_same_files_as_a_run_without() {
        let alone = tempfile::tempdir().unwrap();
        let run = Run::open(alone.path(), provenance(1), "").unwrap();
        let keep = |run: &Run, (method, trial)| run.keep(&record(method, trial, trial == 1)).unwrap();
        run.missing().into_iter().for_each(|item| keep(&run, item));
        finish(&run);

        let folder = tempfile::tempdir().unwrap();
        let holder = Run::open(folder.path(), provenance(1), "").unwrap();
        for index in 0..4 {
            let worker = || Run::open_worker(folder.path(), provenance(1), Shard { index, of: 4 }).unwrap();
            // Two attempts at once play the same, a third has nothing to do.
            let (first, second) = (worker(), worker());
            first.missing().into_iter().for_each(|item| keep(&first, item));
            second.missing().into_iter().for_each(|item| keep(&second, item));
            assert_eq!(worker().missing(), []);
        }
        finish(&holder);
        for name in ["trials.jsonl", "table.json", "table.md", "table.csv"] {
            let read = |folder: &Path| std::fs::read_to_string(folder.join(name)).unwrap();
            assert_eq!(read(folder.path()), read(alone.path()), "{name}");
        }
        assert!(!folder.path().join("shards").exists());
        let other = Run::open_worker(folder.path(), provenance(2), Shard { index: 0, of: 4 }).unwrap_err();
        assert!(other.to_string().contains("`seed` is 1"), "{other}");
    }

    #[test]
    fn tables_are_not_made_of_half_a_run() {
        let folder = tempfile::tempdir().unwrap();
        let run = Run::open(folder.path(), provenance(1), "").unwrap();
        run.keep(&record(Method::NoRnn, 0, true)).unwrap();
        let message = run.finish("D1", "sawyer", "paper", &BTreeMap::new()).unwrap_err().to_string();
        assert!(message.contains("trial 0 of heuristic is missing"), "{message}");
        assert!(!folder.path().join("table.json").exists());
    }

    #[test]
    fn a_folder_with_files_of_unknown_origin_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("table.md"), "mine").unwrap();
        let message = Run::open(folder.path(), provenance(1), "").unwrap_err().to_string();
        assert!(message.contains("table.md") && message.contains("run.json"), "{message}");
        assert_eq!(std::fs::read_to_string(folder.path().join("table.md")).unwrap(), "mine");
    }

    #[test]
    fn a_broken_line_in_the_middle_is_named() {
        let folder = tempfile::tempdir().unwrap();
        drop(Run::open(folder.path(), provenance(1), "").unwrap());
        let good = serde_json::to_string(&record(Method::NoRnn, 0, true)).unwrap();
        std::fs::write(folder.path().join("trials.jsonl"), format!("{good}\nnonsense\n{good}\n")).unwrap();
        let message = Run::open(folder.path(), provenance(1), "").unwrap_err().to_string();
        assert!(message.contains("trials.jsonl: line 2"), "{message}");
    }
}
