//! What is wrong with a URDF file.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a file is no URDF that can be used. Messages name the file, the element and what was expected, on one line.
#[derive(Debug, Error)]
pub enum UrdfError {
    /// The file cannot be read.
    #[error("{}: cannot be read, expected a URDF file", .path.display())]
    Read {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file is not URDF.
    #[error("{}: cannot be parsed: {reason}", .path.display())]
    Parse {
        /// File.
        path: PathBuf,
        /// The parser's words.
        reason: String,
    },
    /// A joint is not as the format has it.
    #[error("joint {joint:?} of {}: {problem}", .path.display())]
    Joint {
        /// File.
        path: PathBuf,
        /// Joint.
        joint: String,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// A link is not as the format has it.
    #[error("link {link:?} of {}: {problem}", .path.display())]
    Link {
        /// File.
        path: PathBuf,
        /// Link.
        link: String,
        /// What is wrong and what was expected.
        problem: String,
    },
}

/// About the joint of that name.
#[must_use]
pub fn joint_error(path: &Path, joint: &str, problem: &str) -> UrdfError {
    let joint = whole_file::one_line(joint, 100);
    UrdfError::Joint { path: path.into(), joint, problem: whole_file::one_line(problem, 400) }
}

/// About the link of that name.
#[must_use]
pub fn link_error(path: &Path, link: &str, problem: &str) -> UrdfError {
    let link = whole_file::one_line(link, 100);
    UrdfError::Link { path: path.into(), link, problem: whole_file::one_line(problem, 400) }
}
