//! The frame of pages, numbers, and the format of the glossary.

use std::collections::BTreeSet;

use super::number::{count, fixed, log_evidence, mean_square, p_value, percent, significant};
use super::*;

#[test]
fn nothing_from_outside_is_markup() {
    let evil = "<script>alert(\"1\")</script>&\u{7}";
    let body = html! {
        p title=(evil) { (evil) }
        (section("a", evil, &text(evil)))
        (facts(&[(evil.into(), text(evil))]))
        (picture("<?xml?><svg></svg>", evil))
        (table(&[text(evil)], &[vec![text(evil)]]))
    };
    let page = document(evil, &body);
    assert!(!page.contains("<script") && !page.contains('\u{7}') && !page.contains("<?xml"));
    assert!(page.contains("&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp; "));
}

#[test]
fn pages_alone_may_be_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    assert!(may_be_replaced(&folder.path().join("none.html")));
    assert!(may_be_replaced(&file("page.html", &document("", &text("")))));
    assert!(!may_be_replaced(&file("trials.jsonl", "{}\n")));
    assert!(!may_be_replaced(&file("short", "<!DOC")));
    assert!(!may_be_replaced(folder.path()));
}

#[test]
fn numbers_have_sensible_digits_whatever_they_are() {
    assert_eq!([fixed(-0.04, 1), fixed(-1.25, 1), fixed(f64::NAN, 1)], ["0.0", "−1.2", "–"]);
    assert_eq!([significant(0.0, 3), significant(1234.5, 2), significant(0.012_34, 2)], ["0", "1234", "0.012"]);
    assert_eq!([significant(-2e-9, 2), significant(f64::INFINITY, 2)], ["−2.0e−9", "–"]);
    assert_eq!([percent(0.345), percent(f64::NAN)], ["34 %", "– %"]);
    assert_eq!([count(0), count(999), count(65_300), count(1_000_000)], ["0", "999", "65,300", "1,000,000"]);
    assert_eq!([p_value(0.0), p_value(0.25)], ["< 0.001", "0.250"]);
    assert_eq!(
        [mean_square(1.04), mean_square(100.2), mean_square(2.5e4), mean_square(1e10)],
        ["1.0", "100", "25k", ">1G"]
    );
    assert_eq!([log_evidence(9.94), log_evidence(-12.3), log_evidence(23_456.0)], ["9.9", "−12", "23.5k"]);
}

#[test]
fn marked_words_are_defined_once_at_the_foot() {
    let words = Words::default();
    let shown = html! { (words.mark_as("transition", "transitions")) (words.mark("transition")) (words.mark("D4")) };
    let shown = shown.into_string();
    assert_eq!(shown.matches("<a class=\"word\" href=\"#word-transition\" title=\"One action").count(), 2, "{shown}");
    let list = words.list().into_string();
    assert_eq!(list.matches("<dt").count(), 2);
    assert!(list.find("id=\"word-d4\"").unwrap() < list.find("id=\"word-transition\"").unwrap());
    assert!(words.mark("no such word").into_string().contains("undefined"));
}

#[test]
fn the_glossary_is_sorted_and_its_terms_are_unique() {
    let keys: Vec<_> = glossary().iter().map(|word| (word.topic, word.term.to_lowercase())).collect();
    assert!(keys.is_sorted(), "sorted by topic and term");
    let terms: BTreeSet<&str> = glossary().iter().map(|word| word.term.as_str()).collect();
    assert_eq!(terms.len(), glossary().len());
    let anchors: BTreeSet<String> = glossary().iter().map(Word::anchor).collect();
    assert_eq!(anchors.len(), glossary().len());
    for word in glossary() {
        assert!(word.see.iter().all(|other| terms.contains(other.as_str())), "{}: {:?}", word.term, word.see);
    }
}

#[test]
fn definitions_are_short_sentences() {
    for word in glossary() {
        let more = word.more.split_inclusive(". ").map(str::trim).filter(|sentence| !sentence.is_empty());
        for sentence in std::iter::once(word.means.as_str()).chain(more) {
            assert!(sentence.ends_with('.') && sentence.split_whitespace().count() <= 40, "{}: {sentence}", word.term);
        }
        assert!(!word.means.contains(". "), "{}: one sentence", word.term);
    }
}
