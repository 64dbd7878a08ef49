//! Markdown as a reader meets it: prose, links, anchors.
//!
//! # What counts as prose
//!
//! Paragraphs, list items and quotes. Tables, code blocks, headings, pictures with their texts, HTML and the targets of links do not count.
//! Code within a sentence counts as one word, whatever stands in it.
//!
//! # What counts as a sentence
//!
//! A sentence ends with its paragraph or list item, and at `.`, `!` or `?` if white space follows, and then no lower-case letter. An
//! abbreviation of [`ABBREVIATIONS`] ends none. A colon or a semicolon ends none. What has fewer than [`LEAST_WORDS`] words is a label, and
//! no sentence. A word is what stands between white space and has a letter or a digit in it.

use std::collections::{BTreeMap, BTreeSet};

use pulldown_cmark::{Event, HeadingLevel, Options, Parser, Tag, TagEnd};

/// What has fewer words is a label.
pub const LEAST_WORDS: usize = 3;
/// They end with a full stop that ends no sentence.
pub const ABBREVIATIONS: [&str; 9] = ["e.g.", "i.e.", "al.", "vs.", "cf.", "Fig.", "No.", "Eq.", "approx."];

/// A page.
#[derive(Debug, Default)]
pub struct Document {
    /// Sentences, code in them as `code`.
    pub sentences: Vec<String>,
    /// Targets of links and sources of pictures.
    pub links: Vec<String>,
    /// What a link can point to in it.
    pub anchors: BTreeSet<String>,
    /// All words of prose, headings and tables, without code.
    pub words: Vec<String>,
    /// Headings of the first level.
    pub titles: usize,
}

impl Document {
    /// Reads Markdown.
    #[must_use]
    pub fn read(text: &str) -> Self {
        let mut document = Self::default();
        let mut reader = Reader::default();
        for event in Parser::new_ext(text, Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES) {
            reader.take(event, &mut document);
        }
        document
    }

    /// Words a sentence in the mean; 0 without sentences.
    #[must_use]
    pub fn mean_words(&self) -> f64 {
        let words: usize = self.sentences.iter().map(|sentence| count(sentence)).sum();
        words as f64 / self.sentences.len().max(1) as f64
    }

    /// The sentence with most words, and how many.
    #[must_use]
    pub fn longest(&self) -> Option<(&str, usize)> {
        self.sentences.iter().map(|sentence| (sentence.as_str(), count(sentence))).max_by_key(|(_, words)| *words)
    }
}

/// What is being read.
#[derive(Default)]
struct Reader {
    /// The paragraph so far; every block ends it.
    paragraph: String,
    /// The heading so far.
    heading: Option<String>,
    /// Within so many tables, code blocks and pictures.
    outside: usize,
    /// Within a code block, whose words are not ours to spell.
    in_code: bool,
    /// How often an anchor has been made.
    made: BTreeMap<String, usize>,
}

impl Reader {
    fn take(&mut self, event: Event<'_>, document: &mut Document) {
        match event {
            Event::Start(tag) => self.start(&tag, document),
            Event::End(end) => self.end(end, document),
            Event::Text(text) => self.text(&text, document),
            Event::Code(code) => self.code(&code),
            Event::SoftBreak | Event::HardBreak => self.text(" ", document),
            Event::Html(html) | Event::InlineHtml(html) => document.anchors.extend(marked(&html)),
            _ => (),
        }
    }

    fn start(&mut self, tag: &Tag<'_>, document: &mut Document) {
        match tag {
            Tag::Heading { level, .. } => {
                self.end_of_block(document);
                self.heading = Some(String::new());
                document.titles += usize::from(*level == HeadingLevel::H1);
            }
            Tag::Table(_) | Tag::CodeBlock(_) => {
                self.end_of_block(document);
                self.outside += 1;
                self.in_code = matches!(tag, Tag::CodeBlock(_));
            }
            Tag::Image { dest_url, .. } => {
                document.links.push(dest_url.to_string());
                self.outside += 1;
            }
            Tag::Link { dest_url, .. } => document.links.push(dest_url.to_string()),
            Tag::Paragraph | Tag::Item | Tag::BlockQuote(_) | Tag::List(_) => self.end_of_block(document),
            _ => (),
        }
    }

    fn end(&mut self, end: TagEnd, document: &mut Document) {
        match end {
            TagEnd::Heading(_) => {
                let anchor = anchor(&self.heading.take().unwrap_or_default());
                let before = self.made.entry(anchor.clone()).or_default();
                document.anchors.insert(if *before == 0 { anchor } else { format!("{anchor}-{before}") });
                *before += 1;
            }
            TagEnd::Table | TagEnd::CodeBlock | TagEnd::Image => {
                self.outside -= 1;
                self.in_code = false;
            }
            TagEnd::Paragraph | TagEnd::Item | TagEnd::BlockQuote(_) | TagEnd::List(_) => self.end_of_block(document),
            _ => (),
        }
    }

    fn text(&mut self, text: &str, document: &mut Document) {
        if !self.in_code {
            let words = text.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
            document.words.extend(words.map(String::from));
        }
        if let Some(heading) = &mut self.heading {
            *heading += text;
        } else if self.outside == 0 {
            self.paragraph += text;
        }
    }

    fn code(&mut self, code: &str) {
        if let Some(heading) = &mut self.heading {
            *heading += code;
        } else if self.outside == 0 {
            self.paragraph += "code";
        }
    }

    fn end_of_block(&mut self, document: &mut Document) {
        let paragraph = std::mem::take(&mut self.paragraph);
        document.sentences.extend(sentences(&paragraph));
    }
}

/// Sentences of a paragraph.
fn sentences(paragraph: &str) -> Vec<String> {
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    let mut found = Vec::new();
    let mut sentence: Vec<&str> = Vec::new();
    for (place, word) in words.iter().enumerate() {
        sentence.push(word);
        let bare = word.trim_end_matches([')', '"', '”', '*', '\'', '’']);
        let stops = bare.ends_with(['.', '!', '?']) && !ABBREVIATIONS.contains(&bare.trim_start_matches('('));
        let goes_on = words.get(place + 1).is_some_and(|next| next.starts_with(char::is_lowercase) && *next != "code");
        if stops && !goes_on || place + 1 == words.len() {
            let whole = std::mem::take(&mut sentence).join(" ");
            if count(&whole) >= LEAST_WORDS {
                found.push(whole);
            }
        }
    }
    found
}

fn count(sentence: &str) -> usize {
    sentence.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count()
}

/// What mdBook and GitHub make of a heading: lower case, hyphens for spaces, other characters dropped.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

/// Anchors that HTML makes: `<a id="here">`.
fn marked(html: &str) -> Vec<String> {
    let values = html.split("id=\"").skip(1);
    values.filter_map(|rest| rest.split('"').next()).map(String::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "\
# A `title` with words

This is one sentence, e.g. of ten words or so. Here is
another: it has 3.5 words; or more (it does). What?

| a table | counts |
|---|---|
| not at all. Never | ever |

```
code is not prose. At all.
```

- `--option` is said in [these words](other.md#part) here
- a label

![A picture with a text](picture.svg)

<a id=\"here\"></a>

## A title, again

## A title, again
";

    #[test]
    fn sentences_are_those_of_prose_alone() {
        let document = Document::read(PAGE);
        let expected = [
            "This is one sentence, e.g. of ten words or so.",
            "Here is another: it has 3.5 words; or more (it does).",
            "code is said in these words here",
        ];
        assert_eq!(document.sentences, expected);
        assert!((document.mean_words() - (10.0 + 11.0 + 7.0) / 3.0).abs() < 1e-12, "{}", document.mean_words());
        assert_eq!(document.longest().unwrap().1, 11);
        assert_eq!(document.titles, 1);
    }

    #[test]
    fn links_and_anchors_are_found() {
        let document = Document::read(PAGE);
        assert_eq!(document.links, ["other.md#part", "picture.svg"]);
        let anchors: Vec<&str> = document.anchors.iter().map(String::as_str).collect();
        assert_eq!(anchors, ["a-title-again", "a-title-again-1", "a-title-with-words", "here"]);
        assert_eq!(anchor("95 % interval"), "95--interval");
    }

    #[test]
    fn words_are_those_of_prose_and_headings() {
        let words = Document::read(PAGE).words;
        for word in ["sentence", "title", "table", "picture"] {
            assert!(words.contains(&word.into()), "{word}");
        }
        assert!(!words.contains(&"code".into()) && !words.contains(&"option".into()), "{words:?}");
    }

    #[test]
    fn a_sentence_that_is_too_long_is_seen_as_one() {
        let long = format!("{}end.", "word ".repeat(44));
        assert_eq!(Document::read(&long).longest().unwrap().1, 45);
        // Lists are no way around it, and neither are line breaks.
        assert_eq!(Document::read(&format!("- {}\n  {long}", "more ".repeat(5))).longest().unwrap().1, 50);
        assert_eq!(sentences("It ends. It does.").len(), 0, "labels");
        assert_eq!(sentences("It ends here. So it does. Does it not?").len(), 3);
    }
}
