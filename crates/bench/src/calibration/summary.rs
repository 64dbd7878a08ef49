//! Figures of many worlds, with bootstrap intervals over worlds.

use pomdp::{Purpose, Rng, Seed};
use rand::RngExt as _;
use serde_json::{Map, Value, json};

use super::episode::{NUMBERS, Row, USUAL_DRAWS, World};
use super::reference::Ruler;

/// Steps that are reported; a world that has ended counts with its last belief.
pub(super) const STEPS: [usize; 5] = [0, 2, 5, 8, usize::MAX];
/// Bootstrap draws.
const DRAWS: usize = 1000;

/// The rows of a world that one source made.
type Source = fn(&World) -> &Vec<Row>;

/// Whose belief it is.
pub(super) const SOURCES: [(&str, Source); 3] =
    [("prior", |w| &w.prior), ("network", |w| &w.network), ("filter", |w| &w.filter)];

/// A figure of a step: what a row of a world adds, if anything.
type Figure = Box<dyn Fn(&World, &Row) -> Option<f64>>;

/// All figures of `worlds`.
pub(super) fn summary(worlds: &[World], provenance: &Value) -> Value {
    let mut rng = Seed(1).stream(Purpose::Statistics, 0);
    let mut steps = Map::new();
    for step in STEPS {
        let name = if step == usize::MAX { "last".into() } else { step.to_string() };
        let mut sources = Map::new();
        for (source, rows) in SOURCES {
            let mut figures = Map::new();
            for (figure, value) in figures_of_a_row() {
                let values: Vec<f64> =
                    worlds.iter().filter_map(|w| at(rows(w), step).and_then(|row| value(w, row))).collect();
                figures.insert(figure, interval(&values, &mut rng));
            }
            sources.insert(source.into(), Value::Object(figures));
        }
        steps.insert(name, Value::Object(sources));
    }
    let ranks: Map<String, Value> = NUMBERS
        .iter()
        .enumerate()
        .map(|(index, (name, _))| {
            let last = worlds.iter().filter_map(|w| w.filter.last()?.ranks[index]);
            ((*name).into(), json!(histogram(last)))
        })
        .collect();
    let tarp = histogram(worlds.iter().filter_map(|w| Some(w.filter.last()?.tarp)));
    let each =
        |value: &dyn Fn(&World) -> f64, rng: &mut Rng| interval(&worlds.iter().map(value).collect::<Vec<_>>(), rng);
    let per_update = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let after: Vec<f64> = worlds
        .iter()
        .flat_map(|w| {
            let first = w.first_contact.unwrap_or(usize::MAX);
            let better = move |(step, row): (usize, &Row)| {
                let rivals = w.prior.get(step)?.log_score.max(w.network.get(step)?.log_score);
                (step >= first).then_some(row.log_score - rivals)
            };
            w.filter.iter().enumerate().filter_map(better).collect::<Vec<_>>()
        })
        .collect();
    let mut summary = json!({
        "provenance": provenance,
        "steps": steps,
        "reliability": reliability(worlds),
        "rank_histograms_at_the_last_step": ranks,
        "tarp_histogram_at_the_last_step": tarp,
        "log_score_over_the_better_of_prior_and_network_after_contact": per_update(&after),
        "solved": each(&|w| f64::from(u8::from(w.reason == "goal")), &mut rng),
        "discounted_return": each(&|w| w.discounted_return, &mut rng),
        "transitions_per_update": per_update(&worlds.iter().flat_map(|w| w.transitions.iter().map(|t| *t as f64)).collect::<Vec<_>>()),
        "exponent": per_update(&worlds.iter().flat_map(|w| w.exponents.clone()).collect::<Vec<_>>()),
        "seconds_per_action": per_update(&worlds.iter().map(|w| w.seconds).collect::<Vec<_>>()),
    });
    let ruled: Vec<(&World, &Ruler)> = worlds.iter().filter_map(|w| Some((w, w.ruler.as_ref()?))).collect();
    if !ruled.is_empty() {
        let agreed: Vec<(&World, &Ruler)> = ruled.iter().copied().filter(|(_, ruler)| ruler.agrees()).collect();
        summary["reference"] = json!({
            "all": beside(&ruled, &mut rng),
            "chains_agree": beside(&agreed, &mut rng),
            "failed": worlds.iter().filter(|w| w.ruler_failure.is_some()).count(),
            "ranks": rank_table(&ruled),
            "agreement": ruled.iter().map(|(_, ruler)| ruler.differences()).collect::<Vec<_>>(),
            "transitions_per_chain": per_update(
                &ruled.iter().flat_map(|(_, r)| r.chains.iter().map(|c| c.transitions as f64)).collect::<Vec<_>>()
            ),
        });
    }
    summary
}

/// Figures after the last action of worlds that have a ruler, of every source and of the ruler.
fn beside(ruled: &[(&World, &Ruler)], rng: &mut Rng) -> Value {
    let mut sources = Map::new();
    let names = SOURCES.iter().map(|(name, _)| *name).chain(["reference"]);
    for (index, name) in names.enumerate() {
        let last = |w: &World, ruler: &Ruler| match SOURCES.get(index) {
            Some((_, rows)) => rows(w).last().cloned(),
            None => Some(ruler.row.clone()),
        };
        let mut figures = Map::new();
        for (figure, value) in figures_of_a_row() {
            let values: Vec<f64> = ruled.iter().filter_map(|(w, r)| value(w, &last(w, r)?)).collect();
            figures.insert(figure, interval(&values, rng));
        }
        sources.insert(name.into(), Value::Object(figures));
    }
    json!({ "worlds": ruled.len(), "sources": sources })
}

/// Histograms of the ranks of the truth, and of the joint test, each with the probability that uniform ones are as uneven or more.
fn rank_table(ruled: &[(&World, &Ruler)]) -> Value {
    let rows = || ruled.iter().map(|(_, ruler)| &ruler.row);
    let told = |counts: [usize; 10]| json!({ "counts": counts, "p": statistics::uniform_p(&counts) });
    let of_number = NUMBERS
        .iter()
        .enumerate()
        .map(|(index, (name, _))| ((*name).to_owned(), told(histogram(rows().filter_map(|row| row.ranks[index])))));
    let joint = ("joint".to_owned(), told(histogram(rows().map(|row| row.tarp))));
    Value::Object(of_number.chain([joint]).collect())
}

fn at(rows: &[Row], step: usize) -> Option<&Row> {
    rows.get(step).or_else(|| rows.last())
}

fn figures_of_a_row() -> Vec<(String, Figure)> {
    let truth = |w: &World| f64::from(u8::from(w.has_obstacle));
    let mut figures: Vec<(String, Figure)> = vec![
        ("obstacle_brier".into(), Box::new(move |w, row| Some((row.obstacle - truth(w)).powi(2)))),
        ("obstacle_brier_without_obstacle".into(), Box::new(|w, row| (!w.has_obstacle).then(|| row.obstacle.powi(2)))),
        // A probability of 0 is one that no draw has.
        ("shape_nats".into(), Box::new(|_, row| Some(-row.shape.max(0.5 / row.effective.max(USUAL_DRAWS)).ln()))),
        (
            "obstacle_class_nats".into(),
            Box::new(|_, row| Some(-row.obstacle_class.max(0.5 / row.effective.max(USUAL_DRAWS)).ln())),
        ),
        ("effective".into(), Box::new(|_, row| Some(row.effective))),
        ("log_mass_error".into(), Box::new(|_, row| Some(row.log_mass_error.abs()))),
        ("friction_error".into(), Box::new(|_, row| Some(row.friction_error.abs()))),
        ("log_score".into(), Box::new(|_, row| Some(row.log_score))),
        ("obstacle_m".into(), Box::new(|_, row| row.obstacle_m)),
    ];
    for (index, (name, _)) in NUMBERS.into_iter().enumerate() {
        for (level, margin) in [(90, 0.05), (50, 0.25)] {
            let covered = move |rank: f64| f64::from(u8::from((margin..=1.0 - margin).contains(&rank)));
            figures.push((format!("{name}_coverage_{level}"), Box::new(move |_, row| row.ranks[index].map(covered))));
        }
    }
    figures
}

/// Mean, 95 % interval by bootstrap over worlds, and number.
fn interval(values: &[f64], rng: &mut Rng) -> Value {
    if values.is_empty() {
        return Value::Null;
    }
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n as f64;
    let mut means: Vec<f64> =
        (0..DRAWS).map(|_| (0..n).map(|_| values[rng.random_range(0..n)]).sum::<f64>() / n as f64).collect();
    let low = statistics::quantile(&mut means, 0.025);
    let high = statistics::quantile(&mut means, 0.975);
    json!({ "mean": mean, "low": low, "high": high, "n": n })
}

/// Counts in ten bins of [0, 1].
fn histogram(values: impl Iterator<Item = f64>) -> [usize; 10] {
    let mut counts = [0; 10];
    values.for_each(|value| counts[((10.0 * value) as usize).min(9)] += 1);
    counts
}

/// Of all steps with P(obstacle) in a fifth of [0, 1]: mean P, share with an obstacle, number.
fn reliability(worlds: &[World]) -> Vec<Value> {
    (0..5)
        .map(|bin| {
            let inside = |p: f64| ((5.0 * p) as usize).min(4) == bin;
            let steps: Vec<(f64, bool)> = worlds
                .iter()
                .flat_map(|w| w.filter.iter().map(|row| (row.obstacle, w.has_obstacle)))
                .filter(|(p, _)| inside(*p))
                .collect();
            let n = steps.len().max(1) as f64;
            let said = steps.iter().map(|(p, _)| p).sum::<f64>() / n;
            let held = steps.iter().filter(|(_, has)| *has).count() as f64 / n;
            json!({ "said": said, "held": held, "steps": steps.len() })
        })
        .collect()
}
