//! Arms from files of either kind: a URDF, or a TOML description with a table `[robot]` that names one.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::arm::{Arm, ArmError, Selection};

/// Size of a description.
const MOST_BYTES: u64 = 4 << 20;

/// What is read of a description; its other keys are those of the planner.
#[derive(Debug, Deserialize)]
struct Description {
    robot: Table,
}

#[derive(Debug, Deserialize)]
struct Table {
    urdf: PathBuf,
    actuated_joints: Vec<String>,
    tool_link: Option<String>,
}

impl Arm {
    /// Reads a URDF file, or a TOML file with a table `[robot]`, whose `urdf` is relative to the file's folder or to one above it. What `selection` says goes
    /// before what the description says.
    ///
    /// # Errors
    ///
    /// [`ArmError`] if a file cannot be read, or holds no chain as selected.
    pub fn open(path: &Path, selection: &Selection) -> Result<Self, ArmError> {
        if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("toml")) {
            return Self::load(path, selection);
        }
        let refuse = |problem: &str| ArmError::Arm { path: path.into(), problem: whole_file::one_line(problem, 500) };
        let bytes = whole_file::read(path, MOST_BYTES)
            .map_err(|_| refuse("cannot be read, expected a TOML file with a table [robot]"))?;
        let text = std::str::from_utf8(&bytes).map_err(|_| refuse("expected UTF-8 text"))?;
        let description: Description = toml::from_str(text).map_err(|error| {
            let line = whole_file::line_of(text, error.span().map_or(0, |span| span.start));
            refuse(&format!("line {line}: {}", whole_file::plain(error.message())))
        })?;
        let robot = description.robot;
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        let places = absolute.ancestors().skip(1).map(|folder| folder.join(&robot.urdf));
        let urdf = places.clone().find(|place| place.is_file()).or_else(|| places.clone().next()).unwrap_or_default();
        let selection = Selection {
            joints: selection.joints.clone().or(Some(robot.actuated_joints)),
            tip: selection.tip.clone().or(robot.tool_link),
        };
        Self::load(&urdf, &selection)
    }
}
