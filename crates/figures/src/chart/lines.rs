//! Values over a number.

use super::{Plot, Sides, check_limits, check_references, clip, color_name, draw_reference, reference_entries};
use crate::axis::{Ruler, SMALLEST};
use crate::frame::{Frame, Side};
use crate::legend::{DASHES, Entry, Swatch, marker};
use crate::palette::{Look, Palette};
use crate::panel::{Lines, Scale, Series, Stroke};
use crate::scene::{Point, Rect, Scene};

impl Plot for Lines {
    fn check(&self) -> Result<(), String> {
        check_limits(&self.x)?;
        check_limits(&self.y)?;
        check_references(&self.references)?;
        for series in &self.series {
            if let Some(pair) = series.band.windows(2).find(|p| p[0].0 > p[1].0) {
                let (a, b) = (pair[0].0, pair[1].0);
                return Err(format!("the band of `{}` must ascend in x, but {b} follows {a}", series.name));
            }
        }
        Ok(())
    }

    fn names(&self) -> Vec<&str> {
        self.series.iter().map(|s| color_name(&s.name, &s.like)).collect()
    }

    fn legend(&self, palette: &Palette) -> Vec<Entry> {
        let entry = |s: &Series| {
            let look = palette.look(color_name(&s.name, &s.like));
            let swatch = match s.stroke {
                Stroke::Markers => Swatch::Marker { look, open: false },
                stroke => Swatch::Line { look, dashed: dashed(stroke, look), marked: stroke == Stroke::Marked },
            };
            Entry { name: s.name.clone(), swatch }
        };
        self.series.iter().map(entry).chain(reference_entries(&self.references)).collect()
    }

    fn sides(&self) -> Sides {
        let points = || self.series.iter().flat_map(|s| &s.points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let bands = || self.series.iter().flat_map(|s| &s.band);
        let xs = points().map(|p| p.0).chain(bands().map(|b| b.0));
        let references = self.references.iter().flat_map(|r| [r.low, r.high]);
        let ys = points().map(|p| p.1).chain(bands().flat_map(|b| [b.1, b.2])).chain(references);
        Sides {
            x: Side::Numbers(Ruler::around(&self.x, xs, 0.02)),
            y: Side::Numbers(Ruler::around(&self.y, ys, 0.06)),
            x_label: self.x.label.clone(),
            y_label: self.y.label.clone(),
        }
    }

    fn draw(&self, scene: &mut Scene, frame: &Frame, plot: &Rect, palette: &Palette) -> bool {
        for reference in &self.references {
            draw_reference(scene, frame, plot, reference, true);
        }
        let look = |s: &Series| palette.look(color_name(&s.name, &s.like));
        for series in &self.series {
            for area in bands(series, frame, plot, self.y.scale) {
                scene.area(clip::polygon(&area, plot), look(series).color, 0.2);
            }
        }
        let mut any = false;
        for series in &self.series {
            any |= draw_series(series, look(series), scene, frame, plot);
        }
        any
    }
}

fn dashed(stroke: Stroke, look: Look) -> bool {
    stroke == Stroke::Dashed || look.repeats()
}

/// The outlines of a series' band, one for each stretch without gaps.
fn bands(series: &Series, frame: &Frame, plot: &Rect, scale: Scale) -> Vec<Vec<Point>> {
    // A logarithmic axis has no zero: what reaches it reaches the bottom.
    let bottom = |low: f64| if scale == Scale::Log && low < SMALLEST { SMALLEST } else { low };
    let ends = |&(x, low, high): &(f64, f64, f64)| Some((frame.at(plot, x, bottom(low))?, frame.at(plot, x, high)?));
    let placed: Vec<Option<(Point, Point)>> = series.band.iter().map(ends).collect();
    let stretches = placed.split(Option::is_none).filter(|s| s.len() > 1);
    let outline = |stretch: &[Option<(Point, Point)>]| {
        let low = stretch.iter().flatten().map(|ends| ends.0);
        let high = stretch.iter().flatten().map(|ends| ends.1).rev();
        low.chain(high).collect()
    };
    stretches.map(outline).collect()
}

fn draw_series(series: &Series, look: Look, scene: &mut Scene, frame: &Frame, plot: &Rect) -> bool {
    let placed: Vec<Option<Point>> = series.points.iter().map(|&(x, y)| frame.at(plot, x, y)).collect();
    for stretch in placed.split(Option::is_none) {
        let points: Vec<Point> = stretch.iter().flatten().copied().collect();
        if series.stroke != Stroke::Markers {
            for part in clip::line(&points, plot) {
                if dashed(series.stroke, look) {
                    scene.dashed(&part, look.color, frame.sizes.line, DASHES);
                } else {
                    scene.line(part, look.color, frame.sizes.line);
                }
            }
        }
        // A point between gaps has no line: a dot keeps it visible.
        let alone = points.len() == 1;
        let marked = matches!(series.stroke, Stroke::Marked | Stroke::Markers);
        for point in points.into_iter().filter(|p| clip::contains(plot, *p)) {
            if marked {
                marker(scene, point, frame.sizes.marker, look, false);
            } else if alone {
                scene.disc(point, frame.sizes.line, look.color);
            }
        }
    }
    placed.iter().any(Option::is_some)
}
