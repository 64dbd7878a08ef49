//! LSTM layers, one step at a time (Hochreiter and Schmidhuber 1997, with a forget gate), in PyTorch's order of gates: input, forget, cell, output.

/// One layer.
#[derive(Debug)]
pub(super) struct Layer {
    /// Weights of the inputs and below them of the last output, `[inputs + width, 4 width]`.
    pub(super) weights: Vec<f32>,
    /// `[4 width]`.
    pub(super) bias: Vec<f32>,
}

impl Layer {
    fn width(&self) -> usize {
        self.bias.len() / 4
    }
}

/// All layers, from the input up.
#[derive(Debug)]
pub(super) struct Lstm(pub(super) Vec<Layer>);

/// Output and cell of each layer.
#[derive(Clone, Debug)]
pub(super) struct LstmState(Vec<(Vec<f32>, Vec<f32>)>);

impl Lstm {
    /// Before the first step.
    pub(super) fn start(&self) -> LstmState {
        LstmState(self.0.iter().map(|layer| (vec![0.0; layer.width()], vec![0.0; layer.width()])).collect())
    }

    /// Takes in a row, and returns the output of the last layer.
    pub(super) fn step<'a>(&self, state: &'a mut LstmState, input: &[f32]) -> &'a [f32] {
        let mut below = input.to_vec();
        for (layer, (output, cell)) in self.0.iter().zip(&mut state.0) {
            let mut gates = layer.bias.clone();
            add_product(&mut gates, below.iter().chain(output.iter()), &layer.weights);
            let width = layer.width();
            for i in 0..width {
                let [input, forget, new, open] = [0, 1, 2, 3].map(|gate| gates[gate * width + i]);
                cell[i] = sigmoid(forget) * cell[i] + sigmoid(input) * new.tanh();
                output[i] = sigmoid(open) * cell[i].tanh();
            }
            below.clone_from(output);
        }
        state.0.last().map_or(&[], |(output, _)| output.as_slice())
    }
}

/// `sum += row · weights`, of row-major weights `[row, sum]`.
pub(super) fn add_product<'a>(sum: &mut [f32], row: impl Iterator<Item = &'a f32>, weights: &[f32]) {
    let width = sum.len();
    for (value, weights) in row.zip(weights.chunks_exact(width)) {
        for (sum, weight) in sum.iter_mut().zip(weights) {
            *sum += value * weight;
        }
    }
}

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}
