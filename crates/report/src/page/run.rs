//! One run of `eval`.

use std::collections::BTreeMap;

use agent::Method;
use experiments::{Archive, Row, TrialRecord};
use maud::html;
use page::number::{fixed, p_value, percent};
use page::{Markup, Words, facts, picture, section, table, text};

use super::titled;
use crate::Error;

/// A page about a run, finished or not.
///
/// # Errors
///
/// A picture that cannot be drawn.
pub fn run_page(run: &Archive) -> Result<String, Error> {
    let words = Words::default();
    let title = format!("{} with {}, preset {}", run.domain, run.robot, run.preset);
    let mut pictures = Vec::new();
    for (name, figure) in run.figures() {
        pictures.push(picture(&figure.svg()?, &name));
    }
    let pictures = html! { @for picture in &pictures { (picture) } p.soft { (READING) } };
    let body = html! {
        (summary(run, &words))
        (section("success", "Success", &success(run, &words)))
        (section("pictures", "Success, actions to the goal, and what the belief learnt", &pictures))
        (section("failures", "Why trials failed", &failures(run, &words)))
        (section("pairs", "On the same worlds", &pairs(run, &words)))
        (section("trials", "Trials", &trials(run)))
        (section("source", "Where this comes from", &source(run)))
        (section("words", "Words", &words.list()))
    };
    Ok(titled(&title, &body))
}

const READING: &str = "Intervals are Wilson's at 95 %. Errors of the belief: median over the trials and their quartiles after \
    each action; a trial that has ended keeps its last belief.";

fn summary(run: &Archive, words: &Words) -> Markup {
    // Oracle and heuristic are bounds.
    let methods = run.table.rows.iter().filter(|row| !matches!(row.method, Method::Oracle | Method::Heuristic));
    let best = methods.max_by_key(|row| (row.successes, std::cmp::Reverse(row.method)));
    let mut numbers = vec![(run.trials.len().to_string(), words.mark_as("trial", "trials"))];
    let count = run.table.provenance.trials;
    let whole = run.table.rows.iter().all(|row| row.trials == count) && count > 0;
    if !whole {
        let has: Vec<String> =
            run.table.rows.iter().map(|row| format!("{} {}", row.method.name(), row.trials)).collect();
        return html! {
            (facts(&numbers))
            p.bad { "Not finished: of " (count) " trials a method there are " (has.join(", ")) "." }
        };
    }
    if let Some(row) = best {
        let successes = format!("{} of {}", row.successes, row.trials);
        numbers.push((successes, text("reached the goal with the best method")));
        numbers.push((row.method.name().to_owned(), text("is that method")));
    }
    facts(&numbers)
}

fn success(run: &Archive, words: &Words) -> Markup {
    let row = |row: &Row| {
        let published = row.published.map_or("–".into(), |p| format!("{} of {}", p.successes, p.trials));
        let [low, high] = row.interval95;
        vec![
            words.mark(row.method.name()),
            html! { b { (row.successes) " of " (row.trials) } },
            text(format!("{} to {}", percent(low), percent(high))),
            text(published),
            text(fixed(row.mean_return, 1)),
            text(row.mean_steps_to_goal.map_or("–".into(), |steps| fixed(steps, 1))),
            text(fixed(row.mean_depletions, 2)),
            text(fixed(row.transitions_per_action, 0)),
            text(format!("{} of {}", row.obstacle_touched, row.with_obstacle)),
        ]
    };
    let rows: Vec<Vec<Markup>> = run.table.rows.iter().map(row).collect();
    let heads = [
        words.mark("method"),
        words.mark_as("goal", "reached the goal"),
        words.mark_as("95 % interval", "95 %"),
        words.mark("published"),
        words.mark_as("discounted return", "return"),
        text("actions to the goal"),
        words.mark_as("depletion", "depletions"),
        words.mark_as("transition", "transitions an action"),
        words.mark_as("obstacle", "obstacles touched"),
    ];
    table(&heads, &rows)
}

fn failures(run: &Archive, words: &Words) -> Markup {
    let mut kinds: Vec<_> = run.table.rows.iter().flat_map(|row| row.failures.keys().copied()).collect();
    kinds.sort();
    kinds.dedup();
    if kinds.is_empty() {
        return html! { p { "None did." } };
    }
    let mut heads = vec![text("method")];
    heads.extend(kinds.iter().map(|kind| failure(kind.name(), words)));
    let row = |row: &Row| {
        let mut cells = vec![text(row.method.name())];
        cells.extend(kinds.iter().map(|kind| text(row.failures.get(kind).unwrap_or(&0))));
        cells
    };
    let rows: Vec<Vec<Markup>> = run.table.rows.iter().map(row).collect();
    table(&heads, &rows)
}

/// The name of a kind of failure, with what it means.
pub(super) fn failure(name: &str, words: &Words) -> Markup {
    let term = match name {
        "excessive-force" => "large force",
        "out-of-reach" => "out of reach",
        name => name,
    };
    words.mark_as(term, name)
}

fn pairs(run: &Archive, words: &Words) -> Markup {
    if run.table.pairs.is_empty() {
        return html! { p { "One method was played." } };
    }
    let pairs = run.table.pairs.iter();
    let rows: Vec<Vec<Markup>> = pairs
        .map(|pair| {
            vec![
                text(format!("{} and {}", pair.first.name(), pair.second.name())),
                text(pair.both),
                text(pair.first_only),
                text(pair.second_only),
                text(pair.neither),
                text(p_value(pair.p)),
            ]
        })
        .collect();
    let heads = ["methods", "both solved", "the first alone", "the second alone", "neither"];
    let heads: Vec<Markup> = heads.iter().map(text).chain([words.mark("McNemar p")]).collect();
    table(&heads, &rows)
}

/// Columns that a page can show.
const MOST_SQUARES: u32 = 2000;

/// A square for each trial: which worlds are hard shows as columns.
fn trials(run: &Archive) -> Markup {
    let mut by_method: BTreeMap<_, BTreeMap<u32, &TrialRecord>> = BTreeMap::new();
    for trial in &run.trials {
        by_method.entry(trial.method).or_default().insert(trial.trial, trial);
    }
    let count = run.table.provenance.trials;
    if count > MOST_SQUARES {
        return html! { p { (count) " trials a method are too many to draw; they are in trials.jsonl." } };
    }
    let command = format!(
        "cargo xtask demo --domain {} --robot {} --preset {} --seed {} --method METHOD --trial N",
        run.domain, run.robot, run.preset, run.table.provenance.run.seed
    );
    html! {
        div.scroll {
            table.trials {
                tbody {
                    @for (method, trials) in &by_method {
                        tr {
                            th scope="row" { (method.name()) }
                            @for number in 0..count { (square(trials.get(&number).copied(), number)) }
                        }
                        "\n"
                    }
                }
            }
        }
        p.soft {
            "A column is a world, the same for all methods; green reached the goal. Point at a square to read it; "
            code { (command) }
            " plays one again, if this run had no overrides and no other world."
        }
    }
}

fn square(trial: Option<&TrialRecord>, number: u32) -> Markup {
    let Some(trial) = trial else {
        return html! { td { i.open title={ "trial " (number) ": not played" } {} } };
    };
    let obstacle = if trial.has_obstacle { ", obstacle" } else { "" };
    let title = format!("trial {number}: {}, {} actions{obstacle}", trial.reason.name(), trial.steps);
    html! { td { i class=(if trial.success { "won" } else { "lost" }) title=(title) {} } }
}

fn source(run: &Archive) -> Markup {
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
    let rows: Vec<Vec<Markup>> = rows.iter().map(|(key, value)| vec![text(key), text(value)]).collect();
    table(&[], &rows)
}
