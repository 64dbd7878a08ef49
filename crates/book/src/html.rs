//! The book as HTML, and the API docs beside it.
//!
//! Pages may link to files of the project beside the book, such as pictures of results. In HTML they would lead out of the folder: these files are
//! copied to `project/` in it, and the links changed.

use std::path::{Component, Path, PathBuf};

use anyhow::{Context as _, Result};
use mdbook_driver::MDBook;
use mdbook_driver::config::Config;

/// Says of a folder that it is ours: mdBook clears what it writes to.
const MARK: &str = ".surmise-docs";
/// Where files from outside the book are put.
const PROJECT: &str = "project";

/// A folder that documentation cannot go to.
#[derive(Debug, thiserror::Error)]
pub enum Taken {
    /// It holds files of others.
    #[error("--out {}: expected a new folder or one of earlier documentation, found other files", .0.display())]
    Others(PathBuf),
    /// It is none.
    #[error("{}: {}", .0, .0.source)]
    Place(whole_file::Error),
}

/// Makes HTML of `docs/` in `out`.
///
/// # Errors
///
/// [`Taken`]; a book that mdBook refuses; a disk that does.
pub fn build(root: &Path, out: &Path) -> Result<()> {
    check(out)?;
    let file = root.join("docs/book.toml");
    let mut config = Config::from_disk(&file).with_context(|| format!("cannot read {}", file.display()))?;
    config.build.build_dir = std::path::absolute(out)?;
    // A chapter that SUMMARY.md names and nobody wrote is an error, no empty page.
    config.build.create_missing = false;
    let stage = tempfile::tempdir().context("cannot make a temporary folder")?;
    copy_folder(&root.join("docs"), stage.path())?;
    bring_in(root, stage.path(), Path::new("src"))?;
    MDBook::load_with_config(stage.path(), config)?.build()?;
    std::fs::write(out.join(MARK), "").with_context(|| format!("cannot write to {}", out.display()))
}

/// Refuses a folder with files of others, and what is none.
///
/// # Errors
///
/// [`Taken`]; a folder that cannot be listed.
pub fn check(out: &Path) -> Result<()> {
    whole_file::check_folder(out).map_err(Taken::Place)?;
    let mut entries = match std::fs::read_dir(out) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error).with_context(|| format!("cannot list {}", out.display())),
    };
    if entries.next().is_some() && !out.join(MARK).exists() {
        return Err(Taken::Others(out.to_path_buf()).into());
    }
    Ok(())
}

/// The text of a page of `folder` with the files that it includes named by their whole paths: the stage does not hold them.
fn included(folder: &Path, text: &str) -> Result<String> {
    const INCLUDE: &str = "{{#include ";
    let mut parts = text.split(INCLUDE);
    let mut changed = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find([':', '}']).unwrap_or(part.len());
        let file = folder.join(part[..end].trim());
        let file = file.canonicalize().with_context(|| format!("a page includes {}", file.display()))?;
        changed += &format!("{INCLUDE}{}{}", file.display(), &part[end..]);
    }
    Ok(changed)
}

/// Copies what the pages in a folder of the stage link to outside of the book, and changes the links.
fn bring_in(root: &Path, stage: &Path, folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(stage.join(folder))? {
        let path = folder.join(entry?.file_name());
        if stage.join(&path).is_dir() {
            bring_in(root, stage, &path)?;
        } else if path.extension().is_some_and(|end| end == "md") {
            let text = included(&root.join("docs").join(folder), &std::fs::read_to_string(stage.join(&path))?)?;
            let mut parts = text.split("](");
            let mut changed = parts.next().unwrap_or_default().to_owned();
            for part in parts {
                let (link, rest) = part.split_once(')').unwrap_or((part, ""));
                let end = if part.len() > link.len() { ")" } else { "" };
                let link = brought(root, stage, &path, link)?.unwrap_or_else(|| link.to_owned());
                changed += &format!("]({link}{end}{rest}");
            }
            std::fs::write(stage.join(&path), changed)?;
        }
    }
    Ok(())
}

/// The link to the copy of a file outside of the book; `None` for any other link.
fn brought(root: &Path, stage: &Path, page: &Path, link: &str) -> Result<Option<String>> {
    let file = link.split('#').next().unwrap_or_default();
    let Some(target) = plain(&Path::new("docs").join(page).with_file_name("").join(file)) else { return Ok(None) };
    if link.contains("://") || target.starts_with("docs/src") || !root.join(&target).is_file() {
        return Ok(None);
    }
    let from = root.join(&target);
    // mdBook makes nothing of Markdown that is no chapter: it is copied as text.
    let name = if from.extension().is_some_and(|end| end == "md") { target.with_extension("txt") } else { target };
    let copy = stage.join("src").join(PROJECT).join(&name);
    if let Some(folder) = copy.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::copy(&from, &copy).with_context(|| format!("cannot copy {}", from.display()))?;
    // `src/` and the page itself are no folders above.
    let up = "../".repeat(page.components().count().saturating_sub(2));
    Ok(Some(format!("{up}{PROJECT}/{}", name.display())))
}

/// A path without `.` and `..`; `None` where it leaves the project.
fn plain(path: &Path) -> Option<PathBuf> {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => plain.push(name),
            Component::ParentDir => plain.pop().then_some(())?,
            _ => (),
        }
    }
    Some(plain)
}

/// Copies a folder with all that is in it. Links are not followed.
///
/// # Errors
///
/// A disk that refuses.
pub fn copy_folder(from: &Path, to: &Path) -> Result<()> {
    std::fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    for entry in std::fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let entry = entry?;
        let (path, target) = (entry.path(), to.join(entry.file_name()));
        let kind = entry.file_type()?;
        if kind.is_dir() {
            copy_folder(&path, &target)?;
        } else if kind.is_file() {
            std::fs::copy(&path, &target).with_context(|| format!("cannot copy {}", path.display()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_book_becomes_pages_with_a_search_index_and_is_replaced_by_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write("docs/book.toml", "[book]\ntitle = \"T\"\n");
        write("docs/src/SUMMARY.md", "# Summary\n\n- [One](one.md)\n");
        write("assets/a.svg", "<svg/>");
        write("NOTES.md", "Notes.");
        write(
            "docs/src/one.md",
            "# One\n\nA page. [An](../../assets/a.svg) and [Notes](../../NOTES.md#x), [no](../../none.md).\n\n{{#include ../../NOTES.md:1:1}}\n",
        );
        let out = folder.path().join("out");
        for _ in 0..2 {
            build(folder.path(), &out).unwrap();
            assert!(std::fs::read_to_string(out.join("index.html")).unwrap().contains("A page."));
        }
        let page = std::fs::read_to_string(out.join("one.html")).unwrap();
        assert!(page.contains("\"project/assets/a.svg\"") && page.contains("\"project/NOTES.txt\""), "{page}");
        assert!(page.contains("<p>Notes.</p>"), "what lies beside the book is included: {page}");
        assert!(out.join("project/assets/a.svg").is_file() && out.join("project/NOTES.txt").is_file());
        let names: Vec<String> =
            std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        assert!(names.iter().any(|name| name.starts_with("searchindex")), "{names:?}");
        let missing = included(folder.path(), "{{#include none.md}}").unwrap_err().to_string();
        assert!(missing.contains("includes") && missing.contains("none.md"), "{missing}");
        copy_folder(&out, &folder.path().join("copy/here")).unwrap();
        assert!(folder.path().join("copy/here/one.html").is_file());
        write("docs/src/SUMMARY.md", "# Summary\n\n- [Two](two.md)\n");
        assert!(build(folder.path(), &out).is_err(), "a chapter that nobody wrote");
    }

    #[test]
    fn files_of_others_are_never_cleared() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("thesis.tex"), "").unwrap();
        let error = build(folder.path(), folder.path()).unwrap_err();
        assert!(error.is::<Taken>() && error.to_string().contains("found other files"), "{error}");
        assert!(folder.path().join("thesis.tex").exists());
    }
}
