//! What somebody may have meant who wrote a name that does not exist.

use crate::explain::known_keys;
use crate::format::{resolved, target, variants};

/// Below this likeness of two names a guess would be noise.
const LIKENESS_MIN: f64 = 0.75;

/// A message of serde on an unknown key or choice, with the nearest that exists.
pub(crate) fn with_nearest(message: &str) -> String {
    let Some((unknown, expected)) = message.split_once(", expected ") else { return message.into() };
    let name = ["unknown field `", "unknown variant `"].iter().find_map(|start| unknown.strip_prefix(start));
    let Some(name) = name.and_then(|name| name.strip_suffix('`')) else { return message.into() };
    // Every second piece stands between backticks.
    let known: Vec<&str> = expected.split('`').skip(1).step_by(2).collect();
    let hint = elsewhere(name).map(|key| format!("there is `{key}`"));
    match hint.or_else(|| nearest(name, &known).map(|key| format!("nearest is `{key}`"))) {
        Some(hint) => format!("{unknown}, {hint}, expected {expected}"),
        None => message.into(),
    }
}

/// A message that a name or a table with one key was expected, with those that exist at `key`.
pub(crate) fn with_choices(message: String, key: &str) -> String {
    const EXPECTED: &str = "expected a name, or a table with one key";
    let Some((before, after)) = message.split_once(EXPECTED) else { return message };
    let schema = resolved();
    let mut node = &schema;
    for part in key.split('.') {
        node = target(&schema, node);
        node = &node["properties"][part];
    }
    let names = variants(target(&schema, node)).flat_map(|variant| {
        let name = variant["const"].as_str().map(|name| format!("\"{name}\""));
        let keys = variant["properties"].as_object().into_iter().flat_map(|keys| keys.keys());
        name.into_iter().chain(keys.map(|key| format!("{{ {key} = … }}")))
    });
    match names.collect::<Vec<_>>() {
        names if names.is_empty() => message,
        names => format!("{before}expected one of {}{after}", names.join(", ")),
    }
}

/// The one key of another table that has this very name.
fn elsewhere(name: &str) -> Option<String> {
    let mut same = known_keys().into_iter().filter(|key| key.rsplit('.').next() == Some(name));
    let found = same.next();
    found.filter(|_| same.next().is_none())
}

fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let likeness = |other: &str| strsim::jaro_winkler(name, other);
    let best = known.iter().copied().max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(best) >= LIKENESS_MIN).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_key_is_answered_with_the_nearest_one() {
        let message = "unknown field `horizn`, expected one of `horizon`, `discount`";
        assert_eq!(
            with_nearest(message),
            "unknown field `horizn`, nearest is `horizon`, expected one of `horizon`, `discount`"
        );
        let choice = "unknown variant `teher`, expected `tether` or `restitution`";
        assert!(with_nearest(choice).contains("nearest is `tether`"));
    }

    #[test]
    fn a_key_in_the_wrong_table_is_answered_with_the_right_one() {
        let message = "unknown field `horizon`, expected one of `version`, `name`";
        assert!(with_nearest(message).contains("there is `task.horizon`"), "{}", with_nearest(message));
    }

    #[test]
    fn a_wrong_choice_is_answered_with_those_that_exist() {
        let message = || "expected a name, or a table with one key, found 500".to_string();
        let said = with_choices(message(), "planner.budget");
        assert!(said.starts_with("expected one of {") && said.contains("{ transitions = … }"), "{said}");
        assert!(said.ends_with(", found 500"), "{said}");
        assert!(with_choices(message(), "belief.filter").contains("\"bridge\""));
        assert_eq!(with_choices(message(), "no.such.key"), message());
    }

    #[test]
    fn what_is_like_nothing_gets_no_guess() {
        let message = "unknown field `xyzzy`, expected one of `horizon`, `discount`";
        assert_eq!(with_nearest(message), message);
        assert_eq!(with_nearest("invalid type: string"), "invalid type: string");
    }
}
