//! Several runs side by side: rows, sums over domains, and comparisons on the same worlds.

use std::collections::{BTreeMap, BTreeSet};

use agent::Method;
use scenario::Published;
use serde::{Deserialize, Serialize};
use statistics::wilson95;

use crate::log::Trials;
use crate::paired::Cells;
use crate::{Failure, Row, Table, TablePlan};

mod csv;
mod markdown;

/// A finished run of a table.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Its name in the table.
    pub(crate) run: String,
    /// Its run directory.
    pub(crate) folder: String,
    /// The methods that the table shows.
    pub(crate) methods: Vec<Method>,
    /// Whether it belongs to another table.
    pub(crate) included: bool,
    /// Its overrides.
    pub(crate) set: Vec<String>,
    /// Published results that take the place of the domain's.
    pub(crate) published: Option<BTreeMap<String, Published>>,
    /// What it found.
    pub(crate) table: Table,
    /// Its trials.
    pub(crate) trials: Trials,
}

impl Part {
    /// Name and version of the world; `None` for our simulated one.
    fn world(&self) -> Option<String> {
        // Without its address, which can hold a path of the machine that it ran on.
        self.table.provenance.run.world.as_ref().map(|world| format!("{} {}", world.name, world.version))
    }

    fn domain(&self) -> Option<&str> {
        self.table.rows.first().map(|row| row.domain.as_str())
    }
}

/// A method of a run: a row of the paper's tables.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Arm {
    /// Run.
    pub run: String,
    /// Method.
    pub method: Method,
}

impl Arm {
    /// Name in tables.
    #[must_use]
    pub fn label(&self) -> String {
        format!("{} {}", self.run, self.method.name())
    }
}

/// A row of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CombinedRow {
    /// Run.
    pub run: String,
    /// Its run directory, as in the provenance.
    pub folder: String,
    /// World; null for our simulated one.
    pub world: Option<String>,
    /// The row.
    #[serde(flatten)]
    pub row: Row,
}

impl CombinedRow {
    /// Whose row it is.
    #[must_use]
    pub fn arm(&self) -> Arm {
        Arm { run: self.run.clone(), method: self.row.method }
    }
}

/// Trials of an arm over several domains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Total {
    /// Name of the domains together.
    pub domains: String,
    /// Run.
    pub run: String,
    /// Method.
    pub method: Method,
    /// Trials that reached the goal.
    pub successes: u32,
    /// Trials.
    pub trials: u32,
    /// Wilson interval of the success rate over all of them.
    pub interval95: [f64; 2],
    /// Sum of the paper's figures; null where it lacks one.
    pub published: Option<Published>,
    /// Failed trials by what kept them from the goal.
    pub failures: BTreeMap<Failure, u32>,
}

/// Two arms on the same worlds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Domain, or name of several together.
    pub domains: String,
    /// One arm.
    pub first: Arm,
    /// The other.
    pub second: Arm,
    /// Worlds that both solved.
    pub both: u32,
    /// Worlds that only the first solved.
    pub first_only: u32,
    /// Worlds that only the second solved.
    pub second_only: u32,
    /// Worlds that neither solved.
    pub neither: u32,
    /// Two-sided p of a sign-flip test. Worlds of one number share their draws in all domains, so each number has one
    /// sign for the sum of its differences. On a single domain this is McNemar's exact test. Not corrected for the
    /// number of comparisons.
    pub p: f64,
    /// Two-sided p of McNemar's exact test of the counts above (McNemar 1947). It treats worlds of several domains as
    /// independent.
    pub mcnemar_p: f64,
}

impl Comparison {
    /// Both arms.
    #[must_use]
    pub fn arms(&self) -> (&Arm, &Arm) {
        (&self.first, &self.second)
    }
}

/// What decided a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// Commit of the checkout that played it.
    pub commit: String,
    /// Hash of the resolved scenario.
    pub scenario_hash: String,
    /// Hash of the arm's URDF file.
    pub urdf_hash: String,
    /// Hash of the prior's weights; null where no method needs one.
    pub prior_hash: Option<String>,
    /// World; null for our simulated one.
    pub world: Option<String>,
    /// Overrides of the plan.
    pub set: Vec<String>,
    /// Methods.
    pub methods: Vec<Method>,
    /// Trials a method.
    pub trials: u32,
}

/// What all runs share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Common {
    /// Version of this file's format.
    pub version: u32,
    /// Root seed.
    pub seed: u64,
    /// Whether the budgets were those of `--quick`.
    pub quick: bool,
    /// Overrides of scenario entries for all runs.
    pub set: Vec<String>,
}

/// Where the numbers come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sources {
    /// What all runs share.
    #[serde(flatten)]
    pub common: Common,
    /// Runs by their folder.
    pub runs: BTreeMap<String, Source>,
}

/// Several runs as one table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Combined {
    /// For people.
    pub title: String,
    /// Tables stand in this order.
    pub order: u32,
    /// One row an arm and domain.
    pub rows: Vec<CombinedRow>,
    /// Sums over domains.
    pub totals: Vec<Total>,
    /// Arms on the same worlds, by domain and over several; with runs of another table beside this one's, one of each.
    pub comparisons: Vec<Comparison>,
    /// Run directories that are not finished, or could not be played.
    pub missing: Vec<String>,
    /// Where the numbers come from.
    pub provenance: Sources,
}

impl Combined {
    pub(crate) fn new(plan: &TablePlan, parts: &[Part], missing: Vec<String>, common: &Common) -> Self {
        let rows = rows(parts);
        let totals = totals(plan, &rows);
        let runs = parts.iter().map(|part| (part.folder.clone(), source(part))).collect();
        Self {
            title: plan.title.clone(),
            order: plan.order,
            totals,
            comparisons: comparisons(plan, parts, &arms(&rows)),
            rows,
            missing,
            provenance: Sources { common: common.clone(), runs },
        }
    }

    /// The arms, in the order of their first rows.
    #[must_use]
    pub fn arms(&self) -> Vec<Arm> {
        arms(&self.rows)
    }

    /// The domains, in the order of their first rows.
    #[must_use]
    pub fn domains(&self) -> Vec<String> {
        let mut domains: Vec<String> = Vec::new();
        for row in &self.rows {
            if !domains.contains(&row.row.domain) {
                domains.push(row.row.domain.clone());
            }
        }
        domains
    }

    /// The row of an arm on a domain.
    #[must_use]
    pub fn row(&self, arm: &Arm, domain: &str) -> Option<&CombinedRow> {
        self.rows.iter().find(|row| row.arm() == *arm && row.row.domain == domain)
    }
}

fn rows(parts: &[Part]) -> Vec<CombinedRow> {
    let row = |part: &Part, row: &Row| {
        let published = match &part.published {
            Some(published) => published.get(row.method.name()).copied(),
            None => row.published,
        };
        let row = Row { published, ..row.clone() };
        CombinedRow { run: part.run.clone(), folder: part.folder.clone(), world: part.world(), row }
    };
    let shown = |part: &Part, row: &Row| part.methods.contains(&row.method);
    parts.iter().flat_map(|p| p.table.rows.iter().filter(|r| shown(p, r)).map(|r| row(p, r))).collect()
}

fn arms(rows: &[CombinedRow]) -> Vec<Arm> {
    let mut arms = Vec::new();
    for row in rows {
        let arm = row.arm();
        if !arms.contains(&arm) {
            arms.push(arm);
        }
    }
    arms
}

/// Sums of the arms that have played all domains of a pool.
fn totals(plan: &TablePlan, rows: &[CombinedRow]) -> Vec<Total> {
    let total = |pool: &crate::Pool, arm: Arm| {
        let of_domain = |domain: &String| rows.iter().find(|r| r.arm() == arm && r.row.domain == *domain);
        let rows = pool.domains.iter().map(of_domain).collect::<Option<Vec<_>>>()?;
        let successes = rows.iter().map(|r| r.row.successes).sum();
        let trials = rows.iter().map(|r| r.row.trials).sum();
        let published = rows.iter().map(|r| r.row.published).collect::<Option<Vec<_>>>();
        let published = published.map(|all| Published {
            successes: all.iter().map(|p| p.successes).sum(),
            trials: all.iter().map(|p| p.trials).sum(),
        });
        let mut failures = BTreeMap::new();
        for (failure, count) in rows.iter().flat_map(|r| &r.row.failures) {
            *failures.entry(*failure).or_insert(0) += count;
        }
        let (domains, interval95) = (pool.name.clone(), wilson95(successes, trials));
        let Arm { run, method } = arm;
        Some(Total { domains, run, method, successes, trials, interval95, published, failures })
    };
    plan.pools.iter().flat_map(|pool| arms(rows).into_iter().filter_map(|arm| total(pool, arm))).collect()
}

/// Every two arms on each domain and each pool, where both have played it in the same world. Where there are runs of other tables, each of
/// them with each of this one's.
fn comparisons(plan: &TablePlan, parts: &[Part], arms: &[Arm]) -> Vec<Comparison> {
    let single = plan.domains.iter().map(|domain| (domain.clone(), vec![domain.clone()]));
    let pools = plan.pools.iter().map(|pool| (pool.name.clone(), pool.domains.clone()));
    let included: BTreeSet<&str> = parts.iter().filter(|part| part.included).map(|part| part.run.as_str()).collect();
    let wanted = |first: &Arm, second: &Arm| {
        let of_others = |arm: &Arm| included.contains(arm.run.as_str());
        included.is_empty() || (of_others(first) && !of_others(second))
    };
    let mut comparisons = Vec::new();
    for (name, domains) in single.chain(pools) {
        for (index, first) in arms.iter().enumerate() {
            for second in arms[index + 1..].iter().filter(|second| wanted(first, second)) {
                let cells = domains.iter().map(|domain| cells(parts, domain, first, second));
                let Some(cells) = cells.reduce(|a, b| Some(a?.plus(b?))).flatten() else { continue };
                let (domains, first, second) = (name.clone(), first.clone(), second.clone());
                let (p, mcnemar_p) = (cells.p(), cells.mcnemar_p());
                let Cells { both, first_only, second_only, neither, .. } = cells;
                let comparison =
                    Comparison { domains, first, second, both, first_only, second_only, neither, p, mcnemar_p };
                comparisons.push(comparison);
            }
        }
    }
    comparisons
}

/// `None` where one of the arms has not played the domain, or the other in another world.
fn cells(parts: &[Part], domain: &str, first: &Arm, second: &Arm) -> Option<Cells> {
    let part = |arm: &Arm| parts.iter().find(|part| part.run == arm.run && part.domain() == Some(domain));
    let (one, other) = (part(first)?, part(second)?);
    let cells = || Cells::of((&one.trials, first.method), (&other.trials, second.method));
    (one.world() == other.world()).then(cells)
}

fn source(part: &Part) -> Source {
    let provenance = &part.table.provenance;
    Source {
        commit: provenance.run.commit.clone(),
        scenario_hash: provenance.run.scenario_hash.clone(),
        urdf_hash: provenance.run.urdf_hash.clone(),
        prior_hash: provenance.run.prior_hash.clone(),
        world: part.world(),
        set: part.set.clone(),
        methods: provenance.methods.clone(),
        trials: provenance.trials,
    }
}

#[cfg(test)]
pub(crate) mod tests;
