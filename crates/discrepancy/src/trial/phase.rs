//! What goes on in an episode.

use physics_model::rig::RigReading;
use serde::Serialize;

use super::Trial;

/// Less than this, N, is no contact.
const CONTACT_N: f64 = 0.02;
/// What is thrown is held if its acceleration differs from gravity's by this share of it.
const HELD: f64 = 0.3;
/// How long, s, its impact on the table lasts.
const IMPACT_SECS: f64 = 0.02;
/// How long, s, a contact is new.
const ONSET_SECS: f64 = 0.1;

/// What goes on in an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Nothing has touched the tool yet; of what is thrown: it has touched nothing.
    FreeMotion,
    /// The first tenth of a second of a contact; of what is thrown, its first 20 ms.
    ContactOnset,
    /// Tool and object touch, and the object does not roll; of what is thrown: it touches the table, be it at rest.
    Sliding,
    /// The same of a round object.
    Rolling,
    /// Tool and object, or what is thrown and the table, have touched before.
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
    /// What goes on in each row of a simulated episode. Of what is thrown the readings say when it does not fall with `gravity_mps2`.
    #[must_use]
    pub fn phases(&self, readings: &[RigReading], rolls: bool, gravity_mps2: f64) -> Vec<Phase> {
        let tick_secs = self.tick_secs();
        let onset_secs = if self.tool_m.is_some() { ONSET_SECS } else { IMPACT_SECS };
        let onset = (onset_secs / tick_secs).ceil() as usize;
        let mut before_mps = self.start.linear_mps;
        let mut touches = |reading: &RigReading| {
            let [ax, ay, az] = std::array::from_fn(|i| (reading.object.linear_mps[i] - before_mps[i]) / tick_secs);
            before_mps = reading.object.linear_mps;
            let held_mps2 = ax.hypot(ay).hypot(az + gravity_mps2);
            if self.tool_m.is_some() {
                reading.wrench.force_magnitude_n() > CONTACT_N
            } else {
                held_mps2 > HELD * gravity_mps2
            }
        };
        let (mut since, mut touched, mut by_tick) = (0, false, vec![Phase::FreeMotion]);
        for (tick, reading) in readings.iter().enumerate() {
            if touches(reading) {
                // A piece of a toss may begin on the table.
                since = if touched {
                    since + 1
                } else if tick == 0 && self.tool_m.is_none() {
                    onset
                } else {
                    0
                };
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
