//! What can go wrong.

use std::path::PathBuf;

/// Errors of this crate. Numbers that are not finite are gaps in a picture, never errors.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A figure without panels or columns, or with more pixels than fit in memory.
    #[error("the figure cannot be drawn: {reason}")]
    Figure {
        /// What was expected and what was found.
        reason: String,
    },
    /// Data of a panel that contradict each other.
    #[error("panel `{panel}`: {reason}")]
    Panel {
        /// The panel's title.
        panel: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// Titles, labels and tick labels leave no room for the data.
    #[error(
        "panel `{panel}`: {width_px:.0} × {height_px:.0} px are left for the data beside the labels, {} × {} are needed: make panels larger",
        crate::SMALLEST_PLOT_PX.0, crate::SMALLEST_PLOT_PX.1
    )]
    TooSmall {
        /// The panel's title.
        panel: String,
        /// Width left for the data.
        width_px: f64,
        /// Height left for the data.
        height_px: f64,
    },
    /// The drawing library refused something.
    #[error("cannot draw: {reason}")]
    Draw {
        /// The library's words.
        reason: String,
    },
    /// The picture could not be encoded.
    #[error("cannot encode the picture as PNG")]
    Encode {
        /// The encoder's words.
        source: png::EncodingError,
    },
    /// The operating system refused something.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// What was tried, as a verb.
        action: &'static str,
        /// On which file or folder.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
}
