//! The figures as Markdown.

use serde_json::Value;

use super::episode::NUMBERS;
use super::reference::{MOST_DIFFERENCE, MOST_SCALE};
use super::summary::{SOURCES, STEPS};

/// Columns: figure, title, digits.
const COLUMNS: [(&str, &str, usize); 8] = [
    ("obstacle_brier", "Brier of the obstacle", 3),
    ("obstacle_brier_without_obstacle", "the same, worlds without one", 3),
    ("shape_nats", "−ln P(true shape)", 2),
    ("obstacle_class_nats", "−ln P(obstacle's class)", 2),
    ("log_mass_error", "error of ln mass", 2),
    ("friction_error", "error of friction", 3),
    ("log_score", "log score of Θ", 2),
    ("obstacle_m", "obstacle off, m", 3),
];

/// In which world of others it was played, and what it did not bring to an end.
fn external(provenance: &Value) -> String {
    let [name, version] = ["name", "version"].map(|key| provenance["world"][key].as_str().unwrap_or_default());
    if name.is_empty() {
        return String::new();
    }
    format!(", played in {name} {version}, where {} failed", provenance["failed"])
}

/// The summary as a page.
#[must_use]
pub fn table(summary: &Value) -> String {
    let p = &summary["provenance"];
    let mut text = format!(
        "# Calibration of the belief: {} on the {}\n\n{} worlds of seed {}{}, preset {}. In brackets: 95 % by bootstrap over worlds.\n\n",
        p["domain"].as_str().unwrap_or_default(),
        p["robot"].as_str().unwrap_or_default(),
        p["worlds"],
        p["seed"],
        external(p),
        p["preset"].as_str().unwrap_or_default()
    );
    text += "| step | belief |";
    COLUMNS.iter().for_each(|(_, title, _)| text += &format!(" {title} |"));
    text += &format!("\n|---|---|{}\n", "---|".repeat(COLUMNS.len()));
    rows(summary, &mut text, |cells| {
        COLUMNS.iter().map(|(figure, _, digits)| interval(&cells[*figure], *digits)).collect()
    });
    text += "\nCoverage of 90 % intervals:\n\n| step | belief |";
    NUMBERS.iter().for_each(|(name, _)| text += &format!(" {} |", name.replace('_', " ")));
    text += &format!("\n|---|---|{}\n", "---|".repeat(NUMBERS.len()));
    rows(summary, &mut text, |cells| {
        NUMBERS.iter().map(|(name, _)| interval(&cells[format!("{name}_coverage_90")], 2)).collect()
    });
    text += "\n| P(obstacle) said | held | steps |\n|---|---|---|\n";
    for bin in summary["reliability"].as_array().into_iter().flatten() {
        text += &format!("| {} | {} | {} |\n", number(&bin["said"], 2), number(&bin["held"], 2), bin["steps"]);
    }
    text += &format!(
        "\nSolved {}, discounted return {}. Transitions an update: {}; exponent of the bridge: {}; seconds an action on one thread: {}.\n\
         Log score over the better of prior and network, steps after the first contact: {}. Histogram of the joint test (TARP): {}.\n",
        interval(&summary["solved"], 2),
        interval(&summary["discounted_return"], 1),
        number(&summary["transitions_per_update"], 0),
        number(&summary["exponent"], 2),
        number(&summary["seconds_per_action"], 2),
        number(&summary["log_score_over_the_better_of_prior_and_network_after_contact"], 2),
        summary["tarp_histogram_at_the_last_step"]
    );
    reference(&summary["reference"], &mut text);
    text
}

/// The last belief beside samples of the exact posterior.
fn reference(reference: &Value, text: &mut String) {
    if reference.is_null() {
        return;
    }
    *text += &format!(
        "\nThe last belief beside the exact posterior, as two chains of annealed sequential Monte Carlo sample it (`reference`: both together), {} \
         transitions each on average. They agree where R̂ of ln mass and friction is at most {MOST_SCALE} and P(obstacle) differs by at most \
         {MOST_DIFFERENCE}; elsewhere at least one has missed something. Worlds without a ruler: {}.\n\n",
        number(&reference["transitions_per_chain"], 0),
        reference["failed"]
    );
    *text += "| worlds | belief |";
    COLUMNS.iter().for_each(|(_, title, _)| *text += &format!(" {title} |"));
    *text += &format!(" mass covered | friction covered |\n|---|---|{}\n", "---|".repeat(COLUMNS.len() + 2));
    for (key, words) in [("all", "all"), ("chains_agree", "where chains agree")] {
        let part = &reference[key];
        let title = format!("{words}, {}", part["worlds"]);
        for source in SOURCES.iter().map(|(name, _)| *name).chain(["reference"]) {
            let cells = &part["sources"][source];
            let mut values: Vec<String> =
                COLUMNS.iter().map(|(figure, _, digits)| interval(&cells[*figure], *digits)).collect();
            values.extend(["mass", "friction"].map(|name| interval(&cells[format!("{name}_coverage_90")], 2)));
            *text += &format!("| {title} | {source} | {} |\n", values.join(" | "));
        }
    }
    ranks(reference, text);
}

/// How even the ranks of the truth among the samples are, and how far the chains are from agreement.
fn ranks(reference: &Value, text: &mut String) {
    let (Some(ranks), Some(agreement)) = (reference["ranks"].as_object(), reference["agreement"].as_array()) else {
        return;
    };
    *text += "\nRanks of the truth among the samples, in tenths, with the probability that uniform ones are as uneven (χ²), all worlds:\n\n\
              | number | counts | p |\n|---|---|---|\n";
    for (name, rank) in ranks {
        *text += &format!("| {} | {} | {} |\n", name.replace('_', " "), rank["counts"], number(&rank["p"], 3));
    }
    let within = |index: usize, most: f64| {
        agreement.iter().filter(|world| world[index].as_f64().is_some_and(|found| found <= most)).count()
    };
    *text += &format!(
        "\nOf {} worlds R̂ of ln mass is at most {MOST_SCALE} in {}, of friction in {}, and P(obstacle) differs by at most {MOST_DIFFERENCE} in {}.\n",
        agreement.len(),
        within(0, MOST_SCALE),
        within(1, MOST_SCALE),
        within(2, MOST_DIFFERENCE)
    );
}

fn rows(summary: &Value, text: &mut String, cells: impl Fn(&Value) -> Vec<String>) {
    for step in STEPS {
        let name = if step == usize::MAX { "last".to_string() } else { step.to_string() };
        for (source, _) in SOURCES {
            *text += &format!("| {name} | {source} | {} |\n", cells(&summary["steps"][&name][source]).join(" | "));
        }
    }
}

fn number(value: &Value, digits: usize) -> String {
    let text = value.as_f64().map_or("–".into(), |v| format!("{v:.digits$}"));
    // What rounds to zero has no sign.
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| c == '0' || c == '.') => zero.into(),
        _ => text,
    }
}

fn interval(value: &Value, digits: usize) -> String {
    if value.is_null() {
        return "–".into();
    }
    format!(
        "{} ({} to {})",
        number(&value["mean"], digits),
        number(&value["low"], digits),
        number(&value["high"], digits)
    )
}
