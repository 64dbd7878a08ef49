//! Loss and gradient by hand: backpropagation through time on packed batches and the `gemm` crates.
//!
//! Two products a step and layer, and otherwise only element-wise operations; automatic differentiation would record about a hundred small
//! operations for each. It works on plain vectors and is generic over f32 (training) and f64 (tests). Tests hold it to
//! finite differences and to the loss and gradient that PyTorch recorded.
//!
//! On one kind of CPU the same seed gives the same bytes for any number of threads. They pick their kernels by the
//! CPU's vector units (FMA, AVX-512), so another kind of CPU rounds differently.

mod batch;
mod head;
mod lstm;
mod real;

pub use batch::Batch;
pub(crate) use head::HALF_LOG_TAU;
pub use head::LOG_STDDEV_LIMITS;
pub use real::Real;
pub(crate) use real::wide;

use crate::parameters::{Dimensions, Parameters};
use real::{Matrix, add_column_sums, product};

/// Dropout factors on the output of each LSTM layer: 0 or 1/(1 − p), `[layers][rows, width]`, in packed order.
pub type Dropout<T> = Vec<Vec<T>>;

/// Buffers of one chunk of a batch and the gradient that it yields; reused from batch to batch.
#[derive(Clone, Debug)]
pub struct Workspace<T> {
    dimensions: Dimensions,
    layers: Vec<lstm::Layer<T>>,
    /// Output rows, after the backward pass their gradients, `[rows, outputs]`.
    outputs: Vec<T>,
    /// Gradient of the output of each layer, `[rows, width]`.
    hidden_gradients: Vec<Vec<T>>,
    row: head::Row<T>,
    /// Gradient of the weights.
    pub gradient: Parameters<T>,
}

impl<T: Real> Workspace<T> {
    /// Empty buffers for a network of these sizes.
    #[must_use]
    pub fn new(dimensions: &Dimensions) -> Self {
        Self {
            dimensions: dimensions.clone(),
            layers: dimensions.hidden.iter().map(|&width| lstm::Layer::new(width)).collect(),
            outputs: Vec::new(),
            hidden_gradients: vec![Vec::new(); dimensions.hidden.len()],
            row: head::Row::new(dimensions),
            gradient: Parameters::zeros(dimensions),
        }
    }

    /// Σ over the rows of `batch` of −ln p(targets, classes), in normalised units, without a gradient.
    #[must_use]
    pub fn loss(&mut self, parameters: &Parameters<T>, batch: &Batch<T>) -> f64 {
        self.forward(parameters, batch, None);
        rows(&self.dimensions, &mut self.row, &mut self.outputs, batch, None)
    }

    /// Sums over the rows of `batch`, `[continuous]` each: squared standardised errors of the targets that apply and their number, the
    /// components weighted by their responsibilities. Their ratio is 1 where the stated spread is right.
    #[must_use]
    pub fn moments(&mut self, parameters: &Parameters<T>, batch: &Batch<T>) -> (Vec<f64>, Vec<f64>) {
        self.forward(parameters, batch, None);
        let sizes = &self.dimensions;
        let (targets, kinds) = (sizes.continuous, sizes.classes.len());
        let (mut squares, mut counts) = (vec![0.0; targets], vec![0.0; targets]);
        for (index, outputs) in self.outputs.chunks_exact(sizes.outputs()).take(batch.rows).enumerate() {
            let at = index * targets..(index + 1) * targets;
            let (target, mask) = (&batch.targets[at.clone()], &batch.mask[at]);
            let classes = &batch.classes[index * kinds..(index + 1) * kinds];
            let _ = self.row.loss(sizes, outputs, target, mask, classes);
            self.row.add_moments(sizes, mask, &mut squares, &mut counts);
        }
        (squares, counts)
    }

    /// As [`Workspace::loss`]; `self.gradient` becomes `scale` times the gradient of that sum.
    pub fn loss_and_gradient(
        &mut self,
        parameters: &Parameters<T>,
        batch: &Batch<T>,
        dropout: Option<&Dropout<T>>,
        scale: T,
    ) -> f64 {
        self.forward(parameters, batch, dropout);
        let loss = rows(&self.dimensions, &mut self.row, &mut self.outputs, batch, Some(scale));
        self.backward(parameters, batch, dropout);
        loss
    }

    /// Raw output rows of the network, `[rows, outputs]` in packed order.
    #[must_use]
    pub fn outputs(&mut self, parameters: &Parameters<T>, batch: &Batch<T>) -> &[T] {
        self.forward(parameters, batch, None);
        &self.outputs[..batch.rows * self.dimensions.outputs()]
    }

    fn forward(&mut self, parameters: &Parameters<T>, batch: &Batch<T>, dropout: Option<&Dropout<T>>) {
        let (sizes, rows) = (&self.dimensions, batch.rows);
        let factors = |layer: usize| dropout.map(|factors| factors[layer].as_slice());
        for layer in 0..sizes.hidden.len() {
            let (below, current) = self.layers.split_at_mut(layer);
            let inputs = below.last().map_or(batch.observations.as_slice(), |below| below.output(factors(layer - 1)));
            let weights = [parameters.input(layer), parameters.recurrent(layer), parameters.bias(layer)];
            current[0].forward(batch, inputs, weights, factors(layer));
        }
        let (width, stride) = (sizes.top(), sizes.outputs());
        self.outputs.resize(rows * stride, T::ZERO);
        let top = self.layers[sizes.hidden.len() - 1].output(factors(sizes.hidden.len() - 1));
        let hidden = Matrix::dense(&top[..rows * width], rows, width);
        let mut first = 0;
        for (index, (_, outputs)) in sizes.heads().into_iter().enumerate() {
            let (weight, bias) = parameters.head(sizes.hidden.len(), index);
            for row in self.outputs.chunks_exact_mut(stride).take(rows) {
                row[first..first + outputs].copy_from_slice(bias);
            }
            let target = self.outputs.get_mut(first..).unwrap_or_default();
            product(target, stride, true, hidden, Matrix::dense(weight, width, outputs));
            first += outputs;
        }
    }

    fn backward(&mut self, parameters: &Parameters<T>, batch: &Batch<T>, dropout: Option<&Dropout<T>>) {
        let (sizes, rows) = (&self.dimensions, batch.rows);
        let (layers, width, stride) = (sizes.hidden.len(), sizes.top(), sizes.outputs());
        let factors = |layer: usize| dropout.map(|factors| factors[layer].as_slice());
        self.gradient.tensors.iter_mut().for_each(|tensor| tensor.fill(T::ZERO));
        for (gradient, &width) in self.hidden_gradients.iter_mut().zip(&sizes.hidden) {
            gradient.resize(rows * width, T::ZERO);
        }
        let top = self.layers[layers - 1].output(factors(layers - 1));
        let hidden = Matrix::dense(&top[..rows * width], rows, width);
        let mut first = 0;
        for (index, (_, outputs)) in sizes.heads().into_iter().enumerate() {
            let (weight, _) = parameters.head(layers, index);
            let gradient = Matrix::strided(self.outputs.get(first..).unwrap_or_default(), rows, outputs, stride);
            let back = Matrix::dense(weight, width, outputs).transposed();
            product(&mut self.hidden_gradients[layers - 1], width, index > 0, gradient, back);
            let (of_weight, of_bias) = self.gradient.tensors[3 * layers + 2 * index..].split_at_mut(1);
            product(&mut of_weight[0], outputs, true, hidden.transposed(), gradient);
            add_column_sums(&mut of_bias[0], self.outputs.get(first..).unwrap_or_default(), rows, stride);
            first += outputs;
        }
        for layer in (0..layers).rev() {
            let (below, current) = self.layers.split_at_mut(layer);
            let inputs = below.last().map_or(batch.observations.as_slice(), |below| below.output(factors(layer - 1)));
            let weights = [parameters.input(layer), parameters.recurrent(layer)];
            let [of_input, of_recurrent, of_bias] = &mut self.gradient.tensors[3 * layer..3 * layer + 3] else {
                unreachable!("a layer has three tensors")
            };
            let gradients = [of_input.as_mut_slice(), of_recurrent, of_bias];
            let (lower, upper) = self.hidden_gradients.split_at_mut(layer);
            let upstream = &mut upper[0][..rows * sizes.hidden[layer]];
            if let Some(factors) = factors(layer) {
                upstream.iter_mut().zip(factors).for_each(|(gradient, &factor)| *gradient = *gradient * factor);
            }
            let target = lower.last_mut().map(Vec::as_mut_slice);
            current[0].backward(batch, inputs, weights, gradients, upstream, target);
        }
    }
}

wide! {
/// Loss of every row; with `scale`, output rows are replaced by their gradients.
fn rows<T>(sizes: &Dimensions, row: &mut head::Row<T>, outputs: &mut [T], batch: &Batch<T>, scale: Option<T>) -> f64 {
    let (targets, kinds) = (sizes.continuous, sizes.classes.len());
    let mut total = 0.0;
    for (index, outputs) in outputs.chunks_exact_mut(sizes.outputs()).take(batch.rows).enumerate() {
        let at = index * targets..(index + 1) * targets;
        let (target, mask) = (&batch.targets[at.clone()], &batch.mask[at]);
        let classes = &batch.classes[index * kinds..(index + 1) * kinds];
        total += row.loss(sizes, outputs, target, mask, classes);
        if let Some(scale) = scale {
            row.gradient(sizes, outputs, mask, classes, scale);
        }
    }
    total
}
}

#[cfg(test)]
mod tests;
