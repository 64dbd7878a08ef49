//! What can go wrong.

/// Errors of this crate: one sentence each.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] measured_log::Error),
    /// A log of joints, or its arm, cannot be read.
    #[error(transparent)]
    Joints(#[from] arm_diagnosis::Error),
    /// A model cannot be built from the log's header, or from a model file.
    #[error("the nominal model: {reason}")]
    Model {
        /// What is wrong.
        reason: String,
    },
    /// The log lacks what a diagnosis needs.
    #[error("{log}: {reason}")]
    Unfit {
        /// Folder of the log.
        log: String,
        /// What is missing.
        reason: String,
    },
    /// The arm of a log cannot be found or read.
    #[error(transparent)]
    Robot(#[from] physics_model::robot::RobotError),
    /// The folder for the results cannot be made.
    #[error("cannot create {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: std::path::PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The folder for the results holds others.
    #[error("{source}: {}", source.source)]
    Taken {
        /// What is there.
        source: whole_file::Error,
    },
    /// A file could not be written whole.
    #[error("{source}: {}", source.source)]
    Write {
        /// What was tried, on which file, and why it failed.
        #[from]
        source: whole_file::Error,
    },
}
