//! Combined tables as pictures.

use agent::Method;
use figures::{Axis, Chart, Direction, Dots, Estimate, Estimates, Figure, Lines, Mark, Panel, Series};

use crate::combined::{Arm, Combined, CombinedRow, Part};
use crate::learning::{Curve, Quantity, Spread};
use crate::{Row, TablePlan};

/// Every picture of a table with its file name.
pub(crate) fn all(plan: &TablePlan, combined: &Combined, parts: &[Part], curves: &[Curve]) -> Vec<(String, Figure)> {
    let mut pictures = vec![
        (plan.success_figure(), success(combined)),
        (format!("{}-steps", plan.name), steps_to_goal(combined, parts)),
    ];
    let has_panels = |figure: &Figure| !figure.panels.is_empty();
    for domain in combined.domains() {
        let of_domain: Vec<&Curve> = curves.iter().filter(|curve| curve.domain == domain).collect();
        let picture = of_one_domain(plan, combined, &domain, &of_domain);
        pictures.extend(has_panels(&picture).then(|| (format!("{}-{domain}", plan.name), picture)));
    }
    pictures
}

/// A method has one colour in all pictures.
fn colors() -> Vec<String> {
    Method::ALL.iter().map(|method| method.name().to_string()).collect()
}

/// The runs of a table, in their order.
fn runs(combined: &Combined) -> Vec<String> {
    let mut runs: Vec<String> = Vec::new();
    for row in &combined.rows {
        if !runs.contains(&row.run) {
            runs.push(row.run.clone());
        }
    }
    runs
}

fn rate(row: &Row) -> Estimate {
    Estimate::within(f64::from(row.successes) / f64::from(row.trials.max(1)), row.interval95[0], row.interval95[1])
}

fn published_rate(row: &Row) -> Estimate {
    row.published
        .map_or_else(Estimate::missing, |p| Estimate::exact(f64::from(p.successes) / f64::from(p.trials.max(1))))
}

/// Name of our own values beside the published ones.
const HERE: &str = "here";
/// Name for a value without one of its own.
const QUARTILES: &str = "median and quartiles";
/// The learnt quantities that are drawn. The files hold all of them.
const SHOWN: [Quantity; 5] =
    [Quantity::Friction, Quantity::LogMass, Quantity::Shape, Quantity::Obstacle, Quantity::ObstaclePlace];
/// More domains than this stand side by side; up to as many have a panel each.
const FEW_DOMAINS: usize = 2;
/// More runs than this share panels, by their medians alone.
const FEW_RUNS: usize = 3;

fn success(combined: &Combined) -> Figure {
    let domains = combined.domains();
    let (panels, columns, panel_size_px) = if domains.len() > FEW_DOMAINS {
        let panels: Vec<Panel> = runs(combined).iter().map(|run| success_of_run(combined, run, &domains)).collect();
        (panels, 1, (900, 320))
    } else {
        let panels: Vec<Panel> = domains.iter().map(|domain| success_of_arms(combined, domain)).collect();
        let height = 90 + 34 * combined.arms().len() as u32;
        (panels, domains.len(), (900 / domains.len().max(1) as u32, height))
    };
    let title = format!("{}: success with 95 % Wilson intervals", combined.title);
    let colors = if domains.len() > FEW_DOMAINS { colors() } else { vec![HERE.into()] };
    Figure { title, panels, columns, panel_size_px, colors }
}

/// Each method by domain: the paper's figure 4, with what the paper published of the run's own methods as open markers.
fn success_of_run(combined: &Combined, run: &str, domains: &[String]) -> Panel {
    let values = |arm: &Arm, of: fn(&Row) -> Estimate| -> Vec<Estimate> {
        let row = |domain: &String| combined.row(arm, domain).map_or_else(Estimate::missing, |r| of(&r.row));
        domains.iter().map(row).collect()
    };
    let ours =
        |arm: &Arm| Estimates { name: arm.method.name().into(), values: values(arm, rate), ..Estimates::default() };
    let theirs = |arm: &Arm| {
        let (name, values) = (arm.method.name(), values(arm, published_rate));
        let known = values.iter().any(|estimate| estimate.value.is_finite());
        let published =
            || Estimates { name: format!("{name}, published"), values, mark: Mark::Open, like: name.into() };
        known.then(published)
    };
    let own: Vec<Arm> = combined.arms().into_iter().filter(|arm| arm.run == run).collect();
    let series: Vec<Estimates> = own.iter().flat_map(|arm| std::iter::once(ours(arm)).chain(theirs(arm))).collect();
    let dots = Dots {
        categories: domains.to_vec(),
        value: Axis { limits: Some((0.0, 1.0)), ..Axis::new("success rate") },
        series,
        direction: Direction::Up,
        ..Dots::default()
    };
    Panel { title: format!("preset {run}"), chart: Chart::Dots(dots) }
}

/// Each method of each run on one domain.
fn success_of_arms(combined: &Combined, domain: &str) -> Panel {
    let rows: Vec<&CombinedRow> = combined.rows.iter().filter(|row| row.row.domain == domain).collect();
    rates(domain, &rows, |row| row.arm().label())
}

/// A row each, ours with its interval above what the paper published.
fn rates(title: &str, rows: &[&CombinedRow], name: fn(&CombinedRow) -> String) -> Panel {
    let series = |name: &str, mark, of: fn(&Row) -> Estimate| Estimates {
        name: name.into(),
        values: rows.iter().map(|row| of(&row.row)).collect(),
        mark,
        like: HERE.into(),
    };
    let ours = series(HERE, Mark::Dot, rate);
    let theirs = series("published", Mark::Open, published_rate);
    let known = theirs.values.iter().any(|estimate| estimate.value.is_finite());
    let dots = Dots {
        categories: rows.iter().map(|row| name(row)).collect(),
        value: Axis { limits: Some((0.0, 1.0)), ..Axis::new("success rate") },
        series: std::iter::once(ours).chain(known.then_some(theirs)).collect(),
        direction: Direction::Right,
        ..Dots::default()
    };
    Panel { title: title.into(), chart: Chart::Dots(dots) }
}

/// Median and quartiles of the actions of successful trials.
fn steps_to_goal(combined: &Combined, parts: &[Part]) -> Figure {
    let domains = combined.domains();
    let values = |arm: &Arm, domain: &str| {
        let of_arm = |part: &&Part| part.run == arm.run && part.table.rows.iter().any(|row| row.domain == domain);
        let trials = parts.iter().filter(of_arm).flat_map(|part| part.trials.values());
        let solved = trials.filter(|trial| trial.method == arm.method && trial.success);
        let spread = Spread::of(solved.map(|trial| trial.steps as f64).collect());
        spread.map_or_else(Estimate::missing, |s| Estimate::within(s.median, s.low, s.high))
    };
    let panel = |title: String, arms: &[Arm], categories: &[String], by_domain: bool| {
        let series = |arm: &Arm| Estimates {
            name: arm.method.name().into(),
            values: domains.iter().map(|domain| values(arm, domain)).collect(),
            ..Estimates::default()
        };
        let of_arms = |domain: &String| Estimates {
            name: QUARTILES.into(),
            values: arms.iter().map(|arm| values(arm, domain)).collect(),
            ..Estimates::default()
        };
        let dots = Dots {
            categories: categories.to_vec(),
            value: Axis::new(if by_domain { "actions, median and quartiles" } else { "actions to the goal" }),
            series: if by_domain { arms.iter().map(series).collect() } else { vec![of_arms(&title)] },
            direction: if by_domain { Direction::Up } else { Direction::Right },
            ..Dots::default()
        };
        Panel { title, chart: Chart::Dots(dots) }
    };
    let arms = combined.arms();
    let labels: Vec<String> = arms.iter().map(Arm::label).collect();
    let by_domain = domains.len() > FEW_DOMAINS;
    let panels: Vec<Panel> = if by_domain {
        let of_run = |run: &String| arms.iter().filter(|arm| arm.run == *run).cloned().collect::<Vec<_>>();
        runs(combined).iter().map(|run| panel(format!("preset {run}"), &of_run(run), &domains, true)).collect()
    } else {
        domains.iter().map(|domain| panel(domain.clone(), &arms, &labels, false)).collect()
    };
    let height = if by_domain { 300 } else { 90 + 34 * arms.len() as u32 };
    Figure {
        title: format!("{}: actions of successful trials", combined.title),
        columns: panels.len().clamp(1, 2),
        panel_size_px: (if panels.len() > 1 { 450 } else { 900 }, height),
        panels,
        colors: if by_domain { colors() } else { vec![QUARTILES.into()] },
    }
}

/// What the beliefs learn on one domain, below the success rates where these have no picture of their own.
fn of_one_domain(plan: &TablePlan, combined: &Combined, domain: &str, curves: &[&Curve]) -> Figure {
    let learnt = |run: &String| curves.iter().any(|curve| curve.arm.run == *run);
    let runs: Vec<String> = runs(combined).into_iter().filter(learnt).collect();
    let side_by_side = runs.len() <= FEW_RUNS;
    let mut panels = Vec::new();
    if side_by_side && combined.domains().len() > FEW_DOMAINS {
        panels.extend(runs.iter().map(|run| success_on(combined, run, domain)));
    }
    for quantity in SHOWN {
        let of_quantity: Vec<&Curve> = curves.iter().filter(|curve| curve.quantity == quantity).copied().collect();
        let spreads: Vec<&Spread> = of_quantity.iter().flat_map(|curve| curve.steps.iter().flatten()).collect();
        // A known quantity has no curve: the shape on D1, the obstacle on D1 to D3.
        let share = matches!(quantity, Quantity::Shape | Quantity::Obstacle);
        if spreads.is_empty() || (share && spreads.iter().all(|spread| spread.low == 1.0)) {
            continue;
        }
        let largest = spreads.iter().map(|spread| if side_by_side { spread.high } else { spread.median });
        let limit = if share { 1.0 } else { 1.05 * largest.fold(0.0, f64::max) };
        if side_by_side {
            let first = panels.is_empty();
            panels.extend(runs.iter().map(|run| {
                let of_run: Vec<&Curve> = of_quantity.iter().filter(|curve| curve.arm.run == *run).copied().collect();
                learning(if first { run } else { "" }, quantity, limit, &of_run, false)
            }));
        } else {
            panels.push(learning("", quantity, limit, &of_quantity, true));
        }
    }
    let spread = if side_by_side { "median and quartiles over trials" } else { "medians over trials" };
    Figure {
        title: format!("{domain}, {}: how far the belief is from the truth ({spread})", plan.robot),
        columns: if side_by_side { runs.len() } else { 2 },
        panel_size_px: (450, if side_by_side { 190 } else { 280 }),
        panels,
        colors: if side_by_side { colors() } else { Vec::new() },
    }
}

fn success_on(combined: &Combined, run: &str, domain: &str) -> Panel {
    let rows = combined.rows.iter().filter(|row| row.run == run && row.row.domain == domain).collect::<Vec<_>>();
    rates(run, &rows, |row| row.row.method.name().into())
}

/// Errors by step; without their quartiles where many share a panel, each then by its run and method.
fn learning(title: &str, quantity: Quantity, limit: f64, curves: &[&Curve], many: bool) -> Panel {
    let series = curves.iter().map(|curve| {
        let steps = || curve.steps.iter().enumerate().filter_map(|(step, spread)| Some((step as f64, (*spread)?)));
        let band = steps().filter(|_| !many).map(|(step, spread)| (step, spread.low, spread.high));
        Series {
            name: if many { curve.arm.label() } else { curve.arm.method.name().into() },
            points: steps().map(|(step, spread)| (step, spread.median)).collect(),
            band: band.collect(),
            ..Series::default()
        }
    });
    let label = match quantity {
        Quantity::Friction => "error of friction",
        Quantity::LogMass => "error of ln mass",
        Quantity::Com => "error of centre of mass / m",
        Quantity::Size => "error of size / m",
        Quantity::Shape => "P(true shape)",
        Quantity::Obstacle => "P(obstacle truth)",
        Quantity::ObstaclePlace => "obstacle off / m",
    };
    // An error of zero alone leaves no room for an axis.
    let limits = (limit > 0.0).then_some((0.0, limit));
    let last = curves.iter().map(|curve| curve.steps.len()).max().unwrap_or(0).saturating_sub(1).max(1);
    let lines = Lines {
        x: Axis { limits: Some((0.0, last as f64)), ..Axis::new("actions") },
        y: Axis { limits, ..Axis::new(label) },
        series: series.collect(),
        references: Vec::new(),
    };
    Panel { title: title.into(), chart: Chart::Lines(lines) }
}
