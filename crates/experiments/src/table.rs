//! The table of a run: JSON for machines, Markdown for people, CSV for spreadsheets.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use agent::{Method, Reason};
use scenario::Published;
use serde::{Deserialize, Serialize};
use statistics::wilson95;

use crate::paired::{Pair, pairs, probability};
use crate::{Failure, Provenance, TrialRecord, spreadsheet};

/// A method's row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Domain.
    pub domain: String,
    /// Robot.
    pub robot: String,
    /// Preset.
    pub preset: String,
    /// Method.
    pub method: Method,
    /// Trials that reached the goal.
    pub successes: u32,
    /// Trials.
    pub trials: u32,
    /// Wilson interval of the success rate.
    pub interval95: [f64; 2],
    /// The paper's figure; null where it has none.
    pub published: Option<Published>,
    /// Trials by the reason they ended for.
    pub reasons: BTreeMap<Reason, u32>,
    /// Failed trials by what kept them from the goal: see [`Failure::of`].
    pub failures: BTreeMap<Failure, u32>,
    /// Mean discounted return.
    pub mean_return: f64,
    /// Mean number of actions of the successful trials; null where none was.
    pub mean_steps_to_goal: Option<f64>,
    /// Updates in which no simulated particle agreed with the observation, per trial.
    pub mean_depletions: f64,
    /// Simulated transitions per action.
    pub transitions_per_action: f64,
    /// Actions with a force above the limit, per trial.
    pub mean_large_forces: f64,
    /// Actions that would have left the reachable region, per trial.
    pub mean_out_of_reach: f64,
    /// Trials whose world has an obstacle.
    pub with_obstacle: u32,
    /// Trials in which the object or the tool pushed against it.
    pub obstacle_touched: u32,
}

/// The table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// One row a method.
    pub rows: Vec<Row>,
    /// Every two methods on the worlds that both played.
    pub pairs: Vec<Pair>,
    /// Where the numbers come from.
    pub provenance: Provenance,
}

impl Table {
    /// Counts the trials of each method, in the order of the run.
    pub(crate) fn new(
        domain: &str,
        robot: &str,
        preset: &str,
        provenance: &Provenance,
        trials: &BTreeMap<(Method, u32), TrialRecord>,
        published: &BTreeMap<String, Published>,
    ) -> Self {
        let row = |method: &Method| {
            let of_method: Vec<&TrialRecord> =
                trials.values().filter(|t| t.method == *method && t.trial < provenance.trials).collect();
            let count = |filter: &dyn Fn(&TrialRecord) -> bool| of_method.iter().filter(|t| filter(t)).count() as u32;
            let n = of_method.len() as u32;
            let successes = count(&|t| t.success);
            let (mut reasons, mut failures) = (BTreeMap::new(), BTreeMap::new());
            for trial in &of_method {
                *reasons.entry(trial.reason).or_insert(0) += 1;
                if let Some(failure) = Failure::of(trial) {
                    *failures.entry(failure).or_insert(0) += 1;
                }
            }
            let mean = |value: &dyn Fn(&TrialRecord) -> f64| {
                of_method.iter().map(|t| value(t)).sum::<f64>() / f64::from(n.max(1))
            };
            let steps_to_goal: usize = of_method.iter().filter(|t| t.success).map(|t| t.steps).sum();
            let actions: usize = of_method.iter().map(|t| t.steps).sum();
            let transitions: usize = of_method.iter().map(|t| t.transitions).sum();
            Row {
                domain: domain.into(),
                robot: robot.into(),
                preset: preset.into(),
                method: *method,
                successes,
                trials: n,
                interval95: wilson95(successes, n),
                published: published.get(method.name()).copied(),
                reasons,
                failures,
                mean_return: mean(&|t| t.discounted_return),
                mean_steps_to_goal: (successes > 0).then(|| steps_to_goal as f64 / f64::from(successes)),
                mean_depletions: mean(&|t| t.depletions as f64),
                transitions_per_action: transitions as f64 / actions.max(1) as f64,
                mean_large_forces: mean(&|t| t.large_forces as f64),
                mean_out_of_reach: mean(&|t| t.out_of_reach as f64),
                with_obstacle: count(&|t| t.has_obstacle),
                obstacle_touched: count(&|t| t.obstacle_touched),
            }
        };
        let played = trials.iter().filter(|((_, trial), _)| *trial < provenance.trials);
        let played = played.map(|(key, record)| (*key, record.clone())).collect();
        Self {
            rows: provenance.methods.iter().map(row).collect(),
            pairs: pairs(&provenance.methods, &played),
            provenance: provenance.clone(),
        }
    }

    /// For people; the last line says what the words mean.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::from(
            "| domain | robot | preset | method | success | 95 % interval | paper | ended by | failed by | steps to goal | obstacle touched |\n\
             |---|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in &self.rows {
            let published = row.published.map_or("–".into(), |p| format!("{}/{}", p.successes, p.trials));
            let reasons: Vec<String> =
                row.reasons.iter().map(|(reason, count)| format!("{} {count}", reason.name())).collect();
            let failures: Vec<String> = row.failures.iter().map(|(f, count)| format!("{} {count}", f.name())).collect();
            let failures = if failures.is_empty() { "–".into() } else { failures.join(", ") };
            let steps = row.mean_steps_to_goal.map_or("–".into(), |s| format!("{s:.1}"));
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {}/{} | {:.2}–{:.2} | {} | {} | {failures} | {} | {} of {} |",
                row.domain,
                row.robot,
                row.preset,
                row.method.name(),
                row.successes,
                row.trials,
                row.interval95[0],
                row.interval95[1],
                published,
                reasons.join(", "),
                steps,
                row.obstacle_touched,
                row.with_obstacle,
            );
        }
        if !self.pairs.is_empty() {
            text += "\n| same worlds | both | first only | second only | neither | McNemar p |\n|---|---|---|---|---|---|\n";
        }
        for pair in &self.pairs {
            let Pair { first, second, both, first_only, second_only, neither, p } = pair;
            let names = format!("{}, {}", first.name(), second.name());
            let _ =
                writeln!(text, "| {names} | {both} | {first_only} | {second_only} | {neither} | {} |", probability(*p));
        }
        text + "\n" + &self.words() + "\n"
    }

    /// What the columns, endings and methods of this table mean, as the glossary says; each word once.
    fn words(&self) -> String {
        let methods = self.rows.iter().map(|row| row.method.name());
        let endings = self.rows.iter().flat_map(|row| row.reasons.keys().map(|reason| reason.name()));
        let failures = self.rows.iter().flat_map(|row| row.failures.keys().map(|failure| failure.name()));
        let p = (!self.pairs.is_empty()).then_some("McNemar p");
        let terms = COLUMNS.into_iter().chain(p).chain(endings).chain(failures).chain(methods);
        let mut told = BTreeSet::new();
        let words = terms.filter_map(page::word).filter(|word| told.insert(&word.term));
        words.map(|word| format!("{}: {}", word.term, word.means)).collect::<Vec<_>>().join(" ")
    }

    /// For spreadsheets.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let header = [
            "domain",
            "robot",
            "preset",
            "method",
            "successes",
            "trials",
            "interval95_low",
            "interval95_high",
            "published_successes",
            "published_trials",
            "mean_return",
            "mean_steps_to_goal",
            "mean_depletions",
            "transitions_per_action",
            "with_obstacle",
            "obstacle_touched",
            "mean_large_forces",
            "mean_out_of_reach",
        ];
        let row = |row: &Row| {
            let [successes, trials] = published_cells(row.published);
            vec![
                row.domain.clone(),
                row.robot.clone(),
                row.preset.clone(),
                row.method.name().into(),
                row.successes.to_string(),
                row.trials.to_string(),
                row.interval95[0].to_string(),
                row.interval95[1].to_string(),
                successes,
                trials,
                row.mean_return.to_string(),
                row.mean_steps_to_goal.map_or(String::new(), |steps| steps.to_string()),
                row.mean_depletions.to_string(),
                row.transitions_per_action.to_string(),
                row.with_obstacle.to_string(),
                row.obstacle_touched.to_string(),
                row.mean_large_forces.to_string(),
                row.mean_out_of_reach.to_string(),
            ]
        };
        spreadsheet::to_csv(&header, self.rows.iter().map(row))
    }
}

/// Successes and trials of a published result; empty where there is none.
pub(crate) fn published_cells(published: Option<Published>) -> [String; 2] {
    published.map_or_else(Default::default, |p| [p.successes.to_string(), p.trials.to_string()])
}

/// Columns of [`Table::to_markdown`] whose heads do not say all.
const COLUMNS: [&str; 6] = ["success", "95 % interval", "ended by", "failed by", "steps to goal", "obstacle touched"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::tests::{provenance, record};

    #[test]
    fn a_table_for_people_ends_with_what_its_words_mean() {
        let table = |methods: &[Method]| {
            let provenance = Provenance { methods: methods.to_vec(), trials: 1, ..provenance(1) };
            let trials = methods.iter().map(|method| ((*method, 0), record(*method, 0, true))).collect();
            Table::new("D1", "sawyer", "surmise", &provenance, &trials, &BTreeMap::new()).to_markdown()
        };
        let all = table(&Method::ALL);
        let (_, last) = all.trim_end().rsplit_once("\n\n").unwrap();
        assert_eq!(last.lines().count(), 1, "{last}");
        for method in Method::ALL {
            let means = page::word(method.name()).unwrap_or_else(|| panic!("{}", method.name())).means.as_str();
            assert!(last.contains(&format!("{}: {means}", method.name())), "{last}");
        }
        for term in COLUMNS.into_iter().chain(["McNemar p"]) {
            assert_eq!(last.matches(&format!("{term}: ")).count(), 1, "{term}: {last}");
        }
        assert!(last.contains(" goal: The circle"), "how a trial ended: {last}");
        // Only what the table has.
        let one = table(&[Method::Heuristic]);
        assert!(one.contains("heuristic: ") && !one.contains("oracle") && !one.contains("McNemar"), "{one}");
    }
}
