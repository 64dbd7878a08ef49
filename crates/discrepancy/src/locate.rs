//! Where simulation and measurement disagree: by channel and phase, with what chance would do.

use std::collections::BTreeMap;

use nalgebra::DVector;
use pomdp::{Purpose, Seed};
use rand_distr::{Distribution as _, StandardUniform};
use serde::Serialize;

use crate::fit::Fit;
use crate::simulator::{Nudge, Simulator};
use crate::trial::{Kind, Phase, groups};

/// So many residuals with a mean square of 1 are added to each episode's.
const FEW: f64 = 5.0;
/// Random flips of signs.
const FLIPS: usize = 999;
/// Parts that an episode is cut into for the heat map.
pub const TIMES: usize = 8;

/// A channel in a phase.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Channel.
    pub channel: Kind,
    /// Phase.
    pub phase: Phase,
    /// Share of all that is beyond noise.
    pub share: f64,
    /// Mean square of the residuals; 1 is noise.
    pub mean_square: f64,
    /// Chance that some cell would stand out as much although nothing is wrong.
    pub p_value: f64,
    /// Mean square in each eighth of the episodes; absent where nothing was read.
    pub over_time: [Option<f64>; TIMES],
}

#[derive(Default)]
struct Sums {
    /// Σ r² of each episode, and its number of residuals.
    episodes: Vec<(f64, usize)>,
    square: f64,
    count: usize,
    times: [(f64, usize); TIMES],
}

/// The cells of a fit, the largest share first.
///
/// Whether a cell stands out is judged between episodes, never between samples. An episode's excess is the logarithm of its mean square, drawn
/// towards 0 where it has few residuals, so that one odd episode does not hide what all show; under the hypothesis that nothing is wrong its sign
/// is a toss of a coin. The largest statistic of all cells under such tosses is what each is compared with.
#[must_use]
pub fn locate(simulator: &Simulator, chosen: &[usize], fit: &Fit, seed: u64) -> Vec<Cell> {
    let rolls = simulator.nominal.rolls();
    let hypothesis = fit.model.hypothesis(&fit.x);
    let mut cells: BTreeMap<(Kind, Phase), Sums> = BTreeMap::new();
    let groups = groups(chosen.iter().map(|index| &simulator.trials[*index]));
    for (place, index) in chosen.iter().enumerate() {
        let group = groups.partition_point(|group| group.end <= place);
        let trial = &simulator.trials[*index];
        let (_, readings) = simulator.readings(&hypothesis, &simulator.nominal.engine(), Nudge::default(), trial);
        let phases = trial.phases(&readings, rolls);
        let end_secs = trial.time_secs[trial.time_secs.len() - 1] - trial.time_secs[0];
        let residuals: &DVector<f64> = &fit.residuals[place];
        for (block, residual) in trial.blocks.iter().zip(residuals.iter()) {
            let middle = usize::midpoint(block.first, block.end - 1);
            let sums = cells.entry((block.kind, phases[middle])).or_default();
            sums.episodes.resize(groups.len(), (0.0, 0));
            sums.episodes[group].0 += residual * residual;
            sums.episodes[group].1 += 1;
            sums.square += residual * residual;
            sums.count += 1;
            let share = (trial.time_secs[middle] - trial.time_secs[0]) / end_secs;
            let time = &mut sums.times[((share * TIMES as f64) as usize).min(TIMES - 1)];
            time.0 += residual * residual;
            time.1 += 1;
        }
    }
    let excess: Vec<Vec<f64>> = (cells.values())
        .map(|sums| {
            let one = |(square, count): &(f64, usize)| ((square + FEW) / (*count as f64 + FEW)).ln();
            sums.episodes.iter().filter(|(_, count)| *count > 0).map(one).collect()
        })
        .collect();
    let mut rng = Seed(seed).stream(Purpose::Statistics, 1);
    let statistic = |excess: &[f64], signs: Option<&[bool]>| {
        let value = |i: usize| if signs.is_some_and(|signs| signs[i]) { -excess[i] } else { excess[i] };
        let n = excess.len() as f64;
        if n < 4.0 {
            // Of three episodes one toss in eight is as good as it gets.
            return 0.0;
        }
        let mean = (0..excess.len()).map(value).sum::<f64>() / n;
        let square = excess.iter().map(|e| e * e).sum::<f64>() / n;
        let variance = (square - mean * mean).max(1e-12) / (n - 1.0).max(1.0);
        mean / variance.sqrt()
    };
    let mut largest: Vec<f64> = (0..FLIPS)
        .map(|_| {
            let signs: Vec<bool> = (0..groups.len()).map(|_| StandardUniform.sample(&mut rng)).collect();
            excess.iter().map(|excess| statistic(excess, Some(&signs))).fold(f64::NEG_INFINITY, f64::max)
        })
        .collect();
    largest.sort_by(f64::total_cmp);
    let total: f64 = cells.values().map(|sums| (sums.square - sums.count as f64).max(0.0)).sum();
    let mut list: Vec<Cell> = (cells.iter().zip(&excess))
        .map(|(((channel, phase), sums), excess)| {
            let found = statistic(excess, None);
            let beyond = FLIPS - largest.partition_point(|value| *value < found);
            Cell {
                channel: *channel,
                phase: *phase,
                share: if total > 0.0 { (sums.square - sums.count as f64).max(0.0) / total } else { 0.0 },
                mean_square: sums.square / sums.count as f64,
                p_value: (beyond + 1) as f64 / (FLIPS + 1) as f64,
                over_time: sums.times.map(|(square, count)| (count > 0).then(|| square / count as f64)),
            }
        })
        .collect();
    list.sort_by(|a, b| b.share.total_cmp(&a.share));
    list
}
