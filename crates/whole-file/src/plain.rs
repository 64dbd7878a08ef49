//! What a decoder says of a file, in words that a person reads who does not know Rust.

/// What decoders call the types that they expect, and what those are for who writes a file. Longer names come before those that they begin with.
const EXPECTED: [(&str, &str); 28] = [
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
    ("string only", "a name, or a table with one key"),
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

/// Kinds of an error that decoders put before what they say, one before the other.
const KINDS: [&str; 15] = [
    "custom: ",
    "Custom: ",
    "ParseIntError: ",
    "ParseFloatError: ",
    "ParseBoolError: ",
    "Parquet argument error: ",
    "External: ",
    "Parquet error: ",
    "Arrow: ",
    "Parser error: ",
    "EOF: ",
    "General: ",
    "Io error: ",
    "External error: ",
    "Invalid argument error: ",
];

/// Sentences of decoders of JSON, TOML, XML and numbers that say nothing to who writes a file.
const SENTENCES: [(&str, &str); 31] = [
    ("failed to fill whole buffer", "it ends too early"),
    ("unexpected end of file", "it ends too early"),
    // A name where a table was: what is there, the decoder does not say.
    ("invalid type: unit variant, expected string only", "expected a name, or a table with one key"),
    ("wanted exactly 1 element, found 0 elements", "expected a table with one key, found an empty one"),
    ("wanted exactly 1 element, more than 1 element", "expected a table with one key, found several keys"),
    ("string values must be quoted, expected literal string", "expected a text in quotes"),
    ("unexpected key or value, expected newline, `#`", "expected a new line or a comment behind the value"),
    ("expected value", VALUE),
    ("expected ident", "expected true, false or null"),
    ("key must be a string", "expected a key in double quotes"),
    ("trailing characters", "expected nothing behind the end of the JSON"),
    ("trailing comma", "expected no comma before the end of a list or table"),
    ("control character (\\u0000-\\u001F) found while parsing a string", "expected a text without control characters"),
    ("invalid escape", ESCAPE),
    ("lone leading surrogate in hex escape", ESCAPE),
    ("unexpected end of hex escape", ESCAPE),
    ("invalid unicode code point", "expected UTF-8 text"),
    ("invalid number", "expected a number"),
    ("number out of range", "expected a smaller number, found one out of range"),
    ("recursion limit exceeded", "expected lists and tables that are not nested as deep"),
    ("No elements found", "expected complete XML, the text ends before its outermost element does"),
    ("Elements not properly nested", "expected XML, where elements end in the order in which they began"),
    ("invalid digit found in string", "expected a whole number"),
    ("cannot parse integer from empty string", "expected a whole number, found nothing"),
    ("invalid float literal", "expected a number"),
    ("cannot parse float from empty string", "expected a number, found nothing"),
    ("number too large to fit in target type", "expected a smaller whole number"),
    ("u64 value was too large", "expected a smaller whole number"),
    ("i64 value was too large", "expected a smaller whole number"),
    ("number too small to fit in target type", "expected a larger whole number"),
    ("provided string was not `true` or `false`", "expected true or false"),
];
const VALUE: &str = "expected a number, a text in double quotes, a list or a table (JSON has neither NaN nor Infinity)";
const ESCAPE: &str = "expected an escape that JSON knows, such as \\n or \\u00e9";

/// The dotted path of the key that a message of serde is about, which was met at `path`: an unknown or a missing key is reported on its table, and stands in the
/// message itself.
///
/// ```
/// use whole_file::key_of;
/// assert_eq!(key_of("object", "unknown field `colour`, expected `shape`"), "object.colour");
/// assert_eq!(key_of("object.colour", "unknown field `colour`, expected `shape`"), "object.colour");
/// assert_eq!(key_of(".", "missing field `object`"), "object");
/// assert_eq!(key_of("object.mass_kg", "invalid type: string \"far\", expected f64"), "object.mass_kg");
/// ```
#[must_use]
pub fn key_of(path: &str, message: &str) -> String {
    let named = ["unknown field `", "missing field `"].iter().find_map(|start| message.strip_prefix(start));
    match named.and_then(|rest| rest.split('`').next()) {
        Some(name) if path == "." => name.into(),
        Some(name) if path.rsplit('.').next() != Some(name) => format!("{path}.{name}"),
        _ => path.into(),
    }
}

/// The message of a decoder (TOML, JSON, XML or Parquet) as words: `invalid type: string "far", expected usize` becomes `expected a whole number, 0 or more, found the
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
    // Decoders of XML and Parquet begin with the kind of the error, those of XML also with the place.
    let mut message = message;
    while let Some(rest) = KINDS.iter().find_map(|kind| message.strip_prefix(kind)) {
        message = rest;
    }
    if let Some((place, reason)) = message.strip_prefix("Parse error; ").and_then(|rest| rest.split_once(", Reason: "))
    {
        return format!("{}: {}", place.replace(':', "").to_lowercase(), plain(reason));
    }
    // JSON decoders add the place.
    let (said, place) = match message.rfind(" at line ") {
        Some(at) if message[at..].contains(" column ") => message.split_at(at),
        _ => (message, ""),
    };
    match (said, place) {
        ("EOF while parsing a value", " at line 1 column 0") => {
            return "expected JSON, the text ends before it is complete: it is empty".into();
        }
        ("expected value" | "expected ident", " at line 1 column 1" | " at line 1 column 2") => {
            return "expected JSON, found other text".into();
        }
        _ => {}
    }
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
        return Some("expected JSON, the text ends before it is complete".into());
    }
    if let Some((_, words)) = SENTENCES.iter().find(|(sentence, _)| *sentence == said) {
        return Some((*words).to_string());
    }
    if let Some(problem) = said.strip_suffix(", expected nothing") {
        return Some(problem.to_string());
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
    // `true`, `5` and `1.5` stand between backticks, what is too large for 64 bits with its type.
    let bare =
        |rest: &str| rest.trim_end_matches(" as i128").trim_end_matches(" as u128").trim_matches('`').to_string();
    known.map_or_else(|| found.to_string(), |(rest, words)| format!("{words}{}", bare(rest)))
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
            (
                "invalid type: integer `99999999999999999999` as i128, expected u64",
                "expected a whole number, 0 or more, found 99999999999999999999",
            ),
            ("u64 value was too large", "expected a smaller whole number"),
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
                "expected JSON, the text ends before it is complete at line 1 column 0",
            ),
            (
                "EOF while parsing a value at line 1 column 0",
                "expected JSON, the text ends before it is complete: it is empty",
            ),
            (
                "EOF while parsing a value at line 3 column 2",
                "expected JSON, the text ends before it is complete at line 3 column 2",
            ),
            ("expected value at line 1 column 1", "expected JSON, found other text"),
            ("expected ident at line 1 column 2", "expected JSON, found other text"),
            (
                "expected value at line 2 column 7",
                "expected a number, a text in double quotes, a list or a table (JSON has neither NaN nor Infinity) at line 2 column 7",
            ),
            (
                "control character (\\u0000-\\u001F) found while parsing a string at line 2 column 0",
                "expected a text without control characters at line 2 column 0",
            ),
            ("unexpected leading zero, expected nothing", "unexpected leading zero"),
            ("invalid type: unit variant, expected string only", "expected a name, or a table with one key"),
            ("ParseFloatError: invalid float literal", "expected a number"),
            ("Parse error; Line: 3, Column: 10, Reason: Malformed XML", "line 3, column 10: Malformed XML"),
            ("number too large to fit in target type", "expected a smaller whole number"),
            ("invalid type: integer `1`, expected enum Verdict", "expected a name, or a table with one key, found 1"),
            ("Parquet error: EOF: file is 3 bytes long", "file is 3 bytes long"),
            ("Arrow: Parquet argument error: External: failed to fill whole buffer", "it ends too early"),
            ("External: failed to fill whole buffer", "it ends too early"),
            ("what nobody knows", "what nobody knows"),
            ("", ""),
        ];
        for (message, expected) in cases {
            assert_eq!(plain(message), expected, "{message}");
        }
    }
}
