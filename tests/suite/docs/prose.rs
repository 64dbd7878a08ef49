//! Documents read easily and are spelt right. What a sentence is, `end_to_end::prose` says.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use end_to_end::prose::Document;
use end_to_end::root;

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

/// What is known to be written wrong, in small letters, and what is meant.
fn misspellings() -> BTreeMap<String, String> {
    let packed = std::fs::File::open(root().join("tests/data/misspellings/misspellings.csv.gz")).unwrap();
    let mut text = String::new();
    flate2::read::GzDecoder::new(packed).read_to_string(&mut text).unwrap();
    let pair = |line: &str| line.split_once(',').map(|(wrong, right)| (wrong.to_lowercase(), right.to_owned()));
    text.lines().map(|line| pair(line).unwrap()).collect()
}

#[test]
fn documents_are_spelt_right() {
    let misspellings = misspellings();
    let known = |word: &str| misspellings.get(&word.to_lowercase());
    assert_eq!(known("Recieve").unwrap(), "receive");
    assert!(known("receive").is_none() && known("colour").is_none() && known("neighbour").is_none());
    let (mut faults, mut words) = (Vec::new(), 0);
    for path in documents() {
        for word in read(&path).words {
            words += 1;
            if let Some(right) = known(&word).filter(|_| !OURS.contains(&word.as_str())) {
                faults.push(format!("{}: {word}: {right}", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(words > 3000, "{words} words");
}
