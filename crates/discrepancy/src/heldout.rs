//! What given models leave of a log's held-out episodes, on one scale: the truth beside what was found.

use measured_log::Log;
use nalgebra::DVector;

use crate::noise::NoiseLevels;
use crate::nominal::Nominal;
use crate::simulator::{Hypothesis, Simulator};
use crate::study::Study;
use crate::trial::Trial;

/// Held-out mean squares of `models`, each with its tunables at their means and its effects, with the errors that last learnt at `learnt_at`. The
/// split is that of a diagnosis with this seed.
#[must_use]
pub fn mean_squares(log: &Log, learnt_at: &Nominal, models: &[&Nominal], seed: u64) -> Vec<f64> {
    let noise = NoiseLevels::of_log(log);
    let holdout = log.split(seed).holdout;
    let trials: Vec<Trial> =
        holdout.iter().flat_map(|i| Trial::of_episode(log, &log.episodes[*i], &noise, learnt_at.has_tool())).collect();
    let plain = |nominal: &Nominal| Hypothesis { z: vec![0.0; nominal.tunables.len()], effects: Vec::new() };
    let simulator = Simulator::new(learnt_at, &trials);
    let mut study = Study::new(&simulator, learnt_at.engine(), (0..trials.len()).collect());
    study.learn_errors(&plain(learnt_at));
    let count = study.count().max(1) as f64;
    (models.iter())
        .map(|model| {
            let raw =
                Study::new(&Simulator::new(model, &trials), study.engine, study.chosen.clone()).raw(&plain(model));
            study.white(&raw, &[]).iter().map(DVector::norm_squared).sum::<f64>() / count
        })
        .collect()
}
