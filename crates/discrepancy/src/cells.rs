//! Which white residuals share a scale: those of a channel, vertical or not, in a phase of an episode, at one time scale.
//!
//! What a model gets wrong is not white: a path that bends away is wrong for long, a contact that chatters is wrong in each reading and right on average. Haar's
//! wavelets tell the two apart (Wornell, Proceedings of the IEEE 81, 1993: they make processes with long memory nearly white, with one variance for each octave). The
//! residuals of a component in a phase are replaced by half differences of neighbours, of neighbouring pairs, of neighbouring fours, …, and their mean: an
//! orthonormal change of coordinates, under which the noise of sensors stays white.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::DVector;

use crate::trial::{Block, Kind, Phase};

/// A channel, whether its component is the vertical one, and a phase.
pub(crate) type Key = (Kind, bool, Phase);

/// The key of a block whose middle row is in `phase`. Of joints no component is vertical.
pub(crate) fn key(block: &Block, phase: Phase) -> Key {
    let joints = matches!(block.kind, Kind::JointPosition | Kind::JointTorque);
    (block.kind, block.component == 2 && !joints, phase)
}

/// The cells of the residuals of an episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Cell of each residual.
    pub of: Vec<usize>,
    /// Number of cells.
    pub count: usize,
    /// Channel and octave of each cell; none of [`Self::one`].
    pub(crate) channels: Vec<(Kind, u32)>,
    /// Residuals of one component in one phase, one after another.
    pub(crate) runs: Vec<Range<usize>>,
}

impl Cells {
    /// One cell of residuals that are left as they are.
    #[must_use]
    pub fn one(count: usize) -> Self {
        Self { of: vec![0; count], count: 1, ..Self::default() }
    }

    /// Of blocks with these keys.
    pub(crate) fn new(blocks: &[Block], keys: &[Key]) -> Self {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for place in 0..keys.len() {
            let goes_on =
                place > 0 && keys[place - 1] == keys[place] && blocks[place - 1].component == blocks[place].component;
            match runs.last_mut().filter(|_| goes_on) {
                Some(run) => run.end = place + 1,
                None => runs.push(place..place + 1),
            }
        }
        let mut places: BTreeMap<(Key, u32), usize> = BTreeMap::new();
        let (mut of, mut channels) = (Vec::with_capacity(keys.len()), Vec::new());
        for run in &runs {
            let key = keys[run.start];
            for octave in octaves(run.len()) {
                let cell = *places.entry((key, octave)).or_insert_with(|| {
                    channels.push((key.0, octave));
                    channels.len() - 1
                });
                of.push(cell);
            }
        }
        Self { of, count: channels.len(), channels, runs }
    }

    /// Residuals in the coordinates of the cells.
    pub(crate) fn transform(&self, mut residuals: DVector<f64>) -> DVector<f64> {
        for run in &self.runs {
            haar(&mut residuals.as_mut_slice()[run.clone()], &mut |_, _| {});
        }
        residuals
    }
}

/// Octave of each coefficient of a run of so many residuals: half of how many it compares; of the mean one more than the largest.
fn octaves(count: usize) -> Vec<u32> {
    let mut octaves = vec![0; count];
    haar(&mut vec![0.0; count], &mut |place, octave| octaves[place] = octave);
    octaves
}

/// Haar's wavelets in place. Where a number is left over it waits for the next octave, with the weight that it has there (unbalanced Haar).
fn haar(values: &mut [f64], tell: &mut dyn FnMut(usize, u32)) {
    // Places of the sums so far, and of how many residuals each is.
    let mut sums: Vec<(usize, f64)> = (0..values.len()).map(|place| (place, 1.0)).collect();
    let mut octave = 0;
    while sums.len() > 1 {
        let mut next = Vec::with_capacity(sums.len().div_ceil(2));
        for pair in sums.chunks(2) {
            let [(a, of_a), (b, of_b)] = pair else {
                next.push(pair[0]);
                continue;
            };
            let (first, second, both) = (values[*a], values[*b], (of_a + of_b).sqrt());
            values[*a] = (of_a.sqrt() * first + of_b.sqrt() * second) / both;
            values[*b] = (of_b.sqrt() * first - of_a.sqrt() * second) / both;
            tell(*b, octave);
            next.push((*a, of_a + of_b));
        }
        sums = next;
        octave += 1;
    }
    if let Some((mean, _)) = sums.first() {
        tell(*mean, octave);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(kind: Kind, component: usize, count: usize) -> Vec<Block> {
        (0..count).map(|first| Block { kind, component, first, end: first + 1 }).collect()
    }

    fn cells(blocks: &[Block], phase: Phase) -> Cells {
        let keys: Vec<Key> = blocks.iter().map(|block| key(block, phase)).collect();
        Cells::new(blocks, &keys)
    }

    #[test]
    fn the_change_of_coordinates_is_orthonormal() {
        for count in [1, 2, 5, 8, 13] {
            let cells = cells(&blocks(Kind::WristForce, 0, count), Phase::Sliding);
            let columns: Vec<DVector<f64>> = (0..count)
                .map(|place| cells.transform(DVector::from_fn(count, |row, _| f64::from(u8::from(row == place)))))
                .collect();
            for (i, a) in columns.iter().enumerate() {
                for (j, b) in columns.iter().enumerate() {
                    assert!((a.dot(b) - f64::from(u8::from(i == j))).abs() < 1e-12, "{count}");
                }
            }
        }
    }

    #[test]
    fn what_chatters_and_what_lasts_are_in_cells_of_their_own() {
        let cells = cells(&blocks(Kind::WristForce, 0, 8), Phase::Sliding);
        // Four differences of neighbours, two of pairs, one of fours, the mean.
        let mut sizes = vec![0; cells.count];
        cells.of.iter().for_each(|cell| sizes[*cell] += 1);
        sizes.sort_unstable();
        assert_eq!(sizes, [1, 1, 2, 4]);
        let energy = |f: fn(usize) -> f64| -> Vec<f64> {
            let found = cells.transform(DVector::from_fn(8, |row, _| f(row)));
            let mut energy = vec![0.0; cells.count];
            found.iter().zip(&cells.of).for_each(|(x, cell)| energy[*cell] += x * x);
            energy
        };
        let chatter = energy(|row| if row % 2 == 0 { 1.0 } else { -1.0 });
        let lasting = energy(|_| 1.0);
        for (a, b) in chatter.iter().zip(&lasting) {
            assert!(a * b < 1e-12, "{chatter:?} {lasting:?}");
        }
        assert!((chatter.iter().sum::<f64>() - 8.0).abs() < 1e-12 && (lasting.iter().sum::<f64>() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn cells_are_told_apart_by_channel_axis_and_phase() {
        let all = [blocks(Kind::WristForce, 0, 1), blocks(Kind::WristForce, 1, 1), blocks(Kind::ObjectPosition, 0, 1)];
        let cells = cells(&all.concat(), Phase::ContactOnset);
        // Both horizontal components share theirs, and no difference is taken across components.
        assert_eq!(cells.of, [0, 0, 1]);
        let upward = Block { kind: Kind::WristForce, component: 2, first: 0, end: 1 };
        assert_ne!(key(&upward, Phase::ContactOnset), key(&all[0][0], Phase::ContactOnset));
    }
}
