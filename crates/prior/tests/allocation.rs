//! What a decision costs the allocator. The counting allocator counts for this thread alone, and for this test program alone.

use allocation_counter::measure;
use pomdp::Seed;
use prior::normalise::Scale;
use prior::{Dimensions, Inference, Normalisation, Parameters};

fn inference() -> (Dimensions, Inference) {
    let sizes =
        Dimensions { observations: 20, continuous: 45, classes: vec![3, 4], hidden: vec![128, 128], components: 10 };
    let scales = |count: usize| vec![Scale { mean: 0.1, stddev: 2.0 }; count];
    let normalisation = Normalisation { observation: scales(sizes.observations), continuous: scales(sizes.continuous) };
    let inference = Inference::new(&sizes, &normalisation, &Parameters::initial(&sizes, Seed(1)));
    (sizes, inference)
}

#[test]
fn a_step_of_inference_allocates_nothing() {
    let (sizes, mut inference) = inference();
    let observation = vec![0.3; sizes.observations];
    let mut weights = 0.0;
    // From the very first step of an episode on, and over a reset.
    let counted = measure(|| {
        for _ in 0..2 {
            for _ in 0..30 {
                weights += inference.step(&observation).weights().iter().sum::<f64>();
            }
            inference.reset();
        }
    });
    assert_eq!(counted.count_total, 0, "{counted:?}");
    assert!((weights - 60.0).abs() < 1e-6, "the steps were taken: {weights}");
}

#[test]
fn the_counter_sees_what_a_copy_of_the_network_allocates() {
    let (sizes, mut inference) = inference();
    let state_bytes = 4 * (sizes.observations + 5 * sizes.top()) as u64;
    let mut copy = None;
    let counted = measure(|| copy = Some(inference.clone()));
    assert!(counted.bytes_total > state_bytes, "{counted:?}");
    let weight_bytes = 4 * Parameters::<f32>::zeros(&sizes).count() as u64;
    assert!(counted.bytes_total < weight_bytes, "copies share the weights: {counted:?}");
    let observation = vec![0.3; sizes.observations];
    let copy = copy.as_mut().unwrap();
    assert_eq!(copy.step(&observation), inference.step(&observation));
}
