//! Where everything goes: title, legend, then panels whose data areas line up along rows and columns.

use crate::chart::{Sides, no_data};
use crate::figure::Figure;
use crate::frame::{Frame, Sizes};
use crate::legend::{self, Entry};
use crate::names::too_long;
use crate::palette::{Palette, TEXT};
use crate::scene::{Align, Rect, Scene, Text};
use crate::text::wrap;
use crate::{Error, LARGEST_PX, SMALLEST_PLOT_PX};

#[cfg(test)]
mod tests;

/// Around the figure and around panels: at the sides, above and below.
const MARGIN: f64 = 8.0;
const MARGIN_ABOVE: f64 = 5.0;
const TITLE: f64 = 16.0;

/// The picture of a figure.
pub(crate) fn lay_out(figure: &Figure) -> Result<Scene, Error> {
    check(figure)?;
    let names = figure.panels.iter().flat_map(|p| p.chart.plot().names());
    let palette = Palette::new(figure.colors.iter().map(String::as_str).chain(names));
    let entries = entries(figure, &palette);
    let width_px = u64::from(figure.panel_size_px.0) * figure.columns as u64;
    let inner = width_px as f64 - 2.0 * MARGIN;
    let title = wrap(&figure.title, TITLE, inner);
    let legend_rows = legend::rows(&entries, inner);
    let long = too_long(&title, TITLE, inner).or_else(|| legend::too_long(&entries, inner));
    if let Some(reason) = long {
        return Err(Error::Figure { reason });
    }
    let title_height = legend::title_height(TITLE, title.len());
    let top = (MARGIN + title_height + legend::height(legend_rows.len())).ceil();
    let rows = figure.panels.len().div_ceil(figure.columns);
    let height_px = top as u64 + rows as u64 * u64::from(figure.panel_size_px.1);
    let pixels = width_px.saturating_mul(height_px);
    if pixels > LARGEST_PX {
        let reason = format!("{width_px} × {height_px} = {pixels} pixels are more than {LARGEST_PX}");
        return Err(Error::Figure { reason });
    }

    let mut scene = Scene { width_px: width_px as u32, height_px: height_px as u32, shapes: Vec::new() };
    let at = (width_px as f64 / 2.0, MARGIN + (title_height - 6.0) / 2.0);
    let like = Text { text: String::new(), at, size: TITLE, align: Align::Middle, turned: false, color: TEXT };
    scene.lines_of_text(&title, &like);
    legend::draw(&mut scene, &legend_rows, MARGIN + title_height);

    let mut frames = frames(figure);
    let grid = align(figure, &mut frames)?;
    for (i, (panel, frame)) in figure.panels.iter().zip(&frames).enumerate() {
        let (cell, plot) = grid.place(i, top);
        frame.draw(&mut scene, &plot, &cell);
        let any = panel.chart.plot().draw(&mut scene, frame, &plot, &palette);
        if !any {
            no_data(&mut scene, &plot, frame.sizes.label);
        }
    }
    Ok(scene)
}

fn check(figure: &Figure) -> Result<(), Error> {
    let refuse = |reason: &str| Err(Error::Figure { reason: reason.into() });
    if figure.panels.is_empty() {
        return refuse("it has no panels");
    }
    if figure.columns == 0 {
        return refuse("it has 0 columns, expected at least 1");
    }
    let (width, height) = figure.panel_size_px;
    let (cells, largest) = (figure.panels.len().max(figure.columns) as u64, u128::from(LARGEST_PX));
    if u128::from(width) * u128::from(height) * u128::from(cells) > largest {
        return refuse(&format!("{cells} panels of {width} × {height} pixels are more than {LARGEST_PX} pixels"));
    }
    for panel in &figure.panels {
        let panel_error = |reason| Error::Panel { panel: panel.title.clone(), reason };
        panel.chart.plot().check().map_err(panel_error)?;
    }
    Ok(())
}

/// What is named, each name once.
fn entries(figure: &Figure, palette: &Palette) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for entry in figure.panels.iter().flat_map(|p| p.chart.plot().legend(palette)) {
        if !entry.name.trim().is_empty() && !entries.contains(&entry) {
            entries.push(entry);
        }
    }
    entries
}

/// Axes of all panels; labels and names that the neighbour below or on the left repeats are written once.
fn frames(figure: &Figure) -> Vec<Frame> {
    let sides: Vec<Sides> = figure.panels.iter().map(|p| p.chart.plot().sides()).collect();
    let frame = |(i, panel): (usize, &crate::Panel)| {
        let below = sides.get(i + figure.columns);
        let left = if i % figure.columns > 0 { sides.get(i - 1) } else { None };
        let this = &sides[i];
        let unless = |repeated: bool, label: &str| if repeated { String::new() } else { label.to_owned() };
        Frame {
            title: panel.title.clone(),
            x: this.x.clone(),
            y: this.y.clone(),
            x_label: unless(below.is_some_and(|b| b.x_label == this.x_label), &this.x_label),
            y_label: unless(left.is_some_and(|l| l.y_label == this.y_label), &this.y_label),
            x_names: below.is_none_or(|b| b.x != this.x || b.x_label != this.x_label),
            y_names: left.is_none_or(|l| l.y != this.y || l.y_label != this.y_label),
            right: 0.0,
            panel: (f64::from(figure.panel_size_px.0), f64::from(figure.panel_size_px.1)),
            sizes: Sizes::of(f64::from(figure.panel_size_px.0)),
        }
    };
    figure.panels.iter().enumerate().map(frame).collect()
}

/// Room for labels: left and right of each column, above and below each row. All plots have one size.
struct Grid {
    columns: Vec<(f64, f64)>,
    rows: Vec<(f64, f64)>,
    /// Of all panels together.
    size: (f64, f64),
}

impl Grid {
    fn plot_size(&self) -> (f64, f64) {
        let share = |total: f64, sides: &[(f64, f64)], margin: f64| {
            let taken: f64 = sides.iter().map(|(a, b)| a + b + 2.0 * margin).sum();
            (total - taken) / sides.len() as f64
        };
        (share(self.size.0, &self.columns, MARGIN), share(self.size.1, &self.rows, MARGIN_ABOVE))
    }

    /// The cell of a panel within its margin, and its plot.
    fn place(&self, index: usize, top: f64) -> (Rect, Rect) {
        let (width, height) = self.plot_size();
        let (column, row) = (index % self.columns.len(), index / self.columns.len());
        let before = |sides: &[(f64, f64)], length: f64, margin: f64| {
            sides.iter().map(|(a, b)| a + b + length + 2.0 * margin).sum::<f64>() + margin
        };
        let left = before(&self.columns[..column], width, MARGIN);
        let above = before(&self.rows[..row], height, MARGIN_ABOVE) + top;
        let (sides, ends) = (self.columns[column], self.rows[row]);
        let plot = Rect {
            left: left + sides.0,
            top: above + ends.0,
            right: left + sides.0 + width,
            bottom: above + ends.0 + height,
        };
        let cell = Rect { left, top: above, right: plot.right + sides.1, bottom: plot.bottom + ends.1 };
        (cell, plot)
    }
}

/// Finds the room for labels. Which ticks fit depends on the room and the room on the ticks: it only grows until all fit.
fn align(figure: &Figure, frames: &mut [Frame]) -> Result<Grid, Error> {
    let (width, height) = (f64::from(figure.panel_size_px.0), f64::from(figure.panel_size_px.1));
    let rows = figure.panels.len().div_ceil(figure.columns);
    let none = (0.0, 0.0);
    let size = (width * figure.columns as f64, height * rows as f64);
    let mut grid = Grid { columns: vec![none; figure.columns], rows: vec![none; rows], size };
    loop {
        let mut grown = false;
        for (i, frame) in frames.iter_mut().enumerate() {
            let plot = grid.plot_size();
            let panel = &figure.panels[i];
            if plot.0 < SMALLEST_PLOT_PX.0 || plot.1 < SMALLEST_PLOT_PX.1 {
                let (width_px, height_px) = (plot.0.max(0.0), plot.1.max(0.0));
                return Err(Error::TooSmall { panel: panel.title.clone(), width_px, height_px });
            }
            frame.right = panel.chart.plot().right(plot, &frame.sizes);
            let needed = frame.insets(plot, grid.place(i, 0.0).0.width());
            let (column, row) = (&mut grid.columns[i % figure.columns], &mut grid.rows[i / figure.columns]);
            grown |= grow(&mut column.0, needed.left) | grow(&mut column.1, needed.right);
            grown |= grow(&mut row.0, needed.top) | grow(&mut row.1, needed.bottom);
        }
        if !grown {
            break;
        }
    }
    for (i, (frame, panel)) in frames.iter().zip(&figure.panels).enumerate() {
        let cell = grid.place(i, 0.0).0;
        if let Some(reason) = frame.crowded(grid.plot_size(), (cell.width(), cell.height())) {
            return Err(Error::Panel { panel: panel.title.clone(), reason });
        }
    }
    Ok(grid)
}

/// By whole pixels, so that growing ends.
fn grow(inset: &mut f64, needed: f64) -> bool {
    let grows = needed > *inset;
    if grows {
        *inset = needed.ceil();
    }
    grows
}
