//! All scores in one table, with what is aimed at beside each figure.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;
use statistics::wilson95;

use crate::generate::Actions;
use crate::plan::Group;
use crate::score::Score;

/// A cell: a share with its interval, or a plain value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cell {
    /// So many of so many, with the 95 % Wilson interval.
    Share {
        /// Hits.
        hits: u32,
        /// Of.
        of: u32,
        /// Interval.
        wilson95: [f64; 2],
    },
    /// A quantile of so many.
    Value {
        /// Value.
        value: f64,
        /// Of.
        of: u32,
    },
}

/// A figure for both kinds of actions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What.
    pub figure: String,
    /// Aim for designed actions and passive logs.
    pub target: [String; 2],
    /// Designed.
    pub designed: Option<Cell>,
    /// Passive.
    pub passive: Option<Cell>,
}

/// The table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// Sets without an answer.
    pub unanswered: usize,
    /// Rows.
    pub rows: Vec<Row>,
    /// Rows of the baselines.
    pub baselines: Vec<Row>,
    /// For both kinds of actions: truth, answer, how often.
    pub confusion: Vec<(Actions, String, String, u32)>,
}

type Figure = fn(&[&Score]) -> Option<Cell>;

impl Table {
    /// Of all scores.
    #[must_use]
    pub fn new(scores: &[Score], unanswered: usize, baselines: bool) -> Self {
        let row = |(figure, designed, passive, of): (&str, &str, &str, Figure)| {
            let cell = |actions| of(&scores.iter().filter(|score| score.actions == actions).collect::<Vec<_>>());
            Row {
                figure: figure.into(),
                target: [designed.into(), passive.into()],
                designed: cell(Actions::Designed),
                passive: cell(Actions::Passive),
            }
        };
        let mut confusion: BTreeMap<(bool, String, String), u32> = BTreeMap::new();
        for score in scores.iter().filter(|score| !matches!(score.group, Group::Pair | Group::Arm)) {
            let key = (score.actions == Actions::Passive, score.truth[0].clone(), score.says().to_owned());
            *confusion.entry(key).or_default() += 1;
        }
        let named = |(passive, truth, says), count| {
            (if passive { Actions::Passive } else { Actions::Designed }, truth, says, count)
        };
        Self {
            unanswered,
            rows: FIGURES.into_iter().map(row).collect(),
            baselines: if baselines { BASELINES.into_iter().map(row).collect() } else { Vec::new() },
            confusion: confusion.into_iter().map(|(key, count)| named(key, count)).collect(),
        }
    }

    /// As Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        rows_to_markdown(&mut text, "figure", &self.rows);
        if !self.baselines.is_empty() {
            text.push('\n');
            rows_to_markdown(&mut text, "baseline", &self.baselines);
        }
        if self.unanswered > 0 {
            let _ = writeln!(text, "\n{} sets have no answer and are not counted.", self.unanswered);
        }
        text
    }

    /// As CSV.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut rows = Vec::new();
        for row in self.rows.iter().chain(&self.baselines) {
            for (actions, cell, target) in
                [("designed", row.designed, &row.target[0]), ("passive", row.passive, &row.target[1])]
            {
                let Some(cell) = cell else { continue };
                let (value, hits, of, ends) = match cell {
                    Cell::Share { hits, of, wilson95 } => {
                        (f64::from(hits) / f64::from(of), hits.to_string(), of, wilson95.map(|end| format!("{end:.4}")))
                    }
                    Cell::Value { value, of } => (value, String::new(), of, [String::new(), String::new()]),
                };
                let [low, high] = ends;
                let (value, of) = (format!("{value:.4}"), of.to_string());
                rows.push(vec![row.figure.clone(), actions.into(), target.clone(), value, hits, of, low, high]);
            }
        }
        to_csv(&["figure", "actions", "target", "value", "hits", "of", "low95", "high95"], rows)
    }

    /// The confusion matrix as a list: truth, answers with their counts.
    #[must_use]
    pub fn confusion_to_markdown(&self) -> String {
        let mut text = String::new();
        for actions in [Actions::Designed, Actions::Passive] {
            let of = || self.confusion.iter().filter(move |entry| entry.0 == actions);
            if of().next().is_none() {
                continue;
            }
            let _ = writeln!(text, "| hidden, {} actions | right | said instead |\n|---|---|---|", actions.name());
            let mut truths: Vec<&String> = of().map(|entry| &entry.1).collect();
            truths.dedup();
            for truth in truths {
                let row = || of().filter(move |entry| entry.1 == *truth);
                let total: u32 = row().map(|entry| entry.3).sum();
                let catalogue = physics_model::EffectKind::ALL.iter().any(|kind| kind.name() == *truth);
                let right = if catalogue || truth == "none" { truth.as_str() } else { "unknown" };
                let hits: u32 = row().filter(|entry| entry.2 == right).map(|entry| entry.3).sum();
                let others: Vec<String> =
                    row().filter(|entry| entry.2 != right).map(|entry| format!("{} {}", entry.2, entry.3)).collect();
                let _ = writeln!(text, "| {truth} | {hits}/{total} | {} |", others.join(", "));
            }
            text.push('\n');
        }
        text
    }

    /// The same as CSV.
    #[must_use]
    pub fn confusion_to_csv(&self) -> String {
        let row = |(actions, truth, says, count): &(Actions, String, String, u32)| {
            vec![actions.name().into(), truth.clone(), says.clone(), count.to_string()]
        };
        to_csv(&["actions", "truth", "answer", "count"], self.confusion.iter().map(row))
    }
}

fn rows_to_markdown(text: &mut String, head: &str, rows: &[Row]) {
    let _ = writeln!(text, "| {head} | designed | target | passive | target |\n|---|---|---|---|---|");
    for row in rows {
        let cell = |cell: Option<Cell>| match cell {
            None => "–".to_owned(),
            Some(Cell::Share { hits, of, wilson95: [low, high] }) => {
                let share = 100.0 * f64::from(hits) / f64::from(of);
                format!("{share:.0} % ({hits}/{of}; {:.0}–{:.0})", 100.0 * low, 100.0 * high)
            }
            Some(Cell::Value { value, of }) if value.abs() >= 20.0 => format!("{value:.0} (n {of})"),
            Some(Cell::Value { value, of }) => format!("{value:.3} (n {of})"),
        };
        let [designed, passive] = &row.target;
        let _ = writeln!(
            text,
            "| {} | {} | {designed} | {} | {passive} |",
            row.figure,
            cell(row.designed),
            cell(row.passive)
        );
    }
}

/// The figures of the issue that asked for this, in its order, and some that explain them.
const FIGURES: [(&str, &str, &str, Figure); 24] = [
    ("hidden effect named first", "≥ 92 %", "≥ 85 %", |s| share(s, in_catalogue, |s| s.first)),
    ("truth in the confusion set", "≥ 97 %", "≥ 95 %", |s| share(s, in_catalogue, |s| s.confused)),
    ("the same, beside a name", "", "", |s| share(s, in_catalogue, |s| s.confused && !s.named.is_empty())),
    ("names in a confusion set: mean", "", "", |s| {
        let of = s.iter().filter(|s| in_catalogue(s) && s.confusion > 0);
        mean(&of.map(|s| s.confusion as f64).collect::<Vec<f64>>())
    }),
    ("names that the evidence leans to where nothing is hidden: mean", "", "", |s| {
        let of = s.iter().filter(|s| s.group == Group::None);
        mean(&of.map(|s| s.confusion as f64).collect::<Vec<f64>>())
    }),
    ("wrong name, first or further, with confidence ≥ 0.9", "≤ 3 %", "≤ 5 %", |s| {
        share(s, in_catalogue, Score::wrong_and_sure)
    }),
    ("the same, first names alone", "", "", |s| share(s, in_catalogue, Score::first_is_wrong_and_sure)),
    ("the same, first or further, over all sets", "", "", |s| share(s, |_| true, Score::wrong_and_sure)),
    ("false alarm with no effect", "≤ 3 %", "≤ 5 %", |s| {
        share(s, |s| s.group == Group::None, |s| s.verdict != "none")
    }),
    ("catalogue effect called unknown", "≤ 5 %", "≤ 8 %", |s| share(s, in_catalogue, |s| s.verdict == "unknown")),
    ("catalogue effect called none", "", "", |s| share(s, in_catalogue, |s| s.verdict == "none")),
    ("a further name beside the right one", "", "", |s| {
        share(s, |s| in_catalogue(s) && s.first, |s| s.named.len() > 1)
    }),
    ("effect outside the catalogue called unknown", "≥ 85 %", "≥ 80 %", |s| {
        share(s, |s| s.group == Group::Unknown, |s| s.verdict == "unknown")
    }),
    ("90 % intervals cover", "85–95 %", "85–95 %", |s| covered(s, Group::Catalogue)),
    ("the same, of effects of pairs", "", "", |s| covered(s, Group::Pair)),
    ("gap closed, held out, relative to the true model: median", "≥ 0.95", "≥ 0.9", |s| quantile(closed(s), 0.5)),
    ("the same: 10th percentile", "≥ 0.8", "≥ 0.7", |s| quantile(closed(s), 0.1)),
    ("two effects, both named", "≥ 65 %", "≥ 50 %", |s| share(s, |s| s.group == Group::Pair, |s| s.both)),
    ("on an arm: effect named first", "", "", |s| {
        share(s, |s| s.group == Group::Arm && !s.is_without_effect(), |s| s.first)
    }),
    ("on an arm: false alarm with no effect", "", "", |s| {
        share(s, |s| s.group == Group::Arm && s.is_without_effect(), |s| s.verdict != "none")
    }),
    ("rollouts a log: median", "", "", |s| quantile(s.iter().map(|s| s.rollouts as f64).collect(), 0.5)),
    ("rollouts a log: most", "≤ 5000", "≤ 5000", |s| quantile(s.iter().map(|s| s.rollouts as f64).collect(), 1.0)),
    ("seconds a log, one thread: median", "", "", |s| quantile(s.iter().map(|s| s.seconds).collect(), 0.5)),
    ("seconds a log, one thread: most", "≤ 180 on 2 cores", "≤ 180 on 2 cores", |s| {
        quantile(s.iter().map(|s| s.seconds).collect(), 1.0)
    }),
];

/// What simple programs reach on the same logs.
const BASELINES: [(&str, &str, &str, Figure); 9] = [
    ("re-tune everything: hidden effect named first", "", "", |s| share(s, in_catalogue, |_| false)),
    ("re-tune everything: gap of the untuned model closed, median", "", "", |s| {
        quantile(from_untuned(s).map(|[_, retuned]| retuned).collect(), 0.5)
    }),
    ("diagnose: the same", "", "", |s| quantile(from_untuned(s).map(|[with, _]| with).collect(), 0.5)),
    ("largest residual names: hidden effect named first", "", "", |s| {
        share(s, in_catalogue, |score| largest_residual(s, score).is_some_and(|name| name == score.truth[0]))
    }),
    ("largest residual names: false alarm with no effect", "", "", |s| {
        share(s, |s| s.group == Group::None, |score| largest_residual(s, score).is_some())
    }),
    ("largest residual names: effect outside the catalogue called unknown", "", "", |s| {
        share(s, |s| s.group == Group::Unknown, |_| false)
    }),
    ("Gaussian processes of what re-tuning leaves: hidden effect named first", "", "", |s| {
        share(s, in_catalogue, |_| false)
    }),
    ("Gaussian processes: gap closed, held out, relative to the true model: median", "", "", |s| {
        quantile(closed_by_process(s), 0.5)
    }),
    ("the same: 10th percentile", "", "", |s| quantile(closed_by_process(s), 0.1)),
];

fn in_catalogue(score: &Score) -> bool {
    score.group == Group::Catalogue
}

/// Parameters of named effects of sets of a group whose intervals hold the true values.
fn covered(scores: &[&Score], group: Group) -> Option<Cell> {
    let of = scores.iter().filter(|score| score.group == group);
    let inside: Vec<bool> = of.flat_map(|score| score.covered.iter().map(|(_, inside)| *inside)).collect();
    count(inside.iter().filter(|inside| **inside).count(), inside.len())
}

fn closed(scores: &[&Score]) -> Vec<f64> {
    scores.iter().filter(|s| in_catalogue(s)).filter_map(|score| score.closed()).collect()
}

fn closed_by_process(scores: &[&Score]) -> Vec<f64> {
    scores.iter().filter(|s| in_catalogue(s)).filter_map(|score| score.closed_by_process()).collect()
}

fn from_untuned(scores: &[&Score]) -> impl Iterator<Item = [f64; 2]> {
    scores.iter().filter(|s| in_catalogue(s)).filter_map(|score| score.closed_from_untuned())
}

/// The effect that shows most often where this one's residuals are largest, learnt from all other sets; `None`: no residual is significant.
fn largest_residual<'a>(scores: &[&'a Score], score: &Score) -> Option<&'a str> {
    let channel = score.channel.as_ref()?;
    let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
    for other in scores.iter().filter(|other| in_catalogue(other) && other.set != score.set) {
        if other.channel.as_ref() == Some(channel) {
            *counts.entry(&other.truth[0]).or_default() += 1;
        }
    }
    // The first of the alphabet where several are as frequent.
    let most = counts.values().max()?;
    counts.iter().find(|(_, count)| *count == most).map(|(name, _)| *name)
}

fn share(scores: &[&Score], of: fn(&Score) -> bool, hit: impl Fn(&Score) -> bool) -> Option<Cell> {
    let of: Vec<&&Score> = scores.iter().filter(|score| of(score)).collect();
    count(of.iter().filter(|score| hit(score)).count(), of.len())
}

fn count(hits: usize, of: usize) -> Option<Cell> {
    let (hits, of) = (hits as u32, of as u32);
    (of > 0).then(|| Cell::Share { hits, of, wilson95: wilson95(hits, of) })
}

fn mean(values: &[f64]) -> Option<Cell> {
    let of = values.len();
    (of > 0).then(|| Cell::Value { value: values.iter().sum::<f64>() / of as f64, of: of as u32 })
}

fn quantile(mut values: Vec<f64>, share: f64) -> Option<Cell> {
    let value = statistics::quantile(&mut values, share)?;
    Some(Cell::Value { value, of: values.len() as u32 })
}

/// A line a set.
#[must_use]
pub fn sets_to_csv(scores: &[Score]) -> String {
    let header = [
        "set",
        "actions",
        "group",
        "truth",
        "strength",
        "noise",
        "verdict",
        "named",
        "confidence",
        "first",
        "confused",
        "heldout_before",
        "heldout_after",
        "heldout_true",
        "heldout_process",
        "closed",
        "channel",
        "rollouts",
        "seconds",
    ];
    let row = |s: &Score| {
        let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.4}"));
        let heldout = |i: usize| number(s.heldout.map(|h| h[i]));
        vec![
            s.set.to_string(),
            s.actions.name().into(),
            format!("{:?}", s.group),
            s.truth.join("+"),
            s.strength.to_string(),
            s.noise.to_string(),
            s.verdict.to_string(),
            s.named.join("+"),
            number(s.confidences.first().copied()),
            s.first.to_string(),
            s.confused.to_string(),
            heldout(0),
            heldout(1),
            heldout(2),
            number(s.process),
            number(s.closed()),
            s.channel.clone().unwrap_or_default(),
            s.rollouts.to_string(),
            format!("{:.1}", s.seconds),
        ]
    };
    to_csv(&header, scores.iter().map(row))
}

/// For spreadsheets; quoted where a cell needs it.
fn to_csv(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(header).expect("memory takes all, and all rows are as long as the header");
    for row in rows {
        csv.write_record(&row).expect("memory takes all, and all rows are as long as the header");
    }
    String::from_utf8(csv.into_inner().expect("memory takes all")).expect("made of text")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_says_of_how_many_it_is() {
        assert_eq!(quantile(vec![3.0, 1.0, 2.0, 4.0], 0.5), Some(Cell::Value { value: 2.5, of: 4 }));
        assert_eq!(quantile(Vec::new(), 0.5), None);
    }
}
