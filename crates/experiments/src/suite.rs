//! All tables: every run of the plan in a run directory of its own, then the combined tables and their pictures.

use std::path::{Path, PathBuf};

use agent::{Method, Timeouts, WorldAddress};
use scenario::{ArmsConfig, EffectsConfig, Scenario};

use crate::combined::{Combined, Common, Part};
use crate::files::{claim, file_error, pretty, write_atomically};
use crate::plan::{Include, Item, Plan, TablePlan};
use crate::{Error, Evaluation, Player, Request, learning, pace, pictures};

/// Marks the folder as ours.
const IDENTITY: &str = "all.json";

/// What is asked for.
#[derive(Clone, Debug)]
pub struct SuiteRequest {
    /// Project folder.
    pub root: PathBuf,
    /// Where everything goes.
    pub out: PathBuf,
    /// Tables, runs or run directories that are played. If empty: all. Finished runs of the others are shown too.
    pub only: Vec<String>,
    /// Trials a method; the scenario's where `None`.
    pub trials: Option<u32>,
    /// Root seed.
    pub seed: u64,
    /// Small budgets.
    pub quick: bool,
    /// Whether finished runs of another commit count too. The tables name the commit.
    pub keep_finished: bool,
    /// Overrides of scenario entries for all runs, after their own.
    pub set: Vec<String>,
    /// Folder of the trained prior of both arms' runs; the default ones where `None`.
    pub prior: Option<PathBuf>,
    /// Python that runs worlds in other simulators.
    pub python: String,
    /// How long such a world may take.
    pub timeouts: Timeouts,
}

/// All runs, ready to be played.
pub struct Suite {
    request: SuiteRequest,
    plan: Plan,
    common: Common,
    entries: Vec<Entry>,
}

/// A run directory; its run where it can be played.
struct Entry {
    folder: PathBuf,
    chosen: bool,
    evaluation: Option<Evaluation>,
}

impl Suite {
    /// Loads and checks all runs, and claims the folders of those that are played. So errors show before the first
    /// trial. `note` is told what is left out, and why.
    ///
    /// # Errors
    ///
    /// A plan, scenario, prior or folder that does not fit. A world in another simulator that cannot be started is left out.
    pub fn prepare(request: SuiteRequest, note: &mut dyn FnMut(&str)) -> Result<Self, Error> {
        let plan = Plan::load(&request.root)?;
        let chosen = plan.chosen(&request.only)?;
        let common = Common { version: 1, seed: request.seed, quick: request.quick, set: request.set.clone() };
        let mut entries = Vec::new();
        for (item, chosen) in plan.items().into_iter().zip(chosen) {
            let folder = request.out.join(item.folder());
            // A run that is not played counts only if it exists.
            let wanted = chosen || folder.join("run.json").exists();
            let mut evaluation = if wanted { prepare(&request, &item, note)? } else { None };
            if let Some(evaluation) = evaluation.as_mut().filter(|_| request.keep_finished) {
                evaluation.adopt(&folder)?;
            }
            entries.push(Entry { folder, chosen, evaluation });
        }
        let suite = Self { request, plan, common, entries };
        suite.check_worlds()?;
        // All folders are looked at before anything is written to one.
        for entry in &suite.entries {
            if let Some(evaluation) = &entry.evaluation {
                evaluation.check(&entry.folder)?;
            }
        }
        claim(&suite.request.out, IDENTITY, &suite.common, &suite.combined_files())?;
        for entry in &suite.entries {
            if let Some(evaluation) = &entry.evaluation {
                evaluation.open(&entry.folder)?;
            }
        }
        Ok(suite)
    }

    /// Plays what the chosen runs lack; false where it was interrupted. `note` is told which run is played.
    ///
    /// # Errors
    ///
    /// The first trial that cannot be played or kept. Finished ones are kept.
    pub fn play(&self, player: &Player<'_>, note: &mut dyn FnMut(&str)) -> Result<bool, Error> {
        let chosen: Vec<_> = self.plan.items().into_iter().zip(&self.entries).filter(|(_, e)| e.chosen).collect();
        let count = chosen.len();
        for (index, (item, entry)) in chosen.into_iter().enumerate() {
            let Some(evaluation) = &entry.evaluation else { continue };
            let run = evaluation.open(&entry.folder)?;
            let missing = run.missing().len();
            note(&format!("{} ({} of {count}): {missing} trials to play", item.folder(), index + 1));
            if missing > 0 && !player.play(evaluation, &run)? {
                return Ok(false);
            }
            evaluation.finish(&run)?;
        }
        Ok(true)
    }

    /// Writes the combined tables and their pictures from all runs that are finished; returns the tables, in their order.
    ///
    /// # Errors
    ///
    /// Where a file cannot be read or written, or a picture cannot be drawn.
    pub fn combine(&self) -> Result<Vec<Combined>, Error> {
        let mut paces = Vec::new();
        let mut tables = Vec::new();
        let finished = self.finished()?;
        for table in &self.plan.tables {
            let (mut parts, mut missing) = (Vec::new(), Vec::new());
            for (item, part) in self.plan.items().iter().zip(&finished) {
                let include = table.include.iter().find(|include| include.run == item.group());
                let own = item.table.name == table.name;
                if !own && (include.is_none() || !table.domains.iter().any(|domain| domain == item.domain)) {
                    continue;
                }
                match part {
                    Some(part) if own => paces.extend(pace::paces(part)),
                    Some(_) => {}
                    None => missing.push(item.folder()),
                }
                parts.extend(part.as_ref().map(|part| shown(part, include)));
            }
            if parts.iter().all(|part| part.included) {
                continue;
            }
            // Runs of other tables first: the others are compared with them.
            parts.sort_by_key(|part| !part.included);
            let combined = Combined::new(table, &parts, missing, &self.common);
            self.write_table(table, &combined, &parts)?;
            tables.push(combined);
        }
        let write = |name: &str, text: String| write_atomically(&self.request.out.join(name), text.as_bytes());
        write("clock.json", pretty(&paces))?;
        write("clock.csv", pace::to_csv(&paces))?;
        write("clock.md", pace::to_markdown(&paces))?;
        Ok(tables)
    }

    /// Copies the combined tables and their pictures to `to`. Nothing of them names a path of this machine.
    ///
    /// # Errors
    ///
    /// Files that cannot be read or written.
    pub fn publish(&self, to: &Path) -> Result<(), Error> {
        std::fs::create_dir_all(to).map_err(file_error(to, "creating the folder"))?;
        let folder = &self.request.out;
        for entry in std::fs::read_dir(folder).map_err(file_error(folder, "listing"))? {
            let file = entry.map_err(file_error(folder, "listing"))?.path();
            let Some(name) = file.file_name().filter(|_| file.is_file()) else { continue };
            // A name that begins with a dot is what a kill left of a write.
            if !name.to_string_lossy().starts_with('.') {
                let bytes = std::fs::read(&file).map_err(file_error(&file, "reading"))?;
                write_atomically(&to.join(name), &bytes)?;
            }
        }
        Ok(())
    }

    fn write_table(&self, plan: &TablePlan, combined: &Combined, parts: &[Part]) -> Result<(), Error> {
        let (out, name) = (&self.request.out, &plan.name);
        let curves = learning::curves(parts);
        let write =
            |suffix: &str, text: String| write_atomically(&out.join(format!("{name}{suffix}")), text.as_bytes());
        write(".json", pretty(combined))?;
        write(".csv", combined.to_csv())?;
        write("-comparisons.csv", combined.comparisons_csv())?;
        write("-learning.csv", learning::to_csv(&curves))?;
        for (name, figure) in pictures::all(plan, combined, parts, &curves) {
            figure.save(&out.join(&name)).map_err(|source| Error::Figure { name, source })?;
        }
        // Last: where it is there, the others are.
        write(".md", combined.to_markdown())
    }

    /// The runs that are finished, in the order of the plan.
    fn finished(&self) -> Result<Vec<Option<Part>>, Error> {
        let part = |(item, entry): (Item<'_>, &Entry)| {
            let Some(evaluation) = &entry.evaluation else { return Ok(None) };
            let run = evaluation.open(&entry.folder)?;
            if !run.missing().is_empty() {
                return Ok(None);
            }
            Ok(Some(Part {
                run: item.run.name.clone(),
                folder: item.folder(),
                methods: item.run.methods.clone(),
                included: false,
                set: item.run.set.clone(),
                published: item.run.published.clone(),
                table: evaluation.finish(&run)?,
                trials: run.trials()?,
            }))
        };
        self.plan.items().into_iter().zip(&self.entries).map(part).collect()
    }

    /// Runs of one domain are compared world by world, so that their worlds have to be the same.
    fn check_worlds(&self) -> Result<(), Error> {
        let mut first: Vec<(&str, &str, &Scenario)> = Vec::new();
        for (item, entry) in self.plan.items().iter().zip(&self.entries) {
            let Some(evaluation) = &entry.evaluation else { continue };
            let (robot, scenario) = (item.table.robot.as_str(), evaluation.scenario());
            match first.iter().find(|(domain, other, _)| (*domain, *other) == (item.domain, robot)) {
                None => first.push((item.domain, robot, scenario)),
                Some((_, _, other)) if same_worlds(other, scenario) => {}
                Some(_) => {
                    let file = self.request.root.join(format!("scenarios/tables/{}.toml", item.table.name));
                    return Err(Error::OtherWorlds { file, run: item.run.name.clone(), domain: item.domain.into() });
                }
            }
        }
        Ok(())
    }

    /// Names of files in the folder that only a suite leaves: tables and pictures, which begin with the name of a table.
    fn combined_files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.request.out).into_iter().flatten().flatten();
        let files = entries.filter(|entry| entry.path().is_file());
        let names = files.filter_map(|entry| entry.file_name().into_string().ok());
        let begins = |file: &str, name: &str| file.strip_prefix(name).is_some_and(|rest| rest.starts_with(['.', '-']));
        let ours = |file: &String| {
            let mut tables = self.plan.tables.iter().map(|table| table.name.as_str());
            tables.any(|name| begins(file, name)) || begins(file, "clock") || begins(file, "figure4")
        };
        names.filter(ours).collect()
    }
}

/// The run of an item; `None`, with a note, where its world cannot be started here.
fn prepare(request: &SuiteRequest, item: &Item<'_>, note: &mut dyn FnMut(&str)) -> Result<Option<Evaluation>, Error> {
    let world = item.run.python_world.as_ref().map(|script| {
        let script = request.root.join(script).display().to_string();
        let arguments = vec![script.clone()];
        let text = format!("{} {script}", request.python);
        (WorldAddress::Command { text, program: request.python.clone(), arguments }, request.timeouts)
    });
    let prepared = Evaluation::prepare(&Request {
        selection: item.selection(&request.root, request.quick, &request.set),
        methods: item.run.methods.clone(),
        trials: request.trials,
        seed: request.seed,
        prior: request.prior.clone(),
        world,
    });
    match prepared {
        Ok(evaluation) => {
            // Hours may pass until it is played.
            evaluation.rest();
            Ok(Some(evaluation))
        }
        Err(Error::World(error)) => {
            let causes = std::iter::successors(Some(&error as &dyn std::error::Error), |e| e.source());
            let causes: Vec<String> = causes.map(ToString::to_string).collect();
            note(&format!("{} is left out: {} (see --python)", item.folder(), causes.join(": ")));
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// A part as a table shows it.
fn shown(part: &Part, include: Option<&Include>) -> Part {
    let mut part = part.clone();
    if let Some(include) = include {
        part.included = true;
        part.methods.retain(|method: &Method| include.methods.contains(method));
    }
    part
}

/// Whether a trial has the same world and the same task in both.
fn same_worlds(a: &Scenario, b: &Scenario) -> bool {
    let method_of_b = Scenario {
        preset: b.preset.clone(),
        arm: ArmsConfig { truth: a.arm.truth.clone(), model: b.arm.model.clone() },
        effects: EffectsConfig { truth: a.effects.truth.clone(), model: b.effects.model.clone() },
        perturb: b.perturb.clone(),
        transition_noise: b.transition_noise,
        initial_belief: b.initial_belief.clone(),
        belief: b.belief.clone(),
        planner: b.planner.clone(),
        agent: b.agent.clone(),
        data: b.data.clone(),
        evaluation: b.evaluation.clone(),
        ..a.clone()
    };
    method_of_b == *b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overrides_of_the_method_keep_the_worlds_and_others_do_not() {
        let root = scenario::find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let load = |preset: &str, set: &[&str]| {
            let set = set.iter().map(ToString::to_string).collect();
            let (domain, preset) = ("D5".into(), preset.into());
            scenario::Selection { domain, preset, set, ..scenario::Selection::new(&root) }.load().unwrap()
        };
        let paper = load("paper", &[]);
        for set in [&[][..], &["planner.depth=7", "agent.rollouts=heuristic"], &["effects.model=[]"]] {
            assert!(same_worlds(&paper, &load("surmise", set)), "{set:?}");
        }
        for set in
            ["distribution.object.friction.mean=0.5", "effects.truth=[]", "task.horizon=7", "world.gravity_mps2=9.0"]
        {
            assert!(!same_worlds(&paper, &load("paper", &[set])), "{set}");
        }
    }
}
