//! The documentation: pages that are made from the code, and the book as HTML beside the API docs.
//!
//! Prose is written by hand in `docs/src`. What a program knows better is made by [`pages`]: the commands and their options, the keys of
//! scenario files, the effects with what each does to a push, and the glossary. These pages are committed; a test regenerates them.

mod commands;
mod effects;
mod glossary;
mod html;
mod joints;
mod keys;
mod markdown;
mod picture;
mod scene;

use std::path::{Path, PathBuf};

use anyhow::Result;

pub use html::{Taken, build, check, copy_folder};

/// A file that is made from the code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// Relative to the project.
    pub path: PathBuf,
    /// What stands in it.
    pub text: String,
}

impl Page {
    pub(crate) fn new(path: &str, text: String) -> Self {
        Self { path: Path::new("docs/src").join(path), text }
    }
}

/// All pages and pictures that are made from the code. `menu` is what `xtask describe` prints.
///
/// # Errors
///
/// A glossary or scenario that cannot be read; a menu of another form; a picture that cannot be drawn.
pub fn pages(root: &Path, menu: &str) -> Result<Vec<Page>> {
    let mut pages = vec![commands::page(menu)?, keys::scenario_page(root)?, keys::robot_page(root)?];
    pages.push(glossary::page(root)?);
    pages.push(joints::page());
    pages.extend(effects::pages(root)?);
    Ok(pages)
}

/// Pages that differ from what is on disk.
#[must_use]
pub fn outdated<'a>(root: &Path, pages: &'a [Page]) -> Vec<&'a Page> {
    let same = |page: &&Page| std::fs::read_to_string(root.join(&page.path)).is_ok_and(|text| text == page.text);
    pages.iter().filter(|page| !same(page)).collect()
}
