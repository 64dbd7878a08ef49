//! Errors of arms and of inverse kinematics.

use std::path::{Path, PathBuf};

use thiserror::Error;
use urdf_file::UrdfError;

/// Why an arm cannot be loaded. Messages name the URDF, the key of [`super::RobotConfig`] or of the URDF, and what was expected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RobotError {
    /// No folder with the descriptions of arms.
    #[error("no folder with scenarios/base.toml at {} or above it: run from inside the project or pass --root", .start.display())]
    Root {
        /// Where the search began.
        start: PathBuf,
    },
    /// A folder that was named as the project's and is not.
    #[error("--root {}: expected a project folder, which holds scenarios/base.toml", .path.display())]
    NoProject {
        /// The folder.
        path: PathBuf,
    },
    /// The description of an arm cannot be read.
    #[error("{}: cannot be read, expected a TOML file with a table [robot]", .path.display())]
    Open {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The description of an arm is no TOML file, or has an unknown, missing or unfit key in its table `[robot]`.
    #[error("{}: {problem}", .path.display())]
    Description {
        /// File.
        path: PathBuf,
        /// Line, key and expectation.
        problem: String,
    },
    /// The URDF cannot be read.
    #[error("robot.urdf = {}: cannot be read, expected a URDF file", .path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file is not URDF.
    #[error("robot.urdf = {}: cannot be parsed: {reason}", .path.display())]
    Parse {
        /// File.
        path: PathBuf,
        /// The parser's words, on one line.
        reason: String,
    },
    /// A link of the configuration is not in the URDF, or does not descend from the base link.
    #[error("robot.{key} = {name:?}: no such link below the base in {}, {known}", .path.display())]
    UnknownLink {
        /// URDF.
        path: PathBuf,
        /// Key of the configuration.
        key: &'static str,
        /// Name given.
        name: String,
        /// Names that would do, in words.
        known: String,
    },
    /// A joint of the configuration is not in the URDF.
    #[error("robot.{key} has {name:?}: no such joint in {}, {known}", .path.display())]
    UnknownJoint {
        /// URDF.
        path: PathBuf,
        /// Key of the configuration.
        key: &'static str,
        /// Name given.
        name: String,
        /// Names that would do, in words.
        known: String,
    },
    /// A joint cannot play the part that it is given.
    #[error("joint {joint:?} of {}: {problem}", .path.display())]
    Joint {
        /// URDF.
        path: PathBuf,
        /// Joint.
        joint: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// A link has impossible values or shapes.
    #[error("link {link:?} of {}: {problem}", .path.display())]
    Link {
        /// URDF.
        path: PathBuf,
        /// Link.
        link: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// A list has not one entry for each joint.
    #[error("robot.{key} of {robot:?} has {found} entries, expected {expected}")]
    JointCount {
        /// Name of the robot.
        robot: String,
        /// Key of the configuration.
        key: &'static str,
        /// Entries given.
        found: usize,
        /// What was expected.
        expected: String,
    },
    /// A value of the configuration is out of its range.
    #[error("robot.{key} of {robot:?} is {value}, expected {expected}")]
    Value {
        /// Name of the robot.
        robot: String,
        /// Key of the configuration.
        key: String,
        /// Value given.
        value: String,
        /// What was expected.
        expected: String,
    },
}

impl From<UrdfError> for RobotError {
    fn from(error: UrdfError) -> Self {
        match error {
            UrdfError::Read { path, source } => Self::Read { path, source },
            UrdfError::Parse { path, reason } => Self::Parse { path, reason },
            UrdfError::Joint { path, joint, problem } => Self::Joint { path, joint, problem },
            UrdfError::Link { path, link, problem } => Self::Link { path, link, problem },
        }
    }
}

/// Why inverse kinematics has no solution.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum IkError {
    /// The seed or the target holds a value that is not finite.
    #[error("seed or target of inverse kinematics is not finite")]
    NotFinite,
    /// The iterations ended away from the target: it is out of reach, or only reachable on another branch.
    #[error(
        "inverse kinematics stopped after {iterations} iterations {position_error_m:.2e} m and {rotation_error_rad:.2e} rad \
         from the target"
    )]
    NotConverged {
        /// Distance that is left, m.
        position_error_m: f64,
        /// Angle that is left, rad.
        rotation_error_rad: f64,
        /// Iterations done.
        iterations: u32,
    },
}

/// Names of a file in a message: what would do.
pub(super) fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    match names.collect::<Vec<_>>().as_slice() {
        [] => "which has none at all".into(),
        names => whole_file::one_line(&format!("expected one of {}", names.join(", ")), 600),
    }
}

/// A name of a file in a message.
pub(super) fn quoted(name: &str) -> String {
    whole_file::one_line(name, 100)
}

pub(super) fn unknown_link<'a>(
    path: &Path,
    key: &'static str,
    name: &str,
    known: impl Iterator<Item = &'a str>,
) -> RobotError {
    RobotError::UnknownLink { path: path.into(), key, name: quoted(name), known: listed(known) }
}

pub(super) fn joint_error(path: &Path, joint: &str, problem: &str) -> RobotError {
    urdf_file::joint_error(path, joint, problem).into()
}

pub(super) fn link_error(path: &Path, link: &str, problem: &str) -> RobotError {
    urdf_file::link_error(path, link, problem).into()
}
