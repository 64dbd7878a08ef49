//! URDF files: read in bounded memory, time and depth.

use std::path::Path;

use super::RobotError;

/// Size of a file.
const MOST_BYTES: u64 = 16 << 20;
/// Depth of its elements; those of URDF are five deep.
const MOST_LEVELS: usize = 100;
/// Links or joints: each is compared with all others, and a chain of them is walked by a function that calls itself.
const MOST_LINKS: usize = 1000;

/// Reads a file of bounded size, depth and number of links.
pub(super) fn read(path: &Path) -> Result<urdf_rs::Robot, RobotError> {
    let bytes = whole_file::read(path, MOST_BYTES)
        .map_err(|error| RobotError::Read { path: path.into(), source: error.source })?;
    let refuse = |reason: &str| RobotError::Parse { path: path.into(), reason: whole_file::one_line(reason, 300) };
    let text = std::str::from_utf8(&bytes).map_err(|error| refuse(&error.to_string()))?;
    // The parser calls itself for each level, and so does what frees its tree.
    if nesting(text) > MOST_LEVELS {
        return Err(refuse(&format!("expected elements at most {MOST_LEVELS} deep")));
    }
    let description = urdf_rs::read_from_string(text).map_err(|error| refuse(&error.to_string()))?;
    let found = description.links.len().max(description.joints.len());
    if found > MOST_LINKS {
        return Err(refuse(&format!("expected at most {MOST_LINKS} links and joints, found {found}")));
    }
    Ok(description)
}

/// How deep the elements are nested at most; comments and declarations count for nothing.
fn nesting(text: &str) -> usize {
    let (mut depth, mut deepest, mut rest) = (0_usize, 0, text);
    while let Some(start) = rest.find('<') {
        rest = &rest[start + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = comment.find("-->").map_or("", |end| &comment[end..]);
        } else if rest.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !rest.starts_with(['!', '?']) {
            deepest = deepest.max(depth + 1);
            let alone = rest.find('>').is_some_and(|end| rest[..end].ends_with('/'));
            depth += usize::from(!alone);
        }
    }
    deepest
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
    fn what_would_overflow_the_stack_or_never_end_is_refused_in_one_line() {
        let folder = std::env::temp_dir().join(format!("surmise-urdf-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("arm.urdf");
        let deep = format!("<robot name=\"a\">{}", "<link name=\"a\">".repeat(200_000));
        let many = format!("<robot name=\"a\">{}</robot>", "<link name=\"a\"/>".repeat(2000));
        let long =
            format!("<robot name=\"a\"><link name=\"a\"><inertial><origin xyz=\"{}\u{1}\n\"/>", "a".repeat(20_000));
        for (text, expected) in
            [(deep, "100 deep"), (many, "1000 links"), (long, "arm.urdf"), (String::new(), "arm.urdf")]
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
