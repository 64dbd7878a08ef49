//! One episode.

use maud::html;
use page::number::{count, fixed, percent};
use page::{Markup, Words, facts, picture, section, table, text};
use recording::{BodyShape, EpisodeTrace, Moment, SeenBelief};

use super::titled;
use crate::describe;

/// A page about an episode; `svg` is its picture from above.
#[must_use]
pub fn episode_page(trace: &EpisodeTrace, svg: &str) -> String {
    let words = Words::default();
    let believes = trace.moments.iter().any(|moment| moment.belief.is_some());
    let above = html! {
        (picture(svg, "the episode from above"))
        p.soft { @if believes { (GHOSTS) } (SOLID) @if believes { (BELOW) } }
    };
    let body = html! {
        (outcome(trace, &words))
        (section("above", "From above", &above))
        (section("belief", "What it believed at the end", &belief(trace, &words)))
        (section("steps", "Step by step", &steps(trace, &words)))
        (section("source", "Where this comes from", &source(trace, &words)))
        (section("words", "Words", &words.list()))
    };
    titled(&trace.title, &body)
}

const GHOSTS: &str = "Each map shows a hundred particles of the belief over each other: the stronger the colour, the more probable. There is none \
    after the action that ends the episode, because nothing is learnt from it. ";
const SOLID: &str = "Solid lines are the true object and the tool with their ways so far, dashes a true obstacle, which no sensor sees.";
const BELOW: &str = " Below, over the actions: what the object is and whether there is an obstacle, then friction and mass with the 90 % of the belief.";

fn outcome(trace: &EpisodeTrace, words: &Words) -> Markup {
    let last = trace.moments.len().saturating_sub(1);
    let (search, updates) = trace.transitions();
    let mut numbers = vec![
        (last.to_string(), words.mark_as("action", "actions")),
        (fixed(trace.discounted_return, 1), words.mark("discounted return")),
    ];
    let transitions = words.mark_as("transition", "transitions");
    numbers.push(match updates {
        Some(updates) if updates > 0 => (
            count(search + updates),
            html! { (transitions) " simulated: " (count(search)) " by the search, " (count(updates)) " to update the belief" },
        ),
        _ => (count(search), html! { (transitions) " simulated by the search" }),
    });
    html! {
        @if trace.success {
            p.good #outcome { "The object reached the goal." }
        } @else {
            p.bad #outcome { "The object did not reach the goal: " (trace.reason) "." }
        }
        (facts(&numbers))
    }
}

fn belief(trace: &EpisodeTrace, words: &Words) -> Markup {
    let Some(belief) = trace.moments.iter().rev().find_map(|m| m.belief.as_ref()) else {
        return html! { p { "This method believes nothing." } };
    };
    let truth = trace.moments.iter().find_map(|m| m.truth.as_ref());
    let known = |is: Option<bool>| is.map_or("–", |is| if is { "yes" } else { "no" });
    let row = |cells: [&str; 4]| cells.iter().map(text).collect::<Vec<_>>();
    let mut rows = Vec::new();
    for (shape, probability) in BodyShape::ALL.iter().zip(belief.shape_probability) {
        let here = known(truth.map(|t| t.object.shape == *shape));
        rows.push(row([&format!("it is a {}", shape.name()), &percent(probability), "", here]));
    }
    let obstacle = known(truth.map(|t| t.obstacle.is_some()));
    rows.push(row(["there is an obstacle", &percent(belief.obstacle_probability), "", obstacle]));
    for p in &belief.parameters {
        let name = if p.unit.is_empty() { p.name.clone() } else { format!("{} / {}", p.name, p.unit) };
        let interval = format!("{} to {}", fixed(p.low, 3), fixed(p.high, 3));
        let truth = p.truth.map_or("–".into(), |value| fixed(value, 3));
        rows.push(row([&name, &fixed(p.median, 3), &interval, &truth]));
    }
    let heads = [text(""), words.mark_as("belief", "believed"), words.mark_as("90 % interval", "90 %"), text("true")];
    html! {
        (table(&heads, &rows))
        p.soft {
            (belief.particles) " " (words.mark_as("particle", "particles")) ", "
            (words.mark_as("effective particles", "effective")) " " (fixed(belief.effective_sample_size, 0))
            ". Nothing is learnt from the action that ends an episode."
        }
    }
}

fn steps(trace: &EpisodeTrace, words: &Words) -> Markup {
    let rows: Vec<Vec<Markup>> = trace.moments.iter().enumerate().map(|(i, moment)| step(i, moment)).collect();
    let heads = [
        text(""),
        words.mark("action"),
        text("reward"),
        words.mark_as("simulation", "simulations"),
        words.mark("depth"),
        words.mark("nodes"),
        text("box"),
        text("cylinder"),
        text("sphere"),
        words.mark("obstacle"),
        words.mark("effective particles"),
        text("what happened"),
    ];
    html! { div.steps { (table(&heads, &rows)) } }
}

fn step(index: usize, moment: &Moment) -> Vec<Markup> {
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
    cells.push(moment.events.join("; "));
    cells.into_iter().map(text).collect()
}

fn source(trace: &EpisodeTrace, words: &Words) -> Markup {
    let row = |key: Markup, value: &dyn page::Render| vec![key, text(value)];
    let rows = [
        row(words.mark("domain"), &trace.domain),
        row(text("robot"), &trace.robot),
        row(words.mark("preset"), &trace.preset),
        row(words.mark("method"), &words.mark_known(&trace.method)),
        row(words.mark("seed"), &trace.seed),
        row(words.mark("trial"), &trace.trial),
        row(text("commit"), &trace.commit),
    ];
    table(&[], &rows)
}
