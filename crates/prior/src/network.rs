//! The network in burn, trained by autodiff: the reference that the fused path is held to.

use crate::Sequence;
use crate::fused::{Batch, Dropout, HALF_LOG_TAU, LOG_STDDEV_LIMITS};
use crate::parameters::{Dimensions, Parameters};
use burn::module::{Module, Param, ParamId};
use burn::optim::GradientsParams;
use burn::tensor::activation::{log_softmax, sigmoid};
use burn::tensor::{Device, Gradients, Tensor, TensorData};

/// The device that networks live on: burn's flex backend on the CPU. Only the weights, Adam and the gradient path `autodiff` use it; the
/// fused path and inference do without burn.
#[must_use]
pub fn device() -> Device {
    Device::flex()
}

/// LSTM layers and the linear heads of the mixture.
#[derive(Module, Debug)]
pub struct Network {
    layers: Vec<LstmLayer>,
    heads: Vec<Head>,
}

/// Weights of one LSTM layer; the gates lie side by side: input, forget, cell, output.
///
/// # Shapes
///
/// `input`: `[inputs, 4 width]`; `recurrent`: `[width, 4 width]`; `bias`: `[4 width]`.
#[derive(Module, Debug)]
struct LstmLayer {
    input: Param<Tensor<2>>,
    recurrent: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

/// A linear map from the last hidden state: `weight` `[width, outputs]`, `bias` `[outputs]`.
#[derive(Module, Debug)]
struct Head {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

/// Raw outputs of the heads, one row per time step and sequence, in the order of [`Dimensions::heads`].
///
/// # Shapes
///
/// `[rows, outputs of the head]` each.
pub type Outputs = Vec<Tensor<2>>;

/// Normalised sequences padded to the longest, as the burn path takes them; row `step · sequences + index`.
#[derive(Clone, Debug)]
pub struct Padded {
    /// One tensor `[sequences, observation]` per time step.
    observations: Vec<Tensor<2>>,
    /// `[rows, continuous]`.
    targets: Tensor<2>,
    /// `[rows, continuous]`.
    mask: Tensor<2>,
    /// One-hot labels, `[rows, labels]` per class target.
    classes: Vec<Tensor<2>>,
    /// 1 for rows that exist, `[rows, 1]`.
    exists: Tensor<2>,
    /// Rows that exist.
    steps: usize,
    /// Position of each packed row of a [`Batch`] in the same sequences.
    positions: Vec<usize>,
}

impl Padded {
    /// Pads `sequences` (normalised).
    #[must_use]
    pub fn new(sequences: &[&Sequence], dimensions: &Dimensions, device: &Device) -> Self {
        let (count, longest) = (sequences.len(), sequences.iter().map(|s| s.steps).max().unwrap_or(0));
        let rows = count * longest;
        let fill = |width: usize, read: &dyn Fn(&Sequence) -> &[f32]| -> Vec<f32> {
            let mut values = vec![0.0; rows * width];
            for (index, sequence) in sequences.iter().enumerate() {
                for step in 0..sequence.steps {
                    let row = step * count + index;
                    values[row * width..][..width].copy_from_slice(&read(sequence)[step * width..][..width]);
                }
            }
            values
        };
        let tensor = |values: Vec<f32>, width: usize| {
            Tensor::<2>::from_data(TensorData::new(values, [rows.max(1), width]), device)
        };
        let observations = fill(dimensions.observations, &|s| &s.observations);
        let width = dimensions.observations;
        let observations = observations
            .chunks_exact((count * width).max(1))
            .map(|step| Tensor::from_data(TensorData::new(step.to_vec(), [count, width]), device))
            .collect();
        let kinds = dimensions.classes.len();
        let mut one_hot: Vec<Vec<f32>> = dimensions.classes.iter().map(|&labels| vec![0.0; rows * labels]).collect();
        let mut exists = vec![0.0; rows];
        for (index, sequence) in sequences.iter().enumerate() {
            for step in 0..sequence.steps {
                let row = step * count + index;
                exists[row] = 1.0;
                for (kind, &labels) in dimensions.classes.iter().enumerate() {
                    one_hot[kind][row * labels + usize::from(sequence.classes[step * kinds + kind])] = 1.0;
                }
            }
        }
        let packed = Batch::<f32>::pack(sequences, dimensions);
        let positions = packed.active.iter().enumerate().flat_map(|(step, &alive)| {
            packed.order[..alive].iter().map(move |&index| step * count + index).collect::<Vec<_>>()
        });
        Self {
            observations,
            targets: tensor(fill(dimensions.continuous, &|s| &s.targets), dimensions.continuous),
            mask: tensor(fill(dimensions.continuous, &|s| &s.mask), dimensions.continuous),
            classes: one_hot.into_iter().zip(&dimensions.classes).map(|(hot, &labels)| tensor(hot, labels)).collect(),
            exists: tensor(exists, 1),
            steps: packed.rows,
            positions: positions.collect(),
        }
    }

    /// Number of time steps of all sequences.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The packed row order of [`Batch`] for the same sequences, as rows of the padded tensors.
    #[must_use]
    pub fn positions(&self) -> &[usize] {
        &self.positions
    }
}

impl Network {
    /// The network with these weights; parameter ids are the positions in [`Dimensions::tensors`], so that an optimiser
    /// state finds its parameters again in another process.
    #[must_use]
    pub fn new(parameters: &Parameters<f32>, dimensions: &Dimensions, device: &Device) -> Self {
        let specs = dimensions.tensors();
        let data = |at: usize| TensorData::new(parameters.tensors[at].clone(), specs[at].shape.clone());
        let id = |at: usize| ParamId::from(at as u64 + 1);
        let tracked = device.is_autodiff();
        let matrix =
            |at: usize| Param::initialized(id(at), Tensor::<2>::from_data(data(at), device).set_require_grad(tracked));
        let vector =
            |at: usize| Param::initialized(id(at), Tensor::<1>::from_data(data(at), device).set_require_grad(tracked));
        let layers = dimensions.hidden.len();
        let heads = 3 * layers..specs.len();
        Self {
            layers: (0..3 * layers)
                .step_by(3)
                .map(|at| LstmLayer { input: matrix(at), recurrent: matrix(at + 1), bias: vector(at + 2) })
                .collect(),
            heads: heads.step_by(2).map(|at| Head { weight: matrix(at), bias: vector(at + 1) }).collect(),
        }
    }

    /// The weights as plain vectors.
    ///
    /// # Panics
    ///
    /// If the network does not hold f32, which no constructor makes.
    #[must_use]
    pub fn parameters(&self) -> Parameters<f32> {
        fn read<const D: usize>(param: &Param<Tensor<D>>) -> Vec<f32> {
            param.val().inner().into_data().try_into_vec().expect("networks are f32")
        }
        let mut tensors = Vec::new();
        for layer in &self.layers {
            tensors.extend([read(&layer.input), read(&layer.recurrent), read(&layer.bias)]);
        }
        for head in &self.heads {
            tensors.extend([read(&head.weight), read(&head.bias)]);
        }
        Parameters { tensors }
    }

    /// Raw outputs for every row of `batch`, padding included.
    #[must_use]
    pub fn forward(&self, batch: &Padded, dropout: Option<&Dropout<f32>>) -> Outputs {
        let device = batch.targets.device();
        let count = batch.observations.first().map_or(0, |step| step.dims()[0]);
        // Slices of one large tracked tensor would cost O(T²) in autodiff: a list of steps does not.
        let mut steps = batch.observations.clone();
        for (index, layer) in self.layers.iter().enumerate() {
            let width = layer.recurrent.val().dims()[0];
            let factors = dropout.map(|factors| batch.unpack(&factors[index], width, count, &device));
            let (input, recurrent) = (layer.input.val(), layer.recurrent.val());
            let bias = layer.bias.val().unsqueeze::<2>();
            let mut state: Option<(Tensor<2>, Tensor<2>)> = None;
            for (step, values) in steps.iter_mut().enumerate() {
                let mut sums = values.clone().matmul(input.clone()) + bias.clone();
                if let Some((_, hidden)) = &state {
                    sums = sums + hidden.clone().matmul(recurrent.clone());
                }
                let gate = |index: usize| sums.clone().slice([0..count, index * width..(index + 1) * width]);
                let mut cell = sigmoid(gate(0)) * gate(2).tanh();
                if let Some((past, _)) = state {
                    cell = cell + sigmoid(gate(1)) * past;
                }
                let hidden = sigmoid(gate(3)) * cell.clone().tanh();
                *values = match &factors {
                    Some(factors) => hidden.clone() * factors[step].clone(),
                    None => hidden.clone(),
                };
                state = Some((cell, hidden));
            }
        }
        let hidden = Tensor::cat(steps, 0);
        self.heads
            .iter()
            .map(|head| hidden.clone().matmul(head.weight.val()) + head.bias.val().unsqueeze::<2>())
            .collect()
    }

    /// Mean over the time steps of `batch` of −ln p(targets, classes), in normalised units.
    ///
    /// # Shapes
    ///
    /// `[1]`.
    ///
    /// # Panics
    ///
    /// If the network was made with other `dimensions`.
    #[must_use]
    pub fn loss(&self, batch: &Padded, dropout: Option<&Dropout<f32>>, dimensions: &Dimensions) -> Tensor<1> {
        let (k, d) = (dimensions.components, dimensions.continuous);
        let mut outputs = self.forward(batch, dropout).into_iter();
        let mut head = || outputs.next().expect("heads follow Dimensions::heads");
        let mut joint = log_softmax(head(), 1);
        let rows = joint.dims()[0];
        let means = head().reshape([rows, k, d]);
        let (low, high) = LOG_STDDEV_LIMITS;
        let log_stddevs = head().reshape([rows, k, d]).clamp(low, high);
        let standard = (batch.targets.clone().unsqueeze_dim::<3>(1) - means) * log_stddevs.clone().neg().exp();
        let terms = standard.square() * 0.5 + log_stddevs + HALF_LOG_TAU;
        let terms = terms * batch.mask.clone().unsqueeze_dim::<3>(1);
        joint = joint - terms.sum_dim(2).reshape([rows, k]);
        if dimensions.labels() > 0 {
            let logits = head().reshape([rows, k, dimensions.labels()]);
            let mut first = 0;
            for (&count, hot) in dimensions.classes.iter().zip(&batch.classes) {
                let logits = logits.clone().slice([0..rows, 0..k, first..first + count]);
                let terms = log_softmax(logits, 2) * hot.clone().unsqueeze_dim::<3>(1);
                joint = joint + terms.sum_dim(2).reshape([rows, k]);
                first += count;
            }
        }
        let largest = joint.clone().detach().max_dim(1);
        let log_density = (joint - largest.clone()).exp().sum_dim(1).log() + largest;
        (log_density * batch.exists.clone()).sum().neg() / batch.steps as f64
    }

    /// Gradients of `self` as plain vectors.
    pub(crate) fn gradients(&self, gradients: &Gradients) -> Parameters<f32> {
        fn read<const D: usize>(param: &Param<Tensor<D>>, gradients: &Gradients) -> Vec<f32> {
            let gradient = param.val().grad(gradients).unwrap_or_else(|| param.val().inner().zeros_like());
            gradient.into_data().try_into_vec().expect("networks are f32")
        }
        let mut tensors = Vec::new();
        for layer in &self.layers {
            tensors.push(read(&layer.input, gradients));
            tensors.push(read(&layer.recurrent, gradients));
            tensors.push(read(&layer.bias, gradients));
        }
        for head in &self.heads {
            tensors.push(read(&head.weight, gradients));
            tensors.push(read(&head.bias, gradients));
        }
        Parameters { tensors }
    }

    /// Gradients computed by hand, in the form that burn's optimisers take.
    pub(crate) fn register(gradients: Parameters<f32>, dimensions: &Dimensions, device: &Device) -> GradientsParams {
        let mut registered = GradientsParams::new();
        for (at, (values, spec)) in gradients.tensors.into_iter().zip(dimensions.tensors()).enumerate() {
            let id = ParamId::from(at as u64 + 1);
            let data = TensorData::new(values, spec.shape.clone());
            match spec.shape.len() {
                1 => registered.register(id, Tensor::<1>::from_data(data, device)),
                _ => registered.register(id, Tensor::<2>::from_data(data, device)),
            }
        }
        registered
    }
}

impl Padded {
    /// Packed rows `[rows, width]` as one padded tensor `[sequences, width]` per step, 1 where nothing was packed.
    fn unpack(&self, packed: &[f32], width: usize, count: usize, device: &Device) -> Vec<Tensor<2>> {
        let mut values = vec![1.0; self.observations.len() * count * width];
        for (row, &position) in packed.chunks_exact(width).zip(&self.positions) {
            values[position * width..][..width].copy_from_slice(row);
        }
        let steps = values.chunks_exact(count * width);
        steps.map(|step| Tensor::from_data(TensorData::new(step.to_vec(), [count, width]), device)).collect()
    }
}

#[cfg(test)]
mod tests;
