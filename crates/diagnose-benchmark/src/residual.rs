//! What re-tuning leaves, learnt without a name: one Gaussian process for each measured component, of what the simulation says at the time
//! (model discrepancy in the sense of Kennedy & O'Hagan, Bayesian calibration of computer models, 2001).

use std::collections::BTreeMap;

use discrepancy::Nominal;
use discrepancy::heldout::{self, Correction, Explanation};
use discrepancy::trial::{Block, Kind, Trial};
use measured_log::Log;
use physics_model::rig::RigReading;
use rayon::prelude::*;

use crate::gaussian_process::GaussianProcess;

/// Blocks of a component that its process learns from, at most: their number cubed is what it costs.
const POINTS: usize = 400;

/// Held-out mean square of the model that is re-tuned, then corrected by Gaussian processes of what it leaves of the fitted episodes; `learnt_at` and
/// `seed` as in [`heldout::mean_squares`].
#[must_use]
pub fn mean_square(log: &Log, nominal: &Nominal, learnt_at: &Nominal, seed: u64) -> f64 {
    let retuned = heldout::retuned(log, nominal, seed);
    let processes = processes(&heldout::simulated(log, &retuned, &log.split(seed).fit));
    let correction: Correction = &|trial, readings| {
        let at = |kind, component| processes.get(&(kind, component));
        let of = |block: &Block| {
            at(block.kind, block.component)
                .map_or(0.0, |process| process.predict(&inputs(trial, readings, block.first)))
        };
        trial.blocks.iter().map(of).collect()
    };
    heldout::mean_squares(log, learnt_at, &[Explanation { model: &retuned, correction: Some(correction) }], seed)[0]
}

type Simulated = (Trial, Vec<RigReading>, Vec<f64>);

fn processes(episodes: &[Simulated]) -> BTreeMap<(Kind, usize), GaussianProcess> {
    let mut blocks: BTreeMap<(Kind, usize), Vec<(usize, usize)>> = BTreeMap::new();
    for (episode, (trial, ..)) in episodes.iter().enumerate() {
        for (index, block) in trial.blocks.iter().enumerate() {
            blocks.entry((block.kind, block.component)).or_default().push((episode, index));
        }
    }
    let fitted = |(component, all): ((Kind, usize), Vec<(usize, usize)>)| {
        let count = all.len().min(POINTS);
        let chosen = (0..count).map(|i| all[i * all.len() / count]);
        let (x, y, groups): (Vec<_>, Vec<_>, Vec<_>) = chosen
            .map(|(episode, index)| {
                let (trial, readings, residuals) = &episodes[episode];
                (inputs(trial, readings, trial.blocks[index].first), residuals[index], episode)
            })
            .collect();
        GaussianProcess::fit(&x, &y, &groups).map(|process| (component, process))
    };
    blocks.into_iter().collect::<Vec<_>>().into_par_iter().filter_map(fitted).collect()
}

/// What a process knows of a row, as simulated: time since the start, s; place (m), heading, velocity (m/s) and spin (rad/s) of the object in the
/// plane; the tool from it in its own axes, m, and its velocity, m/s; force on the tool, N; known weight, kg. In base axes unless said otherwise.
fn inputs(trial: &Trial, readings: &[RigReading], row: usize) -> Vec<f64> {
    let reading = |tick: usize| readings.get(tick.saturating_sub(1)).or(readings.last());
    let tick = trial.tick(row);
    let time_secs = trial.time_secs[row] - trial.time_secs[0];
    let Some(now) = reading(tick) else { return vec![0.0; 15] };
    let object = &now.object;
    let [qx, qy, qz, qw] = object.orientation;
    // First column of the rotation: where the object's x axis points.
    let [cos, sin] = [1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz)];
    let [x, y, _] = object.position_m;
    let [tool_x, tool_y, _] = now.tool_m.unwrap_or_default();
    let [before_x, before_y, _] = reading(tick.saturating_sub(1)).and_then(|r| r.tool_m).unwrap_or_default();
    let tick_secs = time_secs / tick.max(1) as f64;
    let [away_x, away_y] = if now.tool_m.is_some() { [tool_x - x, tool_y - y] } else { [0.0; 2] };
    vec![
        time_secs,
        x,
        y,
        cos,
        sin,
        object.linear_mps[0],
        object.linear_mps[1],
        object.angular_rps[2],
        cos * away_x + sin * away_y,
        cos * away_y - sin * away_x,
        (tool_x - before_x) / tick_secs,
        (tool_y - before_y) / tick_secs,
        now.wrench.force_n[0],
        now.wrench.force_n[1],
        trial.added_mass_kg,
    ]
}
