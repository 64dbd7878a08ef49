//! Charts as SVG and PNG: plain data in, files out.
//!
//! A [`Figure`] is a grid of [`Panel`]s under one title and one legend; a panel has a [`Chart`]: [`Lines`],
//! [`Histogram`], [`Dots`], [`Heat`] or [`Map`]. Equal figures give equal bytes. A series has one colour in all panels, from a
//! palette that colour-blind readers can use. The legend stands above the panels, never over data. Axis labels that
//! neighbours repeat are written once. Numbers that are not finite are gaps; data that contradict each other are typed
//! errors.
//!
//! A [`Canvas`] is a picture that its caller draws; a [`Film`] is several of them as an animated PNG.
//!
//! Sizes are in pixels; what values mean, their labels say: write units there (`time / s`).
//!
//! # Example
//! ```
//! use figures::{Axis, Chart, Figure, Lines, Panel, Reference, Series};
//!
//! let loss = (0..50).map(|epoch| (f64::from(epoch), (-f64::from(epoch) / 10.0).exp())).collect();
//! let curves = Lines {
//!     x: Axis::new("epoch"),
//!     y: Axis::new("negative log-likelihood / nat"),
//!     series: vec![Series { name: "training".into(), points: loss, ..Series::default() }],
//!     references: vec![Reference { name: "uniform".into(), low: 0.8, high: 0.8 }],
//! };
//! let figure = Figure {
//!     title: "Learning".into(),
//!     panels: vec![Panel { title: "jaco".into(), chart: Chart::Lines(curves) }],
//!     columns: 1,
//!     panel_size_px: (600, 300),
//!     ..Figure::default()
//! };
//! let folder = tempfile::tempdir()?;
//! let [svg, png] = figure.save(&folder.path().join("learning"))?;
//! assert!(std::fs::read_to_string(svg)?.contains("negative log-likelihood / nat"));
//! assert!(std::fs::read(png)?.starts_with(b"\x89PNG"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Why so
//! plotters' chart layer places legends over data, cuts long labels and cannot align panels, so layout is ours (a list
//! of shapes that tests look at) and only plotters' backends draw it; all knowledge of them is in `paint` and `text`.

// The gallery's figures are drawn by unit tests too.
#[cfg(test)]
extern crate self as figures;

mod axis;
mod canvas;
mod chart;
mod error;
mod figure;
mod frame;
mod layout;
mod legend;
mod names;
mod paint;
mod palette;
mod panel;
mod scene;
mod text;

pub use canvas::{Canvas, Film, Type};
pub use error::Error;
pub use figure::Figure;
pub use palette::Color;
pub use panel::{
    Axis, Chart, Direction, Dots, Draw, Estimate, Estimates, Heat, Histogram, Lines, Map, Mark, Outline, Panel,
    Reference, Scale, Series, Stroke,
};
pub use scene::Align;

/// Most pixels of a figure; drawing one takes 48 bytes each.
pub const LARGEST_PX: u64 = 10_000_000;
/// Least width and height in pixels that labels must leave for the data of a panel.
pub const SMALLEST_PLOT_PX: (f64, f64) = (30.0, 24.0);
