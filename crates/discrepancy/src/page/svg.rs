//! Small charts in the colours of the page, dark or light, printed or on a telephone: strips are as wide as their place while their text keeps its size.
//!
//! The crate `figures` draws files: its pictures have colours and sizes of their own, a white ground and a legend. Here one key serves several charts, a bar
//! stands in a row of text, and the style sheet says what a line looks like.

use maud::html;
use page::Markup;
use page::number::{fixed, significant};

/// From values to shares of a width.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Axis {
    /// Covers all finite `values`, with a margin.
    pub(super) fn linear(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = span(values);
        let margin = if high > low { 0.06 * (high - low) } else { 0.5 * low.abs().max(1e-3) };
        Self { low: low - margin, high: high + margin, logarithmic: false }
    }

    /// The same between decades; what is not positive stands at the low end.
    pub(super) fn logarithmic(values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = span(values.into_iter().filter(|value| *value > 0.0).map(f64::log10));
        let margin = 0.06 * (high - low).max(0.5);
        Self { low: low - margin, high: high + margin, logarithmic: true }
    }

    /// Share of the width, 0 to 1.
    pub(super) fn at(&self, value: f64) -> f64 {
        let value = match (self.logarithmic, value > 0.0) {
            (true, true) => value.log10(),
            (true, false) => self.low,
            (false, _) => value,
        };
        let share = (value - self.low) / (self.high - self.low);
        if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
    }

    /// The same in per cent, as an attribute.
    pub(super) fn percent(&self, value: f64) -> String {
        format!("{:.2}%", 100.0 * self.at(value))
    }

    /// Round values within, about `count`.
    pub(super) fn ticks(&self, count: usize) -> Vec<f64> {
        if self.logarithmic {
            let steps: &[f64] = if self.high - self.low > 2.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
            let every = ((self.high - self.low) / count as f64).ceil().max(1.0) as i32;
            return (self.low.floor() as i32..=self.high.ceil() as i32)
                .filter(|decade| decade.rem_euclid(every) == 0)
                .flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)))
                .filter(|tick| (self.low..=self.high).contains(&tick.log10()))
                .collect();
        }
        let raw = (self.high - self.low) / count.max(1) as f64;
        let decade = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|s| s * decade).into_iter().find(|s| *s >= raw).unwrap_or(raw);
        let (first, last) = ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        (first..=last.min(first + 20)).map(|i| i as f64 * step).collect()
    }

    /// A tick in words.
    pub(super) fn label(&self, tick: f64) -> String {
        if self.logarithmic {
            return significant(tick, 1);
        }
        if tick.abs() >= 9_999.5 {
            return format!("{}k", significant(tick / 1e3, 2));
        }
        let step = (self.high - self.low) / 10.0;
        fixed(tick, (-step.log10().floor()).clamp(0.0, 6.0) as usize)
    }
}

fn span(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low <= high { (low, high) } else { (0.0, 1.0) }
}

/// An upright line across a strip of this height.
pub(super) fn upright(class: &str, axis: &Axis, value: f64, height: u32) -> Markup {
    let x = axis.percent(value);
    html! { line class=(class) x1=(x) x2=(x) y1="0" y2=(height) {} }
}

/// A strip as wide as its place, with the axis' grid behind `inside`.
pub(super) fn strip(axis: &Axis, ticks: usize, height: u32, inside: &Markup) -> Markup {
    html! {
        svg width="100%" height=(height) aria-hidden="true" {
            @for tick in axis.ticks(ticks) { (upright("grid", axis, tick, height)) }
            (inside)
        }
    }
}

/// The labels under strips.
pub(super) fn strip_labels(axis: &Axis, ticks: usize) -> Markup {
    html! {
        svg width="100%" height="16" aria-hidden="true" {
            @for tick in axis.ticks(ticks) { text x=(axis.percent(tick)) y="12" text-anchor="middle" { (axis.label(tick)) } }
        }
    }
}

/// A plot of fixed proportions with two axes.
#[derive(Debug)]
pub(super) struct Plot {
    /// Horizontal.
    pub(super) x: Axis,
    /// Vertical.
    pub(super) y: Axis,
    body: Vec<Markup>,
}

/// Size of a plot, and its inner borders: left, right, top, bottom.
const SIZE: [f64; 2] = [400.0, 280.0];
const BORDERS: [f64; 4] = [64.0, 388.0, 10.0, 240.0];

impl Plot {
    /// Empty.
    pub(super) fn new(x: Axis, y: Axis) -> Self {
        Self { x, y, body: Vec::new() }
    }

    /// The same, with one scale for both axes.
    pub(super) fn square(mut x: Axis, mut y: Axis) -> Self {
        let [left, right, top, bottom] = BORDERS;
        let scale = ((x.high - x.low) / (right - left)).max((y.high - y.low) / (bottom - top));
        for (axis, length) in [(&mut x, right - left), (&mut y, bottom - top)] {
            let (middle, half) = (0.5 * (axis.low + axis.high), 0.5 * scale * length);
            (axis.low, axis.high) = (middle - half, middle + half);
        }
        Self::new(x, y)
    }

    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let [left, right, top, bottom] = BORDERS;
        [left + self.x.at(x) * (right - left), bottom - self.y.at(y) * (bottom - top)]
    }

    /// A line through points.
    pub(super) fn line(&mut self, class: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let points: Vec<String> = (points.into_iter().filter(|p| p[0].is_finite() && p[1].is_finite()))
            .map(|[x, y]| self.place(x, y))
            .map(|[x, y]| format!("{x:.1},{y:.1}"))
            .collect();
        if !points.is_empty() {
            self.body.push(html! { polyline class=(class) points=(points.join(" ")) {} });
        }
    }

    /// A dot.
    pub(super) fn dot(&mut self, class: &str, [x, y]: [f64; 2]) {
        let [x, y] = self.place(x, y);
        self.body.push(html! { circle class=(class) cx=(tenths(x)) cy=(tenths(y)) r="4" {} });
    }

    /// A bar from `base` to `y`, from `x[0]` to `x[1]`.
    pub(super) fn bar(&mut self, class: &str, x: [f64; 2], base: f64, y: f64) {
        let ([left, a], [right, b]) = (self.place(x[0], base), self.place(x[1], y));
        let (top, height, width) = (a.min(b), (a - b).abs(), (right - left).max(0.5));
        self.body.push(html! {
            rect class=(class) x=(tenths(left)) y=(tenths(top)) width=(tenths(width)) height=(tenths(height)) {}
        });
    }

    /// With axes and their titles.
    pub(super) fn finish(&self, title: &str, x_title: &str, y_title: &str) -> Markup {
        let ([width, height], [left, right, top, bottom]) = (SIZE, BORDERS);
        let (middle, centre) = (0.5 * (left + right), 0.5 * (top + bottom));
        html! {
            svg viewBox={ "0 0 " (width) " " (height) } role="img" {
                title { (title) }
                @for tick in self.x.ticks(6) {
                    @let x = tenths(self.place(tick, 0.0)[0]);
                    line.grid x1=(x) x2=(x) y1=(top) y2=(bottom) {}
                    text x=(x) y=(bottom + 15.0) text-anchor="middle" { (self.x.label(tick)) }
                }
                @for tick in self.y.ticks(5) {
                    @let y = self.place(0.0, tick)[1];
                    line.grid x1=(left) x2=(right) y1=(tenths(y)) y2=(tenths(y)) {}
                    text x=(left - 5.0) y=(tenths(y + 4.0)) text-anchor="end" { (self.y.label(tick)) }
                }
                rect.frame x=(left) y=(top) width=(right - left) height=(bottom - top) {}
                @for shape in &self.body { (shape) }
                text x=(middle) y=(height - 8.0) text-anchor="middle" { (x_title) }
                text x="11" y=(centre) text-anchor="middle" transform=(format!("rotate(-90 11 {centre})")) { (y_title) }
            }
        }
    }
}

/// A coordinate.
fn tenths(value: f64) -> String {
    format!("{value:.1}")
}
