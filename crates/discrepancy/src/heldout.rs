//! What given models leave of a log's held-out episodes, on one scale: the truth beside what was found.

use measured_log::Log;
use nalgebra::DVector;
use physics_model::rig::RigReading;
use rayon::prelude::*;

use crate::fit::{Begin, Effort, fit};
use crate::model::Model;
use crate::noise::NoiseLevels;
use crate::nominal::{Engine, Nominal};
use crate::simulator::{Hypothesis, Nudge, Simulator};
use crate::split::reported;
use crate::study::Study;
use crate::trial::Trial;

/// What is expected of the residuals of a simulated episode: one number a block, taken from them.
pub type Correction<'a> = &'a (dyn Fn(&Trial, &[RigReading]) -> Vec<f64> + Sync);

/// A model with its tunables at their means, and what corrects it.
#[derive(Clone, Copy)]
pub struct Explanation<'a> {
    /// The model.
    pub model: &'a Nominal,
    /// What is taken from its residuals.
    pub correction: Option<Correction<'a>>,
}

impl<'a> Explanation<'a> {
    /// Of a model alone.
    #[must_use]
    pub fn of(model: &'a Nominal) -> Self {
        Self { model, correction: None }
    }
}

/// Mean squares of `explanations` on the held-out episodes that a report is of, with the errors that last learnt at `learnt_at`. The split is that of a diagnosis with this seed.
#[must_use]
pub fn mean_squares(log: &Log, learnt_at: &Nominal, explanations: &[Explanation], seed: u64) -> Vec<f64> {
    let trials = trials(log, &reported(log, &log.split(seed).holdout), learnt_at.has_tool());
    let simulator = Simulator::new(learnt_at, &trials);
    let mut study = Study::new(&simulator, learnt_at.engine(), (0..trials.len()).collect());
    study.learn_errors(&at_means(learnt_at));
    let count = study.count().max(1) as f64;
    (explanations.iter())
        .map(|explanation| {
            let raw = residuals(explanation, &study.engine, &trials);
            study.white(&raw, &[]).iter().map(DVector::norm_squared).sum::<f64>() / count
        })
        .collect()
}

/// The null hypothesis of a diagnosis with this seed: `nominal` re-tuned to the episodes that are not held out, its values as the means.
#[must_use]
pub fn retuned(log: &Log, nominal: &Nominal, seed: u64) -> Nominal {
    let trials = trials(log, &log.split(seed).fit, nominal.has_tool());
    let simulator = Simulator::new(nominal, &trials);
    let mut study = Study::new(&simulator, nominal.engine(), (0..trials.len()).collect());
    let (tunables, clocks) = (nominal.tunables.len(), nominal.clocks());
    let first =
        fit(&study, Model::nominal(tunables, 0).with_clocks(clocks), Begin::at(&vec![0.0; tunables]), Effort::Quick);
    study.learn_errors(&first.model.hypothesis(&first.x));
    let model = Model::nominal(tunables, study.engine_errors()).with_clocks(clocks);
    let mut x = first.x;
    x.resize(model.count(), 0.0);
    let found = fit(&study, model, Begin::at(&x), Effort::Full);
    let mut retuned = nominal.clone();
    for (tunable, z) in retuned.tunables.iter_mut().zip(&found.x) {
        tunable.set(tunable.value(*z));
    }
    retuned
}

/// Episodes of a log that are compared, with what a model's simulation of each says and its standardised residuals.
#[must_use]
pub fn simulated(log: &Log, model: &Nominal, episodes: &[usize]) -> Vec<(Trial, Vec<RigReading>, Vec<f64>)> {
    let trials = trials(log, episodes, model.has_tool());
    let simulator = Simulator::new(model, &trials);
    let found: Vec<_> = trials.par_iter().map(|trial| one(&simulator, &model.engine(), trial)).collect();
    trials.into_iter().zip(found).map(|(trial, (readings, residuals))| (trial, readings, residuals)).collect()
}

fn residuals(explanation: &Explanation, engine: &Engine, trials: &[Trial]) -> Vec<Vec<f64>> {
    let simulator = Simulator::new(explanation.model, trials);
    let corrected = |trial: &Trial| {
        let (readings, mut residuals) = one(&simulator, engine, trial);
        if let Some(correction) = explanation.correction {
            residuals.iter_mut().zip(correction(trial, &readings)).for_each(|(residual, share)| *residual -= share);
        }
        residuals
    };
    trials.par_iter().map(corrected).collect()
}

fn one(simulator: &Simulator, engine: &Engine, trial: &Trial) -> (Vec<RigReading>, Vec<f64>) {
    let (first, readings) = simulator.readings(&at_means(simulator.nominal), engine, Nudge::default(), trial);
    let residuals = trial.residuals(&first, &readings);
    (readings, residuals)
}

fn trials(log: &Log, episodes: &[usize], has_tool: bool) -> Vec<Trial> {
    let noise = NoiseLevels::of_log(log);
    episodes.iter().flat_map(|i| Trial::of_episode(log, &log.episodes[*i], &noise, has_tool)).collect()
}

fn at_means(nominal: &Nominal) -> Hypothesis {
    Hypothesis { z: vec![0.0; nominal.tunables.len()], effects: Vec::new() }
}
