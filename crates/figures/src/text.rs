//! The bundled font: how wide a text is, how it breaks into lines, and its glyphs for the bitmap.
//!
//! plotters 0.3.7 drops each glyph's left bearing in its own use of `ab_glyph`, and scales by another factor than in
//! its SVG. So letters stand unevenly, and PNG and SVG differ. The trait below replaces that drawing.

use std::convert::Infallible;
use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, GlyphId, PxScale, ScaleFont, point};
use plotters_backend::text_anchor::{HPos, Pos, VPos};
use plotters_backend::{BackendColor, BackendCoord, BackendTextStyle, FontFamily, FontTransform};

/// Height of a line of text, in text sizes.
pub(crate) const LINE: f64 = 1.25;
/// From the top of a line to its baseline in text sizes, as plotters' SVG has it.
pub(crate) const BASELINE: f64 = 0.76;
/// Verdana has nearly the widths of DejaVu Sans, for viewers that lack it.
const FAMILY: &str = "DejaVu Sans, Verdana, sans-serif";
/// plotters' SVG writes a font size that is smaller by this factor.
const SVG_SIZE: f64 = 1.24;

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(include_bytes!("../../../assets/fonts/DejaVuSans.ttf")).expect("the bundled font is whole")
});

/// Glyphs with their offset from the start of the text, and the width of all, both in units of `size`.
fn glyphs(text: &str, size: f64) -> (Vec<(GlyphId, f32)>, f32) {
    let font = FONT.as_scaled(scale(size));
    let mut x = 0.0;
    let mut previous: Option<GlyphId> = None;
    let mut placed = Vec::with_capacity(text.len());
    for character in text.chars() {
        let glyph = font.glyph_id(character);
        if let Some(previous) = previous {
            x += font.kern(previous, glyph);
        }
        placed.push((glyph, x));
        x += font.h_advance(glyph);
        previous = Some(glyph);
    }
    (placed, x)
}

/// `ab_glyph` counts the height of a line, we the em.
fn scale(size: f64) -> PxScale {
    let em = FONT.units_per_em().unwrap_or(2048.0);
    PxScale::from(size as f32 * FONT.height_unscaled() / em)
}

/// Width of one line of text, in the unit of `size`.
pub(crate) fn width(text: &str, size: f64) -> f64 {
    f64::from(glyphs(text, size).1)
}

/// Breaks at spaces so that no line is wider than `limit`, except for single words that are.
pub(crate) fn wrap(text: &str, size: f64, limit: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}"), size) <= limit => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The widest of some lines.
pub(crate) fn widest<'a>(lines: impl IntoIterator<Item = &'a String>, size: f64) -> f64 {
    lines.into_iter().map(|l| width(l, size)).fold(0.0, f64::max)
}

/// A text for plotters' backends; sizes in their units.
pub(crate) struct Style {
    pub(crate) size: f64,
    pub(crate) color: BackendColor,
    pub(crate) anchor: HPos,
    /// Reads from bottom to top.
    pub(crate) turned: bool,
}

impl BackendTextStyle for Style {
    type FontError = Infallible;

    fn color(&self) -> BackendColor {
        self.color
    }

    fn size(&self) -> f64 {
        self.size * SVG_SIZE
    }

    fn transform(&self) -> FontTransform {
        if self.turned { FontTransform::Rotate270 } else { FontTransform::None }
    }

    fn anchor(&self) -> Pos {
        Pos::new(self.anchor, VPos::Top)
    }

    fn family(&self) -> FontFamily<'_> {
        FontFamily::Name(FAMILY)
    }

    fn layout_box(&self, text: &str) -> Result<((i32, i32), (i32, i32)), Infallible> {
        Ok(((0, 0), (width(text, self.size).round() as i32, (self.size * LINE).round() as i32)))
    }

    fn draw<E, F: FnMut(i32, i32, BackendColor) -> Result<(), E>>(
        &self,
        text: &str,
        (left, top): BackendCoord,
        mut pixel: F,
    ) -> Result<Result<(), E>, Infallible> {
        let baseline = (BASELINE * self.size) as f32;
        for (glyph, x) in glyphs(text, self.size).0 {
            let placed = glyph.with_scale_and_position(scale(self.size), point(x, baseline));
            let Some(outline) = FONT.outline_glyph(placed) else { continue };
            let corner = outline.px_bounds().min;
            let (x0, y0) = (left + corner.x as i32, top + corner.y as i32);
            let mut result = Ok(());
            outline.draw(|x, y, coverage| {
                if result.is_ok() && coverage > 0.0 {
                    let color = self.color.mix(f64::from(coverage.min(1.0)));
                    result = pixel(x0 + x as i32, y0 + y as i32, color);
                }
            });
            if result.is_err() {
                return Ok(result);
            }
        }
        Ok(Ok(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_as_wide_as_its_glyphs_advance() {
        // DejaVu Sans: a digit advances 1303 of 2048 units, an em dash 2048.
        assert!((width("0000", 2048.0) - 4.0 * 1303.0).abs() < 0.5);
        assert!((width("—", 10.0) - 10.0).abs() < 1e-3);
    }

    #[test]
    fn wrapping_keeps_every_word_and_the_limit() {
        let text = "an arm pushes a rather heavy box over the table";
        let lines = wrap(text, 11.0, 90.0);
        assert!(lines.len() > 2);
        assert_eq!(lines.join(" "), text);
        assert!(lines.iter().all(|l| width(l, 11.0) <= 90.0));
        assert_eq!(wrap("unbreakable", 11.0, 5.0), ["unbreakable"]);
    }

    #[test]
    fn glyphs_stay_within_the_advance_of_the_text() {
        let style = Style {
            size: 100.0,
            color: BackendColor { rgb: (0, 0, 0), alpha: 1.0 },
            anchor: HPos::Left,
            turned: false,
        };
        let (mut low, mut high) = (i32::MAX, i32::MIN);
        let drawn: Result<(), ()> = style
            .draw("llll", (0, 0), |x, _, _| {
                low = low.min(x);
                high = high.max(x);
                Ok(())
            })
            .unwrap();
        drawn.unwrap();
        // `l` is 193 to 377 units of its advance 569: equal bearings left and right.
        let right = width("llll", 100.0) - f64::from(high + 1);
        assert!(low >= 8 && (f64::from(low) - right).abs() <= 2.0, "{low} {right}");
    }
}
