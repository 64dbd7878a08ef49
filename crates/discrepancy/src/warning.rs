//! What a log's own readings say against it, beside what simulations say of it.

use log_check::{Check, Kind, Suspicion, capital};
use measured_log::{Log, Number};
use physics_model::rig::RigTool;
use serde::Serialize;

use crate::heldout::{Explanation, mean_squares, retuned};
use crate::noise::{NoiseLevels, Source};
use crate::nominal::Nominal;
use crate::thin::thinned;

/// Readings that are simulated, at most.
const SIMULATED: usize = 3;
/// Spread, as a share, that a number gets that is given as exact, to see whether that is why an effect was found.
const LOOSE: f64 = 0.5;
/// A loosened number explains as much as what was found if it closes this share of the same gap.
const AS_MUCH: f64 = 0.8;

/// Something that speaks against a log, or against an answer to it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// What.
    pub kind: Kind,
    /// What was found, where, and what would mend it.
    pub sentence: String,
    /// Mean squares of held-out episodes, as the log is read and as it may be meant, with nothing re-tuned; `None` where nothing was simulated.
    pub heldout: Option<[f64; 2]>,
}

/// Checks a log by its own readings; adds what its noise says.
#[must_use]
pub fn check(log: &Log, tool: &RigTool) -> Check {
    let arm = if let RigTool::Arm(arm) = tool { Some(&**arm) } else { None };
    let mut check = log_check::check(log, arm);
    let noise = NoiseLevels::of_log(log);
    let contradicted: Vec<Suspicion> = noise
        .all()
        .filter_map(|noise| {
            let scatter = noise.scatter.filter(|_| noise.source == Source::Given)?;
            noise.contradicts().then(|| {
                let (name, unit) = (noise.channel.name(), noise.unit);
                let found = format!(
                    "log.toml gives {name} a noise of {:.2e} {unit}, its readings scatter by {scatter:.2e}.",
                    noise.stddev
                );
                Suspicion::new(Kind::Noise, found, "Give what the sensor has, or leave it out: it is then estimated.")
            })
        })
        .collect();
    check.suspicions.extend(contradicted);
    check
}

/// The suspicions of a check, each with what held-out episodes say of the likeliest way in which the log may be meant: one simulated pass each.
#[must_use]
pub fn warnings(log: &Log, nominal: &Nominal, check: &Check, seed: u64) -> Vec<Warning> {
    let error = |log: &Log, nominal: &Nominal| {
        let (log, _) = thinned(log, nominal.has_tool(), seed);
        let nominal = nominal.clone().with_period_secs(log.header.period_secs);
        mean_squares(&log, &nominal, &[Explanation::of(&nominal)], seed)[0]
    };
    let mut own = None;
    let mut simulated = 0;
    check
        .suspicions
        .iter()
        .map(|suspicion| {
            let reading = suspicion.readings.first().filter(|_| simulated < SIMULATED);
            let meant = reading.map(|reading| reading.apply(log));
            let other =
                meant.and_then(|meant| Some((Nominal::new(&meant.header, nominal.tool().clone()).ok()?, meant)));
            let heldout = other.map(|(other, meant)| {
                simulated += 1;
                [*own.get_or_insert_with(|| error(log, nominal)), error(&meant, &other)]
            });
            let heldout = heldout.filter(|both| both.iter().all(|error| error.is_finite()));
            let proof = heldout.zip(reading).map(|([before, after], reading)| {
                format!(
                    " {}, the held-out error goes from {before:.3} to {after:.3} before anything is re-tuned.",
                    capital(&reading.words())
                )
            });
            let sentence = suspicion.sentence() + &proof.unwrap_or_default();
            Warning { kind: suspicion.kind, sentence, heldout }
        })
        .collect()
}

/// Numbers given as exact that, given a spread, would explain as much as what was found: `before` and `after` are the held-out errors of the answer.
#[must_use]
pub fn held_fixed(log: &Log, nominal: &Nominal, [before, after]: [f64; 2], seed: u64) -> Option<Warning> {
    let mut loose = thinned(log, nominal.has_tool(), seed).0.into_owned();
    let mut names: Vec<(&str, f64)> = Vec::new();
    let object = &mut loose.header.object;
    for (key, number) in [("object.mass_kg", &mut object.mass_kg), ("table.friction", &mut loose.header.table.friction)]
    {
        if let Number::Fixed(mean) = *number {
            names.push((key, mean));
            *number = Number::Uncertain { mean, stddev: LOOSE * mean };
        }
    }
    if names.is_empty() || before <= after.max(1.0) {
        return None;
    }
    let other = Nominal::new(&loose.header, nominal.tool().clone()).ok()?;
    let found = retuned(&loose, &other, seed);
    let with = mean_squares(&loose, &found, &[Explanation::of(&found)], seed)[0];
    if !with.is_finite() || before - with < AS_MUCH * (before - after) {
        return None;
    }
    let values: Vec<String> = names
        .iter()
        .filter_map(|(key, mean)| {
            let value = found.tunables.iter().find(|tunable| tunable.key == *key)?.mean;
            Some(format!("{key} = {value:.3} instead of {mean}"))
        })
        .collect();
    let sentence = format!(
        "{} given as exact. {} would explain as much: held-out error {with:.2}. Give such a number as {{ mean, stddev }} if it is not weighed.",
        if names.len() == 1 { "A number is" } else { "Numbers are" },
        values.join(" and ")
    );
    Some(Warning { kind: Kind::HeldFixed, sentence, heldout: Some([before, with]) })
}

#[cfg(test)]
mod tests {
    use log_check::Reading;

    use super::*;
    use crate::rig_tool;

    fn log(set: &str) -> Log {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mujoco-logs/logs/").to_owned() + set;
        measured_log::read(folder.as_ref()).unwrap()
    }

    fn nominal(log: &Log) -> Nominal {
        Nominal::new(&log.header, rig_tool(log, None).unwrap()).unwrap()
    }

    #[test]
    fn a_reversed_wrench_is_said_with_what_held_out_episodes_say_of_it() {
        let good = log("set-003");
        assert!(warnings(&good, &nominal(&good), &check(&good, nominal(&good).tool()), 1).is_empty());
        let reversed = Reading::Wrench([(0, -1), (1, -1), (2, -1)]).apply(&good);
        let nominal = nominal(&reversed);
        let found = warnings(&reversed, &nominal, &check(&reversed, nominal.tool()), 1);
        assert_eq!(found.iter().map(|warning| warning.kind).collect::<Vec<_>>(), [Kind::WrenchAxes]);
        let [before, after] = found[0].heldout.unwrap();
        assert!(after < 0.3 * before, "{:?}", found[0]);
        assert!(found[0].sentence.contains("with the wrench reversed"), "{}", found[0].sentence);
    }

    #[test]
    fn a_wrong_mass_that_is_given_as_exact_is_said() {
        let mut log = log("set-002");
        log.header.object.mass_kg = Number::Fixed(0.8);
        let nominal = nominal(&log);
        let found = held_fixed(&log, &nominal, [1.8, 1.4], 1).unwrap();
        assert!(found.kind == Kind::HeldFixed && found.sentence.contains("object.mass_kg"), "{found:?}");
        // Nothing is said where nothing was found.
        assert_eq!(held_fixed(&log, &nominal, [1.0, 1.0], 1), None);
    }

    #[test]
    fn a_noise_that_readings_contradict_is_said() {
        let mut log = log("set-002");
        log.header.noise.object_position_m = log.header.noise.object_position_m.map(|noise| 0.1 * noise);
        let found = check(&log, nominal(&log).tool()).suspicions;
        assert!(found.iter().any(|suspicion| suspicion.kind == Kind::Noise), "{found:?}");
    }
}
