//! How long decisions took: the clock's values, in files of their own, because nobody can reproduce them.

use std::fmt::Write as _;

use agent::Method;
use serde::{Deserialize, Serialize};

use crate::TrialRecord;
use crate::combined::Part;
use crate::spreadsheet;

/// Times of a run's method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pace {
    /// Run directory.
    pub folder: String,
    /// Method.
    pub method: Method,
    /// Decisions.
    pub decisions: usize,
    /// Mean wall-clock time of a decision, s: from an answer of the world to the next action.
    pub mean_decision_seconds: f64,
    /// That of the slowest, s.
    pub slowest_decision_seconds: f64,
    /// Mean wall-clock time of a trial, s.
    pub mean_trial_seconds: f64,
}

/// Times of every arm of `part`.
pub(crate) fn paces(part: &Part) -> Vec<Pace> {
    let pace = |&method: &Method| {
        let of_method: Vec<&TrialRecord> = part.trials.values().filter(|trial| trial.method == method).collect();
        let decisions: usize = of_method.iter().map(|trial| trial.steps).sum();
        let sum = |value: fn(&TrialRecord) -> f64| of_method.iter().map(|trial| value(trial)).sum::<f64>();
        Pace {
            folder: part.folder.clone(),
            method,
            decisions,
            mean_decision_seconds: sum(|trial| trial.decision_seconds) / decisions.max(1) as f64,
            slowest_decision_seconds: of_method.iter().map(|t| t.slowest_decision_seconds).fold(0.0, f64::max),
            mean_trial_seconds: sum(|trial| trial.seconds) / of_method.len().max(1) as f64,
        }
    };
    part.table.provenance.methods.iter().map(pace).collect()
}

/// For people.
pub(crate) fn to_markdown(paces: &[Pace]) -> String {
    let mut text = String::from(
        "Wall-clock times of one thread among those of the run, on the machine that it ran on.\n\n\
         | run | method | decisions | mean decision / s | slowest decision / s | mean trial / s |\n|---|---|---|---|---|---|\n",
    );
    for pace in paces {
        let Pace { folder, method, decisions, mean_decision_seconds, slowest_decision_seconds, mean_trial_seconds } =
            pace;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {folder} | {} | {decisions} | {mean_decision_seconds:.3} | {slowest_decision_seconds:.3} | {mean_trial_seconds:.1} |",
            method.name()
        );
    }
    text
}

/// For spreadsheets.
pub(crate) fn to_csv(paces: &[Pace]) -> String {
    let header =
        ["folder", "method", "decisions", "mean_decision_seconds", "slowest_decision_seconds", "mean_trial_seconds"];
    let row = |pace: &Pace| {
        let times = [pace.mean_decision_seconds, pace.slowest_decision_seconds, pace.mean_trial_seconds];
        let mut row = vec![pace.folder.clone(), pace.method.name().into(), pace.decisions.to_string()];
        row.extend(times.map(|secs| secs.to_string()));
        row
    };
    spreadsheet::to_csv(&header, paces.iter().map(row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decisions_are_averaged_over_actions_and_the_slowest_of_all_is_kept() {
        let mut part = crate::combined::tests::part("paper", "D1", &[(Method::NoRnn, &[true, false])]);
        let mut trials = part.trials.values_mut();
        for (steps, decision_seconds, slowest, seconds) in [(4, 1.0, 0.4, 1.5), (6, 4.0, 0.9, 4.5)] {
            let trial = trials.next().unwrap();
            (trial.steps, trial.decision_seconds, trial.seconds) = (steps, decision_seconds, seconds);
            trial.slowest_decision_seconds = slowest;
        }
        let pace = &paces(&part)[0];
        assert_eq!((pace.decisions, pace.mean_decision_seconds, pace.mean_trial_seconds), (10, 0.5, 3.0));
        assert_eq!(pace.slowest_decision_seconds, 0.9);
        assert!(to_markdown(&paces(&part)).contains("| t-paper-D1 | no-rnn | 10 | 0.500 | 0.900 | 3.0 |"));
        assert!(to_csv(&paces(&part)).ends_with("t-paper-D1,no-rnn,10,0.5,0.9,3\n"));
    }
}
