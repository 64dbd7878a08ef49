//! Which residuals share a scale: those of a channel, vertical or not, in a phase of an episode; and how long their errors last.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::DVector;

use crate::likelihood::Cells;
use crate::trial::{Block, Kind, Phase};

/// A channel, whether its component is the vertical one, and a phase.
pub(crate) type Key = (Kind, bool, Phase);

/// Correlation of neighbours, at most: no longer course is seen in an episode.
const MOST: f64 = 0.98;

/// The key of a block whose middle row is in `phase`. Of joints no component is vertical.
pub(crate) fn key(block: &Block, phase: Phase) -> Key {
    let joints = matches!(block.kind, Kind::JointPosition | Kind::JointTorque);
    (block.kind, block.component == 2 && !joints, phase)
}

/// How long errors last in each cell, in blocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Times(BTreeMap<Key, f64>);

#[derive(Default)]
struct Sums {
    /// Σ r² and, over neighbours r, r′ of a component, Σ r r′.
    square: f64,
    neighbours: f64,
    /// Number of runs of neighbours, and of residuals.
    runs: usize,
    count: usize,
}

impl Times {
    /// Of white residuals. `episodes`: blocks with their keys, and their residuals, of each episode.
    pub(crate) fn of<'a>(episodes: impl Iterator<Item = (&'a [Block], &'a [Key], &'a DVector<f64>)>) -> Self {
        let mut cells: BTreeMap<Key, Sums> = BTreeMap::new();
        for (blocks, keys, residuals) in episodes {
            for (place, key) in keys.iter().enumerate() {
                let follows =
                    place > 0 && keys[place - 1] == *key && blocks[place - 1].component == blocks[place].component;
                let sums = cells.entry(*key).or_default();
                sums.square += residuals[place] * residuals[place];
                sums.count += 1;
                if follows {
                    sums.neighbours += residuals[place - 1] * residuals[place];
                } else {
                    sums.runs += 1;
                }
            }
        }
        // As of an autoregressive process, and no longer than the cell itself.
        let time = |sums: &Sums| {
            let correlation = (sums.neighbours / sums.square).clamp(0.0, MOST);
            let longest = sums.count as f64 / sums.runs as f64;
            ((1.0 + correlation) / (1.0 - correlation)).min(longest)
        };
        let times = cells.iter().map(|(key, sums)| (*key, time(sums)));
        Self(times.filter(|(_, time)| *time > 1.0).collect())
    }

    /// The cells of an episode with these keys.
    pub(crate) fn cells(&self, keys: &[Key]) -> Arc<Cells> {
        let mut places: BTreeMap<Key, usize> = BTreeMap::new();
        let mut times = Vec::new();
        let of = keys.iter().map(|key| {
            *places.entry(*key).or_insert_with(|| {
                times.push(self.0.get(key).copied().unwrap_or(1.0));
                times.len() - 1
            })
        });
        let of = of.collect();
        Arc::new(Cells { of, times })
    }
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    fn blocks(kind: Kind, count: usize) -> Vec<Block> {
        (0..count).map(|first| Block { kind, component: 0, first, end: first + 1 }).collect()
    }

    #[test]
    fn errors_of_an_autoregressive_process_last_as_long_as_its_correlation_says() {
        let time = |correlation: f64| {
            let mut rng = Seed(5).stream(Purpose::Test, 0);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let blocks = blocks(Kind::WristForce, 80);
            let keys: Vec<Key> = blocks.iter().map(|block| key(block, Phase::Sliding)).collect();
            let episodes: Vec<DVector<f64>> = (0..20)
                .map(|_| {
                    let mut x = normal();
                    DVector::from_fn(80, |_, _| {
                        x = correlation * x + (1.0 - correlation * correlation).sqrt() * normal();
                        x
                    })
                })
                .collect();
            let times = Times::of(episodes.iter().map(|residuals| (&blocks[..], &keys[..], residuals)));
            times.cells(&keys).times[0]
        };
        assert!(time(0.0) < 1.1, "{}", time(0.0));
        assert!((7.0..11.0).contains(&time(0.8)), "{}", time(0.8));
    }

    #[test]
    fn cells_are_told_apart_by_channel_axis_and_phase() {
        let all = [blocks(Kind::WristForce, 3), blocks(Kind::ObjectPosition, 2)].concat();
        let keys: Vec<Key> = all.iter().map(|block| key(block, Phase::ContactOnset)).collect();
        let residuals = DVector::from_vec(vec![30.0, 30.0, 30.0, 0.5, -0.5]);
        let times = Times::of(std::iter::once((&all[..], &keys[..], &residuals)));
        let cells = times.cells(&keys);
        assert_eq!(cells.of, [0, 0, 0, 1, 1]);
        // One course of three is worth one residual.
        assert!(cells.times[0] > 2.0 && cells.times[0] <= 3.0 && cells.times[1] == 1.0, "{:?}", cells.times);
        let upward = Block { kind: Kind::WristForce, component: 2, first: 0, end: 1 };
        assert_ne!(key(&upward, Phase::ContactOnset), keys[0]);
    }
}
