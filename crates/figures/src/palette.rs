//! Colours that colour-blind readers tell apart: Okabe and Ito, "Color Universal Design" (2008), without the yellow,
//! which is too light for lines on white. A name has one colour in the whole figure.

use std::collections::BTreeMap;

/// Red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(pub u8, pub u8, pub u8);

pub(crate) const TEXT: Color = Color(0x22, 0x22, 0x22);
pub(crate) const FRAME: Color = Color(0x88, 0x88, 0x88);
pub(crate) const GRID: Color = Color(0xe4, 0xe4, 0xe4);
pub(crate) const REFERENCE: Color = Color(0x66, 0x66, 0x66);
pub(crate) const WHITE: Color = Color(0xff, 0xff, 0xff);
pub(crate) const BLUE: Color = Color(0x00, 0x72, 0xb2);
pub(crate) const VERMILLION: Color = Color(0xd5, 0x5e, 0x00);
pub(crate) const SERIES: [Color; 7] = [
    BLUE,
    VERMILLION,
    Color(0x00, 0x9e, 0x73),
    Color(0xcc, 0x79, 0xa7),
    Color(0xe6, 0x9f, 0x00),
    Color(0x56, 0xb4, 0xe9),
    Color(0x33, 0x33, 0x33),
];

impl Color {
    /// Between this and `other`: 0 is this, 1 is `other`.
    pub(crate) fn mixed(self, other: Color, share: f64) -> Color {
        let mix = |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * share).round() as u8;
        Color(mix(self.0, other.0), mix(self.1, other.1), mix(self.2, other.2))
    }
}

/// From near white to dark blue, for `share` in [0, 1]; lightness falls evenly.
pub(crate) fn heat(share: f64) -> Color {
    const STOPS: [Color; 4] = [Color(0xf7, 0xfb, 0xff), Color(0xa6, 0xcd, 0xe8), BLUE, Color(0x08, 0x30, 0x5c)];
    let position = share.clamp(0.0, 1.0) * 3.0;
    let stop = (position as usize).min(2);
    STOPS[stop].mixed(STOPS[stop + 1], position - stop as f64)
}

/// What tells a series from the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Look {
    pub(crate) color: Color,
    /// Position among the names: decides the marker's shape.
    pub(crate) index: usize,
}

impl Look {
    /// Whether the colours have been used up, so that solid lines must differ otherwise.
    pub(crate) fn repeats(self) -> bool {
        self.index >= SERIES.len()
    }
}

/// Which name has which look.
#[derive(Debug, Default)]
pub(crate) struct Palette(BTreeMap<String, usize>);

impl Palette {
    /// In order of first appearance.
    pub(crate) fn new<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        let mut palette = BTreeMap::new();
        for name in names {
            let next = palette.len();
            palette.entry(name.to_owned()).or_insert(next);
        }
        Self(palette)
    }

    /// The look of a name; the first where it is unknown.
    pub(crate) fn look(&self, name: &str) -> Look {
        let index = self.0.get(name).copied().unwrap_or(0);
        Look { color: SERIES[index % SERIES.len()], index }
    }
}
