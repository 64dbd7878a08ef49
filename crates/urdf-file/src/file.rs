//! URDF files: read in bounded memory, time and depth, and what is wrong with one in words.

use std::path::Path;

use crate::UrdfError;
use crate::model::{self, Urdf};

/// Size of a file.
const MOST_BYTES: u64 = 16 << 20;
/// Depth of its elements; those of URDF are five deep.
const MOST_LEVELS: usize = 100;
/// Attributes of an element, and declarations of namespaces.
const MOST_ATTRIBUTES: usize = 200;
const MOST_NAMESPACES: usize = 200;
/// Links or joints: each is compared with all others, and a chain of them is walked by a function that calls itself.
const MOST_LINKS: usize = 1000;

/// Reads a file of bounded size, depth, number of links and of attributes.
///
/// # Errors
///
/// [`UrdfError`] if it cannot be read, is another format, or an element is not as URDF has it.
pub fn read(path: &Path) -> Result<Urdf, UrdfError> {
    let bytes = whole_file::read(path, MOST_BYTES)
        .map_err(|error| UrdfError::Read { path: path.into(), source: error.source })?;
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let reason = format!("expected UTF-8 text, found another byte at {}", error.valid_up_to());
        UrdfError::Parse { path: path.into(), reason }
    })?;
    parse(path, text)
}

/// Parses the text of the file at `path`.
///
/// # Errors
///
/// [`UrdfError`] if it is another format, or an element is not as URDF has it.
pub fn parse(path: &Path, text: &str) -> Result<Urdf, UrdfError> {
    let refuse = |reason: &str| UrdfError::Parse { path: path.into(), reason: whole_file::one_line(reason, 300) };
    if let Some(problem) = other_format(text) {
        return Err(refuse(&problem));
    }
    let urdf = model::read(path, text)?;
    let found = urdf.links.len().max(urdf.joints.len());
    if found > MOST_LINKS {
        return Err(refuse(&format!("expected at most {MOST_LINKS} links and joints, found {found}")));
    }
    Ok(urdf)
}

/// What a file is that is no URDF, or none that can be read in bounded time: the parser compares each attribute of an element with the others, and each
/// namespace with those around it.
fn other_format(text: &str) -> Option<String> {
    let expected = "expected a URDF file, whose outermost element is <robot>";
    let Some(root) = tags(text).find(|tag| !tag.starts_with('/')) else {
        let found = if text.trim().is_empty() { "an empty file" } else { "a text without elements" };
        return Some(format!("{expected}, found {found}"));
    };
    let name = name(root);
    let found = match name.to_ascii_lowercase().as_str() {
        // Macros that nobody has expanded; a namespace alone is what xacro leaves behind.
        "robot" if tags(text).any(|tag| tag.starts_with("xacro:") || tag.contains("${")) => {
            return Some("expected plain URDF, found xacro macros: run `xacro FILE > arm.urdf` first".into());
        }
        "robot" => return too_wild(text),
        "mujoco" | "mujocoinclude" => "MJCF, the format of MuJoCo".to_string(),
        "sdf" => "SDF, the format of Gazebo".to_string(),
        "html" => "a web page: was the download refused?".to_string(),
        _ => format!("<{}>", whole_file::one_line(name, 60)),
    };
    Some(format!("{expected}, found {found}"))
}

fn too_wild(text: &str) -> Option<String> {
    let (mut depth, mut deepest, mut most, mut spaces) = (0_usize, 0, 0, 0);
    for tag in tags(text) {
        if tag.starts_with('/') {
            depth = depth.saturating_sub(1);
            continue;
        }
        deepest = deepest.max(depth + 1);
        depth += usize::from(!tag.ends_with('/'));
        most = most.max(tag.matches('=').count());
        spaces += tag.matches("xmlns").count();
    }
    let limits = [
        (deepest > MOST_LEVELS, format!("elements at most {MOST_LEVELS} deep")),
        (most > MOST_ATTRIBUTES, format!("elements of at most {MOST_ATTRIBUTES} attributes")),
        (spaces > MOST_NAMESPACES, format!("at most {MOST_NAMESPACES} namespaces")),
    ];
    limits.into_iter().find(|(beyond, _)| *beyond).map(|(_, expected)| format!("expected {expected}"))
}

/// What stands between `<` and `>` of each tag; comments, declarations and sections of plain characters are none.
fn tags(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        loop {
            rest = &rest[rest.find('<')? + 1..];
            let skipped = [("!--", "-->"), ("![CDATA[", "]]>"), ("?", "?>")]
                .into_iter()
                .find(|(begin, _)| rest.starts_with(begin));
            if let Some((begin, end)) = skipped {
                rest = rest[begin.len()..].split_once(end).map_or("", |(_, after)| after);
                continue;
            }
            let end = tag_length(rest);
            let tag = &rest[..end];
            rest = &rest[end..];
            if !tag.starts_with('!') {
                return Some(tag);
            }
        }
    })
}

/// Length of a tag up to its `>`, which may stand in the value of an attribute, too.
fn tag_length(rest: &str) -> usize {
    let mut quote = None;
    for (at, c) in rest.char_indices() {
        match (quote, c) {
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), c) if c == open => quote = None,
            (None, '>') => return at,
            _ => {}
        }
    }
    // A quote that never ends: as far as to the next `>`, as a parser that has lost its way would.
    rest.find('>').unwrap_or(rest.len())
}

fn name(tag: &str) -> &str {
    &tag[..tag.find(|c: char| c.is_whitespace() || c == '/').unwrap_or(tag.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_said_in_words() {
        const JOINT: &str = "<joint name=\"elbow\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/><limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"1\"/></joint>";
        let robot = |inside: &str| format!("<?xml version=\"1.0\"?>\n<robot name=\"r\">{inside}</robot>");
        let cases = [
            ("<mujoco model=\"arm\"><worldbody/></mujoco>".to_string(), "found MJCF, the format of MuJoCo"),
            ("<?xml version='1.0'?><sdf version='1.7'/>".into(), "found SDF, the format of Gazebo"),
            ("<!DOCTYPE html>\n<html><body>404</body></html>".into(), "found a web page"),
            ("<urdf/>".into(), "whose outermost element is <robot>, found <urdf>"),
            (String::new(), "whose outermost element is <robot>, found an empty file"),
            (" \n".into(), "found an empty file"),
            ("mine".into(), "found a text without elements"),
            ("<?xml version=\"1.0\"?>".into(), "found a text without elements"),
            (robot("<xacro:include filename=\"a\"/>"), "run `xacro FILE > arm.urdf`"),
            (robot("<link name=\"${prefix}a\"/>"), "found xacro macros"),
            (robot(&JOINT.replace("<child link=\"b\"/>", "")), "joint \"elbow\" of arm.urdf: <child> is missing"),
            (robot(&JOINT.replace("\"5\"", "\"strong\"")), "joint \"elbow\" of arm.urdf: "),
            (robot(&JOINT.replace("revolute", "hinge")), "is of type \"hinge\", expected one of revolute, "),
            (
                robot("<link name=\"hand\"><inertial><mass/></inertial></link>"),
                "link \"hand\" of arm.urdf: <inertial> has no <inertia>",
            ),
            (robot("<link name=\"hand\">").replace("</robot>", ""), "arm.urdf"),
        ];
        for (text, expected) in cases {
            let message = parse(Path::new("arm.urdf"), &text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
            assert!(!message.contains("custom") && !message.contains("field"), "{message}");
        }
        // What stands in a comment, or in the text of a plugin, is no macro.
        for inside in ["<!-- <xacro:include filename='a'/> -->", "<gazebo><path>${HOME}</path></gazebo>"] {
            assert!(parse(Path::new("arm.urdf"), &robot(inside)).is_ok(), "{inside}");
        }
        let doctype = format!("<!DOCTYPE robot>{}", robot(JOINT));
        assert!(parse(Path::new("arm.urdf"), &doctype).unwrap_err().to_string().contains("expected no <!DOCTYPE"));
        let twice = robot(&JOINT.replace("<child link=\"b\"/>", "<child link=\"b\"/><child link=\"c\"/>"));
        assert!(parse(Path::new("arm.urdf"), &twice).unwrap_err().to_string().contains("two <child>, expected one"));
        // Version 1.1 has quaternions: a quarter turn about z.
        let turned = JOINT.replace("<parent", "<origin quat_xyzw=\"0 0 0.70710678 0.70710678\"/><parent");
        let yaw = parse(Path::new("arm.urdf"), &robot(&turned)).unwrap().joints[0].origin.rpy[2];
        assert!((yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        // A limit without velocity is a limit.
        let slow = parse(Path::new("arm.urdf"), &robot(&JOINT.replace(" velocity=\"1\"", ""))).unwrap();
        assert_eq!((slow.joints[0].limit.upper, slow.joints[0].limit.velocity), (1.0, f64::INFINITY));
        assert_eq!(parse(Path::new("arm.urdf"), &robot(JOINT)).unwrap().joints[0].limit.velocity, 1.0);
    }

    #[test]
    fn what_would_overflow_the_stack_or_never_end_is_refused_in_one_line() {
        let folder = std::env::temp_dir().join(format!("surmise-urdf-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("arm.urdf");
        let deep = format!("<robot name=\"a\">{}", "<link name=\"a\">".repeat(200_000));
        let many = format!("<robot name=\"a\">{}</robot>", "<link name=\"a\"/>".repeat(2000));
        let wide = format!("<robot name=\"a\"{}/>", (0..90_000).map(|i| format!(" a{i}=\"\"")).collect::<String>());
        let spaces =
            format!("<robot name=\"a\">{}", (0..5000).map(|i| format!("<a xmlns:b{i}=\"c\"/>")).collect::<String>());
        let long =
            format!("<robot name=\"a\"><link name=\"a\"><inertial><origin xyz=\"{}\u{1}\n\"/>", "a".repeat(20_000));
        for (text, expected) in [
            (deep, "100 deep"),
            (wide, "200 attributes"),
            (spaces, "200 namespaces"),
            (many, "1000 links"),
            (long, "arm.urdf"),
            (String::new(), "arm.urdf"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("arm.urdf"), "{message}");
            assert!(!message.contains(char::is_control) && message.len() < 600, "{message:?}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(matches!(read(Path::new("/dev/zero")), Err(UrdfError::Read { .. })));
    }
}
