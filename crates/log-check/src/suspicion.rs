//! What looks wrong in a log.

use serde::Serialize;

use crate::Reading;

/// What looks wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Poses of object and tool, or sizes, do not fit together.
    Geometry,
    /// The object's height at rest is not that of the table.
    Height,
    /// Sign or axes of the wrench.
    WrenchAxes,
    /// Unit of forces, or the object's weight.
    ForceUnit,
    /// Torques are not about the tool's centre.
    TorquePoint,
    /// Joints and tool do not fit together.
    Joints,
    /// A sensor that reads the same in every row.
    DeadSensor,
    /// A sensor that stays at its limit.
    Clipped,
    /// Single readings far from those before and after.
    Outliers,
    /// Rows come at another rate than the header says.
    Rate,
    /// Distances between rows scatter.
    Jitter,
    /// Episodes that repeat another one.
    Repeated,
    /// A known weight far above the object's.
    AddedMass,
    /// Gravity of no place on Earth.
    Gravity,
    /// A given noise that is not what readings scatter by.
    Noise,
    /// A number given as exact that would explain what was found if it were not.
    HeldFixed,
}

/// Something that looks wrong in a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Suspicion {
    /// What.
    pub kind: Kind,
    /// What was found, with its numbers.
    pub found: String,
    /// What would mend it.
    pub mend: String,
    /// Episode and time, s, of a row that shows it.
    pub shown_at: Option<(u64, f64)>,
    /// Readings under which the log keeps the rules, the likeliest first; as good as each other by what the log shows.
    pub readings: Vec<Reading>,
}

impl Suspicion {
    /// One that no single row shows and that no reading mends.
    #[must_use]
    pub fn new(kind: Kind, found: String, mend: &str) -> Self {
        Self { kind, found, mend: mend.into(), shown_at: None, readings: Vec::new() }
    }

    /// Both sentences.
    #[must_use]
    pub fn sentence(&self) -> String {
        let at =
            self.shown_at.map(|(episode, secs)| format!(" See episode {episode} at {secs:.3} s.")).unwrap_or_default();
        format!("{}{at} {}", self.found, self.mend)
    }
}

/// With its first letter in upper case.
#[must_use]
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
