//! Before and after: held-out episodes, the worst one in plots, and what the residuals look like.

use super::html::{escape, fixed, mean_square, significant, words};
use super::svg::{Axis, Plot, strip, strip_labels};
use crate::evidence::{ChannelError, Course, Evidence, Path, REACH, Residuals};
use crate::report::{Report, Verdict};
use crate::terms::{Coefficient, FoundTerm, LackingForce};

const KEY: &str = "<p class=\"key\"><i class=\"km\"></i>measured<i class=\"kb\"></i>before: re-tuned nominal<i class=\"ka\"></i>after: with the named effects</p>";
const KEY_NONE: &str = "<p class=\"key\"><i class=\"km\"></i>measured<i class=\"kb\"></i>re-tuned nominal (before and after are the same)</p>";

/// Everything about the gap.
pub(super) fn before_after(report: &Report) -> String {
    let same = report.effects.is_empty();
    let key = if same { KEY_NONE } else { KEY };
    let heldout = &report.heldout;
    let mut out = if same {
        format!(
            "<p>Held-out mean square {}; noise alone leaves {}.</p>",
            fixed(heldout.before, 2),
            fixed(heldout.noise_floor, 0)
        )
    } else {
        format!(
            "<p>Held-out mean square {} before, {} after; noise alone leaves {}. {} % of the gap is closed.</p>",
            fixed(heldout.before, 2),
            fixed(heldout.after, 2),
            fixed(heldout.noise_floor, 0),
            fixed(100.0 * heldout.closed_fraction, 0)
        )
    };
    out += key;
    out += &dumbbells(report, same);
    out += &errors(&report.evidence.errors, same);
    out + &plots(&report.evidence, same)
}

fn dumbbells(report: &Report, same: bool) -> String {
    let mut episodes = report.heldout.episodes.clone();
    if episodes.is_empty() {
        return "<p class=\"soft\">No episode was held out.</p>".into();
    }
    episodes.sort_by(|a, b| b.1.total_cmp(&a.1));
    let floor = report.heldout.noise_floor;
    let axis = Axis::logarithmic(
        episodes.iter().flat_map(|(_, before, after)| [*before, *after]).chain([0.5 * floor, 3.0 * floor]),
    );
    let noise = axis.percent(floor);
    let mut out = String::from("<h3>Each held-out episode</h3>");
    for (id, before, after) in &episodes {
        let (b, a) = (axis.percent(*before), axis.percent(*after));
        let mut inside = format!("<line class=\"mark\" x1=\"{noise}\" x2=\"{noise}\" y1=\"0\" y2=\"22\"/>");
        if !same {
            inside += &format!("<line class=\"link\" x1=\"{b}\" x2=\"{a}\" y1=\"11\" y2=\"11\"/>");
        }
        inside += &format!("<circle class=\"b\" cx=\"{b}\" cy=\"11\" r=\"5\"/>");
        if !same {
            inside += &format!("<circle class=\"a\" cx=\"{a}\" cy=\"11\" r=\"5\"/>");
        }
        let number = |value: f64| if value.abs() < 9.995 { fixed(value, 2) } else { mean_square(value) };
        let numbers = if same { number(*before) } else { format!("{} → {}", number(*before), number(*after)) };
        out += &format!(
            "<div class=\"row episode\"><span>episode {id}</span><div>{}</div><span>{numbers}</span></div>",
            strip(&axis, 5, 22, &inside)
        );
    }
    out += &format!("<div class=\"row axis\"><span></span><div>{}</div><span></span></div>", strip_labels(&axis, 5));
    out + "<p class=\"soft\">Mean square of the white residuals, logarithmic; dashed: noise.</p>"
}

/// Errors in units of a ruler: millimetres, milliradians, newtons.
fn errors(errors: &[ChannelError], same: bool) -> String {
    if errors.is_empty() {
        return String::new();
    }
    let row = |error: &ChannelError| {
        let (factor, unit) = match error.unit {
            "m" => (1e3, "mm"),
            "rad" => (1e3, "mrad"),
            unit => (1.0, unit),
        };
        let cells = |sizes: [f64; 2]| -> String {
            let shown = if same { &sizes[..1] } else { &sizes[..] };
            shown.iter().map(|size| format!("<td>{}</td>", significant(factor * size, 3))).collect()
        };
        format!(
            "<tr><td>{}</td><td>{unit}</td>{}{}</tr>",
            words(error.channel.name()),
            cells([error.before, error.after]),
            cells([error.median_before, error.median_after])
        )
    };
    let heads = if same {
        "<th>root mean square</th><th>median</th>"
    } else {
        "<th>root mean square before</th><th>after</th><th>median before</th><th>after</th>"
    };
    let rows: String = errors.iter().map(row).collect();
    format!(
        "<h3>Held-out error of each channel</h3><table><tr><th>channel</th><th>unit</th>{heads}</tr>{rows}</table>\
         <p class=\"soft\">Measured − simulated, over components and blocks of rows, noise of the sensors included; an episode that has gone \
         another way counts in the root mean square more than in the median.</p>"
    )
}

fn plots(evidence: &Evidence, same: bool) -> String {
    let mut out = String::new();
    let worst = evidence.episode.map(|id| format!("episode {id}, the worst held out")).unwrap_or_default();
    if evidence.path.measured.len() > 1 {
        out += &path(&evidence.path, &worst, same);
    }
    if let Some(course) = evidence.course.as_ref().filter(|course| course.time_secs.len() > 1) {
        out += &force(course, &worst, same);
    }
    if evidence.residuals.count > 0 {
        out += &histogram(&evidence.residuals, same);
        out += &whiteness(&evidence.residuals, same);
    }
    if out.is_empty() { out } else { format!("<h3>To the eye</h3><div class=\"plots\">{out}</div>") }
}

fn figure(svg: &str, caption: &str) -> String {
    format!("<figure>{svg}<figcaption>{caption}</figcaption></figure>")
}

fn path(path: &Path, worst: &str, same: bool) -> String {
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

fn force(course: &Course, worst: &str, same: bool) -> String {
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
    let title = format!("{} {component}, {unit}", words(name));
    let caption = format!("{}, {component}: {worst}.", words(name));
    figure(&plot.finish("A channel over time", "time, s", &title), &caption)
}

/// Steps around the bins of a histogram, as density.
fn outline(shares: &[f64]) -> Vec<[f64; 2]> {
    let width = 2.0 * REACH / shares.len().max(1) as f64;
    let edge = |i: usize| -REACH + width * i as f64;
    shares.iter().enumerate().flat_map(|(i, share)| [[edge(i), share / width], [edge(i + 1), share / width]]).collect()
}

fn histogram(residuals: &Residuals, same: bool) -> String {
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

fn whiteness(residuals: &Residuals, same: bool) -> String {
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
pub(super) fn remains(report: &Report) -> String {
    let description = report.description.as_deref().map(escape).unwrap_or_default();
    match report.verdict {
        Verdict::Unknown => {
            let lacking = report.lacking_force.as_ref().map(lacking_force).unwrap_or_default();
            format!("<div class=\"call\"><p><b>Unexplained.</b> {description}</p></div>{lacking}")
        }
        Verdict::Effect => {
            "<p>Where the model with the named effects still disagrees, on the episodes that it was fitted to:</p>"
                .into()
        }
        Verdict::None => "<p>Nothing that shows: the map above is what the re-tuned nominal model leaves.</p>".into(),
    }
}

/// What the force that is lacking follows.
fn lacking_force(lacking: &LackingForce) -> String {
    let value = |c: &Coefficient| format!("{} {} {}", words(c.key), significant(c.value, 3), c.unit);
    let row = |term: &FoundTerm| {
        let values: Vec<String> = term.coefficients.iter().map(value).collect();
        format!(
            "<tr><td>{}</td><td>{} %</td><td>{}</td></tr>",
            escape(&term.description),
            fixed(100.0 * term.share, 0),
            values.join(", ")
        )
    };
    let table = if lacking.terms.is_empty() {
        "<p>It follows no term that was tried: constant, direction and speed of the motion, place, time, known weight, force.</p>".into()
    } else {
        let rows: String = lacking.terms.iter().map(row).collect();
        format!("<table><tr><th>term</th><th>explains</th><th>values</th></tr>{rows}</table>")
    };
    format!(
        "<h3>The force that is lacking</h3>{table}<p class=\"soft\">{} N on the object beyond the re-tuned nominal model (root mean square of {} windows in which it moves, of {} episodes; \
         the sensors' noise makes {} N). Explains: share of its square in episodes that were left out. Base axes.</p>",
        significant(lacking.root_mean_square_n, 2),
        lacking.windows,
        lacking.episodes,
        significant(lacking.noise_n, 2)
    )
}
