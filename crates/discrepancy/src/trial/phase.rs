//! What goes on in an episode.

use physics_model::rig::RigReading;
use serde::Serialize;

use super::Trial;

/// Less than this, N, is no contact.
const CONTACT_N: f64 = 0.02;
/// How long, s, a contact is new.
const ONSET_SECS: f64 = 0.1;

/// What goes on in an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Nothing has touched the tool yet.
    FreeMotion,
    /// The first tenth of a second of a contact.
    ContactOnset,
    /// Tool and object touch, and the object does not roll.
    Sliding,
    /// Tool and a round object touch.
    Rolling,
    /// The tool has touched the object before.
    AfterContact,
}

impl Phase {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::FreeMotion => "free motion",
            Self::ContactOnset => "contact onset",
            Self::Sliding => "sliding",
            Self::Rolling => "rolling",
            Self::AfterContact => "after contact",
        }
    }
}

impl Trial {
    /// What goes on in each row of a simulated episode.
    #[must_use]
    pub fn phases(&self, readings: &[RigReading], rolls: bool) -> Vec<Phase> {
        let onset = (ONSET_SECS / self.tick_secs()).ceil() as usize;
        let (mut since, mut touched, mut by_tick) = (0, false, vec![Phase::FreeMotion]);
        for reading in readings {
            if reading.wrench.force_magnitude_n() > CONTACT_N {
                since = if touched { since + 1 } else { 0 };
                touched = true;
                let moving = if rolls { Phase::Rolling } else { Phase::Sliding };
                by_tick.push(if since < onset { Phase::ContactOnset } else { moving });
            } else {
                let before = touched || by_tick.last().is_some_and(|phase| *phase != Phase::FreeMotion);
                touched = false;
                by_tick.push(if before { Phase::AfterContact } else { Phase::FreeMotion });
            }
        }
        self.rows.iter().map(|(tick, _)| by_tick[(*tick).min(by_tick.len() - 1)]).collect()
    }

    /// Duration of a tick, s, as the rows say.
    fn tick_secs(&self) -> f64 {
        let (last, _) = self.rows[self.rows.len() - 1];
        (self.time_secs[self.time_secs.len() - 1] - self.time_secs[0]) / last.max(1) as f64
    }
}
