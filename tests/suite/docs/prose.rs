//! Documents read easily and are spelt right. What a sentence is, `end_to_end::prose` says.

use std::path::Path;

use end_to_end::prose::Document;
use end_to_end::root;
use unicase::UniCase;

use super::documents;

/// Most words of a sentence, on any page.
const MOST_WORDS: usize = 40;
/// Most words a sentence in the mean, where newcomers read.
const MEAN_WORDS: f64 = 20.0;
/// Words that the dictionary takes for misspelt ones: look-alikes.
const OURS: [&str; 1] = ["alikes"];

fn read(path: &Path) -> Document {
    Document::read(&std::fs::read_to_string(root().join(path)).unwrap())
}

/// Pages that newcomers read.
fn is_for_newcomers(path: &Path) -> bool {
    let folders = ["docs/src/guides", "docs/src/concepts"];
    let pages = ["README.md", "docs/src/README.md", "docs/src/first-steps.md"];
    folders.iter().any(|folder| path.starts_with(folder)) || pages.iter().any(|page| path == Path::new(page))
}

#[test]
fn no_sentence_has_to_be_read_twice() {
    let mut faults = Vec::new();
    for path in documents() {
        for sentence in read(&path).sentences {
            let words = sentence.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count();
            if words > MOST_WORDS {
                faults.push(format!("{}: {words} words: {sentence}", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{} sentences above {MOST_WORDS} words: {faults:#?}", faults.len());
}

#[test]
fn what_newcomers_read_has_short_sentences() {
    let (mut faults, mut pages) = (Vec::new(), 0);
    for path in documents().into_iter().filter(|path| is_for_newcomers(path)) {
        let mean = read(&path).mean_words();
        pages += 1;
        if mean > MEAN_WORDS {
            faults.push(format!("{}: {mean:.1} words a sentence", path.display()));
        }
    }
    assert!(faults.is_empty(), "above {MEAN_WORDS}: {faults:#?}");
    assert!(pages >= 2, "{pages} pages");
}

#[test]
fn documents_are_spelt_right() {
    let known = |word: &str| typos_dict::WORD.find(&UniCase::new(word)).copied().unwrap_or_default();
    assert_eq!(known("recieve"), ["receive"]);
    assert!(known("receive").is_empty() && known("colour").is_empty() && known("neighbour").is_empty());
    let (mut faults, mut words) = (Vec::new(), 0);
    for path in documents() {
        for word in read(&path).words {
            words += 1;
            let right = known(&word);
            if !right.is_empty() && !OURS.contains(&word.as_str()) {
                faults.push(format!("{}: {word}: {}", path.display(), right.join(" or ")));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(words > 3000, "{words} words");
}
