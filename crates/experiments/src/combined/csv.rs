//! Combined tables for spreadsheets.

use std::fmt::Write as _;

use agent::Method;
use scenario::Published;

use super::Combined;

impl Combined {
    /// Rows and sums over domains.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "domains,run,method,robot,preset,world,successes,trials,interval95_low,interval95_high,published_successes,\
             published_trials,mean_return,mean_steps_to_goal,mean_depletions,transitions_per_action,mean_large_forces,\
             mean_out_of_reach,with_obstacle,obstacle_touched,failures,seed,commit,scenario_hash\n",
        );
        for combined in &self.rows {
            let row = &combined.row;
            let steps = row.mean_steps_to_goal.map_or(String::new(), |steps| steps.to_string());
            let rest = [row.mean_depletions, row.transitions_per_action, row.mean_large_forces, row.mean_out_of_reach];
            let rest = rest.map(|value| value.to_string()).join(",");
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{},{},{}",
                head(&row.domain, &combined.run, row.method),
                row.robot,
                row.preset,
                combined.world.as_deref().unwrap_or_default(),
                counts(row.successes, row.trials, row.interval95, row.published),
                row.mean_return,
                steps,
                rest,
                row.with_obstacle,
                row.obstacle_touched,
                failures(&row.failures),
                self.provenance.common.seed,
                self.provenance
                    .runs
                    .get(&combined.folder)
                    .map_or(String::from(","), |run| format!("{},{}", run.commit, run.scenario_hash)),
            );
        }
        for total in &self.totals {
            let _ = writeln!(
                text,
                "{},,,,{},,,,,,,,,{},{},,",
                head(&total.domains, &total.run, total.method),
                counts(total.successes, total.trials, total.interval95, total.published),
                failures(&total.failures),
                self.provenance.common.seed,
            );
        }
        text
    }

    /// Comparisons.
    #[must_use]
    pub fn comparisons_csv(&self) -> String {
        let mut text = String::from(
            "domains,first_run,first_method,second_run,second_method,both,first_only,second_only,neither,p,mcnemar_p\n",
        );
        for c in &self.comparisons {
            let (first, second) = (head(&c.domains, &c.first.run, c.first.method), c.second.method.name());
            let counts = [c.both, c.first_only, c.second_only, c.neither].map(|count| count.to_string()).join(",");
            let _ = writeln!(text, "{first},{},{second},{counts},{},{}", c.second.run, c.p, c.mcnemar_p);
        }
        text
    }
}

fn head(domains: &str, run: &str, method: Method) -> String {
    // A pool's name is free text.
    let domains = if domains.contains(',') { format!("\"{domains}\"") } else { domains.to_string() };
    format!("{domains},{run},{}", method.name())
}

fn counts(successes: u32, trials: u32, interval95: [f64; 2], published: Option<Published>) -> String {
    let published = published.map_or(",".into(), |p| format!("{},{}", p.successes, p.trials));
    format!("{successes},{trials},{},{},{published}", interval95[0], interval95[1])
}

fn failures(failures: &std::collections::BTreeMap<crate::Failure, u32>) -> String {
    let words: Vec<String> = failures.iter().map(|(failure, count)| format!("{} {count}", failure.name())).collect();
    words.join("; ")
}
