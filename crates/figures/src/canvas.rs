//! A picture that its caller draws, and pictures that follow each other.

use crate::Error;
use crate::chart::clip;
use crate::palette::{Color, WHITE};
use crate::scene::{Align, Rect, Scene, Text};
use crate::text;
use crate::{LARGEST_PX, paint};

/// A picture in pixels from its upper left corner, x to the right and y down, on white. What is drawn later covers what was drawn before.
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    scene: Scene,
    window: Option<Rect>,
}

/// How a text looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Type {
    /// Height of an em, pixels.
    pub size: f64,
    /// Where its place is: start, middle or end of the line.
    pub align: Align,
    /// Colour.
    pub color: Color,
}

impl Canvas {
    /// Empty, of this width and height in pixels.
    ///
    /// # Errors
    /// [`Error::Figure`] without pixels or above [`LARGEST_PX`].
    pub fn new(width_px: u32, height_px: u32) -> Result<Self, Error> {
        let pixels = u64::from(width_px) * u64::from(height_px);
        if pixels == 0 || pixels > LARGEST_PX {
            let reason = format!("{width_px} × {height_px} pixels: expected at least one and at most {LARGEST_PX}");
            return Err(Error::Figure { reason });
        }
        Ok(Self { scene: Scene { width_px, height_px, shapes: Vec::new() }, window: None })
    }

    /// From now on areas and lines are drawn only between this upper left and lower right corner.
    pub fn clip(&mut self, (left, top): (f64, f64), (right, bottom): (f64, f64)) {
        self.window = Some(Rect { left, top, right, bottom });
    }

    /// From now on they are drawn everywhere.
    pub fn unclip(&mut self) {
        self.window = None;
    }

    /// A filled polygon; `opacity` from 0 to 1.
    pub fn area(&mut self, points: Vec<(f64, f64)>, color: Color, opacity: f64) {
        let points = match &self.window {
            Some(window) => clip::polygon(&points, window),
            None => points,
        };
        self.scene.area(points, color, opacity.clamp(0.0, 1.0));
    }

    /// A filled rectangle from its upper left to its lower right corner.
    pub fn rectangle(&mut self, (left, top): (f64, f64), (right, bottom): (f64, f64), color: Color) {
        self.area(vec![(left, top), (right, top), (right, bottom), (left, bottom)], color, 1.0);
    }

    /// A line through points, `width` pixels wide.
    pub fn line(&mut self, points: &[(f64, f64)], color: Color, width: f64) {
        for part in self.parts(points) {
            self.scene.line(part, color, width);
        }
    }

    /// The same in dashes.
    pub fn dashed(&mut self, points: &[(f64, f64)], color: Color, width: f64) {
        for part in self.parts(points) {
            self.scene.dashed(&part, color, width, (3.0 * width, 2.5 * width));
        }
    }

    /// What of a line is within the window.
    fn parts(&self, points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
        match &self.window {
            Some(window) => clip::line(points, window),
            None => vec![points.to_vec()],
        }
    }

    /// A disc.
    pub fn disc(&mut self, center: (f64, f64), radius: f64, color: Color) {
        self.scene.disc(center, radius, color);
    }

    /// A line of text, its middle at the height of `at`.
    pub fn text(&mut self, text: &str, at: (f64, f64), look: Type) {
        let Type { size, align, color } = look;
        self.scene.text(Text { text: text.to_owned(), at, size, align, turned: false, color });
    }

    /// Width of a line of text, pixels.
    #[must_use]
    pub fn text_width(text: &str, size: f64) -> f64 {
        text::width(text, size)
    }

    /// The picture as PNG.
    ///
    /// # Errors
    /// [`Error::Draw`] or [`Error::Encode`] where the libraries refuse.
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        paint::png(&self.scene)
    }
}

/// Pictures of one size, each with the time that it is shown for, ms.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// In their order.
    pub pictures: Vec<(Canvas, u16)>,
}

/// What an animation is encoded from: whole pixels of a rectangle.
struct Patch {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Film {
    /// The film as an animated PNG that begins again and again; a viewer that knows no animation shows the first picture. Equal films give equal
    /// bytes. Colours are rounded to 32 levels a channel, which nobody sees and which halves the file.
    ///
    /// # Errors
    /// [`Error::Figure`] without pictures or for pictures of different sizes; [`Error::Draw`] or [`Error::Encode`] where the libraries refuse.
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        let size = |canvas: &Canvas| (canvas.scene.width_px, canvas.scene.height_px);
        let refuse = |reason: &str| Err(Error::Figure { reason: reason.into() });
        let Some((first, _)) = self.pictures.first() else { return refuse("a film needs a picture") };
        if self.pictures.iter().any(|(canvas, _)| size(canvas) != size(first)) {
            return refuse("the pictures of a film need one size");
        }
        let (width, height) = size(first);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let encode = |source| Error::Encode { source };
        encoder.set_animated(self.pictures.len() as u32, 0).map_err(encode)?;
        let mut writer = encoder.write_header().map_err(encode)?;
        let mut before: Option<Vec<u8>> = None;
        for (canvas, millis) in &self.pictures {
            let mut pixels = paint::pixels(&canvas.scene)?;
            pixels.iter_mut().for_each(|value| *value = rounded(*value));
            writer.set_frame_delay(*millis, 1000).map_err(encode)?;
            let patch = changed(before.as_deref(), &pixels, width as usize, height as usize);
            if before.is_some() {
                // Position and size are checked against each other: begin from the corner.
                writer.reset_frame_position().map_err(encode)?;
                writer.set_frame_dimension(patch.width as u32, patch.height as u32).map_err(encode)?;
                writer.set_frame_position(patch.left as u32, patch.top as u32).map_err(encode)?;
            }
            writer.write_image_data(&cut(&pixels, &patch, width as usize)).map_err(encode)?;
            before = Some(pixels);
        }
        writer.finish().map_err(encode)?;
        Ok(bytes)
    }
}

/// To the nearest of 32 levels from 0 to 255.
fn rounded(value: u8) -> u8 {
    let level = (u32::from(value) * 31 + 127) / 255;
    ((level * 255 + 15) / 31) as u8
}

/// The smallest rectangle that holds all pixels that differ; one pixel where none does, as a frame needs one.
fn changed(before: Option<&[u8]>, now: &[u8], width: usize, height: usize) -> Patch {
    let Some(before) = before else { return Patch { left: 0, top: 0, width, height } };
    let (mut left, mut right, mut top, mut bottom) = (width, 0, height, 0);
    for (y, (old, new)) in before.chunks_exact(3 * width).zip(now.chunks_exact(3 * width)).enumerate() {
        let differs = |x: &usize| old[3 * x..3 * x + 3] != new[3 * x..3 * x + 3];
        if let Some(first) = (0..width).find(differs) {
            let last = (0..width).rev().find(differs).unwrap_or(first);
            (left, right) = (left.min(first), right.max(last));
            (top, bottom) = (top.min(y), y);
        }
    }
    if left > right {
        return Patch { left: 0, top: 0, width: 1, height: 1 };
    }
    Patch { left, top, width: right - left + 1, height: bottom - top + 1 }
}

fn cut(pixels: &[u8], patch: &Patch, width: usize) -> Vec<u8> {
    let rows = pixels.chunks_exact(3 * width).skip(patch.top).take(patch.height);
    rows.flat_map(|row| &row[3 * patch.left..3 * (patch.left + patch.width)]).copied().collect()
}

impl Color {
    /// Text.
    pub const INK: Self = crate::palette::TEXT;
    /// Secondary text and frames.
    pub const SOFT: Self = crate::palette::REFERENCE;
    /// Where nothing is.
    pub const WHITE: Self = WHITE;

    /// A colour of the palette that colour-blind readers tell apart, counted from 0; after the last the first again.
    #[must_use]
    pub fn series(index: usize) -> Self {
        crate::palette::SERIES[index % crate::palette::SERIES.len()]
    }

    /// Between this and white: 0 is this, 1 is white.
    #[must_use]
    pub fn lighter(self, share: f64) -> Self {
        self.mixed(WHITE, share.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(x: f64) -> Canvas {
        let mut canvas = Canvas::new(40, 20).unwrap();
        canvas.rectangle((x, 5.0), (x + 4.0, 9.0), Color::INK);
        canvas
    }

    /// The frames of a film as a viewer puts them together.
    fn shown(bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let (width, height) = (reader.info().width as usize, reader.info().height as usize);
        let count = reader.info().animation_control.unwrap().num_frames;
        let mut screen = vec![0; width * height * 3];
        (0..count)
            .map(|_| {
                let mut buffer = vec![0; width * height * 3];
                let info = reader.next_frame(&mut buffer).unwrap();
                let (left, top) = reader.info().frame_control.map_or((0, 0), |f| (f.x_offset, f.y_offset));
                for (i, row) in buffer[..info.buffer_size()].chunks_exact(3 * info.width as usize).enumerate() {
                    let at = ((top as usize + i) * width + left as usize) * 3;
                    screen[at..at + row.len()].copy_from_slice(row);
                }
                screen.clone()
            })
            .collect()
    }

    #[test]
    fn a_film_shows_its_pictures_one_after_the_other() {
        let film = Film { pictures: [3.0, 3.0, 20.0].map(|x| (dot(x), 100)).to_vec() };
        let bytes = film.png().unwrap();
        assert_eq!(bytes, film.png().unwrap(), "equal films give equal bytes");
        let expected: Vec<Vec<u8>> = (film.pictures.iter())
            .map(|(canvas, _)| paint::pixels(&canvas.scene).unwrap().into_iter().map(rounded).collect())
            .collect();
        assert_eq!(shown(&bytes), expected);
    }

    #[test]
    fn what_is_no_film_is_said() {
        assert!(Film::default().png().unwrap_err().to_string().contains("needs a picture"));
        let pictures = vec![(dot(3.0), 100), (Canvas::new(10, 10).unwrap(), 100)];
        assert!(Film { pictures }.png().unwrap_err().to_string().contains("one size"));
        assert!(Canvas::new(0, 10).is_err() && Canvas::new(100_000, 100_000).is_err());
    }

    #[test]
    fn colours_keep_black_and_white() {
        assert_eq!([0, 255].map(rounded), [0, 255]);
        assert!(
            (0..=255_u8).all(|value| rounded(value).abs_diff(value) <= 4 && rounded(rounded(value)) == rounded(value))
        );
    }
}
