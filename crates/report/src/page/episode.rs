//! One episode.

use recording::{BodyShape, EpisodeTrace, Moment, SeenBelief};

use super::{escape, facts, fixed, page, percent, picture, section, table};
use crate::describe;

/// A page about an episode; `svg` is its picture from above.
#[must_use]
pub fn episode_page(trace: &EpisodeTrace, svg: &str) -> String {
    let believes = trace.moments.iter().any(|moment| moment.belief.is_some());
    let reading = format!(
        "<p class=\"soft\">{}{SOLID}{}</p>\n",
        if believes { GHOSTS } else { "" },
        if believes { BELOW } else { "" }
    );
    let body = [
        outcome(trace),
        section("above", "From above", &(picture(svg, "the episode from above") + &reading)),
        section("belief", "What it believed at the end", &belief(trace)),
        section("steps", "Step by step", &steps(trace)),
        section("source", "Where this comes from", &source(trace)),
    ];
    page(&trace.title, &body.concat())
}

const GHOSTS: &str = "Each map shows a hundred particles of the belief over each other: the stronger the colour, the more probable; none after the action that ends \
    the episode, from which nothing is learnt. ";
const SOLID: &str = "Solid lines are the true object and the tool with their ways so far, dashes a true obstacle, which no sensor sees.";
const BELOW: &str = " Below, over the actions: what the object is and whether there is an obstacle, then friction and mass with the 90 % of the belief.";

fn outcome(trace: &EpisodeTrace) -> String {
    let last = trace.moments.len().saturating_sub(1);
    let transitions: usize = trace.moments.iter().filter_map(|m| m.search.as_ref()).map(|s| s.transitions).sum();
    let (class, end) = if trace.success {
        ("good", "The object reached the goal.".to_owned())
    } else {
        ("bad", format!("The object did not reach the goal: {}.", escape(&trace.reason)))
    };
    let numbers = facts(&[
        (last.to_string(), "actions"),
        (fixed(trace.discounted_return, 1), "discounted return"),
        (transitions.to_string(), "transitions simulated by the search"),
    ]);
    format!("<p class=\"{class}\" id=\"outcome\">{end}</p>\n{numbers}")
}

fn belief(trace: &EpisodeTrace) -> String {
    let Some(belief) = trace.moments.iter().rev().find_map(|m| m.belief.as_ref()) else {
        return "<p>This method believes nothing.</p>\n".into();
    };
    let truth = trace.moments.iter().find_map(|m| m.truth.as_ref());
    let mut rows = Vec::new();
    for (shape, probability) in BodyShape::ALL.iter().zip(belief.shape_probability) {
        let here = truth.map_or("–", |t| if t.object.shape == *shape { "yes" } else { "no" });
        rows.push(vec![format!("it is a {}", shape.name()), percent(probability), String::new(), here.into()]);
    }
    let obstacle = truth.map_or("–", |t| if t.obstacle.is_some() { "yes" } else { "no" });
    let share = percent(belief.obstacle_probability);
    rows.push(vec!["there is an obstacle".into(), share, String::new(), obstacle.into()]);
    for p in &belief.parameters {
        let unit = if p.unit.is_empty() { String::new() } else { format!(" / {}", escape(&p.unit)) };
        rows.push(vec![
            escape(&p.name) + &unit,
            fixed(p.median, 3),
            format!("{} to {}", fixed(p.low, 3), fixed(p.high, 3)),
            p.truth.map_or("–".into(), |value| fixed(value, 3)),
        ]);
    }
    let note = format!(
        "<p class=\"soft\">{} particles, effective {}. Nothing is learnt from the action that ends an episode.</p>\n",
        belief.particles,
        fixed(belief.effective_sample_size, 0)
    );
    table(&["", "believed", "90 %", "true"], &rows) + &note
}

fn steps(trace: &EpisodeTrace) -> String {
    let rows: Vec<Vec<String>> = trace.moments.iter().enumerate().map(|(i, moment)| step(i, moment)).collect();
    let heads = [
        "",
        "action",
        "reward",
        "simulations",
        "depth",
        "nodes",
        "box",
        "cylinder",
        "sphere",
        "obstacle",
        "effective particles",
        "what happened",
    ];
    format!("<div class=\"steps\">{}</div>\n", table(&heads, &rows))
}

fn step(index: usize, moment: &Moment) -> Vec<String> {
    let dash = || "–".to_owned();
    let search =
        |value: fn(&recording::SeenSearch) -> usize| moment.search.as_ref().map_or_else(dash, |s| value(s).to_string());
    let believed = |value: &dyn Fn(&SeenBelief) -> String| moment.belief.as_ref().map_or_else(dash, value);
    let mut cells = vec![
        index.to_string(),
        moment.action.map_or_else(dash, |a| describe::action(a).to_owned()),
        moment.reward.map_or_else(dash, |r| fixed(r, 1)),
        search(|s| s.simulations),
        search(|s| s.depth),
        search(|s| s.nodes),
    ];
    cells.extend((0..3).map(|i| believed(&|b| percent(b.shape_probability[i]))));
    cells.push(believed(&|b| percent(b.obstacle_probability)));
    cells.push(believed(&|b| fixed(b.effective_sample_size, 0)));
    cells.push(escape(&moment.events.join("; ")));
    cells
}

fn source(trace: &EpisodeTrace) -> String {
    let rows = [
        ("domain", trace.domain.clone()),
        ("robot", trace.robot.clone()),
        ("preset", trace.preset.clone()),
        ("method", trace.method.clone()),
        ("seed", trace.seed.to_string()),
        ("trial", trace.trial.to_string()),
        ("commit", trace.commit.clone()),
    ];
    let rows: Vec<Vec<String>> = rows.iter().map(|(key, value)| vec![(*key).to_owned(), escape(value)]).collect();
    table(&["", ""], &rows)
}
