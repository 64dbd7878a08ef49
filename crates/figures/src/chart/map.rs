//! Shapes in the plane.

use super::{Plot, Sides, clip, color_name};
use crate::axis::{Ruler, distinct, drawable};
use crate::frame::{Frame, Side};
use crate::legend::{DASHES, Entry, Swatch, marker};
use crate::palette::{Look, Palette, TEXT};
use crate::panel::{Axis, Draw, Map, Outline};
use crate::scene::{Align, Point, Rect, Scene, Text};

/// From the corner of the plot to the bar of the scale, and half the height of its ends.
const BAR: (f64, f64) = (10.0, 3.0);
/// Around shapes where the map has no limits, as a share of their extent.
const MARGIN: f64 = 0.05;

/// From values to pixels, with one scale for both axes and the middle in the middle.
struct Projection {
    pixels_a_unit: f64,
    /// Values in the middle of the plot.
    middle: Point,
    center: Point,
}

impl Projection {
    fn new((x, y): (Limits, Limits), plot: &Rect) -> Self {
        let pixels_a_unit = (plot.width() / (x.1 - x.0)).min(plot.height() / (y.1 - y.0));
        let center = ((plot.left + plot.right) / 2.0, (plot.top + plot.bottom) / 2.0);
        Self { pixels_a_unit, middle: ((x.0 + x.1) / 2.0, (y.0 + y.1) / 2.0), center }
    }

    fn at(&self, (x, y): Point) -> Option<Point> {
        let place = |value: f64, middle: f64| drawable(value).then_some((value - middle) * self.pixels_a_unit);
        Some((self.center.0 + place(x, self.middle.0)?, self.center.1 - place(y, self.middle.1)?))
    }
}

type Limits = (f64, f64);

impl Map {
    /// Lowest and highest values of x and of y.
    fn extent(&self) -> Option<(Limits, Limits)> {
        if self.limits.is_some() {
            return self.limits;
        }
        let points = || self.shapes.iter().flat_map(|s| &s.points).filter(|p| drawable(p.0) && drawable(p.1));
        let around = |value: fn(&Point) -> f64| {
            let low = points().map(value).fold(f64::INFINITY, f64::min);
            let high = points().map(value).fold(f64::NEG_INFINITY, f64::max);
            (low <= high).then(|| {
                let margin = if distinct(low, high) { MARGIN * (high - low) } else { 0.5 };
                (low - margin, high + margin)
            })
        };
        Some((around(|p| p.0)?, around(|p| p.1)?))
    }

    fn draw_scale(&self, scene: &mut Scene, projection: &Projection, frame: &Frame, plot: &Rect) {
        let Some((length, label)) = &self.scale_bar else { return };
        let (left, y) = (plot.left + BAR.0, plot.bottom - BAR.0);
        let right = left + length * projection.pixels_a_unit;
        if right > plot.right {
            return;
        }
        scene.line(vec![(left, y), (right, y)], TEXT, 1.5);
        for x in [left, right] {
            scene.line(vec![(x, y - BAR.1), (x, y + BAR.1)], TEXT, 1.5);
        }
        let size = frame.sizes.tick;
        let at = (right + 5.0, y);
        scene.text(Text { text: label.clone(), at, size, align: Align::Start, turned: false, color: TEXT });
    }
}

impl Plot for Map {
    fn check(&self) -> Result<(), String> {
        if let Some((x, y)) = self.limits {
            for (name, (low, high)) in [("x", x), ("y", y)] {
                if !(drawable(low) && drawable(high) && distinct(low, high)) {
                    return Err(format!("limits of {name} must be finite and ascend, not {low} to {high}"));
                }
            }
        }
        for shape in &self.shapes {
            if let Draw::Area { opacity } = shape.draw
                && !(0.0..=1.0).contains(&opacity)
            {
                return Err(format!("the opacity of `{}` must be 0 to 1, not {opacity}", shape.name));
            }
        }
        match &self.scale_bar {
            Some((length, _)) if !(drawable(*length) && *length > 0.0) => {
                Err(format!("the bar of the scale must have a positive length, not {length}"))
            }
            _ => Ok(()),
        }
    }

    fn names(&self) -> Vec<&str> {
        self.shapes.iter().map(|s| color_name(&s.name, &s.like)).collect()
    }

    fn legend(&self, palette: &Palette) -> Vec<Entry> {
        let entry = |s: &Outline| {
            let look = palette.look(color_name(&s.name, &s.like));
            let swatch = match s.draw {
                // Areas lie over each other: the legend has the colour at half its strength.
                Draw::Area { .. } => Swatch::Fill(look.color.mixed(crate::palette::WHITE, 0.5)),
                Draw::Line => Swatch::Line { look, dashed: false, marked: false },
                Draw::Dashed => Swatch::Line { look, dashed: true, marked: false },
                Draw::Markers => Swatch::Marker { look, open: false },
            };
            Entry { name: s.name.clone(), swatch }
        };
        self.shapes.iter().map(entry).collect()
    }

    /// Nothing is written beside a map: its scale is in it.
    fn sides(&self) -> Sides {
        let empty = || Side::Numbers(Ruler::around(&Axis::default(), std::iter::empty(), 0.0));
        Sides { x: empty(), y: empty(), x_label: String::new(), y_label: String::new() }
    }

    fn draw(&self, scene: &mut Scene, frame: &Frame, plot: &Rect, palette: &Palette) -> bool {
        let Some(extent) = self.extent() else { return false };
        let projection = Projection::new(extent, plot);
        for shape in &self.shapes {
            let look = palette.look(color_name(&shape.name, &shape.like));
            draw_shape(shape, look, &projection, scene, frame, plot);
        }
        self.draw_scale(scene, &projection, frame, plot);
        frame.outline(scene, plot);
        true
    }
}

fn draw_shape(shape: &Outline, look: Look, projection: &Projection, scene: &mut Scene, frame: &Frame, plot: &Rect) {
    let points: Vec<Point> = shape.points.iter().filter_map(|p| projection.at(*p)).collect();
    match shape.draw {
        Draw::Area { opacity } => scene.area(clip::polygon(&points, plot), look.color, opacity),
        Draw::Line => clip::line(&points, plot).into_iter().for_each(|l| scene.line(l, look.color, frame.sizes.line)),
        Draw::Dashed => {
            let lines = clip::line(&points, plot);
            lines.iter().for_each(|line| scene.dashed(line, look.color, frame.sizes.line, DASHES));
        }
        Draw::Markers => {
            for point in points.into_iter().filter(|p| clip::contains(plot, *p)) {
                marker(scene, point, frame.sizes.marker, look, false);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_stays_a_square_in_the_middle_whatever_the_plot() {
        let plot = Rect { left: 10.0, top: 20.0, right: 210.0, bottom: 120.0 };
        let map = Map { shapes: vec![outline(&[(0.4, -0.1), (0.6, -0.1), (0.6, 0.1), (0.4, 0.1)])], ..Map::default() };
        let projection = Projection::new(map.extent().unwrap(), &plot);
        let corner = projection.at((0.6, 0.1)).unwrap();
        // 0.2 and a twentieth on each side fill the height of 100; x is right, y up.
        let half = 0.1 / 0.22 * 100.0;
        assert!((corner.0 - (110.0 + half)).abs() < 1e-9 && (corner.1 - (70.0 - half)).abs() < 1e-9, "{corner:?}");
        assert_eq!(projection.at((0.5, f64::NAN)), None);
    }

    #[test]
    fn without_shapes_or_with_one_point_it_is_drawn() {
        assert!(Map::default().extent().is_none());
        let map = Map { shapes: vec![outline(&[(1.0, 2.0)])], ..Map::default() };
        assert_eq!(map.extent(), Some(((0.5, 1.5), (1.5, 2.5))));
    }

    #[test]
    fn what_cannot_be_drawn_is_said() {
        let limits = Some(((0.0, 1.0), (1.0, 1.0)));
        assert!(Map { limits, ..Map::default() }.check().unwrap_err().contains("limits of y"));
        let shape = Outline { draw: Draw::Area { opacity: 1.5 }, ..outline(&[]) };
        assert!(Map { shapes: vec![shape], ..Map::default() }.check().unwrap_err().contains("opacity"));
        let scale_bar = Some((0.0, "0 m".into()));
        assert!(Map { scale_bar, ..Map::default() }.check().unwrap_err().contains("positive length"));
    }

    fn outline(points: &[Point]) -> Outline {
        Outline { name: "box".into(), points: points.to_vec(), ..Outline::default() }
    }
}
