//! An episode in words, for the terminal.

use std::fmt::Write as _;

use experiments::TrialRecord;
use page::number::count;
use recording::{BodyShape, EpisodeTrace, Moment, SeenBelief};

/// Names of the actions, by number: directions in the base frame.
const ACTIONS: [&str; 10] = ["+x", "+x +y", "+y", "−x +y", "−x", "−x −y", "−y", "+x −y", "up", "down"];

/// Name of an action.
#[must_use]
pub fn action(index: u8) -> &'static str {
    ACTIONS.get(usize::from(index)).copied().unwrap_or("?")
}

/// A moment in a line.
#[must_use]
pub fn moment(count: usize, moment: &Moment) -> String {
    let mut line = match moment.action {
        None => "start     ".to_owned(),
        Some(index) => format!("{count:3} {:<6}", action(index)),
    };
    if let Some(search) = &moment.search {
        let _ = write!(line, "  {:5} simulations, depth {:2}", search.simulations, search.depth);
    }
    if let Some(belief) = &moment.belief {
        let _ = write!(line, "  {}", believed(belief));
    }
    for event in &moment.events {
        let _ = write!(line, "  [{event}]");
    }
    line
}

fn believed(belief: &SeenBelief) -> String {
    let shapes = BodyShape::ALL.iter().zip(belief.shape_probability);
    let shapes: Vec<String> = shapes.map(|(shape, p)| format!("{} {p:.2}", shape.name())).collect();
    format!("{}  obstacle {:.2}", shapes.join(" "), belief.obstacle_probability)
}

/// How it ended, and what the robot believes at the end beside what is true.
#[must_use]
pub fn summary(trace: &EpisodeTrace, record: &TrialRecord) -> String {
    let end = if trace.success { "reached the goal" } else { "did not reach the goal" };
    let why = if trace.success { String::new() } else { format!(" ({})", trace.reason) };
    let mut out = format!(
        "\n{end}{why} after {} actions in {:.0} s: {:.2} s for each update and search, {}\n",
        record.steps,
        record.seconds,
        record.decision_seconds / record.steps.max(1) as f64,
        transitions(trace)
    );
    let truth = trace.moments.iter().find_map(|moment| moment.truth.as_ref());
    let Some(belief) = trace.moments.iter().rev().find_map(|moment| moment.belief.as_ref()) else { return out };
    out.push_str("\n                       believed at the end      true\n");
    if let Some(truth) = truth {
        let probability = belief.shape_probability[truth.object.shape as usize];
        let shape = truth.object.shape.name();
        let _ = writeln!(out, "it is a {shape:<14} {:<24} yes", percent(probability));
        let there = truth.obstacle.map_or("no".into(), |body| format!("yes, a {}", body.shape.name()));
        let _ = writeln!(out, "there is an obstacle   {:<24} {there}", percent(belief.obstacle_probability));
    }
    for p in &belief.parameters {
        let name = if p.unit.is_empty() { p.name.clone() } else { format!("{} / {}", p.name, p.unit) };
        let interval = format!("{:.3} ({:.3} to {:.3})", p.median, p.low, p.high);
        let truth = p.truth.map_or("–".into(), |value| format!("{value:.3}"));
        let _ = writeln!(out, "{name:<22} {interval:<24} {truth}");
    }
    out
}

/// What was simulated, with its parts where there are two.
#[must_use]
pub fn transitions(trace: &EpisodeTrace) -> String {
    let (search, updates) = trace.transitions();
    match updates {
        Some(updates) if updates > 0 => {
            let [total, search, updates] = [search + updates, search, updates].map(count);
            format!("{total} transitions simulated: {search} by the search, {updates} to update the belief")
        }
        _ => format!("{} transitions simulated by the search", count(search)),
    }
}

fn percent(probability: f64) -> String {
    format!("{:.0} %", 100.0 * probability)
}

#[cfg(test)]
mod tests {
    use recording::SeenSearch;

    use super::*;

    #[test]
    fn transitions_of_search_and_updates_are_told_apart() {
        let moment = |search: usize, updates: Option<usize>| Moment {
            action: Some(0),
            reward: None,
            events: Vec::new(),
            joints: Vec::new(),
            tool: recording::Pose::default(),
            truth: None,
            belief: None,
            search: Some(SeenSearch { simulations: 1, transitions: search, depth: 1, nodes: 1, actions: Vec::new() }),
            update_transitions: updates,
        };
        let trace = |moments| EpisodeTrace { moments, ..EpisodeTrace::default() };
        let both = transitions(&trace(vec![moment(4000, Some(1000)), moment(3990, Some(10))]));
        assert_eq!(both, "9,000 transitions simulated: 7,990 by the search, 1,010 to update the belief");
        // A method without a belief, and a trace of an older version.
        for none in [Some(0), None] {
            assert_eq!(transitions(&trace(vec![moment(4000, none)])), "4,000 transitions simulated by the search");
        }
    }
}
