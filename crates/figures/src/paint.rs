//! A scene through plotters' backends. They count in whole units and do not smooth thick lines, so both draw on a grid
//! of four units a pixel: SVG says so in its view box, PNG averages.

use plotters_backend::text_anchor::HPos;
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, DrawingBackend, DrawingErrorKind};
use plotters_bitmap::BitMapBackend;
use plotters_svg::SVGBackend;

use crate::Error;
use crate::palette::Color;
use crate::scene::{Align, Point, Scene, Shape};
use crate::text::Style;

/// Units a pixel.
const GRID: u32 = 4;

/// The picture as text.
pub(crate) fn svg(scene: &Scene) -> Result<String, Error> {
    let mut out = String::new();
    let (width, height) = (scene.width_px * GRID, scene.height_px * GRID);
    let mut backend = SVGBackend::with_string(&mut out, (width, height));
    paint(&mut backend, scene, Joints::Native)?;
    backend.present().map_err(refused)?;
    drop(backend);
    // The size on the page, before the view box.
    let written = format!("<svg width=\"{width}\" height=\"{height}\"");
    let Some(rest) = out.strip_prefix(&written) else {
        return Err(Error::Draw { reason: format!("the SVG does not start with {written}") });
    };
    Ok(format!("<svg width=\"{}\" height=\"{}\"{rest}", scene.width_px, scene.height_px))
}

/// The picture as PNG, 8 bits a channel, without an alpha channel.
pub(crate) fn png(scene: &Scene) -> Result<Vec<u8>, Error> {
    let pixels = pixels(scene)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, scene.width_px, scene.height_px);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let encode = |source| Error::Encode { source };
    let mut writer = encoder.write_header().map_err(encode)?;
    writer.write_image_data(&pixels).map_err(encode)?;
    writer.finish().map_err(encode)?;
    Ok(bytes)
}

/// The picture's pixels, `[height, width, 3]`: red, green and blue from 0 to 255.
pub(crate) fn pixels(scene: &Scene) -> Result<Vec<u8>, Error> {
    let (width, height) = (scene.width_px * GRID, scene.height_px * GRID);
    let mut fine = vec![0xff; width as usize * height as usize * 3];
    let mut backend = BitMapBackend::with_buffer(&mut fine, (width, height));
    paint(&mut backend, scene, Joints::Discs)?;
    backend.present().map_err(refused)?;
    drop(backend);
    Ok(averaged(&fine, width as usize))
}

/// Means over squares of `GRID` units.
fn averaged(fine: &[u8], width: usize) -> Vec<u8> {
    let side = GRID as usize;
    let mut pixels = Vec::with_capacity(fine.len() / (side * side));
    let mut sums = vec![0_u32; width / side * 3];
    for rows in fine.chunks_exact(width * 3 * side) {
        sums.fill(0);
        for row in rows.chunks_exact(width * 3) {
            for (sum, square) in sums.chunks_exact_mut(3).zip(row.chunks_exact(3 * side)) {
                for unit in square.chunks_exact(3) {
                    for (sum, channel) in sum.iter_mut().zip(unit) {
                        *sum += u32::from(*channel);
                    }
                }
            }
        }
        let area = GRID * GRID;
        pixels.extend(sums.iter().map(|sum| ((sum + area / 2) / area) as u8));
    }
    pixels
}

/// Who joins the pieces of a line.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Joints {
    /// The viewer.
    Native,
    /// We, with discs: the bitmap would fill one outline of all pieces, with holes where it crosses itself.
    Discs,
}

/// A colour and a line width.
struct Stroke(BackendColor, u32);

impl BackendStyle for Stroke {
    fn color(&self) -> BackendColor {
        self.0
    }

    fn stroke_width(&self) -> u32 {
        self.1
    }
}

fn units(pixels: f64) -> i32 {
    (pixels * f64::from(GRID)).round() as i32
}

fn place(point: Point) -> BackendCoord {
    (units(point.0), units(point.1))
}

fn ink(color: Color, opacity: f64) -> BackendColor {
    BackendColor { rgb: (color.0, color.1, color.2), alpha: opacity }
}

#[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
fn refused<E: std::error::Error + Send + Sync>(error: DrawingErrorKind<E>) -> Error {
    Error::Draw { reason: error.to_string() }
}

fn paint<B: DrawingBackend>(backend: &mut B, scene: &Scene, joints: Joints) -> Result<(), Error> {
    let (width, height) = (scene.width_px * GRID, scene.height_px * GRID);
    let page = (width as i32, height as i32);
    backend.draw_rect((0, 0), page, &ink(crate::palette::WHITE, 1.0), true).map_err(refused)?;
    for shape in &scene.shapes {
        match shape {
            Shape::Area { points, color, opacity } => {
                let points = points.iter().copied().map(place);
                backend.fill_polygon(points, &ink(*color, *opacity)).map_err(refused)?;
            }
            Shape::Line { points, color, width } => {
                let mut points: Vec<BackendCoord> = points.iter().copied().map(place).collect();
                points.dedup();
                let stroke = Stroke(ink(*color, 1.0), units(*width).max(1) as u32);
                line(backend, &points, &stroke, joints).map_err(refused)?;
            }
            Shape::Disc { center, radius, color } => {
                let radius = units(*radius).max(1) as u32;
                backend.draw_circle(place(*center), radius, &ink(*color, 1.0), true).map_err(refused)?;
            }
            Shape::Text(text) => {
                let anchor = match text.align {
                    Align::Start => HPos::Left,
                    Align::Middle => HPos::Center,
                    Align::End => HPos::Right,
                };
                let size = text.size * f64::from(GRID);
                let style = Style { size, color: ink(text.color, 1.0), anchor, turned: text.turned };
                backend.draw_text(&text.text, &style, place(text.corner())).map_err(refused)?;
            }
        }
    }
    Ok(())
}

fn line<B: DrawingBackend>(
    backend: &mut B,
    points: &[BackendCoord],
    stroke: &Stroke,
    joints: Joints,
) -> Result<(), DrawingErrorKind<B::ErrorType>> {
    if joints == Joints::Native {
        return backend.draw_path(points.iter().copied(), stroke);
    }
    for pair in points.windows(2) {
        backend.draw_line(pair[0], pair[1], stroke)?;
    }
    if stroke.1 > 2 {
        for joint in points.iter().skip(1).take(points.len().saturating_sub(2)) {
            backend.draw_circle(*joint, stroke.1 / 2, &stroke.0, true)?;
        }
    }
    Ok(())
}
