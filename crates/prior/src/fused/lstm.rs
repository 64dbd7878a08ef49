//! One LSTM layer over a packed batch, forward and backward (Hochreiter and Schmidhuber 1997, with forget gates).
//!
//! With gates (i, f, g, o) = (σ, σ, tanh, σ)(x W + h′ R + b), where ′ marks the step before:
//! c = f c′ + i g, h = o tanh c.

use super::real::{Matrix, Real, add_column_sums, product, wide};
use crate::fused::Batch;

/// What a layer keeps between the passes, reused from batch to batch.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layer<T> {
    width: usize,
    /// Activated gates, after the backward pass their gradients before activation, `[rows, 4 width]`.
    gates: Vec<T>,
    /// c, `[rows, width]`.
    cell: Vec<T>,
    /// tanh c, `[rows, width]`.
    squashed: Vec<T>,
    /// h of the step before (0 at the first), `[rows, width]`.
    previous: Vec<T>,
    /// h, `[rows, width]`.
    pub(crate) hidden: Vec<T>,
    /// h as the next layer sees it where dropout is on, `[rows, width]`, else unused.
    pub(crate) dropped: Vec<T>,
    /// Gradients of h and c that flow to the step before, `[active, width]`.
    hidden_gradient: Vec<T>,
    cell_gradient: Vec<T>,
    /// Recurrent weights transposed, `[4 width, width]`: the product of every step would pack them anew.
    transposed: Vec<T>,
}

impl<T: Real> Layer<T> {
    pub(crate) fn new(width: usize) -> Self {
        Self { width, ..Self::default() }
    }

    /// What the next layer reads.
    pub(crate) fn output(&self, dropout: Option<&[T]>) -> &[T] {
        if dropout.is_some() { &self.dropped } else { &self.hidden }
    }

    /// # Shapes
    ///
    /// - `inputs`: `[rows, inputs]`; `weights`: `[inputs, 4 width]`, `[width, 4 width]`, `[4 width]`
    /// - `dropout`: factors on the output, `[rows, width]`
    pub(crate) fn forward(&mut self, batch: &Batch<T>, inputs: &[T], weights: [&[T]; 3], dropout: Option<&[T]>) {
        let [input, recurrent, bias] = weights;
        let (width, rows) = (self.width, batch.rows);
        self.gates.resize(rows * 4 * width, T::ZERO);
        for buffer in [&mut self.cell, &mut self.squashed, &mut self.previous, &mut self.hidden] {
            buffer.resize(rows * width, T::ZERO);
        }
        for row in self.gates.chunks_exact_mut(4 * width) {
            row.copy_from_slice(bias);
        }
        let inner = input.len() / (4 * width);
        let inputs = Matrix::dense(&inputs[..rows * inner], rows, inner);
        product(&mut self.gates, 4 * width, true, inputs, Matrix::dense(input, inner, 4 * width));
        self.previous[..batch.active.first().map_or(0, |alive| alive * width)].fill(T::ZERO);
        for (step, (&offset, &alive)) in batch.offsets.iter().zip(&batch.active).enumerate() {
            let now = offset * width..(offset + alive) * width;
            let gates = &mut self.gates[offset * 4 * width..(offset + alive) * 4 * width];
            // Rows of the step before that are still alive: the first `alive` of it.
            let before = if step > 0 { batch.offsets[step - 1] * width } else { 0 };
            let (past_cell, cell) = self.cell.split_at_mut(now.start);
            let past_cell = if step > 0 { Some(&past_cell[before..before + alive * width]) } else { None };
            if step > 0 {
                let (past, _) = self.hidden.split_at(now.start);
                self.previous[now.clone()].copy_from_slice(&past[before..before + alive * width]);
                let previous = Matrix::dense(&self.previous[now.clone()], alive, width);
                product(gates, 4 * width, true, previous, Matrix::dense(recurrent, width, 4 * width));
            }
            activate(width, gates, past_cell, cell, &mut self.squashed[now.clone()], &mut self.hidden[now]);
        }
        if let Some(factors) = dropout {
            self.dropped.clear();
            self.dropped.extend(self.hidden.iter().zip(factors).map(|(&hidden, &factor)| hidden * factor));
        }
    }

    /// Turns `upstream`, the gradient of `hidden`, into gradients of the weights (accumulated) and of the inputs.
    ///
    /// # Shapes
    ///
    /// As in [`Layer::forward`]; `upstream`: `[rows, width]`, overwritten; `input_gradient`: `[rows, inputs]`.
    pub(crate) fn backward(
        &mut self,
        batch: &Batch<T>,
        inputs: &[T],
        weights: [&[T]; 2],
        gradients: [&mut [T]; 3],
        upstream: &mut [T],
        input_gradient: Option<&mut [T]>,
    ) {
        let [input, recurrent] = weights;
        let (width, rows) = (self.width, batch.rows);
        let widest = batch.active.first().copied().unwrap_or(0) * width;
        self.hidden_gradient.resize(widest, T::ZERO);
        self.cell_gradient.clear();
        self.cell_gradient.resize(widest, T::ZERO);
        self.transposed.clear();
        for column in 0..4 * width {
            self.transposed.extend(recurrent.iter().skip(column).step_by(4 * width));
        }
        for step in (0..batch.active.len()).rev() {
            let (offset, alive) = (batch.offsets[step], batch.active[step]);
            let upstream = &mut upstream[offset * width..(offset + alive) * width];
            if let Some(&later) = batch.active.get(step + 1) {
                let flowing = &self.hidden_gradient[..later * width];
                upstream.iter_mut().zip(flowing).for_each(|(gradient, &flow)| *gradient += flow);
            }
            let before = step.checked_sub(1).map(|earlier| batch.offsets[earlier] * width);
            let past_cell = before.map(|start| &self.cell[start..start + alive * width]);
            let gates = &mut self.gates[offset * 4 * width..(offset + alive) * 4 * width];
            let squashed = &self.squashed[offset * width..(offset + alive) * width];
            deactivate(width, gates, past_cell, squashed, upstream, &mut self.cell_gradient[..alive * width]);
            if step > 0 {
                let gates = Matrix::dense(&*gates, alive, 4 * width);
                let back = Matrix::dense(&self.transposed, 4 * width, width);
                product(&mut self.hidden_gradient, width, false, gates, back);
            }
        }
        let inner = input.len() / (4 * width);
        let [of_input, of_recurrent, of_bias] = gradients;
        let gates = Matrix::dense(&self.gates[..rows * 4 * width], rows, 4 * width);
        let inputs = Matrix::dense(&inputs[..rows * inner], rows, inner);
        product(of_input, 4 * width, true, inputs.transposed(), gates);
        let first = batch.active.first().copied().unwrap_or(0);
        let previous = Matrix::dense(&self.previous[first * width..rows * width], rows - first, width);
        let later = Matrix::dense(&self.gates[first * 4 * width..rows * 4 * width], rows - first, 4 * width);
        product(of_recurrent, 4 * width, true, previous.transposed(), later);
        add_column_sums(of_bias, &self.gates, rows, 4 * width);
        if let Some(target) = input_gradient {
            product(target, inner, false, gates, Matrix::dense(input, inner, 4 * width).transposed());
        }
    }
}

wide! {
/// Gates from their sums, then cell and hidden state; all `[alive, …]`.
fn activate<T>(
    width: usize,
    gates: &mut [T],
    past_cell: Option<&[T]>,
    cell: &mut [T],
    squashed: &mut [T],
    hidden: &mut [T],
) {
    for (row, gates) in gates.chunks_exact_mut(4 * width).enumerate() {
        let at = row * width..(row + 1) * width;
        gates[..2 * width].iter_mut().for_each(|value| *value = value.sigmoid());
        let (input, rest) = gates.split_at_mut(width);
        let (forget, rest) = rest.split_at_mut(width);
        let (candidate, output) = rest.split_at_mut(width);
        candidate.iter_mut().for_each(|value| *value = value.tanh());
        output.iter_mut().for_each(|value| *value = value.sigmoid());
        let cell = &mut cell[at.clone()];
        for ((cell, &input), &candidate) in cell.iter_mut().zip(&*input).zip(&*candidate) {
            *cell = input * candidate;
        }
        if let Some(past) = past_cell {
            for ((cell, &forget), &past) in cell.iter_mut().zip(&*forget).zip(&past[at.clone()]) {
                *cell += forget * past;
            }
        }
        let squashed = &mut squashed[at.clone()];
        for (squashed, &cell) in squashed.iter_mut().zip(&*cell) {
            *squashed = cell.tanh();
        }
        for ((hidden, &output), &squashed) in hidden[at].iter_mut().zip(&*output).zip(&*squashed) {
            *hidden = output * squashed;
        }
    }
}
}

wide! {
/// Writes the gradients of the gates before activation in place of the gates. Writes the gradient of the cell one step
/// earlier in place of `cell_gradient`, which holds the gradient from the next step. All are `[alive, …]`.
fn deactivate<T>(
    width: usize,
    gates: &mut [T],
    past_cell: Option<&[T]>,
    squashed: &[T],
    upstream: &[T],
    cell_gradient: &mut [T],
) {
    for (row, gates) in gates.chunks_exact_mut(4 * width).enumerate() {
        let at = row * width..(row + 1) * width;
        let (input, rest) = gates.split_at_mut(width);
        let (forget, rest) = rest.split_at_mut(width);
        let (candidate, output) = rest.split_at_mut(width);
        let (squashed, upstream) = (&squashed[at.clone()], &upstream[at.clone()]);
        let flow = &mut cell_gradient[at.clone()];
        for unit in 0..width {
            let (i, f, g, o) = (input[unit], forget[unit], candidate[unit], output[unit]);
            let (tanh, up) = (squashed[unit], upstream[unit]);
            let cell = flow[unit] + up * o * (T::ONE - tanh * tanh);
            output[unit] = (up * tanh * o * (T::ONE - o)).flush();
            input[unit] = (cell * g * i * (T::ONE - i)).flush();
            candidate[unit] = (cell * i * (T::ONE - g * g)).flush();
            forget[unit] = (cell * f * (T::ONE - f)).flush();
            flow[unit] = (cell * f).flush();
        }
        match past_cell {
            Some(past) => {
                forget.iter_mut().zip(&past[at]).for_each(|(forget, &past)| *forget = (*forget * past).flush());
            }
            None => forget.fill(T::ZERO),
        }
    }
}
}
