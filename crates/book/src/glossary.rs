//! The glossary, from `assets/glossary.toml`.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use serde::Deserialize;

use crate::Page;
use crate::markdown::{MADE, escaped};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Glossary {
    word: Vec<Word>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Word {
    term: String,
    topic: String,
    means: String,
    #[serde(default)]
    also: Vec<String>,
    more: Option<String>,
    #[serde(default)]
    see: Vec<String>,
}

/// Topics in the order of the page, and their headings.
const TOPICS: [(&str, &str); 6] = [
    ("planning", "Planning"),
    ("method", "Methods"),
    ("domain", "Domains"),
    ("results", "Results"),
    ("network", "Network"),
    ("diagnosis", "Diagnosis"),
];

pub(crate) fn page(root: &Path) -> Result<Page> {
    let path = root.join("assets/glossary.toml");
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let glossary: Glossary = toml::from_str(&text).with_context(|| path.display().to_string())?;
    Ok(Page::new("reference/glossary.md", written(&glossary.word)?))
}

fn written(words: &[Word]) -> Result<String> {
    let mut topics: BTreeMap<&str, Vec<&Word>> = BTreeMap::new();
    for word in words {
        if !TOPICS.iter().any(|(topic, _)| *topic == word.topic) {
            bail!("`{}`: expected a known topic, found `{}`", word.term, word.topic);
        }
        if let Some(other) = word.see.iter().find(|other| !words.iter().any(|word| word.term == **other)) {
            bail!("`{}`: expected a term of the glossary, found `{other}`", word.term);
        }
        topics.entry(&word.topic).or_default().push(word);
    }
    let mut text =
        format!("{MADE}\n# Glossary\n\nThis page defines every special word that programs, tables and pages print.\n");
    for (topic, heading) in TOPICS {
        let Some(words) = topics.get(topic) else { continue };
        text += &format!("\n## {heading}\n");
        for word in words {
            let (own, made) = (anchor(&word.term), of_heading(&word.term));
            let mark = if own == made { String::new() } else { format!("<a id=\"{own}\"></a>\n\n") };
            text += &format!("\n{mark}### {}\n\n{}", escaped(&word.term), escaped(&word.means));
            if let Some(more) = &word.more {
                text += &format!(" {}", escaped(more));
            }
            let also: Vec<String> = word.also.iter().map(|also| escaped(also)).collect();
            if !also.is_empty() {
                text += &format!(" Also printed as: {}.", also.join(", "));
            }
            let see: Vec<String> = word.see.iter().map(|see| format!("[{}](#{})", escaped(see), anchor(see))).collect();
            if !see.is_empty() {
                text += &format!(" See {}.", see.join(", "));
            }
            text.push('\n');
        }
    }
    Ok(text)
}

/// The anchor of a term, as `assets/glossary.toml` says: lower case, one hyphen for every run of other characters.
fn anchor(term: &str) -> String {
    let lower = term.to_lowercase();
    let words = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-")
}

/// What mdBook makes of a heading: lower case, hyphens for spaces, other characters dropped.
fn of_heading(term: &str) -> String {
    let kept = term.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(term: &str, topic: &str, see: &[&str]) -> Word {
        let see = see.iter().map(ToString::to_string).collect();
        Word { term: term.into(), topic: topic.into(), means: "A thing.".into(), also: vec![], more: None, see }
    }

    #[test]
    fn words_stand_under_their_topics_and_link_to_each_other() {
        let words = [word("ln evidence", "diagnosis", &[]), word("belief", "planning", &["ln evidence"])];
        let text = written(&words).unwrap();
        assert!(text.find("## Planning").unwrap() < text.find("## Diagnosis").unwrap());
        assert!(text.contains("### belief\n\nA thing. See [ln evidence](#ln-evidence).\n"), "{text}");
        let text = written(&[word("95 % interval", "results", &[])]).unwrap();
        assert!(text.contains("<a id=\"95-interval\"></a>\n\n### 95 % interval\n"), "{text}");
    }

    #[test]
    fn a_glossary_that_contradicts_itself_is_an_error() {
        let error = |words: &[Word]| written(words).unwrap_err().to_string();
        assert!(error(&[word("belief", "nowhere", &[])]).contains("known topic, found `nowhere`"));
        assert!(error(&[word("belief", "planning", &["what"])]).contains("found `what`"));
    }
}
