use super::*;
use crate::Sequence;
use crate::parameters::tests::dimensions;
use pomdp::{Purpose, Rng, Seed};
use rand::RngExt as _;
use std::collections::BTreeMap;

fn random_sequence(sizes: &Dimensions, steps: usize, rng: &mut Rng) -> Sequence {
    let mut uniform = |count: usize| (0..count).map(|_| 4.0 * rng.random::<f32>() - 2.0).collect::<Vec<f32>>();
    let observations = uniform(steps * sizes.observations);
    let targets = uniform(steps * sizes.continuous);
    let mask = uniform(steps * sizes.continuous).iter().map(|&v| if v > -1.0 { 1.0 } else { 0.0 }).collect();
    let classes = (0..steps).flat_map(|_| sizes.classes.clone()).map(|labels| rng.random_range(0..labels) as u8);
    Sequence { observations, targets, mask, classes: classes.collect(), steps }
}

fn problem(item: u64) -> (Dimensions, Parameters<f32>, Vec<Sequence>, Rng) {
    let sizes = dimensions(5, 6, &[3, 4], &[7, 9], 3);
    let mut rng = Seed(5).stream(Purpose::Test, item);
    let mut parameters = Parameters::initial(&sizes, Seed(5));
    for value in parameters.tensors.iter_mut().flatten() {
        *value += 0.6 * rng.random::<f32>() - 0.3;
    }
    // Two scales beyond their limits, where the gradient stops.
    let log_stddevs = sizes.tensors().iter().position(|spec| spec.name == "heads.log_stddevs.bias").unwrap();
    (parameters.tensors[log_stddevs][0], parameters.tensors[log_stddevs][7]) = (-8.0, 6.0);
    let sequences = [4, 1, 7, 7, 3].map(|steps| random_sequence(&sizes, steps, &mut rng));
    (sizes, parameters, sequences.into(), rng)
}

fn random_dropout(sizes: &Dimensions, rows: usize, rng: &mut Rng) -> Dropout<f32> {
    let mut factor = || if rng.random::<f32>() < 0.25 { 0.0 } else { 4.0 / 3.0 };
    sizes.hidden.iter().map(|&width| (0..rows * width).map(|_| factor()).collect()).collect()
}

#[test]
fn gradient_is_that_of_finite_differences_in_f64() {
    let (sizes, parameters, sequences, mut rng) = problem(9);
    let sequences: Vec<&Sequence> = sequences.iter().collect();
    let batch = Batch::<f64>::pack(&sequences, &sizes);
    let dropout = random_dropout(&sizes, batch.rows, &mut rng);
    let dropout = dropout.iter().map(|layer| layer.iter().map(|&v| f64::from(v)).collect()).collect();
    let mut parameters = parameters.map(f64::from);
    let mut space = Workspace::new(&sizes);
    let _ = space.loss_and_gradient(&parameters, &batch, Some(&dropout), 1.0);
    let gradient = space.gradient.clone();
    let mut checked = 0;
    for tensor in 0..parameters.tensors.len() {
        for index in (0..parameters.tensors[tensor].len()).step_by(3) {
            let (step, value) = (1e-5, parameters.tensors[tensor][index]);
            let mut at = |offset: f64| {
                parameters.tensors[tensor][index] = value + offset;
                space.loss_and_gradient(&parameters, &batch, Some(&dropout), 1.0)
            };
            let slope = (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step);
            parameters.tensors[tensor][index] = value;
            let exact = gradient.tensors[tensor][index];
            let name = &sizes.tensors()[tensor].name;
            assert!((slope - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{name}[{index}]: {slope} {exact}");
            checked += 1;
        }
    }
    assert!(checked > 500, "{checked}");
}

#[test]
fn what_the_mask_hides_changes_nothing() {
    let (sizes, parameters, mut sequences, _) = problem(4);
    let run = |sequences: &[Sequence]| {
        let batch = Batch::<f32>::pack(&sequences.iter().collect::<Vec<_>>(), &sizes);
        let mut space = Workspace::new(&sizes);
        (space.loss_and_gradient(&parameters, &batch, None, 1.0), space.gradient)
    };
    let before = run(&sequences);
    for sequence in &mut sequences {
        for (target, &mask) in sequence.targets.iter_mut().zip(&sequence.mask) {
            *target += 3.0 * (1.0 - mask);
        }
    }
    assert_eq!(before, run(&sequences));
    let (index, _) = sequences[0].mask.iter().enumerate().find(|(_, mask)| **mask == 1.0).unwrap();
    sequences[0].targets[index] += 0.1;
    assert_ne!(before.0, run(&sequences).0, "a target that applies does count");
}

/// A small network with its loss and gradient in f64, written by PyTorch (tests/peers/pytorch_prior.py --reference).
#[derive(serde::Deserialize)]
struct Recorded {
    sizes: RecordedSizes,
    sequences: Vec<RecordedSequence>,
    weights: BTreeMap<String, Vec<f64>>,
    loss: f64,
    gradient: BTreeMap<String, Vec<f64>>,
}

#[derive(serde::Deserialize)]
struct RecordedSizes {
    observations: usize,
    continuous: usize,
    classes: Vec<usize>,
    hidden: Vec<usize>,
    components: usize,
}

#[derive(serde::Deserialize)]
struct RecordedSequence {
    steps: usize,
    observations: Vec<f32>,
    targets: Vec<f32>,
    mask: Vec<f32>,
    classes: Vec<u8>,
}

fn recorded() -> (Dimensions, Parameters<f64>, Vec<Sequence>, f64, Parameters<f64>) {
    let recorded: Recorded = serde_json::from_str(include_str!("../../tests/data/pytorch_reference.json")).unwrap();
    let RecordedSizes { observations, continuous, classes, hidden, components } = recorded.sizes;
    let sizes = dimensions(observations, continuous, &classes, &hidden, components);
    let in_order = |mut named: BTreeMap<String, Vec<f64>>| {
        let tensors = sizes.tensors().into_iter().map(|spec| {
            let values = named.remove(&spec.name).unwrap_or_else(|| panic!("{} is not recorded", spec.name));
            assert_eq!(values.len(), spec.len(), "{}", spec.name);
            values
        });
        let parameters = Parameters { tensors: tensors.collect() };
        assert!(named.is_empty(), "{:?}", named.keys());
        parameters
    };
    let sequences = recorded.sequences.into_iter().map(|sequence| {
        let RecordedSequence { steps, observations, targets, mask, classes } = sequence;
        Sequence { observations, targets, mask, classes, steps }
    });
    let sequences = sequences.collect();
    (sizes.clone(), in_order(recorded.weights), sequences, recorded.loss, in_order(recorded.gradient))
}

/// Fails unless every value is within `tolerance` times the largest of its tensor.
fn assert_gradients_agree<T: Real>(
    ours: &Parameters<T>,
    reference: &Parameters<f64>,
    sizes: &Dimensions,
    tolerance: f64,
) {
    for ((ours, reference), spec) in ours.tensors.iter().zip(&reference.tensors).zip(sizes.tensors()) {
        let largest = reference.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        assert!(largest > 1e-4, "{}: a gradient of zero compares nothing", spec.name);
        for (index, (ours, reference)) in ours.iter().zip(reference).enumerate() {
            let difference = (ours.to_f64() - reference).abs();
            assert!(difference <= tolerance * largest, "{}[{index}]: {} {reference}", spec.name, ours.to_f64());
        }
    }
}

#[test]
fn loss_and_gradient_are_those_that_pytorch_recorded() {
    fn check<T: Real>(convert: impl Fn(f64) -> T, tolerance: f64) {
        let (sizes, weights, sequences, loss, gradient) = recorded();
        let weights = weights.map(convert);
        let batch = Batch::<T>::pack(&sequences.iter().collect::<Vec<_>>(), &sizes);
        let mut space = Workspace::new(&sizes);
        let ours = space.loss_and_gradient(&weights, &batch, None, T::from_f64(1.0 / batch.rows as f64));
        let ours = ours / batch.rows as f64;
        assert!((ours / loss - 1.0).abs() < tolerance, "{ours} {loss}");
        assert_gradients_agree(&space.gradient, &gradient, &sizes, tolerance);
    }
    let (_, weights, ..) = recorded();
    assert_eq!(weights.map(|value| value as f32).map(f64::from), weights, "the recorded weights are exact in f32");
    check::<f64>(|value| value, 1e-9);
    check::<f32>(|value| value as f32, 1e-5);
}

#[test]
fn in_f32_loss_and_gradient_are_those_of_f64_with_dropout() {
    let (sizes, parameters, sequences, mut rng) = problem(1);
    let sequences: Vec<&Sequence> = sequences.iter().collect();
    let (narrow, wide) = (Batch::<f32>::pack(&sequences, &sizes), Batch::<f64>::pack(&sequences, &sizes));
    let dropout = random_dropout(&sizes, narrow.rows, &mut rng);
    let exact = dropout.iter().map(|layer| layer.iter().map(|&factor| f64::from(factor)).collect()).collect();
    let (mut ours, mut reference) = (Workspace::new(&sizes), Workspace::new(&sizes));
    let loss = ours.loss_and_gradient(&parameters, &narrow, Some(&dropout), 1.0);
    let expected = reference.loss_and_gradient(&parameters.map(f64::from), &wide, Some(&exact), 1.0);
    assert!((loss / expected - 1.0).abs() < 1e-5, "{loss} {expected}");
    assert_gradients_agree(&ours.gradient, &reference.gradient, &sizes, 1e-5);
}
