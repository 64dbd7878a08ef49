//! Combined tables for people.

use std::fmt::Write as _;

use scenario::Published;

use super::{Arm, Combined, Comparison};
use crate::paired::probability;

impl Combined {
    /// Success rates as in the paper, then what ended the trials, then comparisons, then where it all comes from.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!("# {}\n\n", self.title);
        if self.provenance.common.quick {
            text += "A trial run with tiny budgets: the figures mean nothing.\n\n";
        }
        if !self.missing.is_empty() {
            text += &format!("Not played: {}.\n\n", self.missing.join(", "));
        }
        self.rates(&mut text);
        self.details(&mut text);
        self.paired(&mut text);
        self.sources(&mut text);
        text
    }

    /// Domains and pools, in the order of columns.
    fn columns(&self) -> Vec<String> {
        let mut columns = self.domains();
        for total in &self.totals {
            if !columns.contains(&total.domains) {
                columns.push(total.domains.clone());
            }
        }
        columns
    }

    fn rates(&self, text: &mut String) {
        *text +=
            "Successes of trials, with the 95 % Wilson interval of the rate; what the paper published in brackets.\n\n";
        let columns = self.columns();
        table_head(text, ["run", "method"].into_iter().chain(columns.iter().map(String::as_str)));
        for arm in self.arms() {
            let cell = |column: &String| {
                let row = self.row(&arm, column).map(|row| &row.row);
                let row = row.map(|row| (row.successes, row.trials, row.interval95, row.published));
                let of_arm = |total: &&super::Total| total.run == arm.run && total.method == arm.method;
                let total = self.totals.iter().filter(of_arm).find(|total| total.domains == *column);
                let total = total.map(|total| (total.successes, total.trials, total.interval95, total.published));
                row.or(total).map_or("–".into(), |(successes, trials, interval95, published)| {
                    rate(successes, trials, interval95, published)
                })
            };
            let cells: Vec<String> = columns.iter().map(cell).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| {} | {} | {} |", arm.run, arm.method.name(), cells.join(" | "));
        }
    }

    fn details(&self, text: &mut String) {
        *text += "\nWhat kept failed trials from the goal, and means per trial. A trial that used up its actions counts as \
                  `excessive-force` or `out-of-reach` where at least a third of them met a force above the limit, or would have left \
                  the reach.\n\n";
        let head = [
            "domain",
            "run",
            "method",
            "failed by",
            "steps to goal",
            "depletions",
            "large forces",
            "out of reach",
            "transitions an action",
            "obstacle touched",
            "return",
        ];
        table_head(text, head.into_iter());
        for domain in self.domains() {
            for combined in self.rows.iter().filter(|combined| combined.row.domain == domain) {
                let row = &combined.row;
                let failures: Vec<String> =
                    row.failures.iter().map(|(f, count)| format!("{} {count}", f.name())).collect();
                let failures = if failures.is_empty() { "–".into() } else { failures.join(", ") };
                let steps = row.mean_steps_to_goal.map_or("–".into(), |steps| format!("{steps:.1}"));
                let _ = writeln!(
                    text,
                    "| {domain} | {} | {} | {failures} | {steps} | {:.2} | {:.2} | {:.2} | {:.0} | {} of {} | {:.1} |",
                    combined.run,
                    row.method.name(),
                    row.mean_depletions,
                    row.mean_large_forces,
                    row.mean_out_of_reach,
                    row.transitions_per_action,
                    row.obstacle_touched,
                    row.with_obstacle,
                    row.mean_return,
                );
            }
        }
    }

    fn paired(&self, text: &mut String) {
        if self.comparisons.is_empty() {
            return;
        }
        *text += "\nThe same worlds: how many only the first method solved, how many only the second, and a two-sided p, not corrected for the \
                  number of comparisons. On one domain it is that of McNemar's exact test. Worlds of the same number share their draws in all \
                  domains: over several of them the differences of each number get one random sign (a sign-flip test), and what McNemar's test of \
                  the counts would say, as if all were independent, is in brackets. Intervals of sums take them for independent and are a \
                  little narrow.\n\n";
        let (mut columns, mut pairs): (Vec<&str>, Vec<(&Arm, &Arm)>) = (Vec::new(), Vec::new());
        for comparison in &self.comparisons {
            if !columns.contains(&comparison.domains.as_str()) {
                columns.push(&comparison.domains);
            }
            if !pairs.contains(&comparison.arms()) {
                pairs.push(comparison.arms());
            }
        }
        table_head(text, ["first", "second"].into_iter().chain(columns.iter().copied()));
        for pair in pairs {
            let cell = |column: &&str| {
                let found = self.comparisons.iter().find(|c| c.arms() == pair && c.domains == *column);
                found.map_or("–".into(), |c| format!("{} : {}, p {}", c.first_only, c.second_only, p_values(c)))
            };
            let cells: Vec<String> = columns.iter().map(cell).collect();
            let _ = writeln!(text, "| {} | {} | {} |", pair.0.label(), pair.1.label(), cells.join(" | "));
        }
    }

    fn sources(&self, text: &mut String) {
        let common = &self.provenance.common;
        let _ = write!(text, "\nSeed {}", common.seed);
        if !common.set.is_empty() {
            let _ = write!(text, ", with {}", common.set.join(", "));
        }
        *text += ".\n\n";
        table_head(text, ["run", "commit", "trials a method", "scenario", "prior", "world", "overrides"].into_iter());
        for (folder, source) in &self.provenance.runs {
            let short = |hash: &str| hash.chars().take(12).collect::<String>();
            let _ = writeln!(
                text,
                "| {folder} | {} | {} | {} | {} | {} | {} |",
                source.commit,
                source.trials,
                short(&source.scenario_hash),
                source.prior_hash.as_deref().map_or("–".into(), short),
                source.world.as_deref().unwrap_or("simulated"),
                if source.set.is_empty() { "–".into() } else { source.set.join(", ") },
            );
        }
    }
}

fn table_head<'a>(text: &mut String, columns: impl Iterator<Item = &'a str>) {
    let columns: Vec<&str> = columns.collect();
    let _ = writeln!(text, "| {} |\n|{}", columns.join(" | "), "---|".repeat(columns.len()));
}

fn rate(successes: u32, trials: u32, interval95: [f64; 2], published: Option<Published>) -> String {
    let [low, high] = interval95;
    let published = published.map_or(String::new(), |p| format!(" [{}/{}]", p.successes, p.trials));
    format!("{successes}/{trials} ({low:.2}–{high:.2}){published}")
}

/// Of a comparison: with one sign for each world number, and in brackets McNemar's where that is another.
fn p_values(comparison: &Comparison) -> String {
    let [p, mcnemar] = [comparison.p, comparison.mcnemar_p].map(probability);
    if p == mcnemar { p } else { format!("{p} ({mcnemar})") }
}
