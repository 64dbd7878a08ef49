//! URDF files: read in bounded memory, time and depth, and what is wrong with one in words.

use std::path::Path;

use super::RobotError;
use super::model::{self, Urdf};

/// Size of a file.
const MOST_BYTES: u64 = 16 << 20;
/// Links or joints: each is compared with all others, and a chain of them is walked by a function that calls itself.
const MOST_LINKS: usize = 1000;

/// Reads a file of bounded size and number of links.
pub(super) fn read(path: &Path) -> Result<Urdf, RobotError> {
    let bytes = whole_file::read(path, MOST_BYTES)
        .map_err(|error| RobotError::Read { path: path.into(), source: error.source })?;
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let reason = format!("expected UTF-8 text, found another byte at {}", error.valid_up_to());
        RobotError::Parse { path: path.into(), reason }
    })?;
    parse(path, text)
}

/// Parses the text of the file at `path`.
pub(super) fn parse(path: &Path, text: &str) -> Result<Urdf, RobotError> {
    let refuse = |reason: &str| RobotError::Parse { path: path.into(), reason: whole_file::one_line(reason, 300) };
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

/// What a file is that is no URDF.
fn other_format(text: &str) -> Option<String> {
    let expected = "expected a URDF file, whose outermost element is <robot>";
    let Some(root) = first_element(text) else {
        let found = if text.trim().is_empty() { "an empty file" } else { "a text without elements" };
        return Some(format!("{expected}, found {found}"));
    };
    let found = match root.to_ascii_lowercase().as_str() {
        // Macros that nobody has expanded; a namespace alone is what xacro leaves behind.
        "robot" if text.contains("<xacro:") || text.contains("${") => {
            return Some("expected plain URDF, found xacro macros: run `xacro FILE > arm.urdf` first".into());
        }
        "robot" => return None,
        "mujoco" | "mujocoinclude" => "MJCF, the format of MuJoCo".to_string(),
        "sdf" => "SDF, the format of Gazebo".to_string(),
        "html" => "a web page: was the download refused?".to_string(),
        _ => format!("<{}>", whole_file::one_line(root, 60)),
    };
    Some(format!("{expected}, found {found}"))
}

/// Name of the outermost element: the first tag that is no comment and no declaration.
fn first_element(text: &str) -> Option<&str> {
    let mut rest = text;
    loop {
        rest = &rest[rest.find('<')? + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = &comment[comment.find("-->")?..];
        } else if !rest.starts_with(['!', '?', '/']) {
            let end = rest.find(|c: char| c.is_whitespace() || ['/', '>'].contains(&c)).unwrap_or(rest.len());
            return Some(&rest[..end]);
        }
    }
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
        let long =
            format!("<robot name=\"a\"><link name=\"a\"><inertial><origin xyz=\"{}\u{1}\n\"/>", "a".repeat(20_000));
        for (text, expected) in
            [(deep, "arm.urdf"), (many, "1000 links"), (long, "arm.urdf"), (String::new(), "arm.urdf")]
        {
            std::fs::write(&path, text).unwrap();
            let message = read(&path).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("arm.urdf"), "{message}");
            assert!(!message.contains(char::is_control) && message.len() < 600, "{message:?}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(matches!(read(Path::new("/dev/zero")), Err(RobotError::Read { .. })));
    }
}
