//! Sequences of unequal length packed without padding.

use super::Real;
use crate::{Sequence, parameters::Dimensions};

/// Normalised sequences packed by time step: first the first step of all, then the second of those that have one, and so on.
/// Sorted by falling length, the sequences alive at step t are always the first `active[t]` of step t − 1.
#[derive(Clone, Debug)]
pub struct Batch<T> {
    /// Sequences alive at each step, falling.
    pub active: Vec<usize>,
    /// First row of each step.
    pub offsets: Vec<usize>,
    /// Number of rows: Σ lengths.
    pub rows: usize,
    /// Index into the sequences given, in packed order.
    pub order: Vec<usize>,
    /// `[rows, observation]`.
    pub observations: Vec<T>,
    /// `[rows, continuous]`.
    pub targets: Vec<T>,
    /// `[rows, continuous]`.
    pub mask: Vec<T>,
    /// `[rows, class targets]`.
    pub classes: Vec<u8>,
}

impl<T: Real> Batch<T> {
    /// Packs `sequences` (normalised), longest first, ties in the order given.
    #[must_use]
    pub fn pack(sequences: &[&Sequence], dimensions: &Dimensions) -> Self {
        let mut order: Vec<usize> = (0..sequences.len()).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(sequences[index].steps));
        let longest = order.first().map_or(0, |&index| sequences[index].steps);
        let (mut active, mut offsets, mut rows) = (Vec::with_capacity(longest), Vec::with_capacity(longest), 0);
        for step in 0..longest {
            let alive = order.partition_point(|&index| sequences[index].steps > step);
            offsets.push(rows);
            active.push(alive);
            rows += alive;
        }
        let mut batch = Self {
            active,
            offsets,
            rows,
            order,
            observations: Vec::with_capacity(rows * dimensions.observations),
            targets: Vec::with_capacity(rows * dimensions.continuous),
            mask: Vec::with_capacity(rows * dimensions.continuous),
            classes: Vec::with_capacity(rows * dimensions.classes.len()),
        };
        let convert = |value: &f32| T::from_f64(f64::from(*value));
        for step in 0..longest {
            for &index in &batch.order[..batch.active[step]] {
                let sequence = sequences[index];
                let row = |width: usize| step * width..(step + 1) * width;
                batch.observations.extend(sequence.observations[row(dimensions.observations)].iter().map(convert));
                batch.targets.extend(sequence.targets[row(dimensions.continuous)].iter().map(convert));
                batch.mask.extend(sequence.mask[row(dimensions.continuous)].iter().map(convert));
                batch.classes.extend(&sequence.classes[row(dimensions.classes.len())]);
            }
        }
        batch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::tests::dimensions;

    #[test]
    fn rows_are_ordered_by_step_then_by_falling_length() {
        let sizes = dimensions(1, 1, &[9], &[1], 1);
        let sequence = |tag: u8, steps: usize| Sequence {
            observations: (0..steps).map(|t| f32::from(tag) + t as f32).collect(),
            targets: vec![0.0; steps],
            mask: vec![1.0; steps],
            classes: vec![tag / 10; steps],
            steps,
        };
        let (short, long, middle) = (sequence(10, 1), sequence(20, 3), sequence(30, 2));
        let batch = Batch::<f64>::pack(&[&short, &long, &middle], &sizes);
        assert_eq!((batch.active, batch.offsets, batch.rows), (vec![3, 2, 1], vec![0, 3, 5], 6));
        assert_eq!(batch.order, [1, 2, 0]);
        assert_eq!(batch.observations, [20.0, 30.0, 10.0, 21.0, 31.0, 22.0]);
        assert_eq!(batch.classes, [2, 3, 1, 2, 3, 2]);
    }
}
