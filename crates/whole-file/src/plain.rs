//! What a decoder says of a file, in words that a person reads who does not know Rust.

/// What decoders call the types that they expect, and what those are for who writes a file. Longer names come before those that they begin with.
const EXPECTED: [(&str, &str); 27] = [
    ("usize", WHOLE),
    ("u8", WHOLE),
    ("u16", WHOLE),
    ("u32", WHOLE),
    ("u64", WHOLE),
    ("a nonzero u32", "a whole number, 1 or more"),
    ("a nonzero u64", "a whole number, 1 or more"),
    ("isize", "a whole number"),
    ("i8", "a whole number"),
    ("i16", "a whole number"),
    ("i32", "a whole number"),
    ("i64", "a whole number"),
    ("f32", "a number"),
    ("f64", "a number"),
    ("a boolean", "true or false"),
    ("bool", "true or false"),
    ("a string", "a text"),
    ("a borrowed string", "a text"),
    ("path string", "a path"),
    ("a sequence", "a list"),
    ("a map", "a table"),
    ("map", "a table"),
    ("unit", "nothing"),
    ("string or map", "a name, or a table with one key"),
    ("wanted string or table", "a name, or a table with one key"),
    ("a character", "one character"),
    ("a string containing one floating point value", "a number"),
];
const WHOLE: &str = "a whole number, 0 or more";

/// What a decoder found, by how it begins to say so.
const FOUND: [(&str, &str); 13] = [
    ("string ", "the text "),
    ("character ", "the text "),
    ("integer ", ""),
    ("floating point ", ""),
    ("boolean ", ""),
    ("sequence", "a list"),
    ("map", "a table"),
    ("unit value", "nothing"),
    ("Option value", "nothing"),
    ("null", "null"),
    ("unit variant", "a name"),
    ("newtype variant", "a table"),
    ("enum", "a name or a table"),
];

/// The message of a serde decoder (TOML, JSON or XML) as words: `invalid type: string "far", expected usize` becomes `expected a whole number, 0 or more, found the
/// text "far"`. What it does not know stays as it is.
///
/// ```
/// use whole_file::plain;
/// assert_eq!(plain("invalid type: string \"far\", expected f64"), "expected a number, found the text \"far\"");
/// assert_eq!(plain("custom: missing field `velocity`"), "`velocity` is missing");
/// assert_eq!(plain("unknown field `a`, expected `b` or `c`"), "there is no key `a`, expected `b` or `c`");
/// ```
#[must_use]
pub fn plain(message: &str) -> String {
    let message = message.trim();
    let message = ["custom: ", "Custom: "].iter().find_map(|start| message.strip_prefix(start)).unwrap_or(message);
    // JSON decoders add the place.
    let (said, place) = match message.rfind(" at line ") {
        Some(at) if message[at..].contains(" column ") => message.split_at(at),
        _ => (message, ""),
    };
    words(said).map_or_else(|| message.to_string(), |words| words + place)
}

fn words(said: &str) -> Option<String> {
    let known = |start: &str| said.strip_prefix(start);
    if let Some(rest) = known("missing field `") {
        return Some(format!("`{}` is missing", rest.strip_suffix('`').unwrap_or(rest)));
    }
    if let Some(rest) = known("duplicate field `") {
        return Some(format!("`{}` is given twice", rest.strip_suffix('`').unwrap_or(rest)));
    }
    for (start, what) in [("unknown field `", "key"), ("unknown variant `", "choice")] {
        let Some(rest) = known(start) else { continue };
        let rest = rest.replace(", there are no fields", ", expected none").replace(", there are no variants", "");
        return Some(format!("there is no {what} `{rest}"));
    }
    if let Some(rest) = known("invalid length ") {
        let (found, expected) = rest.split_once(", expected ")?;
        return Some(format!("expected {}, found {found}", expectation(expected)));
    }
    if said.starts_with("EOF while parsing") {
        return Some("the text ends before it is complete".into());
    }
    let rest = known("invalid type: ").or_else(|| known("invalid value: "))?;
    // A text that was found may hold the words as well: the last ones count.
    let (found, expected) = rest.rsplit_once(", expected ")?;
    Some(format!("expected {}, found {}", expectation(expected), finding(found)))
}

fn expectation(expected: &str) -> String {
    if let Some((_, words)) = EXPECTED.iter().find(|(name, _)| *name == expected) {
        return (*words).to_string();
    }
    let counted = [
        ("an array of length ", "a list of "),
        ("a tuple of size ", "a list of "),
        ("fewer elements in ", "fewer in "),
    ];
    if let Some((length, words)) =
        counted.iter().find_map(|(start, words)| Some((expected.strip_prefix(start)?, words)))
    {
        return format!("{words}{}", length.split(' ').next().unwrap_or(length));
    }
    let tables = ["struct variant ", "struct ", "tuple struct "];
    if tables.iter().any(|start| expected.starts_with(start)) {
        return match expected.split_once(" with ") {
            Some((_, elements)) => format!("a list of {}", elements.split(' ').next().unwrap_or(elements)),
            None => "a table".into(),
        };
    }
    if expected.starts_with("enum ") || expected == "variant identifier" {
        return "a name, or a table with one key".into();
    }
    expected.to_string()
}

fn finding(found: &str) -> String {
    let known = FOUND.iter().find_map(|(start, words)| Some((found.strip_prefix(start)?, words)));
    // `true`, `5` and `1.5` stand between backticks.
    known.map_or_else(|| found.to_string(), |(rest, words)| format!("{words}{}", rest.trim_matches('`')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_decoders_say_is_said_in_words() {
        let cases = [
            (
                "invalid type: string \"far\", expected usize",
                "expected a whole number, 0 or more, found the text \"far\"",
            ),
            ("invalid type: floating point `1.5`, expected u32", "expected a whole number, 0 or more, found 1.5"),
            ("invalid value: integer `-1`, expected u64", "expected a whole number, 0 or more, found -1"),
            ("invalid type: boolean `true`, expected f64", "expected a number, found true"),
            ("invalid type: integer `3`, expected struct Header", "expected a table, found 3"),
            ("invalid type: map, expected a sequence", "expected a list, found a table"),
            ("invalid type: sequence, expected a string", "expected a text, found a list"),
            ("invalid type: null, expected f64 at line 3 column 9", "expected a number, found null at line 3 column 9"),
            ("invalid length 2, expected an array of length 3", "expected a list of 3, found 2"),
            ("invalid length 1, expected struct Range with 2 elements", "expected a list of 2, found 1"),
            (
                "invalid type: string \"a, expected b\", expected f64",
                "expected a number, found the text \"a, expected b\"",
            ),
            ("missing field `shape` at line 2 column 1", "`shape` is missing at line 2 column 1"),
            ("duplicate field `shape`", "`shape` is given twice"),
            ("unknown field `a`, there are no fields", "there is no key `a`, expected none"),
            ("unknown variant `x`, expected `y` or `z`", "there is no choice `x`, expected `y` or `z`"),
            (
                "EOF while parsing an object at line 1 column 0",
                "the text ends before it is complete at line 1 column 0",
            ),
            ("invalid type: integer `1`, expected enum Verdict", "expected a name, or a table with one key, found 1"),
            ("what nobody knows", "what nobody knows"),
            ("", ""),
        ];
        for (message, expected) in cases {
            assert_eq!(plain(message), expected, "{message}");
        }
    }
}
