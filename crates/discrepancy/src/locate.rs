//! Where simulation and measurement disagree: by channel and phase, with what chance would do.

use std::collections::BTreeMap;

use nalgebra::DVector;
use pomdp::{Purpose, Seed};
use rand_distr::{Distribution as _, StandardUniform};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::fit::Fit;
use crate::simulator::{Nudge, Simulator};
use crate::trial::{Kind, Phase, groups};

/// So many residuals with a mean square of 1 are added to each episode's.
const FEW: f64 = 5.0;
/// Random flips of signs, where there are fewer than ways to flip them.
const FLIPS: usize = 9_999;
/// Up to so many episodes every way is tried.
const FEW_EPISODES: usize = 13;
/// Of three episodes one flip in eight is as good as it gets.
const LEAST_EPISODES: usize = 4;
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

/// Chance below which a cell stands out.
const SIGNIFICANT: f64 = 0.05;

impl Cell {
    /// Whether it stands out in most episodes.
    #[must_use]
    pub fn stands_out(&self) -> bool {
        self.p_value <= SIGNIFICANT
    }
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
/// Whether a cell stands out is judged between episodes, never between samples: an episode's excess is the logarithm of its mean square, drawn
/// towards 0 where it has few residuals, so that one odd episode does not hide what all show (see `chances`).
#[must_use]
pub fn locate(simulator: &Simulator, chosen: &[usize], fit: &Fit, seed: u64) -> Vec<Cell> {
    let (rolls, gravity_mps2) = (simulator.nominal.rolls(), simulator.nominal.header().gravity_mps2);
    let hypothesis = fit.model.hypothesis(&fit.x);
    let mut cells: BTreeMap<(Kind, Phase), Sums> = BTreeMap::new();
    let groups = groups(chosen.iter().map(|index| &simulator.trials[*index]));
    for (place, index) in chosen.iter().enumerate() {
        let group = groups.partition_point(|group| group.end <= place);
        let trial = &simulator.trials[*index];
        let (_, readings) = simulator.readings(&hypothesis, &simulator.nominal.engine(), Nudge::default(), trial);
        let phases = trial.phases(&readings, rolls, gravity_mps2);
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
    let excess: Vec<Vec<Option<f64>>> = (cells.values())
        .map(|sums| {
            let one =
                |(square, count): &(f64, usize)| (*count > 0).then(|| ((square + FEW) / (*count as f64 + FEW)).ln());
            sums.episodes.iter().map(one).collect()
        })
        .collect();
    let chances = chances(&excess, groups.len(), seed);
    let total: f64 = cells.values().map(|sums| (sums.square - sums.count as f64).max(0.0)).sum();
    let mut list: Vec<Cell> = (cells.iter().zip(chances))
        .map(|(((channel, phase), sums), p_value)| Cell {
            channel: *channel,
            phase: *phase,
            share: if total > 0.0 { (sums.square - sums.count as f64).max(0.0) / total } else { 0.0 },
            mean_square: sums.square / sums.count as f64,
            p_value,
            over_time: sums.times.map(|(square, count)| (count > 0).then(|| square / count as f64)),
        })
        .collect();
    list.sort_by(|a, b| b.share.total_cmp(&a.share));
    list
}

/// Chance, for each cell, that some cell would stand out as much although nothing is wrong. `excess`: of each cell in each of so many episodes, where it
/// was read.
///
/// Under the hypothesis that nothing is wrong the sign of an episode is a toss of a coin, the same for all its cells: a permutation test over episodes,
/// with the least chance of all cells for its statistic (Westfall & Young, Resampling-Based Multiple Testing, 1993). A cell's chance by itself is that
/// of Student's t of its excesses, but no less than one in as many ways as their signs can fall.
fn chances(excess: &[Vec<Option<f64>>], episodes: usize, seed: u64) -> Vec<f64> {
    let cells: Vec<Tossed> = excess.iter().map(|excess| Tossed::new(excess)).collect();
    let alone = |negative: &[bool]| cells.iter().map(|cell| cell.chance(negative)).fold(1.0, f64::min);
    let mut least: Vec<f64> = if episodes <= FEW_EPISODES {
        let way = |bits: usize| -> Vec<bool> { (0..episodes).map(|episode| bits >> episode & 1 == 1).collect() };
        (1..1 << episodes).map(|bits| alone(&way(bits))).collect()
    } else {
        let mut rng = Seed(seed).stream(Purpose::Statistics, 1);
        let mut toss = || -> Vec<bool> { (0..episodes).map(|_| StandardUniform.sample(&mut rng)).collect() };
        (0..FLIPS).map(|_| alone(&toss())).collect()
    };
    least.sort_by(f64::total_cmp);
    let as_measured = vec![false; episodes];
    let of = |cell: &Tossed| {
        let found = cell.chance(&as_measured);
        // What was measured is one of the ways.
        (least.partition_point(|chance| *chance <= found * (1.0 + 1e-9)) + 1) as f64 / (least.len() + 1) as f64
    };
    cells.iter().map(of).collect()
}

/// The excesses of a cell.
struct Tossed {
    /// Episode and excess.
    excess: Vec<(usize, f64)>,
    /// Mean of their squares.
    square: f64,
    /// Of Student's t.
    law: Option<StudentsT>,
}

impl Tossed {
    fn new(excess: &[Option<f64>]) -> Self {
        let excess: Vec<(usize, f64)> = excess.iter().enumerate().filter_map(|(i, e)| e.map(|e| (i, e))).collect();
        let n = excess.len();
        let law = (n >= LEAST_EPISODES).then(|| StudentsT::new(0.0, 1.0, (n - 1) as f64).ok()).flatten();
        Self { square: excess.iter().map(|(_, e)| e * e).sum::<f64>() / n.max(1) as f64, excess, law }
    }

    /// Chance of so large a mean excess, by this cell alone.
    fn chance(&self, negative: &[bool]) -> f64 {
        let Some(law) = &self.law else { return 1.0 };
        let n = self.excess.len() as f64;
        let mean = self.excess.iter().map(|(episode, e)| if negative[*episode] { -e } else { *e }).sum::<f64>() / n;
        let variance = (self.square - mean * mean).max(1e-12) / (n - 1.0);
        let t = mean / variance.sqrt();
        // Residuals of a simulation that went astray need not be finite.
        if t.is_finite() { law.sf(t).max((-n).exp2()) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::StandardNormal;

    use super::*;

    #[test]
    fn of_few_episodes_every_way_to_flip_them_counts() {
        let all = [1.0, 1.1, 0.9, 1.2, 0.8].map(Some).to_vec();
        // No other of the 32 ways is as good.
        assert_eq!(chances(std::slice::from_ref(&all), 5, 1), [1.0 / 32.0]);
        // What says the same again says no more; what was read in three episodes alone says nothing.
        let three = [Some(9.0), Some(9.0), Some(9.0), None, None].to_vec();
        assert_eq!(chances(&[all.clone(), all.clone(), three], 5, 1)[..2], [1.0 / 32.0; 2]);
        // A cell that lacks an episode is flipped with the others' episodes, not with their places: with the first one's sign alone turned it stands out as much.
        let lacking = [None, Some(1.1), Some(0.9), Some(1.2), Some(0.8)].to_vec();
        assert_eq!(chances(&[all, lacking], 5, 1), [1.0 / 32.0, 2.0 / 32.0]);
    }

    #[test]
    fn where_nothing_is_wrong_one_log_in_twenty_has_a_chance_below_a_twentieth() {
        let mut rng = Seed(7).stream(Purpose::World, 0);
        let (logs, episodes) = (400, 24);
        let mut low = 0;
        for log in 0..logs {
            // Cells that share what is odd about an episode, some of which are read in few.
            let odd: Vec<f64> = (0..episodes).map(|_| StandardNormal.sample(&mut rng)).collect();
            let cells: Vec<Vec<Option<f64>>> = (0..6)
                .map(|cell| {
                    let one = |episode: usize| -> Option<f64> {
                        let own: f64 = StandardNormal.sample(&mut rng);
                        episode.is_multiple_of(cell + 1).then_some(odd[episode] + own)
                    };
                    (0..episodes).map(one).collect()
                })
                .collect();
            low += usize::from(chances(&cells, episodes, log).into_iter().any(|chance| chance < 0.05));
        }
        // 20 ± 4.4.
        assert!((7..=33).contains(&low), "{low} of {logs}");
    }
}
