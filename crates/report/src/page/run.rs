//! One run of `eval`.

use std::collections::BTreeMap;

use agent::Method;
use experiments::{Archive, Row};

use super::{escape, facts, fixed, p_value, page, percent, picture, section, table};
use crate::Error;

/// A page about a run, finished or not.
///
/// # Errors
///
/// A picture that cannot be drawn.
pub fn run_page(run: &Archive) -> Result<String, Error> {
    let title = format!("{} with {}, preset {}", run.domain, run.robot, run.preset);
    let mut body = summary(run);
    body += &section("success", "Success", &success(run));
    let mut pictures = String::new();
    for (name, figure) in run.figures() {
        pictures += &picture(&figure.svg()?, &name);
    }
    body += &section("pictures", "Success, actions to the goal, and what the belief learnt", &(pictures + READING));
    body += &section("failures", "Why trials failed", &failures(run));
    body += &section("pairs", "On the same worlds", &pairs(run));
    body += &section("trials", "Trials", &trials(run));
    body += &section("source", "Where this comes from", &source(run));
    Ok(page(&title, &body))
}

const READING: &str = "<p class=\"soft\">Intervals are Wilson's at 95 %. Errors of the belief: median over the trials and their quartiles after \
    each action; a trial that has ended keeps its last belief.</p>\n";

fn summary(run: &Archive) -> String {
    // Oracle and heuristic are bounds.
    let methods = run.table.rows.iter().filter(|row| !matches!(row.method, Method::Oracle | Method::Heuristic));
    let best = methods.max_by_key(|row| (row.successes, std::cmp::Reverse(row.method)));
    let mut numbers = vec![(run.trials.len().to_string(), "trials")];
    let count = run.table.provenance.trials;
    let whole = run.table.rows.iter().all(|row| row.trials == count) && count > 0;
    if !whole {
        let has: Vec<String> =
            run.table.rows.iter().map(|row| format!("{} {}", row.method.name(), row.trials)).collect();
        return facts(&numbers)
            + &format!(
                "<p class=\"bad\">Not finished: of {count} trials a method there are {}.</p>\n",
                has.join(", ")
            );
    }
    if let Some(row) = best {
        numbers.push((format!("{} of {}", row.successes, row.trials), "reached the goal with the best method"));
        numbers.push((row.method.name().to_owned(), "is that method"));
    }
    facts(&numbers)
}

fn success(run: &Archive) -> String {
    let row = |row: &Row| {
        let published = row.published.map_or("–".into(), |p| format!("{} of {}", p.successes, p.trials));
        vec![
            row.method.name().to_owned(),
            format!("<b>{} of {}</b>", row.successes, row.trials),
            format!("{} to {}", percent(row.interval95[0]), percent(row.interval95[1])),
            published,
            fixed(row.mean_return, 1),
            row.mean_steps_to_goal.map_or("–".into(), |steps| fixed(steps, 1)),
            fixed(row.mean_depletions, 2),
            fixed(row.transitions_per_action, 0),
            format!("{} of {}", row.obstacle_touched, row.with_obstacle),
        ]
    };
    let rows: Vec<Vec<String>> = run.table.rows.iter().map(row).collect();
    let heads = [
        "method",
        "reached the goal",
        "95 %",
        "published",
        "return",
        "actions to the goal",
        "depletions",
        "transitions an action",
        "obstacles touched",
    ];
    table(&heads, &rows)
}

fn failures(run: &Archive) -> String {
    let mut kinds: Vec<_> = run.table.rows.iter().flat_map(|row| row.failures.keys().copied()).collect();
    kinds.sort();
    kinds.dedup();
    if kinds.is_empty() {
        return "<p>None did.</p>\n".into();
    }
    let mut heads = vec!["method"];
    heads.extend(kinds.iter().map(|kind| kind.name()));
    let row = |row: &Row| {
        let mut cells = vec![row.method.name().to_owned()];
        cells.extend(kinds.iter().map(|kind| row.failures.get(kind).unwrap_or(&0).to_string()));
        cells
    };
    let rows: Vec<Vec<String>> = run.table.rows.iter().map(row).collect();
    table(&heads, &rows)
}

fn pairs(run: &Archive) -> String {
    if run.table.pairs.is_empty() {
        return "<p>One method was played.</p>\n".into();
    }
    let rows: Vec<Vec<String>> = run
        .table
        .pairs
        .iter()
        .map(|pair| {
            vec![
                format!("{} and {}", pair.first.name(), pair.second.name()),
                pair.both.to_string(),
                pair.first_only.to_string(),
                pair.second_only.to_string(),
                pair.neither.to_string(),
                p_value(pair.p),
            ]
        })
        .collect();
    let heads = ["methods", "both solved", "the first alone", "the second alone", "neither", "McNemar p"];
    table(&heads, &rows)
}

/// Columns that a page can show.
const MOST_SQUARES: u32 = 2000;

/// A square for each trial: which worlds are hard shows as columns.
fn trials(run: &Archive) -> String {
    let mut by_method: BTreeMap<_, BTreeMap<u32, &experiments::TrialRecord>> = BTreeMap::new();
    for trial in &run.trials {
        by_method.entry(trial.method).or_default().insert(trial.trial, trial);
    }
    let count = run.table.provenance.trials;
    if count > MOST_SQUARES {
        return format!("<p>{count} trials a method are too many to draw; they are in trials.jsonl.</p>\n");
    }
    let square = |trial: Option<&&experiments::TrialRecord>, number: u32| match trial {
        None => format!("<td><i class=\"open\" title=\"trial {number}: not played\"></i></td>"),
        Some(t) => {
            let class = if t.success { "won" } else { "lost" };
            let obstacle = if t.has_obstacle { ", obstacle" } else { "" };
            let title = format!("trial {number}: {}, {} actions{obstacle}", t.reason.name(), t.steps);
            format!("<td><i class=\"{class}\" title=\"{title}\"></i></td>")
        }
    };
    let rows: String = by_method
        .iter()
        .map(|(method, trials)| {
            let cells: String = (0..count).map(|number| square(trials.get(&number), number)).collect();
            format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", method.name())
        })
        .collect();
    format!(
        "<div class=\"scroll\"><table class=\"trials\"><tbody>{rows}</tbody></table></div>\n\
         <p class=\"soft\">A column is a world, the same for all methods; green reached the goal. Point at a square to read it; \
         <code>cargo xtask demo --domain {} --robot {} --preset {} --seed {} --method METHOD --trial N</code> plays one again, if this run had no overrides and \
         no other world.</p>\n",
        escape(&run.domain),
        escape(&run.robot),
        escape(&run.preset),
        run.table.provenance.run.seed
    )
}

fn source(run: &Archive) -> String {
    let identity = &run.table.provenance.run;
    let world = identity.world.as_ref().map_or("our own simulation".into(), |w| format!("{} {}", w.name, w.version));
    let rows = [
        ("commit", identity.commit.clone()),
        ("seed", identity.seed.to_string()),
        ("world", world),
        ("hash of the scenario", identity.scenario_hash.clone()),
        ("hash of the arm", identity.urdf_hash.clone()),
        ("hash of the prior", identity.prior_hash.clone().unwrap_or_else(|| "–".into())),
    ];
    let rows: Vec<Vec<String>> = rows.iter().map(|(key, value)| vec![(*key).to_owned(), escape(value)]).collect();
    table(&["", ""], &rows)
}
