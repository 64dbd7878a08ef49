//! Values with intervals per category.

use super::{Plot, Sides, check_limits, check_references, clip, color_name, draw_reference, reference_entries};
use crate::axis::{Ruler, drawable};
use crate::frame::{Frame, Side};
use crate::legend::{Entry, Swatch, marker};
use crate::palette::{GRID, Look, Palette, TEXT, WHITE};
use crate::panel::{Direction, Dots, Estimate, Estimates, Mark, Scale};
use crate::scene::{Point, Rect, Scene};

/// Share of a category's slot that its series divide between them.
const USED: f64 = 0.76;

impl Dots {
    fn upwards(&self) -> bool {
        self.direction == Direction::Up
    }

    fn at(&self, frame: &Frame, plot: &Rect, slot: f64, value: f64) -> Option<Point> {
        if self.upwards() { frame.at(plot, slot, value) } else { frame.at(plot, value, slot) }
    }
}

impl Plot for Dots {
    fn check(&self) -> Result<(), String> {
        check_limits(&self.value)?;
        check_references(&self.references)?;
        if self.categories.is_empty() {
            return Err("dots need at least one category".into());
        }
        for series in &self.series {
            let (found, expected) = (series.values.len(), self.categories.len());
            if found != expected {
                return Err(format!("`{}` has {found} values for {expected} categories", series.name));
            }
            if series.mark == Mark::Bar && self.value.scale == Scale::Log {
                return Err(format!("`{}`: bars start at zero, which a logarithmic axis lacks", series.name));
            }
        }
        Ok(())
    }

    fn names(&self) -> Vec<&str> {
        self.series.iter().map(|s| color_name(&s.name, &s.like)).collect()
    }

    fn legend(&self, palette: &Palette) -> Vec<Entry> {
        let entry = |s: &Estimates| {
            let look = palette.look(color_name(&s.name, &s.like));
            let swatch = match s.mark {
                Mark::Bar => Swatch::Fill(look.color.mixed(WHITE, 0.2)),
                mark => Swatch::Marker { look, open: mark == Mark::Open },
            };
            Entry { name: s.name.clone(), swatch }
        };
        self.series.iter().map(entry).chain(reference_entries(&self.references)).collect()
    }

    fn sides(&self) -> Sides {
        let estimates = self.series.iter().flat_map(|s| &s.values).flat_map(|e| [e.value, e.low, e.high]);
        let values = estimates.chain(self.references.iter().flat_map(|r| [r.low, r.high]));
        let ruler = if self.series.iter().any(|s| s.mark == Mark::Bar) {
            Ruler::from_zero(&self.value, values)
        } else {
            Ruler::around(&self.value, values, 0.06)
        };
        let (values, names) = (Side::Numbers(ruler), Side::Names(self.categories.clone()));
        let (value_label, name_label) = (self.value.label.clone(), self.category_label.clone());
        if self.upwards() {
            Sides { x: names, y: values, x_label: name_label, y_label: value_label }
        } else {
            Sides { x: values, y: names, x_label: value_label, y_label: name_label }
        }
    }

    fn draw(&self, scene: &mut Scene, frame: &Frame, plot: &Rect, palette: &Palette) -> bool {
        for slot in 1..self.categories.len() {
            let ends = if self.upwards() {
                frame.x_at(plot, slot as f64).map(|x| [(x, plot.top), (x, plot.bottom)])
            } else {
                frame.y_at(plot, slot as f64).map(|y| [(plot.left, y), (plot.right, y)])
            };
            scene.line(ends.into_iter().flatten().collect(), GRID, 1.0);
        }
        for reference in &self.references {
            draw_reference(scene, frame, plot, reference, self.upwards());
        }
        let lane = USED / self.series.len().max(1) as f64;
        for (i, series) in self.series.iter().enumerate() {
            let look = palette.look(color_name(&series.name, &series.like));
            let middle = (1.0 - USED) / 2.0 + (i as f64 + 0.5) * lane;
            for (category, estimate) in series.values.iter().enumerate() {
                let place = Place { chart: self, frame, plot, slot: category as f64 + middle, lane };
                place.draw(scene, estimate, series.mark, look);
            }
        }
        self.series.iter().flat_map(|s| &s.values).any(|e| drawable(e.value))
    }
}

/// Where one estimate goes.
struct Place<'a> {
    chart: &'a Dots,
    frame: &'a Frame,
    plot: &'a Rect,
    slot: f64,
    lane: f64,
}

impl Place<'_> {
    fn at(&self, slot: f64, value: f64) -> Option<Point> {
        self.chart.at(self.frame, self.plot, slot, value)
    }

    fn draw(&self, scene: &mut Scene, estimate: &Estimate, mark: Mark, look: Look) {
        let Some(center) = self.at(self.slot, estimate.value) else { return };
        if mark == Mark::Bar {
            let half = 0.44 * self.lane;
            let corners = [
                (self.slot - half, 0.0),
                (self.slot + half, 0.0),
                (self.slot + half, estimate.value),
                (self.slot - half, estimate.value),
            ];
            let points: Vec<Point> = corners.into_iter().filter_map(|(s, v)| self.at(s, v)).collect();
            scene.area(clip::polygon(&points, self.plot), look.color.mixed(WHITE, 0.2), 1.0);
        }
        self.interval(scene, estimate, if mark == Mark::Bar { TEXT } else { look.color });
        if mark != Mark::Bar && clip::contains(self.plot, center) {
            let across = self.plot_across() * self.lane / 2.0;
            let radius = self.frame.sizes.marker.min(across.max(2.0));
            marker(scene, center, radius, look, mark == Mark::Open);
        }
    }

    /// Pixels per category.
    fn plot_across(&self) -> f64 {
        let length = if self.chart.upwards() { self.plot.width() } else { self.plot.height() };
        length / self.chart.categories.len() as f64
    }

    /// A line from end to end, with caps at ends inside the plot.
    fn interval(&self, scene: &mut Scene, estimate: &Estimate, color: crate::palette::Color) {
        let (Some(low), Some(high)) = (self.at(self.slot, estimate.low), self.at(self.slot, estimate.high)) else {
            return;
        };
        let Some((from, to)) = clip::segment(low, high, self.plot) else { return };
        let width = 0.75 * self.frame.sizes.line;
        scene.line(vec![from, to], color, width);
        let cap = (self.plot_across() * self.lane / 2.0 - 1.0).clamp(0.0, self.frame.sizes.marker - 0.5);
        let (dx, dy) = if self.chart.upwards() { (cap, 0.0) } else { (0.0, cap) };
        for (end, drawn) in [(low, from), (high, to)] {
            if end == drawn && cap > 0.0 {
                scene.line(vec![(end.0 - dx, end.1 - dy), (end.0 + dx, end.1 + dy)], color, width);
            }
        }
    }
}
