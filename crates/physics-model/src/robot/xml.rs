//! Where the elements of an XML text begin and end: enough to say which of them a parser did not take.

/// The beginning of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Element<'a> {
    /// Its name.
    pub(super) name: &'a str,
    /// What stands between its name and the end of its first tag.
    pub(super) inside: &'a str,
    /// Elements around it.
    pub(super) depth: usize,
    /// Place of its `<`.
    start: usize,
    /// Place behind its name.
    pub(super) name_end: usize,
    /// Whether it has no content.
    empty: bool,
    /// Place behind its first tag.
    tag_end: usize,
}

impl<'a> Element<'a> {
    /// Value of an attribute.
    pub(super) fn attribute(&self, name: &str) -> Option<&'a str> {
        let mut rest = self.inside;
        loop {
            let (key, after) = rest.split_once('=')?;
            let after = after.trim_start();
            let quote = after.chars().next().filter(|c| ['"', '\''].contains(c))?;
            let (value, behind) = after[1..].split_once(quote)?;
            if key.trim() == name {
                return Some(value);
            }
            rest = behind;
        }
    }

    /// The element with its content, in the text that it was found in; `None` where it does not end.
    pub(super) fn whole(&self, text: &'a str) -> Option<&'a str> {
        if self.empty {
            return Some(&text[self.start..self.tag_end]);
        }
        let (mut depth, mut tags) = (1, Tags { text, at: self.tag_end });
        loop {
            match tags.next()? {
                Tag::Open { empty: true, .. } => {}
                Tag::Open { .. } => depth += 1,
                Tag::Close { end } => {
                    depth -= 1;
                    if depth == 0 {
                        return Some(&text[self.start..end]);
                    }
                }
            }
        }
    }
}

/// All elements in the order of their beginnings; comments and declarations count for nothing.
pub(super) fn elements(text: &str) -> impl Iterator<Item = Element<'_>> {
    let mut depth = 0_usize;
    Tags { text, at: 0 }.filter_map(move |tag| match tag {
        Tag::Open { start, name_end, end, empty } => {
            let inside = text[name_end..end].trim_end_matches('>').trim_end_matches('/');
            let name = &text[start + 1..name_end];
            let element = Element { name, inside, depth, start, name_end, empty, tag_end: end };
            depth += usize::from(!empty);
            Some(element)
        }
        Tag::Close { .. } => {
            depth = depth.saturating_sub(1);
            None
        }
    })
}

/// How deep the elements are nested at most.
pub(super) fn nesting(text: &str) -> usize {
    elements(text).map(|element| element.depth + 1).max().unwrap_or(0)
}

enum Tag {
    Open { start: usize, name_end: usize, end: usize, empty: bool },
    Close { end: usize },
}

struct Tags<'a> {
    text: &'a str,
    at: usize,
}

impl Iterator for Tags<'_> {
    type Item = Tag;

    fn next(&mut self) -> Option<Tag> {
        loop {
            let start = self.at + self.text[self.at..].find('<')?;
            let rest = &self.text[start + 1..];
            if let Some(comment) = rest.strip_prefix("!--") {
                self.at = comment.find("-->").map_or(self.text.len(), |end| start + 4 + end + 3);
                continue;
            }
            let end = start + 1 + tag_length(rest);
            self.at = end;
            if rest.starts_with(['!', '?']) {
                continue;
            }
            if rest.starts_with('/') {
                return Some(Tag::Close { end });
            }
            let name = rest.find(|c: char| c.is_whitespace() || ['/', '>'].contains(&c)).unwrap_or(rest.len());
            let empty = self.text[start..end].ends_with("/>");
            return Some(Tag::Open { start, name_end: (start + 1 + name).min(end), end, empty });
        }
    }
}

/// Length of a tag up to its `>`, which may stand in the value of an attribute, too.
fn tag_length(rest: &str) -> usize {
    let mut quote = None;
    for (at, c) in rest.char_indices() {
        match (quote, c) {
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if c == open => quote = None,
            (None, '>') => return at + 1,
            _ => {}
        }
    }
    // A quote that never ends: as far as to the next `>`, as a parser that has lost its way would.
    rest.find('>').map_or(rest.len(), |at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nesting_counts_open_elements_alone() {
        assert_eq!(nesting("<?xml version=\"1.0\"?><!-- <a><a><a> --><robot><link/><link><mass/></link></robot>"), 3);
        assert_eq!(nesting(&"<link/>".repeat(500)), 1);
        assert_eq!(nesting(&"<link>".repeat(500)), 500);
        assert_eq!(nesting("<!-- never closed <a><b>"), 0);
    }

    #[test]
    fn elements_have_names_attributes_and_ends() {
        let text = "<r a='>' b = \"2\"><l name=\"x\"><l/></l><m name='y'/></r><n";
        let all: Vec<Element<'_>> = elements(text).collect();
        let names: Vec<_> = all.iter().map(|e| (e.name, e.depth)).collect();
        assert_eq!(names, [("r", 0), ("l", 1), ("l", 2), ("m", 1), ("n", 0)]);
        assert_eq!((all[0].attribute("a"), all[0].attribute("b"), all[0].attribute("c")), (Some(">"), Some("2"), None));
        assert_eq!(all[1].whole(text), Some("<l name=\"x\"><l/></l>"));
        assert_eq!((all[3].whole(text), all[3].attribute("name")), (Some("<m name='y'/>"), Some("y")));
        assert_eq!((all[0].whole(text), all[4].whole(text)), (Some(&text[..text.len() - 2]), None));
    }
}
