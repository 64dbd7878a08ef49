//! Counts per bin.

use super::{Plot, Sides, check_limits, check_references, draw_reference, reference_entries};
use crate::axis::{Ruler, drawable};
use crate::frame::{Frame, Side};
use crate::legend::{Entry, Swatch};
use crate::palette::{Color, Palette, VERMILLION, WHITE};
use crate::panel::{Axis, Histogram, Reference, Scale};
use crate::scene::{Rect, Scene};

impl Histogram {
    fn edges_axis(&self) -> Axis {
        Axis { limits: Some(self.edges), ..self.x.clone() }
    }

    fn outside(&self, count: f64) -> bool {
        self.expected.as_ref().is_some_and(|e| count < e.low || count > e.high)
    }

    fn fill(&self, palette: &Palette) -> Color {
        palette.look(&self.name).color.mixed(WHITE, 0.35)
    }

    fn expected(&self) -> &[Reference] {
        self.expected.as_slice()
    }
}

impl Plot for Histogram {
    fn check(&self) -> Result<(), String> {
        check_limits(&self.edges_axis())?;
        check_limits(&self.y)?;
        check_references(self.expected())?;
        if self.x.scale == Scale::Log || self.y.scale == Scale::Log {
            return Err("a histogram has linear axes: its bins are equally wide and its bars start at zero".into());
        }
        match self.counts.iter().find(|c| **c < 0.0) {
            Some(count) => Err(format!("counts must not be negative, not {count}")),
            None if self.counts.is_empty() => Err("a histogram needs at least one bin".into()),
            None => Ok(()),
        }
    }

    fn names(&self) -> Vec<&str> {
        vec![&self.name]
    }

    fn legend(&self, palette: &Palette) -> Vec<Entry> {
        let mut entries = vec![Entry { name: self.name.clone(), swatch: Swatch::Fill(self.fill(palette)) }];
        if let Some(expected) = &self.expected
            && !expected.name.is_empty()
        {
            entries.extend(reference_entries(self.expected()));
            let name = if self.name.is_empty() { "outside".into() } else { format!("{}, outside", self.name) };
            entries.push(Entry { name, swatch: Swatch::Fill(VERMILLION) });
        }
        entries
    }

    fn sides(&self) -> Sides {
        let edges = [self.edges.0, self.edges.1];
        let expected = self.expected.iter().flat_map(|e| [e.low, e.high]);
        Sides {
            x: Side::Numbers(Ruler::around(&self.edges_axis(), edges.into_iter(), 0.0)),
            y: Side::Numbers(Ruler::from_zero(&self.y, self.counts.iter().copied().chain(expected))),
            x_label: self.x.label.clone(),
            y_label: self.y.label.clone(),
        }
    }

    fn draw(&self, scene: &mut Scene, frame: &Frame, plot: &Rect, palette: &Palette) -> bool {
        let bin = (self.edges.1 - self.edges.0) / self.counts.len() as f64;
        for (i, count) in self.counts.iter().enumerate().filter(|(_, c)| drawable(**c)) {
            let left = self.edges.0 + i as f64 * bin;
            let ends = (frame.at(plot, left, *count), frame.at(plot, left + bin, 0.0));
            let (Some((left, top)), Some((right, bottom))) = ends else { continue };
            let gap = if right - left > 5.0 { 0.5 } else { 0.0 };
            let bar = Rect {
                left: left + gap,
                top: top.clamp(plot.top, plot.bottom),
                right: right - gap,
                bottom: bottom.clamp(plot.top, plot.bottom),
            };
            let color = if self.outside(*count) { VERMILLION } else { self.fill(palette) };
            scene.area(bar.corners(), color, 1.0);
        }
        if let Some(expected) = &self.expected {
            draw_reference(scene, frame, plot, expected, true);
        }
        self.counts.iter().any(|c| drawable(*c))
    }
}
