//! Which colour is what: rows above the panels, where no data are.

use crate::palette::{Color, Look, REFERENCE, TEXT};
use crate::scene::{Align, Point, Rect, Scene, Text};
use crate::text::{LINE, width};

const SIZE: f64 = 12.0;
const GAP: f64 = 6.0;
const BETWEEN: f64 = 20.0;

/// How something looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Swatch {
    Line { look: Look, dashed: bool, marked: bool },
    Marker { look: Look, open: bool },
    Fill(Color),
    ReferenceLine,
    ReferenceBand,
}

/// A swatch with its name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) swatch: Swatch,
}

/// Dashes of references, and of series that ask for them.
pub(crate) const DASHES: (f64, f64) = (6.0, 4.0);

/// Rows of entries that fit in `width_px`.
pub(crate) fn rows(entries: &[Entry], width_px: f64) -> Vec<Vec<&Entry>> {
    let mut rows: Vec<Vec<&Entry>> = Vec::new();
    let mut used = f64::INFINITY;
    for entry in entries {
        let length = length(entry) + BETWEEN;
        if used + length - BETWEEN > width_px {
            rows.push(Vec::new());
            used = 0.0;
        }
        used += length;
        if let Some(row) = rows.last_mut() {
            row.push(entry);
        }
    }
    rows
}

fn length(entry: &Entry) -> f64 {
    swatch_width(entry.swatch) + GAP + width(&entry.name, SIZE)
}

fn swatch_width(swatch: Swatch) -> f64 {
    match swatch {
        Swatch::Marker { .. } | Swatch::Fill(_) => 12.0,
        _ => 24.0,
    }
}

/// Says which entry does not fit in one row.
pub(crate) fn too_long(entries: &[Entry], width_px: f64) -> Option<String> {
    let entry = entries.iter().find(|e| length(e) > width_px)?;
    Some(format!("`{}` is {:.0} px long in the legend, {width_px:.0} px are there", entry.name, length(entry)))
}

/// Height of some rows, with a margin below.
pub(crate) fn height(rows: usize) -> f64 {
    if rows == 0 { 0.0 } else { rows as f64 * SIZE * 1.6 + GAP }
}

/// Draws rows, each centred, from `top` down.
pub(crate) fn draw(scene: &mut Scene, rows: &[Vec<&Entry>], top: f64) {
    for (i, row) in rows.iter().enumerate() {
        let total: f64 = row.iter().map(|e| length(e) + BETWEEN).sum::<f64>() - BETWEEN;
        let mut x = (f64::from(scene.width_px) - total) / 2.0;
        let y = top + (i as f64 + 0.5) * SIZE * 1.6;
        for entry in row {
            let right = x + swatch_width(entry.swatch);
            swatch(scene, entry.swatch, &Rect { left: x, top: y - 5.5, right, bottom: y + 5.5 });
            let at = (right + GAP, y);
            scene.text(Text {
                text: entry.name.clone(),
                at,
                size: SIZE,
                align: Align::Start,
                turned: false,
                color: TEXT,
            });
            x += length(entry) + BETWEEN;
        }
    }
}

fn swatch(scene: &mut Scene, swatch: Swatch, area: &Rect) {
    let y = (area.top + area.bottom) / 2.0;
    let ends = [(area.left, y), (area.right, y)];
    let middle = ((area.left + area.right) / 2.0, y);
    match swatch {
        Swatch::Line { look, dashed, marked } => {
            if dashed {
                scene.dashed(&ends, look.color, 2.0, DASHES);
            } else {
                scene.line(ends.to_vec(), look.color, 2.0);
            }
            if marked {
                marker(scene, middle, 4.0, look, false);
            }
        }
        Swatch::Marker { look, open } => marker(scene, middle, 4.5, look, open),
        Swatch::Fill(color) => scene.area(area.corners(), color, 1.0),
        Swatch::ReferenceLine => scene.dashed(&ends, REFERENCE, 1.25, DASHES),
        Swatch::ReferenceBand => {
            scene.area(area.corners(), REFERENCE, BAND);
            for y in [area.top, area.bottom] {
                scene.line(vec![(area.left, y), (area.right, y)], REFERENCE, 0.75);
            }
        }
    }
}

/// Opacity of reference bands.
pub(crate) const BAND: f64 = 0.18;

/// A marker: round, square, triangle or diamond by series.
pub(crate) fn marker(scene: &mut Scene, (x, y): Point, radius: f64, look: Look, open: bool) {
    let shape: Vec<Point> = match look.index % 4 {
        0 => Vec::new(),
        1 => vec![(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
        2 => vec![(0.0, -1.25), (1.1, 0.8), (-1.1, 0.8)],
        _ => vec![(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
    };
    let place = |scale: f64| shape.iter().map(|(dx, dy)| (x + dx * scale, y + dy * scale)).collect::<Vec<_>>();
    let inner = radius - 1.6;
    if shape.is_empty() {
        scene.disc((x, y), radius, look.color);
        if open {
            scene.disc((x, y), inner, crate::palette::WHITE);
        }
    } else {
        scene.area(place(radius), look.color, 1.0);
        if open {
            scene.area(place(inner), crate::palette::WHITE, 1.0);
        }
    }
}

/// Height of one line of the figure's title.
pub(crate) fn title_height(size: f64, lines: usize) -> f64 {
    if lines == 0 { 0.0 } else { lines as f64 * size * LINE + GAP }
}
