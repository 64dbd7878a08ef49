//! Descriptions of arms: TOML files with a table `[robot]`, in the folder of scenarios.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{RobotConfig, RobotError};

/// Size of a file.
const MOST_BYTES: u64 = 4 << 20;

/// The nearest folder at or above `start` that holds `scenarios/base.toml`: arms are in its `scenarios/robots`, their URDF files relative to it.
///
/// # Errors
///
/// [`RobotError::Root`] where there is none.
pub fn find_root(start: &Path) -> Result<PathBuf, RobotError> {
    let absolute = std::path::absolute(start).unwrap_or_else(|_| start.to_path_buf());
    absolute
        .ancestors()
        .find(|folder| folder.join("scenarios/base.toml").is_file())
        .map(Path::to_path_buf)
        .ok_or(RobotError::Root { start: absolute.clone() })
}

/// Refuses a project folder that somebody named and that is none.
///
/// # Errors
///
/// [`RobotError::NoProject`] where `root` does not hold `scenarios/base.toml`.
pub fn check_root(root: &Path) -> Result<(), RobotError> {
    if root.join("scenarios/base.toml").is_file() {
        Ok(())
    } else {
        Err(RobotError::NoProject { path: root.to_path_buf() })
    }
}

impl RobotConfig {
    /// Reads the table `[robot]` of a TOML file. A scenario's file of an arm has other tables as well: those are the scenario's.
    ///
    /// # Errors
    ///
    /// [`RobotError::Open`] where the file cannot be read, [`RobotError::Description`] where it has no such table or a wrong key in it.
    pub fn read(path: &Path) -> Result<Self, RobotError> {
        #[derive(Deserialize)]
        struct File {
            robot: RobotConfig,
        }
        let bytes = whole_file::read(path, MOST_BYTES)
            .map_err(|error| RobotError::Open { path: path.into(), source: error.source })?;
        let refuse =
            |problem: &str| RobotError::Description { path: path.into(), problem: whole_file::one_line(problem, 1000) };
        let text = std::str::from_utf8(&bytes)
            .map_err(|error| refuse(&format!("expected UTF-8 text, found another byte at {}", error.valid_up_to())))?;
        let file: File = toml::from_str(text).map_err(|error| {
            let line = whole_file::line_of(text, error.span().map_or(0, |span| span.start));
            refuse(&format!("line {line}: {}", whole_file::plain(error.message())))
        })?;
        Ok(file.robot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_is_its_table_robot_and_what_is_wrong_with_it_is_said_in_one_line() {
        let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let sawyer = RobotConfig::read(&root.join("scenarios/robots/sawyer.toml")).unwrap();
        assert_eq!((sawyer.name.as_str(), sawyer.actuated_joints.len()), ("sawyer", 7));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("arm.toml");
        let cases: [(&[u8], &str); 4] = [
            (b"[world]\n", "`robot` is missing"),
            (b"[robot]\nname = 3\n", "line 2"),
            (b"[robot]\nurfd = \"a\"\n", "there is no key `urfd`"),
            (b"\xff", "UTF-8"),
        ];
        for (bytes, expected) in cases {
            std::fs::write(&path, bytes).unwrap();
            let message = RobotConfig::read(&path).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("arm.toml"), "{message}");
            assert!(!message.contains(char::is_control), "{message:?}");
        }
        assert!(matches!(RobotConfig::read(Path::new("/dev/zero")), Err(RobotError::Open { .. })));
        assert!(matches!(find_root(folder.path()), Err(RobotError::Root { .. })));
    }
}
