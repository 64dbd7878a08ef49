//! Pages are whole, well-formed as far as tags go, and need nothing from elsewhere.

use recording::EpisodeTrace;

use super::*;

/// Every element that is opened is closed in order.
fn check_structure(html: &str) {
    const VOID: [&str; 3] = ["meta", "!DOCTYPE", "br"];
    let mut open: Vec<&str> = Vec::new();
    let mut rest = html;
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a tag ends");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        let name = tag.trim_start_matches('/').split([' ', '\n', '/']).next().unwrap_or_default();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "closed");
        } else if !(tag.ends_with('/') || tag.starts_with('!') || VOID.contains(&name)) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!html.contains("class=\"undefined\""), "a word that the glossary lacks");
    for foreign in ["http://", "https://", "<script", "url(", "@import"] {
        let found = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!found.contains(foreign), "{foreign}");
    }
}

#[test]
fn text_from_files_cannot_become_markup() {
    let trace = EpisodeTrace {
        title: "<script>alert(1)</script>".into(),
        reason: "a & \"b\"".into(),
        commit: "<b>".into(),
        ..EpisodeTrace::default()
    };
    let html = episode_page(&trace, "<svg></svg>");
    check_structure(&html);
    assert!(html.contains("&lt;script&gt;") && html.contains("a &amp; &quot;b&quot;"));
}

#[test]
fn a_run_and_an_episode_have_their_parts() {
    let root = scenario::find_root(std::path::Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let run = experiments::Archive::read(&root.join("assets/results/table1-surmise-D4")).unwrap();
    let html = run_page(&run).unwrap();
    check_structure(&html);
    for id in ["success", "pictures", "failures", "pairs", "trials", "source", "words"] {
        assert!(html.contains(&format!("<section id=\"{id}\">")), "{id}");
    }
    assert_eq!(html.matches("<figure").count(), run.figures().len());
    // A square for each trial of each method, and the published table says the same.
    assert_eq!(html.matches("class=\"won\"").count() + html.matches("class=\"lost\"").count(), run.trials.len());
    let mixture = run.table.rows.iter().find(|row| row.method == agent::Method::Mixture).unwrap();
    assert!(html.contains(&format!("<b>{} of {}</b>", mixture.successes, mixture.trials)));
    let suite = Suite::read(&root.join("assets/results")).unwrap();
    assert!(!suite.is_empty());
    let html = suite_page(&suite);
    check_structure(&html);
    let places = ["table1", "table2", "ablation"].map(|name| html.find(&format!("id=\"{name}\"")).unwrap());
    assert!(places.is_sorted(), "in the order of their plans");
}

#[test]
fn a_table_of_another_version_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("other.json"), "{\"rows\": 3}").unwrap();
    assert!(Suite::read(folder.path()).unwrap().is_empty(), "no table");
    std::fs::write(folder.path().join("old.json"), "{\"rows\": [], \"comparisons\": [], \"provenance\": {}}").unwrap();
    let error = Suite::read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("old.json") && error.contains("is missing"), "{error}");
}
