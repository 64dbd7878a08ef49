//! Combined tables for spreadsheets.

use agent::Method;
use scenario::Published;

use super::Combined;
use crate::spreadsheet;
use crate::table::published_cells;

impl Combined {
    /// Rows and sums over domains.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let header = [
            "domains",
            "run",
            "method",
            "robot",
            "preset",
            "world",
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
            "mean_large_forces",
            "mean_out_of_reach",
            "with_obstacle",
            "obstacle_touched",
            "failures",
            "seed",
            "commit",
            "scenario_hash",
        ];
        let seed = self.provenance.common.seed.to_string();
        let rows = self.rows.iter().map(|combined| {
            let row = &combined.row;
            let mut cells = head(&row.domain, &combined.run, row.method).to_vec();
            cells.extend([row.robot.clone(), row.preset.clone(), combined.world.clone().unwrap_or_default()]);
            cells.extend(counts(row.successes, row.trials, row.interval95, row.published));
            cells.push(row.mean_return.to_string());
            cells.push(row.mean_steps_to_goal.map_or(String::new(), |steps| steps.to_string()));
            let rest = [row.mean_depletions, row.transitions_per_action, row.mean_large_forces, row.mean_out_of_reach];
            cells.extend(rest.map(|value| value.to_string()));
            cells.extend([row.with_obstacle.to_string(), row.obstacle_touched.to_string()]);
            cells.extend([failures(&row.failures), seed.clone()]);
            let run = self.provenance.runs.get(&combined.folder);
            cells.extend(
                run.map_or_else(Default::default, |run| [run.commit.to_string(), run.scenario_hash.to_string()]),
            );
            cells
        });
        let totals = self.totals.iter().map(|total| {
            let mut cells = head(&total.domains, &total.run, total.method).to_vec();
            cells.extend([const { String::new() }; 3]);
            cells.extend(counts(total.successes, total.trials, total.interval95, total.published));
            cells.extend([const { String::new() }; 8]);
            cells.extend([failures(&total.failures), seed.clone(), String::new(), String::new()]);
            cells
        });
        spreadsheet::to_csv(&header, rows.chain(totals))
    }

    /// Comparisons.
    #[must_use]
    pub fn comparisons_csv(&self) -> String {
        let header = [
            "domains",
            "first_run",
            "first_method",
            "second_run",
            "second_method",
            "both",
            "first_only",
            "second_only",
            "neither",
            "p",
            "mcnemar_p",
        ];
        let rows = self.comparisons.iter().map(|c| {
            let mut cells = head(&c.domains, &c.first.run, c.first.method).to_vec();
            cells.extend([c.second.run.clone(), c.second.method.name().into()]);
            cells.extend([c.both, c.first_only, c.second_only, c.neither].map(|count| count.to_string()));
            cells.extend([c.p.to_string(), c.mcnemar_p.to_string()]);
            cells
        });
        spreadsheet::to_csv(&header, rows)
    }
}

fn head(domains: &str, run: &str, method: Method) -> [String; 3] {
    [domains.into(), run.into(), method.name().into()]
}

fn counts(successes: u32, trials: u32, interval95: [f64; 2], published: Option<Published>) -> [String; 6] {
    let [low, high] = interval95.map(|end| end.to_string());
    let [published_successes, published_trials] = published_cells(published);
    [successes.to_string(), trials.to_string(), low, high, published_successes, published_trials]
}

fn failures(failures: &std::collections::BTreeMap<crate::Failure, u32>) -> String {
    let words: Vec<String> = failures.iter().map(|(failure, count)| format!("{} {count}", failure.name())).collect();
    words.join("; ")
}
