//! The box around the data: ticks, names of categories, labels, light grid. All charts share it.

use crate::axis::{Ruler, Tick};
use crate::names::{CLOSEST, Names, SMALLEST_NAME, too_long, wrapped, wrapped_into};
use crate::palette::{FRAME, GRID, TEXT};
use crate::scene::{Align, Point, Rect, Scene, Text};
use crate::text::{LINE, widest, width, wrap};

/// Between ticks and their labels, and between labels.
const GAP: f64 = 6.0;

/// Sizes of text in pixels, by how wide panels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sizes {
    pub(crate) tick: f64,
    pub(crate) label: f64,
    pub(crate) title: f64,
    /// Width of data lines.
    pub(crate) line: f64,
    /// Radius of markers.
    pub(crate) marker: f64,
}

impl Sizes {
    pub(crate) fn of(panel_width_px: f64) -> Self {
        if panel_width_px >= 260.0 {
            Self { tick: 11.0, label: 12.0, title: 13.0, line: 2.0, marker: 4.0 }
        } else {
            Self { tick: 9.0, label: 10.0, title: 10.5, line: 1.5, marker: 3.0 }
        }
    }
}

/// What an axis counts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Side {
    Numbers(Ruler),
    /// One slot of equal width for each name.
    Names(Vec<String>),
}

impl Side {
    /// Where a value is between the ends; slot `i` of names is from `i` to `i + 1`.
    pub(crate) fn share(&self, value: f64) -> Option<f64> {
        match self {
            Self::Numbers(ruler) => ruler.share(value),
            Self::Names(names) => Some(value / names.len() as f64),
        }
    }
}

/// Room around the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Insets {
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) top: f64,
    pub(crate) bottom: f64,
}

/// Axes of a chart. Names go down on the vertical one, numbers up.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) title: String,
    pub(crate) x: Side,
    pub(crate) y: Side,
    /// Empty where the neighbour below says the same.
    pub(crate) x_label: String,
    /// Empty where the neighbour on the left says the same.
    pub(crate) y_label: String,
    /// Whether names below are written, or stand below the neighbour.
    pub(crate) x_names: bool,
    /// Whether names on the left are written, or stand left of the neighbour.
    pub(crate) y_names: bool,
    /// A column on the right, for a bar of colours.
    pub(crate) right: f64,
    /// Mean size of panels: names take at most two fifths of it, where their words allow.
    pub(crate) panel: (f64, f64),
    pub(crate) sizes: Sizes,
}

impl Frame {
    /// Horizontal ticks: as many as fit without touching.
    fn x_ticks(&self, ruler: &Ruler, length: f64) -> Vec<Tick> {
        let fits = |ticks: &[Tick]| {
            let mut end = f64::NEG_INFINITY;
            ticks.iter().filter(|t| !t.label.is_empty()).all(|tick| {
                let middle = ruler.share(tick.value).unwrap_or(0.0) * length;
                let half = width(&tick.label, self.sizes.tick) / 2.0;
                let free = middle - half > end;
                end = middle + half + self.sizes.tick;
                free
            })
        };
        let most = ((length / (3.0 * self.sizes.tick)) as usize).clamp(2, 10);
        let found = (2..=most).rev().map(|count| ruler.ticks(count)).find(|ticks| fits(ticks));
        // Even two touch: the first alone.
        found.unwrap_or_else(|| ruler.ticks(2).into_iter().take(1).collect())
    }

    fn y_ticks(&self, ruler: &Ruler, length: f64) -> Vec<Tick> {
        ruler.ticks(((length / (2.4 * self.sizes.tick)) as usize).clamp(2, 8))
    }

    /// A size of names in which as many lines fit side by side.
    fn name_size(&self, slot: f64) -> f64 {
        self.sizes.tick.min(slot / CLOSEST)
    }

    /// Why names, labels or title cannot be written legibly in a cell of that size, if so.
    pub(crate) fn crowded(&self, plot: (f64, f64), cell: (f64, f64)) -> Option<String> {
        let crowded = |side: &Side, length: f64| match side {
            Side::Names(names) if self.name_size(length / names.len() as f64) < SMALLEST_NAME => {
                let needed = SMALLEST_NAME * CLOSEST * names.len() as f64;
                Some(format!("{} names side by side need {needed:.0} px, {length:.0} px are there", names.len()))
            }
            _ => None,
        };
        let Sizes { label, title, .. } = self.sizes;
        let long = |text: &str, size: f64, room: f64| too_long(&wrap(text, size, room), size, room);
        crowded(&self.x, plot.0)
            .or_else(|| crowded(&self.y, plot.1))
            .or_else(|| long(&self.title, title, cell.0))
            .or_else(|| long(&self.x_label, label, cell.0))
            .or_else(|| long(&self.y_label, label, plot.1))
    }

    /// Names below: level where they fit, else turned.
    fn names_below(&self, names: &[String], length: f64) -> Names {
        let slot = length / names.len() as f64;
        if !self.x_names {
            return Names { lines: vec![Vec::new(); names.len()], size: self.sizes.tick, turned: false };
        }
        let level = wrapped(names, self.sizes.tick, slot - GAP);
        if level.iter().all(|l| widest(l, self.sizes.tick) <= slot - GAP && l.len() <= 4) {
            return Names { lines: level, size: self.sizes.tick, turned: false };
        }
        let size = self.name_size(slot);
        Names { lines: wrapped_into(names, size, 0.4 * self.panel.1, slot), size, turned: true }
    }

    /// Names on the left.
    fn names_left(&self, names: &[String], length: f64) -> Names {
        let slot = length / names.len() as f64;
        if !self.y_names {
            return Names { lines: vec![Vec::new(); names.len()], size: self.sizes.tick, turned: false };
        }
        let size = self.name_size(slot);
        Names { lines: wrapped_into(names, size, 0.4 * self.panel.0, slot), size, turned: false }
    }

    fn title_lines(&self, panel_width: f64) -> Vec<String> {
        wrap(&self.title, self.sizes.title, panel_width)
    }

    /// The room that labels need around a plot of that size in a panel of that width.
    pub(crate) fn insets(&self, plot: (f64, f64), panel_width: f64) -> Insets {
        let Sizes { tick, label, title, .. } = self.sizes;
        let mut insets = Insets { left: GAP, right: GAP + self.right, top: GAP, bottom: GAP };
        match &self.x {
            Side::Numbers(ruler) => {
                insets.bottom += tick * LINE;
                for tick in self.x_ticks(ruler, plot.0) {
                    let half = width(&tick.label, self.sizes.tick) / 2.0;
                    let middle = ruler.share(tick.value).unwrap_or(0.5) * plot.0;
                    insets.right = insets.right.max(middle + half - plot.0 + 2.0);
                    insets.left = insets.left.max(half - middle + 2.0);
                }
            }
            Side::Names(names) => {
                let names = self.names_below(names, plot.0);
                insets.bottom += if names.turned { names.longest() } else { names.tallest() };
            }
        }
        let left = match &self.y {
            Side::Numbers(ruler) => {
                insets.top = insets.top.max(tick * 0.6);
                self.y_ticks(ruler, plot.1).iter().map(|t| width(&t.label, tick)).fold(0.0, f64::max)
            }
            Side::Names(names) => self.names_left(names, plot.1).longest(),
        };
        insets.left = insets.left.max(left + 2.0 * GAP);
        if !self.x_label.is_empty() {
            insets.bottom += wrap(&self.x_label, label, panel_width).len() as f64 * label * LINE + GAP / 2.0;
        }
        if !self.y_label.is_empty() {
            insets.left += wrap(&self.y_label, label, plot.1.max(1.0)).len() as f64 * label * LINE;
        }
        insets.top += self.title_lines(panel_width).len() as f64 * title * LINE;
        insets
    }

    /// Where a pair of values is.
    pub(crate) fn at(&self, plot: &Rect, x: f64, y: f64) -> Option<Point> {
        Some((self.x_at(plot, x)?, self.y_at(plot, y)?))
    }

    pub(crate) fn x_at(&self, plot: &Rect, x: f64) -> Option<f64> {
        Some(plot.left + self.x.share(x)? * plot.width())
    }

    pub(crate) fn y_at(&self, plot: &Rect, y: f64) -> Option<f64> {
        let share = self.y.share(y)?;
        Some(match self.y {
            Side::Numbers(_) => plot.bottom - share * plot.height(),
            Side::Names(_) => plot.top + share * plot.height(),
        })
    }

    /// Grid, outline, labels and title, below the data.
    pub(crate) fn draw(&self, scene: &mut Scene, plot: &Rect, panel: &Rect) {
        let Sizes { tick: size, label, title, .. } = self.sizes;
        let text = |at, size, align| Text { text: String::new(), at, size, align, turned: false, color: TEXT };
        let panel_width = panel.width();

        let mut below = plot.bottom + GAP;
        match &self.x {
            Side::Numbers(ruler) => {
                for tick in self.x_ticks(ruler, plot.width()) {
                    let Some(x) = self.x_at(plot, tick.value) else { continue };
                    scene.line(vec![(x, plot.top), (x, plot.bottom)], GRID, 1.0);
                    let at = (x, below + size * LINE / 2.0);
                    scene.text(Text { text: tick.label, ..text(at, size, Align::Middle) });
                }
                below += size * LINE;
            }
            Side::Names(names) => {
                let names = self.names_below(names, plot.width());
                for (i, lines) in names.lines.iter().enumerate() {
                    let Some(x) = self.x_at(plot, i as f64 + 0.5) else { continue };
                    if names.turned {
                        let like = Text { turned: true, ..text((x, below), names.size, Align::End) };
                        scene.lines_of_text(lines, &like);
                    } else {
                        let at = (x, below + lines.len() as f64 * names.size * LINE / 2.0);
                        scene.lines_of_text(lines, &text(at, names.size, Align::Middle));
                    }
                }
                below += if names.turned { names.longest() } else { names.tallest() };
            }
        }
        let lines = wrap(&self.x_label, label, panel_width);
        let at = ((plot.left + plot.right) / 2.0, below + GAP / 2.0 + lines.len() as f64 * label * LINE / 2.0);
        scene.lines_of_text(&lines, &text(within(at, panel, &lines, label), label, Align::Middle));

        let mut widest_left: f64 = 0.0;
        match &self.y {
            Side::Numbers(ruler) => {
                for tick in self.y_ticks(ruler, plot.height()) {
                    let Some(y) = self.y_at(plot, tick.value) else { continue };
                    scene.line(vec![(plot.left, y), (plot.right, y)], GRID, 1.0);
                    widest_left = widest_left.max(width(&tick.label, size));
                    scene.text(Text { text: tick.label, ..text((plot.left - GAP, y), size, Align::End) });
                }
            }
            Side::Names(names) => {
                let names = self.names_left(names, plot.height());
                widest_left = names.longest();
                for (i, lines) in names.lines.iter().enumerate() {
                    let Some(y) = self.y_at(plot, i as f64 + 0.5) else { continue };
                    scene.lines_of_text(lines, &text((plot.left - GAP, y), names.size, Align::End));
                }
            }
        }
        let lines = wrap(&self.y_label, label, plot.height());
        let x = plot.left - 1.5 * GAP - widest_left - lines.len() as f64 * label * LINE / 2.0;
        let like = Text { turned: true, ..text((x, (plot.top + plot.bottom) / 2.0), label, Align::Middle) };
        scene.lines_of_text(&lines, &like);

        let lines = self.title_lines(panel_width);
        let at = ((plot.left + plot.right) / 2.0, plot.top - GAP - lines.len() as f64 * title * LINE / 2.0);
        scene.lines_of_text(&lines, &text(within(at, panel, &lines, title), title, Align::Middle));
        self.outline(scene, plot);
    }

    /// The lines around the plot.
    pub(crate) fn outline(&self, scene: &mut Scene, plot: &Rect) {
        let mut corners = plot.corners();
        corners.push(corners[0]);
        scene.line(corners, FRAME, 1.0);
    }
}

/// Moves centred lines sideways into the panel.
fn within(at: Point, panel: &Rect, lines: &[String], size: f64) -> Point {
    let half = widest(lines, size) / 2.0;
    (at.0.min(panel.right - half).max(panel.left + half), at.1)
}
