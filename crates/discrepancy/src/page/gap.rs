//! Before and after: held-out episodes, the worst one in plots, and what the residuals look like.

use maud::html;
use page::number::{fixed, mean_square, percent, significant};
use page::{Markup, Words, table, text};

use super::plain;
use super::svg::{Axis, Plot, strip, strip_labels, upright};
use crate::evidence::{ChannelError, Course, Evidence, Path, REACH, Residuals};
use crate::report::{Report, Verdict};
use crate::terms::{Coefficient, FoundTerm, LackingForce};

/// What the colours of the charts mean.
fn key(same: bool, words: &Words) -> Markup {
    let retuned = words.mark("re-tuned");
    html! {
        p.key {
            i.km {} "measured" i.kb {}
            @if same { (retuned) " nominal (before and after are the same)" } @else { "before: " (retuned) " nominal" i.ka {} "after: with the named effects" }
        }
    }
}

/// Everything about the gap.
pub(super) fn before_after(report: &Report, words: &Words) -> Markup {
    let same = report.effects.is_empty();
    let heldout = &report.heldout;
    let [before, after] = [heldout.before, heldout.after].map(|value| fixed(value, 2));
    html! {
        p {
            (words.mark_as("held out", "Held-out")) " " (words.mark("mean square")) " " (before)
            @if !same { " before, " (after) " after" }
            "; noise alone leaves " (fixed(heldout.noise_floor, 0)) "."
            @if !same { " " (percent(heldout.closed_fraction)) " of the " (words.mark("gap")) " is closed." }
        }
        (key(same, words))
        (dumbbells(report, same))
        (errors(&report.evidence.errors, same))
        (plots(&report.evidence, same))
    }
}

fn dumbbells(report: &Report, same: bool) -> Markup {
    let mut episodes = report.heldout.episodes.clone();
    if episodes.is_empty() {
        return html! { p.soft { "No episode was held out." } };
    }
    episodes.sort_by(|a, b| b.1.total_cmp(&a.1));
    let floor = report.heldout.noise_floor;
    let axis = Axis::logarithmic(
        episodes.iter().flat_map(|(_, before, after)| [*before, *after]).chain([0.5 * floor, 3.0 * floor]),
    );
    let number = |value: f64| if value.abs() < 9.995 { fixed(value, 2) } else { mean_square(value) };
    let row = |(id, before, after): &(u64, f64, f64)| {
        let (b, a) = (axis.percent(*before), axis.percent(*after));
        let inside = html! {
            (upright("mark", &axis, floor, 22))
            @if !same { line.link x1=(b) x2=(a) y1="11" y2="11" {} }
            circle.b cx=(b) cy="11" r="5" {}
            @if !same { circle.a cx=(a) cy="11" r="5" {} }
        };
        let numbers = if same { number(*before) } else { format!("{} → {}", number(*before), number(*after)) };
        html! {
            div class="row episode" {
                span { "episode " (id) } div { (strip(&axis, 5, 22, &inside)) } span { (numbers) }
            }
        }
    };
    html! {
        h3 { "Each held-out episode" }
        @for episode in &episodes { (row(episode)) }
        div class="row axis" { span {} div { (strip_labels(&axis, 5)) } span {} }
        p.soft { "Mean square of the white residuals, logarithmic; dashed: noise." }
    }
}

/// Errors in units of a ruler: millimetres, milliradians, newtons.
fn errors(errors: &[ChannelError], same: bool) -> Markup {
    if errors.is_empty() {
        return text("");
    }
    let row = |error: &ChannelError| {
        let (factor, unit) = match error.unit {
            "m" => (1e3, "mm"),
            "rad" => (1e3, "mrad"),
            unit => (1.0, unit),
        };
        let pairs = [[error.before, error.after], [error.median_before, error.median_after]];
        let sizes = pairs.into_iter().flat_map(|sizes| sizes.into_iter().take(if same { 1 } else { 2 }));
        let mut cells = vec![text(plain(error.channel.name())), text(unit)];
        cells.extend(sizes.map(|size| text(significant(factor * size, 3))));
        cells
    };
    let heads: &[&str] = if same {
        &["channel", "unit", "root mean square", "median"]
    } else {
        &["channel", "unit", "root mean square before", "after", "median before", "after"]
    };
    let heads: Vec<Markup> = heads.iter().map(text).collect();
    let rows: Vec<Vec<Markup>> = errors.iter().map(row).collect();
    html! {
        h3 { "Held-out error of each channel" }
        (table(&heads, &rows))
        p.soft {
            "Measured − simulated, over components and blocks of rows, noise of the sensors included; an episode that has gone \
             another way counts in the root mean square more than in the median."
        }
    }
}

fn plots(evidence: &Evidence, same: bool) -> Markup {
    let worst = evidence.episode.map(|id| format!("episode {id}, the worst held out")).unwrap_or_default();
    let mut figures = Vec::new();
    if evidence.path.measured.len() > 1 {
        figures.push(path(&evidence.path, &worst, same));
    }
    if let Some(course) = evidence.course.as_ref().filter(|course| course.time_secs.len() > 1) {
        figures.push(force(course, &worst, same));
    }
    if evidence.residuals.count > 0 {
        figures.push(histogram(&evidence.residuals, same));
        figures.push(whiteness(&evidence.residuals, same));
    }
    html! { @if !figures.is_empty() { h3 { "To the eye" } div.plots { @for figure in &figures { (figure) } } } }
}

fn figure(svg: &Markup, caption: &str) -> Markup {
    html! { figure { (svg) figcaption { (caption) } } }
}

fn path(path: &Path, worst: &str, same: bool) -> Markup {
    let all = || path.measured.iter().chain(&path.before).chain(&path.after);
    let mut plot = Plot::square(Axis::linear(all().map(|p| p[0])), Axis::linear(all().map(|p| p[1])));
    plot.line("lm", path.measured.iter().copied());
    plot.line("lb", path.before.iter().copied());
    if !same {
        plot.line("la", path.after.iter().copied());
        path.after.last().inspect(|end| plot.dot("a", **end));
    }
    path.before.last().inspect(|end| plot.dot("b", **end));
    figure(
        &plot.finish("Path of the object from above", "x, m", "y, m"),
        &format!("The object from above: {worst}. Dots: where it ends."),
    )
}

fn force(course: &Course, worst: &str, same: bool) -> Markup {
    let values = course.measured.iter().chain(&course.before).chain(&course.after).copied();
    let mut plot = Plot::new(Axis::linear(course.time_secs.iter().copied()), Axis::linear(values));
    let line = |values: &[f64]| {
        course.time_secs.iter().copied().zip(values.iter().copied()).map(|(t, v)| [t, v]).collect::<Vec<_>>()
    };
    plot.line("lm", line(&course.measured));
    plot.line("lb", line(&course.before));
    if !same {
        plot.line("la", line(&course.after));
    }
    let axis =
        ["x", "y", "z"].get(course.component).map_or_else(|| course.component.to_string(), |axis| (*axis).into());
    let (name, unit) = (course.channel.name(), course.channel.unit());
    let component = if name == "joint_torque" { format!("joint {}", course.component) } else { axis };
    let title = format!("{} {component}, {unit}", plain(name));
    let caption = format!("{}, {component}: {worst}.", plain(name));
    figure(&plot.finish("A channel over time", "time, s", &title), &caption)
}

/// Steps around the bins of a histogram, as density.
fn outline(shares: &[f64]) -> Vec<[f64; 2]> {
    let width = 2.0 * REACH / shares.len().max(1) as f64;
    let edge = |i: usize| -REACH + width * i as f64;
    shares.iter().enumerate().flat_map(|(i, share)| [[edge(i), share / width], [edge(i + 1), share / width]]).collect()
}

fn histogram(residuals: &Residuals, same: bool) -> Markup {
    let [before, after] = residuals.histogram.each_ref().map(|shares| outline(shares));
    let normal = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let heights = before.iter().chain(&after).map(|p| p[1]).chain([0.0, normal(0.0)]);
    let mut plot = Plot::new(Axis::linear([-REACH, REACH]), Axis::linear(heights));
    plot.line("lm", (-60..=60).map(|i| f64::from(i) * REACH / 60.0).map(|x| [x, normal(x)]));
    plot.line("lb", before);
    if !same {
        plot.line("la", after);
    }
    let caption = format!(
        "{} held-out residuals against N(0, 1), the grey curve; beyond {REACH} counts in the outermost bins.",
        residuals.count
    );
    figure(&plot.finish("Distribution of the residuals", "residual, standard deviations", "density"), &caption)
}

fn whiteness(residuals: &Residuals, same: bool) -> Markup {
    let [before, after] = &residuals.autocorrelation;
    let band = residuals.white_below;
    let lags = before.len().max(after.len()) as f64;
    let values = before.iter().chain(after).copied().chain([0.0, band, -band, 0.2, -0.1]);
    let mut plot = Plot::new(Axis::linear([0.5, lags + 0.5]), Axis::linear(values));
    for level in [-band, band] {
        plot.line("mark", [[0.5, level], [lags + 0.5, level]]);
    }
    for (i, value) in before.iter().enumerate() {
        let lag = (i + 1) as f64;
        plot.bar("b", [lag - 0.3, if same { lag + 0.3 } else { lag }], 0.0, *value);
        if let Some(value) = after.get(i).filter(|_| !same) {
            plot.bar("a", [lag, lag + 0.3], 0.0, *value);
        }
    }
    let caption = "Autocorrelation of the held-out residuals; white ones stay between the dashed lines 19 times of 20.";
    figure(&plot.finish("Autocorrelation of the residuals", "lag, blocks of rows", "autocorrelation"), caption)
}

/// What remains, as a sentence or two.
pub(super) fn remains(report: &Report) -> Markup {
    if let Some(description) = &report.description {
        return html! {
            div.call { p { b { "Unexplained." } " " (description) } }
            @if let Some(lacking) = &report.lacking_force { (lacking_force(lacking)) }
        };
    }
    match report.verdict {
        Verdict::Effect => html! {
            p { "Where the model with the named effects still disagrees, on the episodes that it was fitted to:" }
        },
        Verdict::None | Verdict::Unknown => {
            html! { p { "Nothing that shows: the map above is what the re-tuned nominal model leaves." } }
        }
    }
}

/// What the force that is lacking follows.
fn lacking_force(lacking: &LackingForce) -> Markup {
    let value = |c: &Coefficient| format!("{} {} {}", plain(c.key), significant(c.value, 3), c.unit);
    let row = |term: &FoundTerm| {
        let values: Vec<String> = term.coefficients.iter().map(value).collect();
        vec![text(&term.description), text(percent(term.share)), text(values.join(", "))]
    };
    let rows: Vec<Vec<Markup>> = lacking.terms.iter().map(row).collect();
    html! {
        h3 { "The force that is lacking" }
        @if rows.is_empty() {
            p { "It follows no term that was tried: constant, direction and speed of the motion, place, time, known weight, force." }
        } @else {
            div.values { (table(&["term", "explains", "values"].map(text), &rows)) }
        }
        p.soft {
            (significant(lacking.root_mean_square_n, 2)) " N on the object beyond the re-tuned nominal model (root mean square of "
            (lacking.windows) " windows in which it moves, of " (lacking.episodes) " episodes; the sensors' noise makes "
            (significant(lacking.noise_n, 2)) " N). Explains: share of its square in episodes that were left out. Base axes."
        }
    }
}
