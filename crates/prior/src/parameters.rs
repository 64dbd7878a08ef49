//! Sizes of the network and its weights as plain vectors, the form that fused training, files and inference share.

use crate::{Error, Layout};
use pomdp::{Purpose, Seed};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

/// Largest width of a layer, and most components: beyond it sizes would overflow before memory does.
const LARGEST: usize = 1 << 16;

/// Shape of the network. The paper: two layers of 128, 10 components.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Width of each LSTM layer, from the input to the heads.
    pub hidden: Vec<usize>,
    /// Number of mixture components.
    pub components: usize,
    /// Whether the state is carried from step to step; without it every observation stands alone, which is what memory is measured against.
    pub memory: bool,
}

/// All sizes of a network for one layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dimensions {
    /// Observation columns.
    pub observations: usize,
    /// Continuous targets.
    pub continuous: usize,
    /// Number of labels of each class target.
    pub classes: Vec<usize>,
    /// Width of each LSTM layer.
    pub hidden: Vec<usize>,
    /// Mixture components.
    pub components: usize,
}

/// Name and shape of one weight tensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorSpec {
    /// Name in files, such as `layers.0.recurrent`.
    pub name: String,
    /// `[inputs, outputs]` of a matrix, `[outputs]` of a bias.
    pub shape: Vec<usize>,
}

impl TensorSpec {
    /// Number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether it holds no value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Dimensions {
    /// Sizes of `config` for `layout`.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] for a size of zero, or more than 255 labels.
    pub fn new(config: &NetworkConfig, layout: &Layout) -> Result<Self, Error> {
        let dimensions = Self::unchecked(config, layout);
        let refuse = |setting, found: String, expected| Err(Error::Config { setting, found, expected });
        if config.hidden.is_empty() || config.hidden.contains(&0) {
            return refuse(
                "network.hidden",
                format!("{:?}", config.hidden),
                "at least one layer, each at least 1 wide",
            );
        }
        if config.hidden.iter().any(|&width| width > LARGEST) || config.components > LARGEST {
            let found = format!("{:?} and {} components", config.hidden, config.components);
            return refuse("network", found, "at most 65536 each");
        }
        if config.components == 0 {
            return refuse("network.components", "0".into(), "at least 1");
        }
        if dimensions.observations == 0 || dimensions.continuous == 0 {
            let found = format!("{} observations and {} targets", dimensions.observations, dimensions.continuous);
            return refuse("layout", found, "at least one observation and one continuous target");
        }
        if dimensions.classes.iter().any(|&count| count == 0 || count > 255) {
            return refuse("layout.classes", format!("{:?} labels", dimensions.classes), "1 to 255 labels each");
        }
        Ok(dimensions)
    }

    pub(crate) fn unchecked(config: &NetworkConfig, layout: &Layout) -> Self {
        Self {
            observations: layout.observation.len(),
            continuous: layout.continuous.len(),
            classes: layout.classes.iter().map(|target| target.labels.len()).collect(),
            hidden: config.hidden.clone(),
            components: config.components,
        }
    }

    /// Number of labels of all class targets together.
    #[must_use]
    pub fn labels(&self) -> usize {
        self.classes.iter().sum()
    }

    /// Width of the last LSTM layer.
    #[must_use]
    pub fn top(&self) -> usize {
        self.hidden[self.hidden.len() - 1]
    }

    /// Name and width of each linear head, in the order of the output row
    /// `[components | components × continuous | components × continuous | components × labels]`.
    /// A head without outputs (no class target) is left out.
    #[must_use]
    pub fn heads(&self) -> Vec<(&'static str, usize)> {
        let gaussian = self.components * self.continuous;
        let all = [
            ("logits", self.components),
            ("means", gaussian),
            ("log_stddevs", gaussian),
            ("classes", self.components * self.labels()),
        ];
        all.into_iter().filter(|(_, width)| *width > 0).collect()
    }

    /// Width of the output row.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.heads().iter().map(|(_, width)| width).sum()
    }

    /// Input width of LSTM layer `layer`.
    #[must_use]
    pub fn layer_inputs(&self, layer: usize) -> usize {
        if layer == 0 { self.observations } else { self.hidden[layer - 1] }
    }

    /// Every weight tensor in order: per layer `input`, `recurrent` and `bias` (four gates side by side: input, forget,
    /// cell, output), then `weight` and `bias` of each head.
    #[must_use]
    pub fn tensors(&self) -> Vec<TensorSpec> {
        let mut specs = Vec::new();
        let mut push = |name: String, shape: Vec<usize>| specs.push(TensorSpec { name, shape });
        for (layer, &width) in self.hidden.iter().enumerate() {
            push(format!("layers.{layer}.input"), vec![self.layer_inputs(layer), 4 * width]);
            push(format!("layers.{layer}.recurrent"), vec![width, 4 * width]);
            push(format!("layers.{layer}.bias"), vec![4 * width]);
        }
        for (name, width) in self.heads() {
            push(format!("heads.{name}.weight"), vec![self.top(), width]);
            push(format!("heads.{name}.bias"), vec![width]);
        }
        specs
    }
}

/// Weights (or their gradients) as plain vectors in the order of [`Dimensions::tensors`], matrices row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters<T> {
    /// One vector per tensor.
    pub tensors: Vec<Vec<T>>,
}

impl<T: Copy + Default> Parameters<T> {
    /// All zero.
    #[must_use]
    pub fn zeros(dimensions: &Dimensions) -> Self {
        Self { tensors: dimensions.tensors().iter().map(|spec| vec![T::default(); spec.len()]).collect() }
    }

    /// Number of values.
    #[must_use]
    pub fn count(&self) -> usize {
        self.tensors.iter().map(Vec::len).sum()
    }

    /// The same weights, each value converted by `convert`.
    pub fn map<U>(&self, convert: impl Fn(T) -> U) -> Parameters<U> {
        Parameters { tensors: self.tensors.iter().map(|tensor| tensor.iter().map(|&v| convert(v)).collect()).collect() }
    }

    pub(crate) fn input(&self, layer: usize) -> &[T] {
        &self.tensors[3 * layer]
    }

    pub(crate) fn recurrent(&self, layer: usize) -> &[T] {
        &self.tensors[3 * layer + 1]
    }

    pub(crate) fn bias(&self, layer: usize) -> &[T] {
        &self.tensors[3 * layer + 2]
    }

    /// Weight and bias of head number `head` of a network with `layers` LSTM layers.
    pub(crate) fn head(&self, layers: usize, head: usize) -> (&[T], &[T]) {
        let at = 3 * layers + 2 * head;
        (&self.tensors[at], &self.tensors[at + 1])
    }
}

impl Parameters<f32> {
    /// Fresh weights, uniform in ±1/√width. Forget gates are open (bias + 1, Jozefowicz et al. 2015). Means of the
    /// components are spread over ±1 normalised units, so that they start apart. All scales are 1, all classes equal.
    #[must_use]
    pub fn initial(dimensions: &Dimensions, seed: Seed) -> Self {
        let mut parameters = Self::zeros(dimensions);
        let layers = dimensions.hidden.len();
        for (index, (tensor, spec)) in parameters.tensors.iter_mut().zip(dimensions.tensors()).enumerate() {
            let mut rng = seed.stream(Purpose::Weights, index as u64);
            let width = if index < 3 * layers { dimensions.hidden[index / 3] } else { dimensions.top() };
            let limit = match (spec.name.as_str(), spec.shape.len()) {
                ("heads.means.bias", _) => 1.0,
                (name, 1) if name.starts_with("heads") => 0.0,
                _ => 1.0 / (width as f32).sqrt(),
            };
            tensor.fill_with(|| limit * (2.0 * rng.random::<f32>() - 1.0));
            if index < 3 * layers && spec.shape.len() == 1 {
                tensor[width..2 * width].iter_mut().for_each(|bias| *bias += 1.0);
            }
        }
        parameters
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Sizes for tests.
    pub(crate) fn dimensions(
        observations: usize,
        continuous: usize,
        classes: &[usize],
        hidden: &[usize],
        k: usize,
    ) -> Dimensions {
        let classes = classes.to_vec();
        Dimensions { observations, continuous, classes, hidden: hidden.to_vec(), components: k }
    }

    #[test]
    fn published_network_has_the_expected_number_of_weights() {
        let sizes = dimensions(20, 45, &[3, 4], &[128, 128], 10);
        let lstm = 4 * 128 * (20 + 128 + 1) + 4 * 128 * (128 + 128 + 1);
        let heads = 129 * (10 + 450 + 450 + 70);
        assert_eq!(Parameters::<f32>::zeros(&sizes).count(), lstm + heads);
        assert_eq!(sizes.outputs(), 980);
    }

    #[test]
    fn initial_weights_depend_on_the_seed_alone() {
        let sizes = dimensions(3, 2, &[3], &[5, 4], 2);
        let first = Parameters::initial(&sizes, Seed(1));
        assert_eq!(first, Parameters::initial(&sizes, Seed(1)));
        assert_ne!(first, Parameters::initial(&sizes, Seed(2)));
        assert!(first.bias(0)[5..10].iter().all(|&bias| bias > 0.5), "forget gates start open");
        assert!(first.bias(0)[..5].iter().all(|&bias| bias < 0.5));
    }

    #[test]
    fn a_network_without_outputs_is_refused() {
        let layout = crate::layout::tests::layout(2, 0, &[]);
        let config = NetworkConfig { hidden: vec![4], components: 2, memory: true };
        let message = Dimensions::new(&config, &layout).unwrap_err().to_string();
        assert_eq!(
            message,
            "layout is 2 observations and 0 targets, expected at least one observation and one continuous target"
        );
    }
}
