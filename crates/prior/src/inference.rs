//! One observation in, one mixture out: a stateful, allocation-free step on plain slices.

use crate::checkpoint::Checkpoint;
use crate::fused::{LOG_STDDEV_LIMITS, Real, wide};
use crate::mixture::Mixture;
use crate::normalise::{Normalisation, Scale, normalise_observation};
use crate::parameters::{Dimensions, Parameters};
use crate::{Error, Layout};
use std::path::Path;
use std::sync::Arc;

/// The trained network with the state of one episode. Clones share the weights.
#[derive(Clone, Debug)]
pub struct Inference {
    weights: Arc<Weights>,
    /// Whether the state is carried from step to step.
    memory: bool,
    /// Cell state, `[width]` per layer.
    cells: Vec<Vec<f32>>,
    /// Input of each layer followed by its hidden state, `[inputs + width]`.
    states: Vec<Vec<f32>>,
    /// Gates of the widest layer, up to a whole tile.
    gates: Vec<f32>,
    /// Last hidden state.
    top: Vec<f32>,
    /// Raw outputs of the heads, up to a whole tile.
    outputs: Vec<f32>,
    mixture: Mixture,
}

/// Columns whose sums stay in registers while a step runs down the rows of a matrix.
const TILE: usize = 64;

/// One row of a tile, at the start of a cache line: vectors that straddle two lines load at half the speed.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct TileRow([f32; TILE]);

/// A row-major `[rows, width]` matrix cut into tiles of [`TILE`] columns (zeros beyond the last), one after the other: the order in which a step
/// reads it.
fn tiles(matrix: &[f32], width: usize) -> Vec<TileRow> {
    let firsts = (0..width).step_by(TILE);
    let rows =
        firsts.flat_map(|first| matrix.chunks_exact(width).map(move |row| &row[first..(first + TILE).min(width)]));
    rows.map(|row| TileRow(std::array::from_fn(|column| row.get(column).copied().unwrap_or(0.0)))).collect()
}

#[derive(Debug)]
struct Weights {
    dimensions: Dimensions,
    normalisation: Normalisation,
    /// Input weights above recurrent weights, `[inputs + width, 4 width]` in tiles, and bias `[4 width]`, per layer.
    layers: Vec<(Vec<TileRow>, Vec<f32>)>,
    /// All heads side by side: `[width, outputs]` in tiles and `[outputs]`.
    heads: (Vec<TileRow>, Vec<f32>),
}

impl Inference {
    /// Loads the prior in `dir`, which must be made for `expected`.
    ///
    /// # Errors
    ///
    /// What [`Checkpoint::load`] refuses.
    pub fn load(dir: &Path, expected: &Layout) -> Result<Self, Error> {
        Checkpoint::load(dir, Some(expected))?.inference()
    }

    /// The network with these weights, at the start of an episode.
    #[must_use]
    pub fn new(dimensions: &Dimensions, normalisation: &Normalisation, parameters: &Parameters<f32>) -> Self {
        let (sizes, count) = (dimensions, dimensions.hidden.len());
        let layers = (0..count)
            .map(|layer| {
                let matrix = [parameters.input(layer), parameters.recurrent(layer)].concat();
                (tiles(&matrix, 4 * sizes.hidden[layer]), parameters.bias(layer).to_vec())
            })
            .collect();
        let heads = sizes.heads();
        let mut weight = Vec::with_capacity(sizes.top() * sizes.outputs());
        for row in 0..sizes.top() {
            for (index, (_, width)) in heads.iter().enumerate() {
                weight.extend(&parameters.head(count, index).0[row * width..(row + 1) * width]);
            }
        }
        let bias = (0..heads.len()).flat_map(|index| parameters.head(count, index).1).copied().collect();
        let states = (0..count).map(|layer| vec![0.0; sizes.layer_inputs(layer) + sizes.hidden[layer]]);
        Self {
            memory: true,
            cells: sizes.hidden.iter().map(|&width| vec![0.0; width]).collect(),
            states: states.collect(),
            gates: vec![0.0; (4 * sizes.hidden.iter().max().copied().unwrap_or(0)).next_multiple_of(TILE)],
            top: vec![0.0; sizes.top()],
            outputs: vec![0.0; sizes.outputs().next_multiple_of(TILE)],
            mixture: Mixture::blank(sizes.components, sizes.continuous, sizes.classes.clone()),
            weights: Arc::new(Weights {
                dimensions: sizes.clone(),
                normalisation: normalisation.clone(),
                layers,
                heads: (tiles(&weight, sizes.outputs()), bias),
            }),
        }
    }

    /// The same, but every step starts afresh unless `memory`.
    pub(crate) fn with_memory(self, memory: bool) -> Self {
        Self { memory, ..self }
    }

    /// Sizes of the network.
    #[must_use]
    pub fn dimensions(&self) -> &Dimensions {
        &self.weights.dimensions
    }

    /// Forgets the episode.
    pub fn reset(&mut self) {
        for values in self.cells.iter_mut().chain(&mut self.states) {
            values.fill(0.0);
        }
    }

    /// Takes in the next observation of the episode, in original units, and returns what it now suggests.
    ///
    /// # Panics
    ///
    /// If `observation` is not as long as the layout.
    pub fn step(&mut self, observation: &[f64]) -> &Mixture {
        if !self.memory {
            self.reset();
        }
        let weights = Arc::clone(&self.weights);
        assert_eq!(observation.len(), weights.dimensions.observations, "observation columns");
        let values = observation.iter().zip(&weights.normalisation.observation);
        for (target, (&value, scale)) in self.states[0].iter_mut().zip(values) {
            *target = normalise_observation(value, scale);
        }
        for (layer, (matrix, bias)) in weights.layers.iter().enumerate() {
            let (width, inputs) = (weights.dimensions.hidden[layer], weights.dimensions.layer_inputs(layer));
            let gates = &mut self.gates[..(4 * width).next_multiple_of(TILE)];
            gates[..4 * width].copy_from_slice(bias);
            accumulate(gates, matrix, &self.states[layer]);
            activate(&mut gates[..4 * width], &mut self.cells[layer], &mut self.states[layer][inputs..]);
            let (done, next) = self.states.split_at_mut(layer + 1);
            let hidden = &done[layer][inputs..];
            match next.first_mut() {
                Some(next) => next[..width].copy_from_slice(hidden),
                None => self.top.copy_from_slice(hidden),
            }
        }
        self.outputs[..weights.heads.1.len()].copy_from_slice(&weights.heads.1);
        accumulate(&mut self.outputs, &weights.heads.0, &self.top);
        self.read_outputs();
        &self.mixture
    }

    /// Raw outputs of the last step in normalised units, in the order of [`Dimensions::heads`].
    #[must_use]
    pub fn raw_outputs(&self) -> &[f32] {
        &self.outputs[..self.weights.heads.1.len()]
    }

    fn read_outputs(&mut self) {
        let (sizes, mixture) = (&self.weights.dimensions, &mut self.mixture);
        let (k, d) = (sizes.components, sizes.continuous);
        let (logits, rest) = self.outputs.split_at(k);
        let (means, rest) = rest.split_at(k * d);
        let (log_stddevs, labels) = rest.split_at(k * d);
        log_softmax(logits, &mut mixture.log_weights);
        for (weight, log) in mixture.weights.iter_mut().zip(&mixture.log_weights) {
            *weight = log.exp();
        }
        let scales = &self.weights.normalisation.continuous;
        for component in 0..k {
            let at = component * d..(component + 1) * d;
            let targets = (&mut mixture.means[at.clone()], &mut mixture.stddevs[at.clone()]);
            gaussians(targets, &means[at.clone()], &log_stddevs[at], scales);
        }
        let mut first = 0;
        for _ in 0..k {
            for &count in &sizes.classes {
                log_softmax(&labels[first..first + count], &mut mixture.log_classes[first..first + count]);
                first += count;
            }
        }
    }
}

wide! {
/// `target += vector · matrix` for a matrix laid out by [`tiles`]; `target` is as long as all tiles are wide.
fn accumulate(target: &mut [f32], tiles: &[TileRow], vector: &[f32]) {
    for (target, tile) in target.chunks_exact_mut(TILE).zip(tiles.chunks_exact(vector.len())) {
        let mut sums = [0.0_f32; TILE];
        for (row, &value) in tile.iter().zip(vector) {
            for (sum, &weight) in sums.iter_mut().zip(&row.0) {
                *sum += value * weight;
            }
        }
        target.iter_mut().zip(sums).for_each(|(target, sum)| *target += sum);
    }
}
}

wide! {
/// New cell and hidden state of one layer from the gate sums.
fn activate(gates: &mut [f32], cell: &mut [f32], hidden: &mut [f32]) {
    let width = cell.len();
    gates[..2 * width].iter_mut().for_each(|value| *value = value.sigmoid());
    gates[2 * width..3 * width].iter_mut().for_each(|value| *value = Real::tanh(*value));
    gates[3 * width..].iter_mut().for_each(|value| *value = value.sigmoid());
    let (input, rest) = gates.split_at(width);
    let (forget, rest) = rest.split_at(width);
    let (candidate, output) = rest.split_at(width);
    for index in 0..width {
        cell[index] = input[index] * candidate[index] + forget[index] * cell[index];
        hidden[index] = output[index] * Real::tanh(cell[index]);
    }
}
}

wide! {
/// Means and standard deviations of one component in original units.
fn gaussians(targets: (&mut [f64], &mut [f64]), means: &[f32], log_stddevs: &[f32], scales: &[Scale]) {
    let (low, high) = (LOG_STDDEV_LIMITS.0 as f32, LOG_STDDEV_LIMITS.1 as f32);
    for ((target, &mean), scale) in targets.0.iter_mut().zip(means).zip(scales) {
        *target = f64::from(mean) * scale.stddev + scale.mean;
    }
    for ((target, &log_stddev), scale) in targets.1.iter_mut().zip(log_stddevs).zip(scales) {
        *target = f64::from(Real::exp(log_stddev.limit(low, high))) * scale.stddev;
    }
}
}

/// Logits to ln probabilities.
fn log_softmax(logits: &[f32], target: &mut [f64]) {
    let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let total: f64 = logits.iter().map(|&logit| f64::from(logit - largest).exp()).sum();
    let shift = f64::from(largest) + total.ln();
    target.iter_mut().zip(logits).for_each(|(target, &logit)| *target = f64::from(logit) - shift);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sequence;
    use crate::fused::{Batch, Workspace};
    use crate::parameters::tests::dimensions;
    use pomdp::{Purpose, Seed};
    use rand::RngExt as _;

    #[test]
    fn steps_equal_the_forward_pass_of_training_and_a_reset_starts_afresh() {
        let sizes = dimensions(6, 5, &[3, 4], &[13, 9], 4);
        let parameters = Parameters::initial(&sizes, Seed(2));
        let scale = |index: usize| Scale { mean: 0.3 * index as f64, stddev: 1.0 + index as f64 };
        let normalisation =
            Normalisation { observation: (0..6).map(scale).collect(), continuous: (2..7).map(scale).collect() };
        let (mut rng, steps) = (Seed(2).stream(Purpose::Test, 0), 7);
        let sequence = Sequence {
            observations: (0..steps * 6).map(|_| 6.0 * rng.random::<f32>() - 3.0).collect(),
            targets: (0..steps * 5).map(|_| 6.0 * rng.random::<f32>() - 3.0).collect(),
            mask: (0..steps * 5).map(|index| if index % 3 == 0 { 0.0 } else { 1.0 }).collect(),
            classes: (0..steps * 2).map(|index| (index % 3) as u8).collect(),
            steps,
        };
        let normalised = normalisation.apply(&sequence);
        let batch = Batch::<f64>::pack(&[&normalised], &sizes);
        let mut training = Workspace::new(&sizes);
        let exact = parameters.map(f64::from);
        let loss = training.loss(&exact, &batch) / steps as f64;
        let reference = training.outputs(&exact, &batch);
        let mut inference = Inference::new(&sizes, &normalisation, &parameters);
        for round in 0..2 {
            let mut log_density = 0.0;
            for step in 0..steps {
                let row: Vec<f64> = sequence.observations[step * 6..][..6].iter().map(|&v| f64::from(v)).collect();
                let targets: Vec<f64> = sequence.targets[step * 5..][..5].iter().map(|&v| f64::from(v)).collect();
                let mask: Vec<bool> = sequence.mask[step * 5..][..5].iter().map(|&v| v == 1.0).collect();
                let classes: Vec<usize> = sequence.classes[step * 2..][..2].iter().map(|&c| usize::from(c)).collect();
                log_density += inference.step(&row).log_density_masked(&targets, &mask, &classes);
                let expected = &reference[step * sizes.outputs()..][..sizes.outputs()];
                for (ours, theirs) in inference.raw_outputs().iter().zip(expected) {
                    assert!((f64::from(*ours) - theirs).abs() < 1e-5, "round {round}, step {step}: {ours} {theirs}");
                }
            }
            let original = loss + normalisation.mean_log_scale(&[&sequence]);
            let ours = -log_density / steps as f64;
            assert!((ours - original).abs() < 1e-5 * original.abs(), "original units: {ours} {original}");
            inference.reset();
        }
    }
}
