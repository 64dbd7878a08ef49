//! A log beside its simulation, row by row.

use measured_log::{Channel, Episode, Log};
use rayon::prelude::*;

use crate::error::Error;
use crate::model_file::ModelFile;
use crate::nominal::Nominal;
use crate::prepared::Prepared;
use crate::progress::Progress;
use crate::simulator::{Hypothesis, Nudge, Simulator};
use crate::trial::{Place, Trial};

/// A row of a log, as measured and as simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the episode in the log.
    pub episode: u64,
    /// Piece of it: what is thrown is simulated in pieces, each from where the object was measured to be. The last row of one may be the first of the next.
    pub piece: usize,
    /// Time as in the log, s.
    pub time_secs: f64,
    /// As read.
    pub measured: Seen,
    /// As simulated. Where a simulation has ended early its last reading stands for the rest.
    pub simulated: Seen,
}

/// Where object and tool are, in the base frame; `None` where nothing says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Centre of the object's shape, m.
    pub object_m: Option<[f64; 3]>,
    /// Its orientation, body to base: quaternion x, y, z, w.
    pub orientation: Option<[f64; 4]>,
    /// Centre of the tool, m.
    pub tool_m: Option<[f64; 3]>,
}

/// Simulates a log with a model, each episode freely from its first pose of the object. `nominal`: of the log's header, without effects. Episodes that cannot
/// be simulated are left out.
///
/// # Errors
///
/// [`Error::Model`] for a model with a key that is nothing to re-tune in this log; [`Error::Unfit`] for a log that cannot be simulated.
pub fn overlay(
    log: &Log,
    name: &str,
    nominal: &Nominal,
    model: &ModelFile,
    progress: &dyn Progress,
) -> Result<Vec<Row>, Error> {
    let z = model.coordinates(nominal)?;
    let prepared = Prepared::new(log, name, nominal, 0)?;
    let inverse = prepared.units.inverse();
    let hypothesis = Hypothesis { z, effects: model.effects().iter().map(|effect| inverse.effect(effect)).collect() };
    let (simulated, noise) = (&prepared.nominal, &prepared.noise);
    let mut trials = Vec::new();
    // Of each trial the episode in the log, and which piece of it.
    let mut of = Vec::new();
    for (index, episode) in prepared.log.episodes.iter().enumerate() {
        let pieces = Trial::of_episode(&prepared.log, episode, noise, simulated.has_tool());
        of.extend((0..pieces.len()).map(|piece| (index, piece)));
        trials.extend(pieces);
    }
    let simulator = Simulator::new(simulated, &trials).watched_by(progress, log.episodes.len());
    simulator.stage("simulating");
    let (engine, length) = (simulated.engine(), prepared.units.factor("m"));
    let rows = |(trial, (index, piece)): (&Trial, &(usize, usize))| -> Vec<Row> {
        let (start, readings) = simulator.readings(&hypothesis, &engine, Nudge::default(), trial);
        let episode = &log.episodes[*index];
        let row = |place: Place| Row {
            episode: episode.id,
            piece: *piece,
            time_secs: place.time_secs,
            measured: measured(episode, place.time_secs),
            simulated: seen(&place, length),
        };
        trial.places(&start, &readings).into_iter().map(row).collect()
    };
    Ok(trials.par_iter().zip(&of).map(rows).collect::<Vec<_>>().concat())
}

/// What was read at a time of an episode.
fn measured(episode: &Episode, time_secs: f64) -> Seen {
    let row = episode.time_secs.partition_point(|time| *time < time_secs);
    Seen {
        object_m: episode.vector(Channel::ObjectPosition, row),
        orientation: episode.orientation(row),
        tool_m: episode.vector(Channel::Tool, row),
    }
}

/// A place in units of which one is so many metres.
fn seen(place: &Place, length: f64) -> Seen {
    let metres = |place: [f64; 3]| place.map(|value| length * value);
    Seen { object_m: Some(metres(place.object)), orientation: Some(place.orientation), tool_m: place.tool.map(metres) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded() -> Log {
        let logs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
        let mut log = measured_log::read(&logs.join("set-003")).unwrap();
        log.episodes.truncate(4);
        log
    }

    /// Root mean square distance of measured and simulated object, m.
    fn error_m(rows: &[Row]) -> f64 {
        let square = |row: &Row| {
            let [a, b] = [&row.measured, &row.simulated].map(|seen| seen.object_m.unwrap());
            (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>()
        };
        (rows.iter().map(square).sum::<f64>() / rows.len() as f64).sqrt()
    }

    #[test]
    fn the_tilt_that_a_log_has_brings_its_simulation_nearer() {
        let log = recorded();
        let nominal = Nominal::new(&log.header, crate::rig_tool(&log, None).unwrap()).unwrap();
        let tilt = |text: &str| {
            let model: ModelFile = toml::from_str(text).unwrap();
            overlay(&log, "log", &nominal, &model, &()).unwrap()
        };
        let level = tilt("version = 1");
        let tilted = tilt(
            "version = 1\n[effects]\nmodel = [{ table_tilt = { slope_x_rad = -0.0214, slope_y_rad = -0.0078 } }]\n",
        );
        assert_eq!(level.len(), log.episodes.iter().map(Episode::rows).sum::<usize>());
        let [before, after] = [&level, &tilted].map(|rows| error_m(rows));
        assert!(after < 0.8 * before && before < 0.1, "{before} {after}");
        let first = &tilted[0];
        assert_eq!(
            (first.episode, first.piece, first.time_secs),
            (log.episodes[0].id, 0, log.episodes[0].time_secs[0])
        );
        assert_eq!(first.measured.object_m, log.episodes[0].vector(Channel::ObjectPosition, 0));
        // It begins where the object was measured to be.
        let [a, b] = [first.measured, first.simulated].map(|seen| seen.object_m.unwrap());
        assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 0.005), "{a:?} {b:?}");
    }
}
