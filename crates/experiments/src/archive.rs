//! A run directory that is only looked at: finished or not, of whatever commit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use agent::Method;
use figures::Figure;
use scenario::Published;
use whole_file::plain;

use crate::combined::{Combined, Common, Part};
use crate::files::file_error;
use crate::log::{parse_trials, read_log};
use crate::{Error, Provenance, RunIdentity, Table, TablePlan, TrialRecord, learning, pictures, shards};

/// As many as `eval` plays.
const MOST_TRIALS: u32 = 1_000_000;

/// What a run directory holds.
#[derive(Clone, Debug)]
pub struct Archive {
    /// Domain.
    pub domain: String,
    /// Arm.
    pub robot: String,
    /// Preset.
    pub preset: String,
    /// Counted from the trials that are there.
    pub table: Table,
    /// Those trials, in order of method and trial.
    pub trials: Vec<TrialRecord>,
    folder: String,
}

impl Archive {
    /// Reads a run directory. Nothing is locked or written: it may be a run that is being played.
    ///
    /// # Errors
    ///
    /// A folder without a run, or one whose files cannot be read.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        let file = folder.join("run.json");
        let text = read(&file)?;
        let refused = |file: &PathBuf, message: String| Error::Archive { file: file.clone(), message };
        let run: RunIdentity = serde_json::from_str(&text).map_err(|e| refused(&file, plain(&e.to_string())))?;
        let file = folder.join("scenario.toml");
        // As a table, not a scenario: that of another version of this program is as good to look at.
        let scenario: toml::Table = toml::from_str(&read(&file)?).map_err(|e| refused(&file, plain(e.message())))?;
        let name = |keys: &[&str]| {
            text_at(&scenario, keys).ok_or_else(|| refused(&file, format!("`{}` is missing", keys.join("."))))
        };
        let (domain, robot, preset) = (name(&["name"])?, name(&["robot", "name"])?, name(&["preset"])?);
        let published = published(&scenario, run.world.is_some());
        let file = folder.join("trials.jsonl");
        let mut trials = parse_trials(&file, &read_log(&file)?)?;
        shards::add(folder, &mut trials, run.world.is_none())?;
        if let Some((_, trial)) = trials.keys().find(|(_, trial)| *trial >= MOST_TRIALS) {
            return Err(refused(&file, format!("trial {trial}: expected a number below {MOST_TRIALS}")));
        }
        let methods: Vec<Method> =
            Method::ALL.into_iter().filter(|method| trials.keys().any(|(m, _)| m == method)).collect();
        let count = trials.keys().map(|(_, trial)| trial + 1).max().unwrap_or(0);
        let provenance = Provenance { run, program: String::new(), methods, trials: count };
        let table = Table::new(&domain, &robot, &preset, &provenance, &trials, &published);
        let folder = folder.file_name().map_or_else(|| domain.clone(), |name| name.to_string_lossy().into_owned());
        Ok(Self { domain, robot, preset, table, trials: trials.into_values().collect(), folder })
    }

    /// Pictures with their names: success, actions to the goal, errors of the belief over the actions.
    #[must_use]
    pub fn figures(&self) -> Vec<(String, Figure)> {
        if self.trials.is_empty() {
            return Vec::new();
        }
        let methods = self.table.provenance.methods.clone();
        let run = self.preset.clone();
        let part = Part {
            run,
            folder: self.folder.clone(),
            methods,
            included: false,
            set: Vec::new(),
            published: None,
            table: self.table.clone(),
            trials: self.trials.iter().map(|t| ((t.method, t.trial), t.clone())).collect(),
        };
        let parts = [part];
        let plan = TablePlan {
            version: 1,
            order: 0,
            title: format!("{} with {}, preset {}", self.domain, self.robot, self.preset),
            success_figure: None,
            robot: self.robot.clone(),
            domains: vec![self.domain.clone()],
            pools: Vec::new(),
            include: Vec::new(),
            runs: Vec::new(),
            name: "run".into(),
        };
        let common = Common { version: 1, seed: self.table.provenance.run.seed, quick: false, set: Vec::new() };
        let combined = Combined::new(&plan, &parts, Vec::new(), &common);
        pictures::all(&plan, &combined, &parts, &learning::curves(&parts))
    }
}

fn read(file: &Path) -> Result<String, Error> {
    std::fs::read_to_string(file).map_err(file_error(file, "reading"))
}

fn text_at(table: &toml::Table, keys: &[&str]) -> Option<String> {
    let (last, groups) = keys.split_last()?;
    let group = groups.iter().try_fold(table, |table, key| table.get(*key)?.as_table())?;
    Some(group.get(*last)?.as_str()?.to_owned())
}

/// The paper's figures that the scenario names, of which none are of another simulator.
fn published(scenario: &toml::Table, external: bool) -> BTreeMap<String, Published> {
    let found = || scenario.get("evaluation")?.as_table()?.get("published")?.clone().try_into().ok();
    if external { BTreeMap::new() } else { found().unwrap_or_default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::tests::record;

    #[test]
    fn a_run_that_is_not_finished_is_counted_as_far_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let identity = "{\"version\":1,\"scenario_hash\":\"a\",\"seed\":7,\"prior_hash\":null,\"urdf_hash\":\"b\",\"commit\":\"c\",\"world\":null}";
        write("run.json", identity);
        let published = "[evaluation.published]\nno-rnn = { successes = 1, trials = 30 }\n";
        write("scenario.toml", &format!("name = \"D4\"\npreset = \"paper\"\n[robot]\nname = \"sawyer\"\n{published}"));
        let lines: String = [(Method::NoRnn, 0, true), (Method::NoRnn, 1, false), (Method::Heuristic, 1, true)]
            .map(|(method, trial, success)| serde_json::to_string(&record(method, trial, success)).unwrap() + "\n")
            .concat();
        // A trial that is being written.
        write("trials.jsonl", &(lines + "{\"method\":\"no-rnn\",\"tri"));
        let archive = Archive::read(folder.path()).unwrap();
        let rows: Vec<_> = archive.table.rows.iter().map(|r| (r.method, r.successes, r.trials)).collect();
        assert_eq!(rows, [(Method::NoRnn, 1, 2), (Method::Heuristic, 1, 1)]);
        assert_eq!(archive.table.rows[0].published.map(|p| p.successes), Some(1));
        assert!(!archive.figures().is_empty());
        for figure in archive.figures() {
            figure.1.svg().unwrap();
        }
        write("scenario.toml", "name = 3");
        let error = Archive::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("scenario.toml") && error.contains("`name` is missing"), "{error}");
    }
}
