//! Learning curve and calibration as pictures.

use figures::{
    Axis, Chart, Direction, Dots, Estimate, Estimates, Figure, Heat, Histogram, Lines, Panel, Reference, Series, Stroke,
};
use statrs::distribution::{Binomial, DiscreteCDF as _};

use crate::calibrate::{Calibration, Likelihoods, ParameterReport, Score};
use crate::settings::EpochReport;

/// Negative log-likelihood by epoch.
#[must_use]
pub fn learning_curve(robot: &str, curve: &[EpochReport]) -> Figure {
    let points = |of: fn(&EpochReport) -> f64| curve.iter().map(|row| (row.epoch as f64, of(row))).collect();
    // The first epochs are far above the rest, so the plot starts at the fifth.
    let usual: Vec<f64> = curve.iter().skip(4).flat_map(|row| [row.training_nll, row.held_out_nll]).collect();
    let limits = usual.iter().copied().reduce(f64::min).zip(usual.iter().copied().reduce(f64::max));
    let limits = limits.filter(|(low, high)| low < high).map(|(low, high)| (low - 0.05 * (high - low), high));
    let series = [
        ("training", points(|row| row.training_nll), Stroke::Solid),
        ("held out", points(|row| row.held_out_nll), Stroke::Dashed),
    ];
    let lines = Lines {
        x: Axis::new("epoch"),
        y: Axis { limits, ..Axis::new("negative log-likelihood / nats a step") },
        series: series
            .map(|(name, points, stroke)| Series { name: name.into(), points, stroke, ..Series::default() })
            .into(),
        ..Lines::default()
    };
    Figure {
        title: format!("Training of the prior, {robot}"),
        panels: vec![Panel { title: String::new(), chart: Chart::Lines(lines) }],
        columns: 1,
        panel_size_px: (900, 420),
        ..Figure::default()
    }
}

/// File names of the pictures of a calibration report.
pub const CALIBRATION: [&str; 5] = ["likelihood", "sharpening", "coverage", "ranks", "confusion"];

/// These pictures with their file names.
#[must_use]
pub fn calibration(robot: &str, report: &Calibration) -> Vec<(&'static str, Figure)> {
    let figures = [likelihood, sharpening, coverage, ranks, confusion].map(|draw| draw(robot, report));
    CALIBRATION.into_iter().zip(figures).collect()
}

fn statics(report: &Calibration) -> impl Iterator<Item = &ParameterReport> {
    report.parameters.iter().filter(|parameter| report.static_targets.contains(&parameter.name))
}

/// Likelihood of Θ and of everything by steps since the first contact, for the network and both baselines.
fn likelihood(robot: &str, report: &Calibration) -> Figure {
    let panel = |title: &str, of: fn(&Score) -> Likelihoods| {
        let points = |model: fn(&Likelihoods) -> Option<f64>| -> Vec<(f64, f64)> {
            let steps = report.sharpening.iter().filter(|r| r.since_contact.count > 0);
            steps.filter_map(|r| Some((r.step as f64, model(&of(&r.since_contact))?))).collect()
        };
        let series = [
            ("network", points(|l| l.network), Stroke::Marked),
            ("network without memory", points(|l| l.memoryless), Stroke::Solid),
            ("sampling distribution", points(|l| l.baseline), Stroke::Dashed),
        ];
        let series = series.into_iter().filter(|(_, points, _)| !points.is_empty());
        let lines = Lines {
            x: Axis::new("steps since the first contact"),
            y: Axis::new("negative log-likelihood / nats"),
            series: series
                .map(|(name, points, stroke)| Series { name: name.into(), points, stroke, ..Series::default() })
                .collect(),
            ..Lines::default()
        };
        Panel { title: title.into(), chart: Chart::Lines(lines) }
    };
    Figure {
        title: format!("Held-out likelihood, {robot}, {} episodes", report.episodes),
        panels: vec![panel("Θ", |score| score.static_nll), panel("s and Θ", |score| score.nll)],
        columns: 2,
        panel_size_px: (450, 330),
        ..Figure::default()
    }
}

/// Spread of each parameter and probability of the true shapes by step, with and without contact.
fn sharpening(robot: &str, report: &Calibration) -> Figure {
    let lines = |label: &str, of: &dyn Fn(&Score) -> Option<f64>| {
        let points = |part: fn(&crate::calibrate::StepReport) -> &Score| -> Vec<(f64, f64)> {
            // Means over a handful of episodes only draw noise.
            let steps = report.sharpening.iter().filter(|r| part(r).count >= 100);
            steps.filter_map(|r| Some((r.step as f64, of(part(r))?))).collect()
        };
        let series = [("after a contact", points(|r| &r.after_contact)), ("before", points(|r| &r.before_contact))];
        Chart::Lines(Lines {
            x: Axis::new("step of the episode"),
            y: Axis { limits: Some((0.0, 1.2)), ..Axis::new(label) },
            series: series
                .map(|(name, points)| Series { name: name.into(), points, stroke: Stroke::Marked, ..Series::default() })
                .into(),
            references: vec![Reference { name: "nothing learnt".into(), low: 1.0, high: 1.0 }],
        })
    };
    let spreads = report.static_targets.iter().enumerate().map(|(index, name)| Panel {
        title: name.clone(),
        chart: lines("spread / initial", &|score| score.spread.get(index).copied()),
    });
    let classes = report.classes.iter().enumerate().map(|(index, class)| Panel {
        title: format!("P(true {})", class.name.replace('_', " ")),
        chart: lines("probability", &|score| score.class_probability.get(index).copied()),
    });
    Figure {
        title: format!("What the network has learnt after each step, {robot}"),
        panels: spreads.chain(classes).collect(),
        columns: 4,
        panel_size_px: (240, 190),
        ..Figure::default()
    }
}

/// Coverage of the central intervals of every parameter of Θ.
fn coverage(robot: &str, report: &Calibration) -> Figure {
    let estimates = |name: &str, of: fn(&ParameterReport) -> Estimate| Estimates {
        name: name.into(),
        values: statics(report).map(of).collect(),
        ..Estimates::default()
    };
    let within = |p: &ParameterReport| {
        let error = 2.0 * p.coverage90_stderr;
        Estimate::within(p.coverage90, (p.coverage90 - error).max(0.0), (p.coverage90 + error).min(1.0))
    };
    let dots = Dots {
        categories: statics(report).map(|parameter| parameter.name.clone()).collect(),
        value: Axis { limits: Some((0.3, 1.0)), ..Axis::new("share of the truths inside") },
        series: vec![
            estimates("90 % interval, ± 2 standard errors", within),
            estimates("90 %, last step", |p| p.coverage90_last.map_or_else(Estimate::missing, Estimate::exact)),
            estimates("90 %, last step, obstacle touched", |p| {
                p.coverage90_last_touched.map_or_else(Estimate::missing, Estimate::exact)
            }),
            estimates("50 % interval", |p| Estimate::exact(p.coverage50)),
        ],
        references: vec![
            Reference { name: "0.87 to 0.93".into(), low: 0.87, high: 0.93 },
            Reference { name: "0.5".into(), low: 0.5, high: 0.5 },
        ],
        direction: Direction::Right,
        ..Dots::default()
    };
    Figure {
        title: format!("Coverage, {robot}, {} episodes", report.episodes),
        panels: vec![Panel { title: String::new(), chart: Chart::Dots(dots) }],
        columns: 1,
        panel_size_px: (900, 520),
        ..Figure::default()
    }
}

/// Rank histograms of every continuous target. Steps of one episode share their truth. So the band assumes one rank per
/// episode, and is wider than for independent steps.
fn ranks(robot: &str, report: &Calibration) -> Figure {
    let panels = report.parameters.iter().filter(|parameter| parameter.episodes > 0).map(|parameter| {
        let bins = parameter.ranks.len() as f64;
        let count = parameter.count as f64;
        let band = Binomial::new(1.0 / bins, parameter.episodes as u64).ok().map(|one| {
            let scale = count / parameter.episodes as f64;
            Reference {
                name: "99 % if calibrated, one rank an episode".into(),
                low: scale * one.inverse_cdf(0.005) as f64 / count * bins,
                high: scale * one.inverse_cdf(0.995) as f64 / count * bins,
            }
        });
        Panel {
            title: parameter.name.clone(),
            chart: Chart::Histogram(Histogram {
                x: Axis::new("rank"),
                y: Axis::new("density"),
                name: "ranks".into(),
                counts: parameter.ranks.iter().map(|&n| n as f64 / count * bins).collect(),
                edges: (0.0, 1.0),
                expected: band,
            }),
        }
    });
    Figure {
        title: format!("P(target ≤ truth), {robot}, {} episodes", report.episodes),
        panels: panels.collect(),
        columns: 5,
        panel_size_px: (180, 135),
        ..Figure::default()
    }
}

/// True against likeliest shape at the last step, as shares of the rows.
fn confusion(robot: &str, report: &Calibration) -> Figure {
    let panels = report.classes.iter().map(|class| {
        let share = |row: &Vec<usize>| -> Vec<f64> {
            let total = row.iter().sum::<usize>().max(1) as f64;
            row.iter().map(|&count| count as f64 / total).collect()
        };
        Panel {
            title: class.name.replace('_', " "),
            chart: Chart::Heat(Heat {
                rows: class.labels.clone(),
                columns: class.labels.clone(),
                row_label: "true".into(),
                column_label: "likeliest at the last step".into(),
                values: class.last_confusion.iter().map(share).collect(),
                limits: Some((0.0, 1.0)),
                digits: Some(2),
                value_label: "share of the row".into(),
            }),
        }
    });
    Figure {
        title: format!("Shapes, {robot}, {} episodes", report.episodes),
        panels: panels.collect(),
        columns: 2,
        panel_size_px: (450, 330),
        ..Figure::default()
    }
}
