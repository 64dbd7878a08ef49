//! Panels in a grid under one legend.

use std::path::{Path, PathBuf};

use crate::Error;
use crate::layout::lay_out;
use crate::paint;
use crate::panel::Panel;

/// Panels in rows, with a title and one legend above them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Above everything; may be empty.
    pub title: String,
    /// From left to right, then down.
    pub panels: Vec<Panel>,
    /// Panels a row.
    pub columns: usize,
    /// Mean width and height of panels with their labels. The figure is `columns` times as wide as one panel. Without
    /// title and legend its height is that of one panel times the number of rows. The space that labels leave is
    /// divided evenly between the plots.
    pub panel_size_px: (u32, u32),
    /// Series that take the first colours, whether they are drawn or not: so that a method has one colour in several
    /// figures. The others follow in order of appearance.
    pub colors: Vec<String>,
}

impl Figure {
    /// Width and height in pixels of both formats.
    ///
    /// # Errors
    /// [`Error::Figure`] without panels or columns or above [`LARGEST_PX`](crate::LARGEST_PX), [`Error::Panel`] for data
    /// that contradict each other, [`Error::TooSmall`] where labels leave no room for the data.
    pub fn size_px(&self) -> Result<(u32, u32), Error> {
        let scene = lay_out(self)?;
        Ok((scene.width_px, scene.height_px))
    }

    /// The figure as SVG. Texts are text in DejaVu Sans or what the viewer has like it.
    ///
    /// # Errors
    /// As [`Figure::size_px`].
    pub fn svg(&self) -> Result<String, Error> {
        paint::svg(&lay_out(self)?)
    }

    /// The figure as PNG.
    ///
    /// # Errors
    /// As [`Figure::size_px`].
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        paint::png(&lay_out(self)?)
    }

    /// Writes `stem.svg` and `stem.png`, each whole or not at all, in a folder that exists, and returns their paths. A
    /// dot in the name stays: `a.b` gives `a.b.svg`.
    ///
    /// # Errors
    /// As [`Figure::size_px`], before anything is written; [`Error::Io`] where the operating system refuses.
    pub fn save(&self, stem: &Path) -> Result<[PathBuf; 2], Error> {
        let scene = lay_out(self)?;
        let (svg, png) = (paint::svg(&scene)?, paint::png(&scene)?);
        let paths = ["svg", "png"].map(|extension| {
            let mut path = stem.as_os_str().to_owned();
            path.push(".");
            path.push(extension);
            PathBuf::from(path)
        });
        for (path, bytes) in paths.iter().zip([svg.as_bytes(), &png]) {
            whole_file::write(path, bytes, whole_file::Existing::Replace).map_err(|e| Error::Io {
                action: e.action,
                path: e.path,
                source: e.source,
            })?;
        }
        Ok(paths)
    }
}
