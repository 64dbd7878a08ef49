//! The kinds of charts, each: what is wrong with its data, its axes, its legend, its shapes.

pub(crate) mod clip;
mod dots;
mod heat;
mod histogram;
mod lines;
mod map;

use crate::axis::{SMALLEST, distinct, drawable};
use crate::frame::{Frame, Side, Sizes};
use crate::legend::{BAND, DASHES, Entry, Swatch};
use crate::palette::{Palette, REFERENCE, TEXT};
use crate::panel::{Axis, Chart, Reference, Scale};
use crate::scene::{Align, Rect, Scene, Text};

/// Axes and their labels.
pub(crate) struct Sides {
    pub(crate) x: Side,
    pub(crate) y: Side,
    pub(crate) x_label: String,
    pub(crate) y_label: String,
}

/// What a kind of chart can do.
pub(crate) trait Plot {
    /// What contradicts itself, in words.
    fn check(&self) -> Result<(), String>;
    /// What colours belong to, in order.
    fn names(&self) -> Vec<&str>;
    fn legend(&self, palette: &Palette) -> Vec<Entry>;
    fn sides(&self) -> Sides;
    /// Width of a column on the right of a plot of that size.
    fn right(&self, _plot: (f64, f64), _sizes: &Sizes) -> f64 {
        0.0
    }
    /// Draws the data over the grid; returns false where nothing tells that there are none.
    fn draw(&self, scene: &mut Scene, frame: &Frame, plot: &Rect, palette: &Palette) -> bool;
}

impl Chart {
    pub(crate) fn plot(&self) -> &dyn Plot {
        match self {
            Self::Lines(chart) => chart,
            Self::Histogram(chart) => chart,
            Self::Dots(chart) => chart,
            Self::Heat(chart) => chart,
            Self::Map(chart) => chart,
        }
    }
}

/// What a chart without data shows.
pub(crate) fn no_data(scene: &mut Scene, plot: &Rect, size: f64) {
    let at = ((plot.left + plot.right) / 2.0, (plot.top + plot.bottom) / 2.0);
    scene.text(Text { text: "no data".into(), at, size, align: Align::Middle, turned: false, color: TEXT });
}

fn check_limits(axis: &Axis) -> Result<(), String> {
    match axis.limits {
        Some((low, high)) if !(drawable(low) && drawable(high) && distinct(low, high)) => Err(format!(
            "limits of `{}` must be finite, ascend and differ by more than rounding, not {low} to {high}",
            axis.label
        )),
        Some((low, _)) if axis.scale == Scale::Log && low < SMALLEST => {
            Err(format!("limits of the logarithmic axis `{}` must be positive, not {low}", axis.label))
        }
        _ => Ok(()),
    }
}

fn check_references(references: &[Reference]) -> Result<(), String> {
    match references.iter().find(|r| !(drawable(r.low) && drawable(r.high) && r.low <= r.high)) {
        Some(r) => Err(format!("reference `{}` must be finite and ascend, not {} to {}", r.name, r.low, r.high)),
        None => Ok(()),
    }
}

/// The name that decides the colour.
fn color_name<'a>(name: &'a str, like: &'a str) -> &'a str {
    if like.is_empty() { name } else { like }
}

fn reference_entries(references: &[Reference]) -> impl Iterator<Item = Entry> {
    references.iter().map(|r| Entry {
        name: r.name.clone(),
        swatch: if r.low < r.high { Swatch::ReferenceBand } else { Swatch::ReferenceLine },
    })
}

/// A reference across the plot, on the axis of values.
fn draw_reference(scene: &mut Scene, frame: &Frame, plot: &Rect, reference: &Reference, upwards: bool) {
    let side = if upwards { &frame.y } else { &frame.x };
    let share = |value: f64| side.share(value);
    let (Some(low), Some(high)) = (share(reference.low), share(reference.high)) else { return };
    if high < 0.0 || low > 1.0 {
        return;
    }
    let place = |share: f64| {
        if upwards { plot.bottom - share * plot.height() } else { plot.left + share * plot.width() }
    };
    let across = |at: f64| {
        if upwards { [(plot.left, at), (plot.right, at)] } else { [(at, plot.bottom), (at, plot.top)] }
    };
    if low == high {
        scene.dashed(&across(place(low)), REFERENCE, 1.25, DASHES);
        return;
    }
    let (a, b) = (across(place(low.max(0.0))), across(place(high.min(1.0))));
    scene.area(vec![a[0], a[1], b[1], b[0]], REFERENCE, BAND);
    for (share, ends) in [(low, a), (high, b)] {
        if (0.0..=1.0).contains(&share) {
            scene.line(ends.to_vec(), REFERENCE, 0.75);
        }
    }
}
