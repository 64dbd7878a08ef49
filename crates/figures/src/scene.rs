//! A picture as a list of shapes in pixels, between layout and the backends: tests look at it, both formats draw it.

use crate::palette::Color;
#[cfg(test)]
use crate::text::width;
use crate::text::{BASELINE, LINE};

/// Pixels from the left and from the top.
pub(crate) type Point = (f64, f64);

/// An axis-parallel rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
}

impl Rect {
    pub(crate) fn width(&self) -> f64 {
        self.right - self.left
    }

    pub(crate) fn height(&self) -> f64 {
        self.bottom - self.top
    }

    pub(crate) fn corners(&self) -> Vec<Point> {
        vec![(self.left, self.top), (self.right, self.top), (self.right, self.bottom), (self.left, self.bottom)]
    }
}

/// Where the anchor of a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Where it begins.
    Start,
    /// In its middle.
    Middle,
    /// Where it ends.
    End,
}

/// One line of text. `at` is on the middle of its height (for a turned text: of its width), `align` says where along it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Text {
    pub(crate) text: String,
    pub(crate) at: Point,
    pub(crate) size: f64,
    pub(crate) align: Align,
    pub(crate) turned: bool,
    pub(crate) color: Color,
}

impl Text {
    /// The corner that the backends take: on top of the line, at the anchor.
    pub(crate) fn corner(&self) -> Point {
        // Capitals and digits are 0.73 high: their middle is on `at`.
        let up = (BASELINE - 0.365) * self.size;
        if self.turned { (self.at.0 - up, self.at.1) } else { (self.at.0, self.at.1 - up) }
    }

    /// What the text covers.
    #[cfg(test)]
    pub(crate) fn bounds(&self) -> Rect {
        let length = width(&self.text, self.size);
        let start = match self.align {
            Align::Start => 0.0,
            Align::Middle => -length / 2.0,
            Align::End => -length,
        };
        let (x, y) = self.corner();
        let height = self.size * (LINE - 0.25);
        if self.turned {
            Rect { left: x, top: y - start - length, right: x + height, bottom: y - start }
        } else {
            Rect { left: x + start, top: y, right: x + start + length, bottom: y + height }
        }
    }
}

/// One shape. Lines are opaque, as a line that crosses itself must not darken; areas may be translucent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    Area { points: Vec<Point>, color: Color, opacity: f64 },
    Line { points: Vec<Point>, color: Color, width: f64 },
    Disc { center: Point, radius: f64, color: Color },
    Text(Text),
}

/// Shapes in the order of drawing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scene {
    pub(crate) width_px: u32,
    pub(crate) height_px: u32,
    pub(crate) shapes: Vec<Shape>,
}

impl Scene {
    pub(crate) fn area(&mut self, points: Vec<Point>, color: Color, opacity: f64) {
        if points.len() > 2 {
            self.shapes.push(Shape::Area { points, color, opacity });
        }
    }

    pub(crate) fn line(&mut self, points: Vec<Point>, color: Color, width: f64) {
        if points.len() > 1 {
            self.shapes.push(Shape::Line { points, color, width });
        }
    }

    pub(crate) fn disc(&mut self, center: Point, radius: f64, color: Color) {
        self.shapes.push(Shape::Disc { center, radius, color });
    }

    /// Several lines of text one below the other (turned: one right of the other), around `at`.
    pub(crate) fn lines_of_text(&mut self, lines: &[String], like: &Text) {
        let pitch = like.size * LINE;
        for (i, line) in lines.iter().enumerate() {
            let shift = (i as f64 - (lines.len() as f64 - 1.0) / 2.0) * pitch;
            let (x, y) = like.at;
            let at = if like.turned { (x + shift, y) } else { (x, y + shift) };
            self.text(Text { text: line.clone(), at, ..like.clone() });
        }
    }

    /// Control characters, which XML forbids, become spaces.
    pub(crate) fn text(&mut self, mut text: Text) {
        text.text = text.text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        if !text.text.trim().is_empty() {
            self.shapes.push(Shape::Text(text));
        }
    }

    /// A line of dashes `on` long with gaps of `off`.
    pub(crate) fn dashed(&mut self, points: &[Point], color: Color, width: f64, (on, off): (f64, f64)) {
        let mut dash: Vec<Point> = points.first().copied().into_iter().collect();
        let mut left = on;
        let mut drawing = true;
        for pair in points.windows(2) {
            let (mut from, to) = (pair[0], pair[1]);
            loop {
                let length = (to.0 - from.0).hypot(to.1 - from.1);
                if length <= left {
                    left -= length;
                    if drawing {
                        dash.push(to);
                    }
                    break;
                }
                let share = left / length;
                from = (from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share);
                if drawing {
                    dash.push(from);
                    self.line(std::mem::take(&mut dash), color, width);
                } else {
                    dash = vec![from];
                }
                drawing = !drawing;
                left = if drawing { on } else { off };
            }
        }
        if drawing {
            self.line(dash, color, width);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::BLUE;

    #[test]
    fn dashes_cover_their_share_of_a_line_around_corners() {
        let mut scene = Scene { width_px: 10, height_px: 10, shapes: Vec::new() };
        scene.dashed(&[(0.0, 0.0), (5.0, 0.0), (5.0, 5.0)], BLUE, 1.0, (3.0, 1.0));
        let ends: Vec<_> = scene
            .shapes
            .iter()
            .map(|s| match s {
                Shape::Line { points, .. } => points.clone(),
                other => panic!("{other:?}"),
            })
            .collect();
        let expected =
            [vec![(0.0, 0.0), (3.0, 0.0)], vec![(4.0, 0.0), (5.0, 0.0), (5.0, 2.0)], vec![(5.0, 3.0), (5.0, 5.0)]];
        assert_eq!(ends, expected);
    }
}
