use super::*;
use crate::fused::HALF_LOG_TAU;
use crate::layout::tests::layout;
use crate::normalise::{Normalisation, Scale};
use crate::parameters::Parameters;
use crate::parameters::tests::dimensions;
use pomdp::{Purpose, Rng, Seed};
use rand::RngExt as _;
use rand_distr::StandardNormal;

/// An inference that ignores its input and always suggests: y₀ ~ N(2, 3²), y₁ ~ N(0, 1) if the class is 1, and
/// P(class 0) = P(class 1) = 1/2, told by two components, one a class.
fn fixed_inference(shift: f32) -> (Inference, Layout, Normalisation) {
    let sizes = dimensions(1, 2, &[2], &[2], 2);
    let mut parameters = Parameters::zeros(&sizes);
    // Means in normalised units: component 0 is lost on y₁.
    parameters.tensors[4] = vec![0.0, shift];
    parameters.tensors[6] = vec![0.0, 40.0, 0.0, 0.0];
    parameters.tensors[10] = vec![9.0, -9.0, -9.0, 9.0];
    let mut layout = layout(1, 2, &[2]);
    layout.classes[0].labels[0] = "none".into();
    let scale = |mean, stddev| Scale { mean, stddev };
    let normalisation =
        Normalisation { observation: vec![scale(0.0, 1.0)], continuous: vec![scale(2.0, 3.0), scale(0.0, 1.0)] };
    (Inference::new(&sizes, &normalisation, &parameters), layout, normalisation)
}

/// Episodes drawn from what the inference suggests, the spread of y₀ times `spread`.
fn episodes(count: usize, spread: f32, rng: &mut Rng) -> Vec<Sequence> {
    let normal = |rng: &mut Rng| rng.sample::<f32, _>(StandardNormal);
    let mut draw = |_| {
        let class = u8::from(rng.random::<bool>());
        let rows: Vec<f32> =
            (0..4).map(|i| if i % 2 == 0 { 2.0 + 3.0 * spread * normal(rng) } else { normal(rng) }).collect();
        let mask = [1.0, f32::from(class)].repeat(2);
        Sequence { observations: vec![0.0; 2], targets: rows, mask, classes: vec![class; 2], steps: 2 }
    };
    (0..count).map(&mut draw).collect()
}

fn report(count: usize, spread: f32) -> Calibration {
    shifted_report(count, spread, 0.0)
}

/// `shift` is the logit of class 1.
fn shifted_report(count: usize, spread: f32, shift: f32) -> Calibration {
    let (inference, layout, normalisation) = fixed_inference(shift);
    let sequences = episodes(count, spread, &mut Seed(4).stream(Purpose::Test, 0));
    let references: Vec<&Sequence> = sequences.iter().collect();
    let baseline = Baseline::fit(&layout, &normalisation, &references);
    let contact = |index: usize| if index.is_multiple_of(2) { Some(1) } else { None };
    let held: Vec<Episode> = sequences
        .iter()
        .enumerate()
        .map(|(i, sequence)| Episode {
            sequence,
            contact: contact(i),
            obstacle_contact: i.is_multiple_of(3).then_some(1),
        })
        .collect();
    let models = Models { network: &inference, baseline: &baseline, memoryless: Some(&inference) };
    calibrate(models, &layout, 1..2, &held)
}

#[test]
fn coverage_of_a_true_model_is_nominal_and_of_an_overconfident_one_is_not() {
    // 4000 independent ranks: 5 standard errors of a share of 0.9 are 0.024, of 0.5 are 0.04.
    let honest = report(2000, 1.0);
    for parameter in &honest.parameters {
        assert!((parameter.coverage90 - 0.9).abs() < 0.035, "{parameter:?}");
        assert!((parameter.coverage50 - 0.5).abs() < 0.056, "{parameter:?}");
    }
    let parts = &honest.parameters[0];
    for part in [parts.coverage90_before_contact, parts.coverage90_after_contact, parts.coverage90_last] {
        assert!(part.is_some_and(|share| (share - 0.9).abs() < 0.05), "{parts:?}");
    }
    assert_eq!(honest.parameters[0].count, 4000);
    assert!((1800..2200).contains(&honest.parameters[1].count), "counts only where it applies");
    assert!(honest.parameters[1].ranks.iter().all(|&count| count > 50), "ranks given the class are flat");
    // True spread 2σ: P(|z| < 1.645/2) = 0.589.
    let overconfident = report(2000, 2.0);
    assert!((overconfident.parameters[0].coverage90 - 0.589).abs() < 0.04, "{:?}", overconfident.parameters[0]);
}

#[test]
fn likelihood_equals_the_entropy_of_the_truth() {
    // ½ ln(2πe 9) + ½ · ½ ln(2πe) + ln 2, the last from the class.
    let entropy = 0.5 * (2.0 * std::f64::consts::PI * std::f64::consts::E).ln();
    let exact = entropy + 3.0_f64.ln() + 0.5 * entropy + 2.0_f64.ln();
    let honest = report(4000, 1.0);
    assert!((honest.nll - exact).abs() < 0.05, "{} {exact}", honest.nll);
    // The truth is a product of marginals, so the baseline is as good.
    assert!((honest.baseline_nll - exact).abs() < 0.05, "{} {exact}", honest.baseline_nll);
    assert_eq!(honest.memoryless_nll, Some(honest.nll), "the same network");
    assert_eq!(honest.sharpening.len(), 2);
    let [first, second] = honest.sharpening.as_slice() else { panic!("{} steps", honest.sharpening.len()) };
    assert_eq!((first.before_contact.count, first.since_contact.count, second.since_contact.count), (4000, 2000, 0));
    // y₁, known as well as before any observation: half of ½ ln(2πe), and ln 2 for the class.
    assert!((first.all.static_nll.network.unwrap() - 0.5 * entropy - 2.0_f64.ln()).abs() < 0.05, "{first:?}");
    assert!((first.all.spread[0] - 1.0).abs() < 0.05, "{first:?}");
    assert!((first.all.class_probability[0] - 0.5).abs() < 1e-3, "{first:?}");
    assert_eq!((honest.sharpening[0].after_contact.count, honest.sharpening[1].after_contact.count), (0, 2000));
    assert_eq!(honest.sharpening[1].all.count, 4000);
}

#[test]
fn confidence_of_one_half_is_calibrated_and_confusion_counts_everything() {
    let honest = report(2000, 1.0);
    let class = &honest.classes[0];
    assert!(class.expected_calibration_error < 0.06, "{class:?}");
    assert_eq!(class.confusion.iter().flatten().sum::<usize>(), 4000);
    let right = (class.confusion[0][0] + class.confusion[1][1]) as f64 / 4000.0;
    assert!((class.accuracy - right).abs() < 1e-12);
    assert!(honest.shape_accuracy.is_some() && honest.no_obstacle_accuracy.is_some());
    assert_eq!(honest.obstacle_contact_episodes, 667);
    assert_eq!(class.last_confusion.iter().flatten().sum::<usize>(), 2000);
}

#[test]
fn an_obstacle_counts_as_found_where_it_is_likelier_than_not() {
    for (shift, found, denied) in [(1.0, 1.0, 0.0), (-1.0, 0.0, 1.0)] {
        let report = shifted_report(60, 1.0, shift);
        assert_eq!((report.obstacle_after_contact_accuracy, report.no_obstacle_accuracy), (Some(found), Some(denied)));
        assert_eq!(report.obstacle_balanced_accuracy, Some(0.5), "a constant answer knows nothing");
        assert_eq!((report.untouched_obstacle_found, report.obstacle_found_since_touch), (Some(found), vec![found]));
    }
}

#[test]
fn baseline_of_a_constant_has_the_spread_that_the_network_can_state_at_least() {
    let layout = layout(1, 1, &[2]);
    let (observations, targets, mask) = (vec![0.0; 41], vec![7.0; 41], vec![1.0; 41]);
    let classes = [vec![0; 40], vec![1]].concat();
    let sequence = Sequence { observations, targets, mask, classes, steps: 41 };
    let baseline = Baseline::fit(&layout, &Normalisation::fit(&layout, &[&sequence]), &[&sequence]);
    assert_eq!(baseline.continuous[0], [Scale { mean: 7.0, stddev: (-5.0_f64).exp() }]);
    assert_eq!(baseline.continuous[1], [Scale { mean: 7.0, stddev: 1.0 }], "one row has no spread of its own");
    let exact = 5.0 - HALF_LOG_TAU + (41.0_f64 / 43.0).ln();
    let log_density = baseline.log_density(&[7.0], &[true], &[0]);
    assert!((log_density - exact).abs() < 1e-12, "counts start from one a label: {log_density} {exact}");
}
