//! Which runs make which table: the files in `scenarios/tables/`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use agent::Method;
use scenario::{Published, Selection};
use serde::Deserialize;

use crate::Error;
use crate::files::file_error;

/// Version of the files that this crate reads.
const VERSION: u32 = 1;
/// Where they are, below the project's folder.
const FOLDER: &str = "scenarios/tables";

/// A table: runs on the same domains with the same arm.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TablePlan {
    /// Version of the file's format.
    pub version: u32,
    /// Tables are played in this order.
    pub order: u32,
    /// For people.
    pub title: String,
    /// Name of the picture of success rates; the table's with `-success` where it is missing.
    pub success_figure: Option<String>,
    /// Arm.
    pub robot: String,
    /// Domains.
    pub domains: Vec<String>,
    /// Sums over domains.
    #[serde(default)]
    pub pools: Vec<Pool>,
    /// Runs of other tables that stand beside these.
    #[serde(default)]
    pub include: Vec<Include>,
    /// Runs, each on every domain.
    pub runs: Vec<RunPlan>,
    /// Name: that of the file.
    #[serde(skip)]
    pub name: String,
}

/// Domains whose trials are counted together.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pool {
    /// Name in tables.
    pub name: String,
    /// Domains.
    pub domains: Vec<String>,
}

/// A run of another table.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Include {
    /// `TABLE-RUN`.
    pub run: String,
    /// The methods that are of interest here.
    pub methods: Vec<Method>,
}

/// A run.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunPlan {
    /// Name in the table.
    pub name: String,
    /// Preset.
    pub preset: String,
    /// Methods.
    pub methods: Vec<Method>,
    /// Overrides of scenario entries: `key=value`.
    #[serde(default)]
    pub set: Vec<String>,
    /// A Python program, below the project's folder, that speaks the world protocol; our simulation where it is missing.
    pub python_world: Option<PathBuf>,
    /// Published results by method; those of the domain where it is missing.
    pub published: Option<BTreeMap<String, Published>>,
}

/// One run directory: a run on one domain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item<'a> {
    /// Table.
    pub table: &'a TablePlan,
    /// Run.
    pub run: &'a RunPlan,
    /// Domain.
    pub domain: &'a str,
}

impl Item<'_> {
    /// `TABLE-RUN`.
    #[must_use]
    pub fn group(&self) -> String {
        format!("{}-{}", self.table.name, self.run.name)
    }

    /// The scenario in the project `root`, with overrides `set` after the run's own.
    #[must_use]
    pub fn selection(&self, root: &Path, quick: bool, set: &[String]) -> Selection {
        Selection {
            root: root.to_path_buf(),
            domain: self.domain.into(),
            robot: self.table.robot.clone(),
            preset: self.run.preset.clone(),
            quick,
            set: self.run.set.iter().chain(set).cloned().collect(),
            effects: None,
        }
    }

    /// Name of the run directory: `TABLE-RUN-DOMAIN`.
    #[must_use]
    pub fn folder(&self) -> String {
        format!("{}-{}", self.group(), self.domain)
    }
}

/// All tables, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Tables.
    pub tables: Vec<TablePlan>,
}

impl Plan {
    /// Reads `scenarios/tables/` of the project in `root`.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or that says what cannot be: file, key and expectation.
    pub fn load(root: &Path) -> Result<Self, Error> {
        let folder = root.join(FOLDER);
        let entries = std::fs::read_dir(&folder).map_err(file_error(&folder, "listing"))?;
        let mut files = Vec::new();
        for entry in entries {
            files.push(entry.map_err(file_error(&folder, "listing"))?.path());
        }
        files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
        files.sort();
        let mut tables = files.iter().map(|file| TablePlan::load(file)).collect::<Result<Vec<_>, Error>>()?;
        tables.sort_by_key(|table| table.order);
        let plan = Self { tables };
        match plan.problem() {
            Some((table, problem)) => Err(Error::Plan { file: folder.join(format!("{table}.toml")), problem }),
            None => Ok(plan),
        }
    }

    /// Every run directory, in order.
    #[must_use]
    pub fn items(&self) -> Vec<Item<'_>> {
        let runs = self.tables.iter().flat_map(|table| table.runs.iter().map(move |run| (table, run)));
        runs.flat_map(|(table, run)| table.domains.iter().map(move |domain| Item { table, run, domain })).collect()
    }

    /// Whether `only` chooses an item: all where it is empty, else by table, `TABLE-RUN` or run directory.
    ///
    /// # Errors
    ///
    /// [`Error::Only`] for a name that chooses nothing.
    pub fn chosen(&self, only: &[String]) -> Result<Vec<bool>, Error> {
        let items = self.items();
        let names = |item: &Item<'_>| [item.table.name.clone(), item.group(), item.folder()];
        if let Some(name) = only.iter().find(|name| !items.iter().any(|item| names(item).contains(name))) {
            let known: BTreeSet<String> =
                items.iter().flat_map(|item| [item.table.name.clone(), item.group()]).collect();
            let known: Vec<String> = known.into_iter().collect();
            return Err(Error::Only { name: name.clone(), known: known.join(", ") });
        }
        let chosen = |item: &Item<'_>| only.is_empty() || names(item).iter().any(|name| only.contains(name));
        Ok(items.iter().map(chosen).collect())
    }

    /// What is wrong, and in which table, where it shows only beside the others.
    fn problem(&self) -> Option<(String, String)> {
        let groups: BTreeSet<String> = self.items().iter().map(Item::group).collect();
        let mut folders = BTreeSet::new();
        if let Some(item) = self.items().into_iter().find(|item| !folders.insert(item.folder())) {
            let problem = format!("runs.name: expected another than `{}`, which gives a folder twice", item.run.name);
            return Some((item.table.name.clone(), problem));
        }
        self.tables.iter().find_map(|table| {
            let missing = table.include.iter().find(|include| !groups.contains(&include.run))?;
            let known: Vec<String> = groups.iter().cloned().collect();
            let problem = format!("include.run: expected one of {}, found `{}`", known.join(", "), missing.run);
            Some((table.name.clone(), problem))
        })
    }
}

impl TablePlan {
    fn load(file: &Path) -> Result<Self, Error> {
        #[derive(Deserialize)]
        struct Head {
            version: Option<u32>,
        }
        let text = std::fs::read_to_string(file).map_err(file_error(file, "reading"))?;
        let problem = |problem: String| Error::Plan { file: file.to_path_buf(), problem: problem.replace('\n', " ") };
        let said = |e: toml::de::Error| {
            let line = whole_file::line_of(&text, e.span().map_or(0, |span| span.start));
            problem(format!("line {line}: {}", whole_file::plain(e.message())))
        };
        let head: Head = toml::from_str(&text).map_err(said)?;
        if head.version != Some(VERSION) {
            let found = head.version.map_or("none".into(), |version| version.to_string());
            return Err(problem(format!("version: expected {VERSION}, found {found}")));
        }
        let mut table: Self = toml::from_str(&text).map_err(said)?;
        table.name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match table.problem() {
            Some(found) => Err(problem(found)),
            None => Ok(table),
        }
    }

    /// Name of the picture of success rates.
    #[must_use]
    pub fn success_figure(&self) -> String {
        self.success_figure.clone().unwrap_or_else(|| format!("{}-success", self.name))
    }

    fn problem(&self) -> Option<String> {
        // They become names of folders and files.
        let plain = |name: &str| {
            name.starts_with(|c: char| c.is_ascii_alphanumeric())
                && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c))
        };
        let expectation = "letters, digits, `-` and `_`, first a letter or digit";
        let names = [("the file's name", &self.name)].into_iter();
        let names = names.chain(self.success_figure.iter().map(|name| ("success_figure", name)));
        let names = names.chain(self.domains.iter().map(|name| ("domains", name)));
        let mut names = names.chain(self.runs.iter().map(|run| ("runs.name", &run.name)));
        if let Some((key, name)) = names.find(|(_, name)| !plain(name)) {
            return Some(format!("{key}: expected {expectation}, found `{name}`"));
        }
        if self.domains.is_empty() || self.runs.is_empty() {
            return Some("domains, runs: expected at least one of each".into());
        }
        if let Some(run) = self.runs.iter().find(|run| run.methods.is_empty()) {
            return Some(format!("runs.methods: expected at least one method in run `{}`", run.name));
        }
        let unknown = |pool: &&Pool| pool.domains.is_empty() || pool.domains.iter().any(|d| !self.domains.contains(d));
        let pool = self.pools.iter().find(unknown)?;
        let known = self.domains.join(", ");
        Some(format!("pools.domains: expected some of {known}, found {:?} in pool `{}`", pool.domains, pool.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "version = 1\norder = 1\ntitle = \"T\"\nrobot = \"sawyer\"\ndomains = [\"D1\", \"D2\"]\n\
                         [[runs]]\nname = \"paper\"\npreset = \"paper\"\nmethods = [\"no-rnn\"]\n";

    fn load(files: &[(&str, &str)]) -> Result<Plan, String> {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join(FOLDER);
        std::fs::create_dir_all(&folder).unwrap();
        for (name, text) in files {
            std::fs::write(folder.join(name), text).unwrap();
        }
        Plan::load(root.path()).map_err(|error| error.to_string())
    }

    #[test]
    fn the_plan_of_this_project_has_the_tables_of_the_paper() {
        let root = scenario::find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let plan = Plan::load(&root).unwrap();
        let names: Vec<&str> = plan.tables.iter().map(|table| table.name.as_str()).collect();
        assert_eq!(names, ["table1", "table2", "ablation"]);
        let folders: Vec<String> = plan.items().iter().map(Item::folder).collect();
        assert_eq!(folders[..2], ["table1-paper-D1", "table1-paper-D2"]);
        assert!(folders.contains(&"table2-surmise-obstacle".into()));
        for item in plan.items() {
            let loaded = item.selection(&root, false, &[]).load();
            let scenario = loaded.unwrap_or_else(|error| panic!("{}: {error}", item.folder()));
            assert_eq!((&scenario.name, &scenario.robot.name), (&item.domain.to_string(), &item.table.robot));
        }
        let published = plan.tables[0].runs[0].methods.iter().filter(|method| Method::PUBLISHED.contains(method));
        assert_eq!(published.count(), 3);
    }

    #[test]
    fn runs_are_chosen_by_table_by_run_or_by_folder() {
        let two = TABLE.replace("name = \"paper\"", "name = \"surmise\"").replace("order = 1", "order = 0");
        let plan = load(&[("a.toml", TABLE), ("b.toml", &two)]).unwrap();
        let folders: Vec<String> = plan.items().iter().map(Item::folder).collect();
        assert_eq!(folders, ["b-surmise-D1", "b-surmise-D2", "a-paper-D1", "a-paper-D2"]);
        let chosen = |only: &[&str]| plan.chosen(&only.iter().map(ToString::to_string).collect::<Vec<_>>()).unwrap();
        assert_eq!(chosen(&[]), [true; 4]);
        assert_eq!(chosen(&["a"]), [false, false, true, true]);
        assert_eq!(chosen(&["b-surmise", "a-paper-D2"]), [true, true, false, true]);
        let message = plan.chosen(&["c".into()]).unwrap_err().to_string();
        assert!(message.contains("--only c:") && message.contains("a, a-paper, b, b-surmise"), "{message}");
    }

    #[test]
    fn a_faulty_plan_names_file_key_and_expectation() {
        let message = |text: &str| load(&[("t.toml", text)]).unwrap_err();
        let cases: [(String, &[&str]); 7] = [
            (TABLE.replace("version = 1", "version = 2"), &["version", "expected 1, found 2"]),
            (TABLE.replace("title", "titel"), &["titel", "title"]),
            (TABLE.replace("[\"no-rnn\"]", "[\"rnn\"]"), &["rnn-sampling"]),
            (TABLE.replace("[\"no-rnn\"]", "[]"), &["runs.methods", "`paper`"]),
            (TABLE.replace("name = \"paper\"", "name = \"../paper\""), &["runs.name", "`../paper`"]),
            (
                TABLE.replace("[[runs]]", "pools = [{ name = \"all\", domains = [\"D3\"] }]\n[[runs]]"),
                &["pools", "D1, D2"],
            ),
            (
                TABLE.replace("[[runs]]", "include = [{ run = \"u-paper\", methods = [] }]\n[[runs]]"),
                &["include.run", "t-paper", "`u-paper`"],
            ),
        ];
        for (text, parts) in &cases {
            let message = message(text);
            assert!(message.contains("t.toml") && !message.contains('\n'), "{message}");
            assert!(parts.iter().all(|part| message.contains(part)), "{parts:?} in {message}");
        }
    }
}
