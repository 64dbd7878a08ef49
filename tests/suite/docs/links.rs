//! Links of all documents lead somewhere, pictures exist, pages are short.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use end_to_end::prose::Document;
use end_to_end::root;

use super::documents;

/// Most bytes of a page of the book as a reader gets it; what things are looked up in, and a table alone, may be longer.
const PAGE_BYTES: usize = 12_000;
const LOOKED_UP: [&str; 2] = ["docs/src/reference", "docs/src/results/table-1.md"];
/// The front page.
const README_LINES: usize = 120;
const README_BYTES: usize = 7_000;

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

/// Why a link leads nowhere. API docs are made beside the book, one folder a crate.
fn broken(page: &Path, link: &str, anchors: &BTreeMap<PathBuf, Document>) -> Option<String> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (file, anchor) = link.split_once('#').map_or((link, None), |(file, anchor)| (file, Some(anchor)));
    let folder = page.parent().unwrap_or(Path::new(""));
    let Some(target) = plain(&if file.is_empty() { page.to_path_buf() } else { folder.join(file) }) else {
        return Some("leaves the project".into());
    };
    if let Ok(api) = target.strip_prefix("docs/src/api") {
        let name = api.iter().next().unwrap_or_default().to_string_lossy().replace('_', "-");
        return (!root().join("crates").join(&name).is_dir()).then(|| format!("there is no crate {name}"));
    }
    if !root().join(&target).exists() {
        return Some("there is no such file".into());
    }
    let anchor = anchor.filter(|anchor| !anchor.is_empty())?;
    match anchors.get(&target) {
        Some(document) => (!document.anchors.contains(anchor)).then(|| "there is no such heading".into()),
        None => Some("only documents have headings".into()),
    }
}

#[test]
fn every_link_leads_somewhere() {
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(root().join(&path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        (path, Document::read(&text))
    };
    let pages: BTreeMap<PathBuf, Document> = documents().into_iter().map(read).collect();
    let (mut faults, mut links) = (Vec::new(), 0);
    for (path, document) in &pages {
        for link in &document.links {
            links += 1;
            if let Some(reason) = broken(path, link, &pages) {
                faults.push(format!("{}: {link}: {reason}", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(links > 50, "{links} links");
}

#[test]
fn a_link_to_nowhere_is_found() {
    let page = Path::new("docs/src/guides/some.md");
    let other = Path::new("README.md");
    let anchors = BTreeMap::from([(other.to_path_buf(), Document::read("# Surmise\n\n## Run it\n"))]);
    let reason = |link: &str| broken(page, link, &anchors);
    for good in
        ["https://example.org/x", "../../../README.md", "../../../README.md#run-it", "../api/physics_model/index.html"]
    {
        assert_eq!(reason(good), None, "{good}");
    }
    assert!(reason("../../../README.md#run").unwrap().contains("heading"));
    assert!(reason("missing.md").unwrap().contains("file"));
    assert!(reason("../../../../outside").unwrap().contains("leaves"));
    assert!(reason("../../../Cargo.toml#workspace").unwrap().contains("only documents"));
    assert!(reason("../api/no_such_crate/index.html").unwrap().contains("no crate no-such-crate"));
}

/// Bytes of a page with the files that it includes; of those the lines `FILE:FIRST:LAST`.
fn size(path: &Path) -> usize {
    let text = std::fs::read_to_string(root().join(path)).unwrap();
    let included = |directive: &str| {
        let mut parts = directive.split(':');
        let file = plain(&path.parent().unwrap().join(parts.next().unwrap())).unwrap();
        let lines = std::fs::read_to_string(root().join(&file)).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let mut ends = parts.map(|end| end.parse::<usize>().ok());
        let (first, last) = (ends.next().flatten().unwrap_or(1), ends.next().flatten().unwrap_or(usize::MAX));
        lines.lines().take(last).skip(first - 1).map(|line| line.len() + 1).sum::<usize>()
    };
    let directives = text.split("{{#include ").skip(1).map(|rest| rest.split_once("}}").unwrap().0);
    text.len() + directives.map(included).sum::<usize>()
}

#[test]
fn pages_are_short_and_have_one_title() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    assert!(readme.lines().count() <= README_LINES, "README.md: {} lines", readme.lines().count());
    assert!(readme.len() <= README_BYTES, "README.md: {} bytes", readme.len());
    for path in documents().iter().filter(|path| path.starts_with("docs")) {
        let fits = LOOKED_UP.iter().any(|looked_up| path.starts_with(looked_up)) || size(path) <= PAGE_BYTES;
        assert!(fits, "{}: {} bytes", path.display(), size(path));
        let titles = Document::read(&std::fs::read_to_string(root().join(path)).unwrap()).titles;
        // The summary has a heading for each part of the book.
        assert!(titles == 1 || path.ends_with("SUMMARY.md"), "{}: {titles} titles", path.display());
    }
}

#[test]
fn the_summary_lists_every_page_of_the_book() {
    let summary = std::fs::read_to_string(root().join("docs/src/SUMMARY.md")).unwrap();
    let listed = Document::read(&summary).links;
    for path in documents() {
        let Ok(page) = path.strip_prefix("docs/src") else { continue };
        let page = page.to_str().unwrap();
        assert!(page == "SUMMARY.md" || listed.iter().any(|link| link == page), "SUMMARY.md does not list {page}");
    }
}
