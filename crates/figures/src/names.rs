//! Names side by side along an axis, and lines that do not fit.

use crate::text::{LINE, widest, width, wrap};

/// From line to line of names side by side, in text sizes.
pub(crate) const CLOSEST: f64 = 1.1;
/// Names are not written smaller, in pixels.
pub(crate) const SMALLEST_NAME: f64 = 6.5;

/// Names along an axis, wrapped.
pub(crate) struct Names {
    pub(crate) lines: Vec<Vec<String>>,
    pub(crate) size: f64,
    pub(crate) turned: bool,
}

impl Names {
    /// The longest line.
    pub(crate) fn longest(&self) -> f64 {
        self.lines.iter().map(|l| widest(l, self.size)).fold(0.0, f64::max)
    }

    /// Height of the name with most lines.
    pub(crate) fn tallest(&self) -> f64 {
        self.lines.iter().map(Vec::len).max().unwrap_or(0) as f64 * self.size * LINE
    }
}

pub(crate) fn wrapped(names: &[String], size: f64, limit: f64) -> Vec<Vec<String>> {
    names.iter().map(|n| wrap(n, size, limit)).collect()
}

/// In lines up to `limit` where they fit in a slot, else in one line each.
pub(crate) fn wrapped_into(names: &[String], size: f64, limit: f64, slot: f64) -> Vec<Vec<String>> {
    let lines = wrapped(names, size, limit);
    if lines.iter().all(|l| l.len() <= 1 || l.len() as f64 * size * LINE <= slot) {
        lines
    } else {
        wrapped(names, size, f64::INFINITY)
    }
}

/// Says which line does not fit.
pub(crate) fn too_long(lines: &[String], size: f64, room: f64) -> Option<String> {
    let line = lines.iter().find(|l| width(l, size) > room)?;
    Some(format!("`{line}` is {:.0} px long, {room:.0} px are there", width(line, size)))
}
