//! What can go wrong, each as one sentence with the value found and the one expected.

use std::path::{Path, PathBuf};

/// The words of a parser, on one line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Reason(pub(crate) String);

impl From<serde_json::Error> for Reason {
    fn from(error: serde_json::Error) -> Self {
        Self(whole_file::one_line(&whole_file::plain(&error.to_string()), 400))
    }
}

/// An error of the `prior` crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{}: cannot {action} this path", path.display())]
    Io {
        /// What was touched.
        path: PathBuf,
        /// Verb: "read", "write", …
        action: &'static str,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// A network of the other kind of belief.
    #[error("{}: holds {found}, expected {expected}, the network of belief.filter = \"{filter}\": choose another --prior or --preset", folder.display())]
    OtherKind {
        /// Folder of the network.
        folder: PathBuf,
        /// File that is there.
        found: &'static str,
        /// File that is missing.
        expected: &'static str,
        /// Filter of the scenario.
        filter: &'static str,
    },
    /// A dataset of another task.
    #[error("dataset: schema.{key} is {found}, expected {expected}")]
    Schema {
        /// Key of the schema.
        key: &'static str,
        /// What it holds.
        found: String,
        /// What this task has.
        expected: String,
    },
    /// A shape that does not exist.
    #[error("dataset: {name} of episode {episode} is class {found}, expected one of 0 to {}", labels - 1)]
    Class {
        /// Episode.
        episode: u64,
        /// Class target.
        name: String,
        /// Its class.
        found: u8,
        /// Number of its labels.
        labels: usize,
    },
    /// A JSON file that does not parse (truncated, or keys that this version does not know).
    #[error("{}: not a readable {kind} file (truncated or edited?)", path.display())]
    Json {
        /// File.
        path: PathBuf,
        /// "prior" or "training state".
        kind: &'static str,
        /// Cause.
        #[source]
        source: Reason,
    },
    /// A file of another format version.
    #[error("{}: format version {found}, but this program reads version {expected}", path.display())]
    Version {
        /// File.
        path: PathBuf,
        /// Version in the file.
        found: u64,
        /// Version of this program.
        expected: u64,
    },
    /// A binary file of the wrong length.
    #[error("{}: {found} bytes, but {expected} were written (truncated?)", path.display())]
    Length {
        /// File.
        path: PathBuf,
        /// Bytes in the file.
        found: u64,
        /// Bytes recorded.
        expected: u64,
    },
    /// A binary file whose content changed.
    #[error("{}: blake3 is {found}, but {expected} was recorded (damaged or replaced)", path.display())]
    Hash {
        /// File.
        path: PathBuf,
        /// Hash of the file.
        found: String,
        /// Hash recorded.
        expected: String,
    },
    /// Weights that do not fit the network in the same folder.
    #[error("{}: tensor `{tensor}` is {found}, but the network needs {expected}", path.display())]
    Tensor {
        /// File.
        path: PathBuf,
        /// Tensor.
        tensor: String,
        /// Shape found, or "missing".
        found: String,
        /// Shape expected.
        expected: String,
    },
    /// A prior that contradicts itself, or a weights file that is not safetensors.
    #[error("{}: not usable as a prior: {reason}", path.display())]
    Format {
        /// File.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// A prior of another arm.
    #[error("{}: trained for the robot `{found}`, but this problem uses `{expected}`", path.display())]
    Robot {
        /// File.
        path: PathBuf,
        /// Robot of the prior.
        found: String,
        /// Robot of the problem.
        expected: String,
    },
    /// A prior of another observation or (s, Θ) layout.
    #[error("{}: {part} {index} is {found}, but this problem has {expected}", path.display())]
    Layout {
        /// File.
        path: PathBuf,
        /// "observation", "continuous target" or "class target".
        part: &'static str,
        /// First position that differs.
        index: usize,
        /// Name in the prior.
        found: String,
        /// Name in the problem.
        expected: String,
    },
    /// A training example of the wrong size.
    #[error("sequence {sequence}: {field} holds {found} values, expected {expected}")]
    Size {
        /// Index of the sequence.
        sequence: usize,
        /// Field of `Sequence`.
        field: &'static str,
        /// Its length.
        found: usize,
        /// Length that the layout and the number of steps ask for.
        expected: usize,
    },
    /// A training example with a value that cannot be learnt.
    #[error("sequence {sequence}, step {step}: {name} is {found}, expected {expected}")]
    Value {
        /// Index of the sequence.
        sequence: usize,
        /// Step in the sequence.
        step: usize,
        /// Name from the layout.
        name: String,
        /// Offending value.
        found: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// A setting out of range.
    #[error("{setting} is {found}, expected {expected}")]
    Config {
        /// Setting.
        setting: &'static str,
        /// Offending value.
        found: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// Nothing to train on, or nothing to judge by.
    #[error("{training} training and {held_out} held-out sequences: both parts need at least one")]
    Split {
        /// Training sequences.
        training: usize,
        /// Held-out sequences.
        held_out: usize,
    },
    /// A training state that belongs to other data.
    #[error("{}: belongs to training data with blake3 {found}, but this data has {expected}", path.display())]
    OtherData {
        /// File.
        path: PathBuf,
        /// Hash in the file.
        found: String,
        /// Hash of the data given.
        expected: String,
    },
    /// The gradient left the finite numbers.
    #[error("epoch {epoch}, step {step}: the gradient norm is {norm}; lower the learning rate or clip")]
    Diverged {
        /// Epoch.
        epoch: usize,
        /// Optimiser step within the epoch.
        step: usize,
        /// Norm found.
        norm: f64,
    },
}

impl Error {
    pub(crate) fn io(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { path, action, source }
    }
}
