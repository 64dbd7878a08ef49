//! How much of a gap lies where only one of simulation and measurement has the tool touch the object, and by how much their contacts begin apart.
//!
//! A tool or object of another size than the log says, a tool or object that is tracked elsewhere, and clocks of force and pose that differ make no force that follows motion or place
//! ([`crate::terms`]): the wrist feels a whole contact too early or too late. A size shows as the same way of the tool in each episode, a clock as the same time.

use serde::Serialize;
use statrs::statistics::{Data, OrderStatistics as _};

use crate::replay::Replay;
use crate::trial::Touch;
use crate::units::Units;

/// It is told if this share of the square of the force's error lies there.
const TOLD: f64 = 0.25;
/// Way or time is what is alike if its middle half, as a share of the median, is as narrow beside the other's.
const CLEARLY: f64 = 0.5;
/// Contacts begin at readings; a median of so many of them, which is of one, says nothing.
const READINGS: f64 = 1.5;
/// Episodes that say anything.
const LEAST: usize = 6;

/// Where the tool touches the object in only one of simulation and measurement. Of the force in the plane of the table, in the episodes explained worst.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactGap {
    /// Episodes.
    pub episodes: usize,
    /// Where only the simulated tool touches.
    pub only_simulated: Part,
    /// Where only the measured tool does.
    pub only_measured: Part,
    /// How the first contacts begin; `None` where too few episodes have both.
    pub onset: Option<Onset>,
}

/// A part of the readings of the force on the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Share of the readings.
    pub readings: f64,
    /// Share of the square of measured less simulated force, beyond what the sensor's noise makes.
    pub square: f64,
}

/// By how much first measured contacts begin after first simulated ones, in the quarters of episodes: a quarter of them by less than the first, half by less than the second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Onset {
    /// Episodes with both.
    pub episodes: usize,
    /// Time, s; below 0 where the measured one begins first.
    pub after_secs: [f64; 3],
    /// The tool's way in that time, m, with the same sign.
    pub after_m: [f64; 3],
    /// Time between two readings, s: their median.
    pub reading_secs: f64,
    /// Time by which they begin apart, s, whichever is first: its median.
    #[serde(skip)]
    pub(crate) apart_secs: f64,
}

impl ContactGap {
    /// In units of which `units` says how much one of today's is.
    pub(crate) fn in_units(mut self, units: &Units) -> Self {
        if let Some(onset) = &mut self.onset {
            onset.after_m = onset.after_m.map(|way| units.factor("m") * way);
        }
        self
    }

    /// How contacts begin apart, if that is much of what is left, and where: three quarters of the episodes to the same side. The few readings of an impact may hold much of a square,
    /// too, a reading earlier or later.
    fn told(&self) -> Option<(Onset, Part)> {
        let onset = self.onset?;
        let [low, middle, high] = onset.after_secs;
        let part = if middle > 0.0 { self.only_simulated } else { self.only_measured };
        let apart = low * high > 0.0 && middle.abs() > READINGS * onset.reading_secs;
        (apart && part.square > TOLD).then_some((onset, part))
    }

    /// By how many readings first contacts begin apart in the median episode; 0 where that is not known.
    pub(crate) fn apart(&self) -> f64 {
        let apart = self.onset.map_or(0.0, |onset| onset.apart_secs / onset.reading_secs);
        if apart.is_finite() { apart } else { 0.0 }
    }

    /// What to do about it; `None` where it is little of what is left.
    pub(crate) fn next_experiment(&self) -> Option<&'static str> {
        Some(match self.told()?.0.alike() {
            Alike::Way => {
                "Measure the tool and the object, and touch the object from two opposite sides: with a wrong size both contacts are late or both early, with a wrong place one is late and one early."
            }
            Alike::Time => "Knock on the object: its poses and the force then show how far their clocks differ.",
            Alike::Both => {
                "Touch the object from two sides at two speeds. Contacts that begin apart by the same distance point to sizes or places, by the same time to \
                 clocks."
            }
        })
    }

    /// In words; `None` where it is little of what is left.
    pub(crate) fn sentence(&self) -> Option<String> {
        let (onset, part) = self.told()?;
        let ([_, secs, _], [_, way_m, _]) = (onset.after_secs, onset.after_m);
        let [only, other, when] =
            if secs > 0.0 { ["simulated", "measured", "after"] } else { ["measured", "simulated", "before"] };
        let readings = 100.0 * part.readings;
        let readings = if readings < 1.0 { "less than 1".into() } else { format!("{readings:.0}") };
        Some(format!(
            "{:.0} % of the squared error of the wrist lies in the {readings} % of its readings in which the {only} tool touches the object and the {other} one does not: \
             measured contacts begin {:.0} ms, or {:.1} mm of the tool's path, {when} simulated ones (medians of {} episodes{})",
            100.0 * part.square,
            1e3 * secs.abs(),
            1e3 * way_m.abs(),
            onset.episodes,
            match onset.alike() {
                Alike::Way =>
                    "; the distance is about the same in each: look at the sizes of tool and object, and at where both are tracked",
                Alike::Time => "; the time is about the same in each: look at the clocks of force and pose",
                Alike::Both =>
                    "; look at the sizes of tool and object, at where both are tracked, and at the clocks of force and pose",
            }
        ))
    }
}

/// In what first contacts begin apart alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Alike {
    Way,
    Time,
    /// At one speed both are.
    Both,
}

impl Onset {
    fn alike(&self) -> Alike {
        let [way, time] = [self.after_m, self.after_secs].map(|[low, middle, high]| ((high - low) / middle).abs());
        // What is told apart by less than a reading is not.
        let reading = (self.reading_secs / self.after_secs[1]).abs();
        if way + reading < CLEARLY * time {
            Alike::Way
        } else if time + reading < CLEARLY * way {
            Alike::Time
        } else {
            Alike::Both
        }
    }
}

/// Of replayed episodes; `None` without a sensor at the tool, and of too few episodes.
pub(crate) fn contact_gap(episodes: &[Vec<Replay>]) -> Option<ContactGap> {
    let touches = |pieces: &Vec<Replay>| -> Vec<Touch> {
        pieces.iter().flat_map(|replay| replay.trial.touches(&replay.start, &replay.readings)).collect()
    };
    of_touches(&episodes.iter().map(touches).filter(|rows| !rows.is_empty()).collect::<Vec<_>>())
}

fn of_touches(episodes: &[Vec<Touch>]) -> Option<ContactGap> {
    let sum = |counts: &dyn Fn(&Touch) -> bool| -> [f64; 2] {
        let rows = episodes.iter().flatten().filter(|touch| counts(touch));
        rows.fold([0.0; 2], |[count, square], touch| [count + 1.0, square + touch.square_n2])
    };
    let [count, square] = sum(&|_| true);
    if episodes.len() < LEAST || square <= 0.0 {
        return None;
    }
    let part = |measured: bool| {
        let [part_count, part_square] = sum(&|touch| touch.measured == measured && touch.simulated != measured);
        Part { readings: part_count / count, square: (part_square / square).clamp(0.0, 1.0) }
    };
    Some(ContactGap {
        episodes: episodes.len(),
        only_simulated: part(false),
        only_measured: part(true),
        onset: onset(episodes),
    })
}

fn onset(episodes: &[Vec<Touch>]) -> Option<Onset> {
    let after: Vec<[f64; 2]> = episodes.iter().filter_map(|rows| after(rows)).collect();
    let quarters = |of: usize| {
        let mut values = Data::new(after.iter().map(|both| both[of]).collect::<Vec<f64>>());
        [0.25, 0.5, 0.75].map(|share| values.quantile(share))
    };
    let steps = episodes.iter().flat_map(|rows| rows.windows(2).map(|two| two[1].time_secs - two[0].time_secs));
    let reading_secs = Data::new(steps.collect::<Vec<f64>>()).median();
    (after.len() >= LEAST).then(|| Onset {
        episodes: after.len(),
        after_secs: quarters(0),
        after_m: quarters(1),
        reading_secs,
        apart_secs: Data::new(after.iter().map(|[secs, _]| secs.abs()).collect::<Vec<f64>>()).median(),
    })
}

/// Time and way of the tool between the first contacts of an episode. A contact lasts two readings at least; one that an episode begins with has begun at no known time, and at
/// its start nothing is simulated to touch.
fn after(rows: &[Touch]) -> Option<[f64; 2]> {
    let first = |touches: fn(&Touch) -> bool| {
        (1..rows.len())
            .find(|row| touches(&rows[row - 1]) && touches(&rows[*row]))
            .map(|row| row - 1)
            .filter(|row| *row > 1)
    };
    let (simulated, measured) = (first(|touch| touch.simulated)?, first(|touch| touch.measured)?);
    let (from, to) = (simulated.min(measured), simulated.max(measured));
    let way_m: f64 = (rows[from..=to].windows(2))
        .map(|two| (two[1].tool_m[0] - two[0].tool_m[0]).hypot(two[1].tool_m[1] - two[0].tool_m[1]))
        .sum();
    let secs = rows[measured].time_secs - rows[simulated].time_secs;
    Some([secs, way_m * secs.signum()])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A push at a speed, of which the tool touches at 2 cm as simulated and at another place, or later, as measured; 2 N once it does.
    fn push(speed_mps: f64, farther_m: f64, later_secs: f64) -> Vec<Touch> {
        (0..200)
            .map(|row| {
                let time_secs = 0.01 * f64::from(row);
                let way = speed_mps * time_secs;
                let simulated = way > 0.02;
                let measured = speed_mps * (time_secs - later_secs) > 0.02 + farther_m;
                let square_n2 = if measured == simulated { 0.01 } else { 4.0 };
                Touch { time_secs, tool_m: [way, 0.0], measured, simulated, square_n2 }
            })
            .collect()
    }

    const SPEEDS: [f64; 6] = [0.02, 0.03, 0.05, 0.06, 0.08, 0.12];

    #[test]
    fn a_smaller_tool_touches_by_the_same_way_later() {
        let gap = of_touches(&SPEEDS.map(|speed| push(speed, 0.004, 0.0))).unwrap();
        let onset = gap.onset.unwrap();
        assert!(onset.after_m.iter().all(|way| (way - 0.004).abs() < 0.001_1), "{gap:?}");
        assert!(onset.after_secs[2] > 1.5 * onset.after_secs[0], "{gap:?}");
        assert!(gap.only_simulated.square > 0.9 && gap.only_measured.square == 0.0, "{gap:?}");
        let seconds: f64 = SPEEDS.iter().map(|speed| 0.004 / speed).sum::<f64>() / 12.0;
        assert!((gap.only_simulated.readings - seconds).abs() < 0.01, "{gap:?}");
        let sentence = gap.sentence().unwrap();
        assert!(sentence.contains("simulated tool touches") && sentence.contains("after simulated"), "{sentence}");
        assert!(sentence.contains("look at the sizes") && !sentence.contains("clocks"), "{sentence}");
        assert!(gap.next_experiment().unwrap().starts_with("Measure"));
        // At one speed nobody can tell a size from a clock.
        let slow = of_touches(&[0.05; 6].map(|speed| push(speed, 0.004, 0.0))).unwrap();
        assert!(slow.next_experiment().unwrap().contains("two speeds"), "{slow:?}");
    }

    #[test]
    fn a_late_clock_of_the_force_by_the_same_time_and_an_early_one_before() {
        let late = of_touches(&SPEEDS.map(|speed| push(speed, 0.0, 0.1))).unwrap();
        let onset = late.onset.unwrap();
        assert!(onset.after_secs.iter().all(|secs| (secs - 0.1).abs() < 0.011), "{late:?}");
        assert!(onset.after_m[2] > 1.5 * onset.after_m[0], "{late:?}");
        let early = of_touches(&SPEEDS.map(|speed| push(speed, 0.0, -0.1))).unwrap();
        assert!(early.onset.unwrap().after_m.iter().all(|way| *way < 0.0), "{early:?}");
        let sentence = early.sentence().unwrap();
        assert!(sentence.contains("before simulated") && sentence.contains("clocks of force"), "{sentence}");
        assert!(early.next_experiment().unwrap().contains("clocks"));
    }

    #[test]
    fn contacts_of_a_tool_that_is_elsewhere_begin_apart_though_half_of_them_are_early() {
        let secs = [0.1, -0.1, 0.1, -0.1, 0.1, -0.1];
        let gap = of_touches(&secs.map(|later| push(0.05, 0.0, later))).unwrap();
        assert!((gap.apart() - 10.0).abs() < 1.1, "{gap:?}");
        let same = of_touches(&SPEEDS.map(|speed| push(speed, 0.0, 0.0))).unwrap();
        assert_eq!(same.apart(), 0.0);
        // Without a contact in both nothing is known.
        let none = of_touches(&[0.0; 6].map(|_| push(0.0, 0.0, 0.0)));
        assert_eq!(none.map_or(0.0, |gap| gap.apart()), 0.0);
    }

    #[test]
    fn of_contacts_at_the_same_time_and_of_few_episodes_nothing_is_told() {
        let same = of_touches(&SPEEDS.map(|speed| push(speed, 0.0, 0.0))).unwrap();
        assert!(same.sentence().is_none() && same.onset.unwrap().after_secs == [0.0; 3], "{same:?}");
        // A reading later is an engine's way to touch, and as much of it as there is.
        let reading = of_touches(&SPEEDS.map(|speed| push(speed, 0.0, 0.01))).unwrap();
        assert!(reading.sentence().is_none() && reading.only_simulated.square > 0.5, "{reading:?}");
        assert!(of_touches(&SPEEDS[..5].iter().map(|speed| push(*speed, 0.004, 0.0)).collect::<Vec<_>>()).is_none());
        // A push that begins in touch, as measured, says nothing of when.
        let mut held = push(0.05, 0.004, 0.0);
        held.iter_mut().for_each(|touch| touch.measured = true);
        assert!(after(&held).is_none());
    }
}
