//! A table of colours.

use super::{Plot, Sides, check_limits};
use crate::axis::{Ruler, distinct, drawable, number};
use crate::frame::{Frame, Side, Sizes};
use crate::legend::Entry;
use crate::palette::{Color, FRAME, Palette, TEXT, WHITE, heat};
use crate::panel::{Axis, Heat};
use crate::scene::{Align, Rect, Scene, Text};
use crate::text::{LINE, width};

/// The bar of colours: its distance from the cells and its width.
const BAR: (f64, f64) = (10.0, 12.0);
const SMALLEST_NUMBER: f64 = 7.5;
const STEPS: usize = 64;

impl Heat {
    fn ruler(&self) -> Ruler {
        let axis = Axis { limits: self.limits, ..Axis::new(self.value_label.clone()) };
        let values = || self.values.iter().flatten().copied();
        if values().any(|v| v < 0.0) {
            Ruler::around(&axis, values(), 0.0)
        } else {
            let highest = values().filter(|v| drawable(*v)).fold(0.0, f64::max);
            let limits = self.limits.or(distinct(0.0, highest).then_some((0.0, highest)));
            Ruler::around(&Axis { limits, ..axis }, values(), 0.0)
        }
    }

    fn cell(&self, plot: (f64, f64)) -> (f64, f64) {
        (plot.0 / self.columns.len() as f64, plot.1 / self.rows.len() as f64)
    }

    /// The size of numbers that fits in cells, if they are wanted.
    fn number_size(&self, plot: (f64, f64), sizes: &Sizes) -> Option<f64> {
        let digits = self.digits?;
        let cell = self.cell(plot);
        let drawn = self.values.iter().flatten().filter(|v| drawable(**v));
        let widest = drawn.map(|v| width(&number(*v, digits), 1.0)).fold(0.1, f64::max);
        let size = sizes.tick.min((cell.0 - 4.0) / widest).min((cell.1 - 2.0) / LINE);
        (size >= SMALLEST_NUMBER).then_some(size)
    }

    fn bar_ticks(ruler: &Ruler, height: f64, sizes: &Sizes) -> Vec<crate::axis::Tick> {
        ruler.ticks(((height / (2.4 * sizes.tick)) as usize).clamp(2, 6))
    }

    fn draw_bar(&self, scene: &mut Scene, plot: &Rect, sizes: &Sizes) {
        let ruler = self.ruler();
        let left = plot.right + BAR.0;
        let bar = Rect { left, right: left + BAR.1, ..*plot };
        let step = bar.height() / STEPS as f64;
        for i in 0..STEPS {
            let bottom = bar.bottom - i as f64 * step;
            let color = heat((i as f64 + 0.5) / STEPS as f64);
            scene.area(Rect { top: bottom - step, bottom, ..bar }.corners(), color, 1.0);
        }
        let mut corners = bar.corners();
        corners.push(corners[0]);
        scene.line(corners, FRAME, 1.0);
        let text = Text {
            text: String::new(),
            at: (0.0, 0.0),
            size: sizes.tick,
            align: Align::Start,
            turned: false,
            color: TEXT,
        };
        let mut widest: f64 = 0.0;
        for tick in Self::bar_ticks(&ruler, bar.height(), sizes) {
            let Some(share) = ruler.share(tick.value) else { continue };
            let y = bar.bottom - share * bar.height();
            scene.line(vec![(bar.right, y), (bar.right + 3.0, y)], FRAME, 1.0);
            widest = widest.max(width(&tick.label, sizes.tick));
            scene.text(Text { text: tick.label, at: (bar.right + 5.0, y), ..text.clone() });
        }
        let at = (bar.right + 7.0 + widest + sizes.label * LINE / 2.0, (bar.top + bar.bottom) / 2.0);
        let like = Text { size: sizes.label, turned: true, align: Align::Middle, at, ..text };
        scene.text(Text { text: self.value_label.clone(), ..like });
    }
}

impl Plot for Heat {
    fn check(&self) -> Result<(), String> {
        let axis = Axis { limits: self.limits, ..Axis::new(self.value_label.clone()) };
        check_limits(&axis)?;
        let (rows, columns) = (self.rows.len(), self.columns.len());
        if rows == 0 || columns == 0 {
            return Err("a heat map needs at least one row and one column".into());
        }
        if self.values.len() != rows {
            return Err(format!("{} rows of values for {rows} names of rows", self.values.len()));
        }
        match self.values.iter().position(|r| r.len() != columns) {
            Some(i) => {
                let (found, row) = (self.values[i].len(), &self.rows[i]);
                Err(format!("row `{row}` has {found} values for {columns} names of columns"))
            }
            None => Ok(()),
        }
    }

    fn names(&self) -> Vec<&str> {
        Vec::new()
    }

    fn legend(&self, _palette: &Palette) -> Vec<Entry> {
        Vec::new()
    }

    fn sides(&self) -> Sides {
        Sides {
            x: Side::Names(self.columns.clone()),
            y: Side::Names(self.rows.clone()),
            x_label: self.column_label.clone(),
            y_label: self.row_label.clone(),
        }
    }

    fn right(&self, plot: (f64, f64), sizes: &Sizes) -> f64 {
        if self.number_size(plot, sizes).is_some() {
            return 0.0;
        }
        let ticks = Self::bar_ticks(&self.ruler(), plot.1, sizes);
        let widest = ticks.iter().map(|t| width(&t.label, sizes.tick)).fold(0.0, f64::max);
        let label = if self.value_label.is_empty() { 0.0 } else { sizes.label * LINE + 2.0 };
        BAR.0 + BAR.1 + 5.0 + widest + label
    }

    fn draw(&self, scene: &mut Scene, frame: &Frame, plot: &Rect, _palette: &Palette) -> bool {
        let ruler = self.ruler();
        let (cell_width, cell_height) = self.cell((plot.width(), plot.height()));
        let size = self.number_size((plot.width(), plot.height()), &frame.sizes);
        for (row, values) in self.values.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                let (left, top) = (plot.left + column as f64 * cell_width, plot.top + row as f64 * cell_height);
                let cell = Rect { left, top, right: left + cell_width, bottom: top + cell_height };
                let Some(share) = ruler.share(*value) else {
                    scene.area(cell.corners(), Color(0xee, 0xee, 0xee), 1.0);
                    scene.line(vec![(cell.left, cell.bottom), (cell.right, cell.top)], FRAME, 1.0);
                    continue;
                };
                scene.area(cell.corners(), heat(share), 1.0);
                if let (Some(size), Some(digits)) = (size, self.digits) {
                    let at = (left + cell_width / 2.0, top + cell_height / 2.0);
                    let color = if share > 0.5 { WHITE } else { TEXT };
                    let text = number(*value, digits);
                    scene.text(Text { text, at, size, align: Align::Middle, turned: false, color });
                }
            }
        }
        if cell_width.min(cell_height) > 8.0 {
            for column in 1..self.columns.len() {
                let x = plot.left + column as f64 * cell_width;
                scene.line(vec![(x, plot.top), (x, plot.bottom)], WHITE, 1.0);
            }
            for row in 1..self.rows.len() {
                let y = plot.top + row as f64 * cell_height;
                scene.line(vec![(plot.left, y), (plot.right, y)], WHITE, 1.0);
            }
        }
        frame.outline(scene, plot);
        if size.is_none() {
            self.draw_bar(scene, plot, &frame.sizes);
        }
        true
    }
}
