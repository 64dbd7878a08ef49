use super::*;
use crate::Inference;
use crate::NetworkConfig;
use crate::layout::tests::layout;
use pomdp::Rng;
use rand::RngExt as _;
use rand_distr::StandardNormal;

fn normal(rng: &mut Rng) -> f32 {
    rng.sample(StandardNormal)
}

fn config(hidden: &[usize], components: usize) -> TrainConfig {
    TrainConfig {
        network: NetworkConfig { hidden: hidden.to_vec(), components, memory: true },
        learning_rate: 0.01,
        schedule: Schedule::Constant,
        batch: 32,
        chunks: 3,
        held_out: 0.2,
        max_epochs: 100,
        patience: 100,
        clip_norm: Some(5.0),
        weight_decay: 0.0,
        dropout: 0.0,
        rescale: false,
    }
}

/// Random episodes of 1 to 6 steps, with masks and two class targets.
pub(crate) fn small_problem() -> (TrainConfig, Layout, Vec<Sequence>) {
    let mut rng = Seed(8).stream(Purpose::Test, 0);
    let data = (0..90).map(|_| {
        let steps = rng.random_range(1..7);
        Sequence {
            observations: (0..3 * steps).map(|_| normal(&mut rng)).collect(),
            targets: (0..2 * steps).map(|_| normal(&mut rng)).collect(),
            mask: (0..2 * steps).map(|_| f32::from(u8::from(rng.random::<f32>() < 0.8))).collect(),
            classes: (0..steps).flat_map(|_| [rng.random_range(0..3), rng.random_range(0..4)]).collect(),
            steps,
        }
    });
    let data = data.collect();
    (config(&[6, 5], 2), layout(3, 2, &[3, 4]), data)
}

/// Weights after `epochs` epochs of the small problem.
fn train(config: TrainConfig, epochs: usize) -> Parameters<f32> {
    let (_, layout, data) = small_problem();
    let mut trainer = Trainer::new(config, layout, &data, Seed(1)).unwrap();
    for _ in 0..epochs {
        trainer.epoch().unwrap();
    }
    trainer.parameters().clone()
}

#[test]
fn a_known_mixture_is_recovered() {
    // Without a hint in the observation, y is N(−2, 0.5²) with class 0 (share 0.3) or N(1, 0.2²) with class 1.
    let mut rng = Seed(11).stream(Purpose::Test, 0);
    let data: Vec<Sequence> = (0..1500)
        .map(|_| {
            let first = rng.random::<f32>() < 0.3;
            let target = if first { -2.0 + 0.5 * normal(&mut rng) } else { 1.0 + 0.2 * normal(&mut rng) };
            let observations = vec![normal(&mut rng)];
            Sequence { observations, targets: vec![target], mask: vec![1.0], classes: vec![u8::from(!first)], steps: 1 }
        })
        .collect();
    let layout = layout(1, 1, &[2]);
    let mut trainer = Trainer::new(config(&[4], 2), layout, &data, Seed(11)).unwrap();
    for _ in 0..60 {
        trainer.epoch().unwrap();
    }
    let mut inference = trainer.checkpoint(BTreeMap::new()).inference().unwrap();
    let mixture = inference.step(&[0.1]);
    let low = usize::from(mixture.means(0)[0] > mixture.means(1)[0]);
    assert!((mixture.weights()[low] - 0.3).abs() < 0.05, "{mixture:?}");
    assert!(
        (mixture.means(low)[0] + 2.0).abs() < 0.12 && (mixture.means(1 - low)[0] - 1.0).abs() < 0.06,
        "{mixture:?}"
    );
    assert!(
        (mixture.stddevs(low)[0] - 0.5).abs() < 0.08 && (mixture.stddevs(1 - low)[0] - 0.2).abs() < 0.05,
        "{mixture:?}"
    );
    assert!(
        mixture.log_classes(low, 0)[0].exp() > 0.97 && mixture.log_classes(1 - low, 0)[1].exp() > 0.97,
        "{mixture:?}"
    );
    // Entropy of the truth: the components do not overlap, so H(shares) + Σ share · ½ ln(2πe σ²).
    let gaussian = |stddev: f64| 0.5 * (2.0 * std::f64::consts::PI * std::f64::consts::E).ln() + stddev.ln();
    let entropy = -0.3 * 0.3_f64.ln() - 0.7 * 0.7_f64.ln() + 0.3 * gaussian(0.5) + 0.7 * gaussian(0.2);
    let last = trainer.curve().last().unwrap();
    assert!((last.training_nll - last.held_out_nll).abs() < 0.15, "both in original units: {last:?}");
    assert!((trainer.held_out_nll() - entropy).abs() < 0.12, "{} {entropy}", trainer.held_out_nll());
}

#[test]
fn a_wrong_spread_is_found_again_on_the_held_out_part() {
    // Without a hint in the observation, y ~ N(1, 0.5²) and z ~ N(0, 2²).
    let mut rng = Seed(13).stream(Purpose::Test, 0);
    let data: Vec<Sequence> = (0..2000)
        .map(|_| {
            let targets = vec![1.0 + 0.5 * normal(&mut rng), 2.0 * normal(&mut rng)];
            Sequence { observations: vec![0.0], targets, mask: vec![1.0; 2], classes: vec![], steps: 1 }
        })
        .collect();
    let mut trainer = Trainer::new(config(&[4], 1), layout(1, 2, &[]), &data, Seed(13)).unwrap();
    for _ in 0..30 {
        trainer.epoch().unwrap();
    }
    // The spread of y three times too small, that of z twice too large.
    let head = trainer.dimensions().heads().iter().position(|(name, _)| *name == "log_stddevs").unwrap();
    let mut wrong = trainer.parameters().clone();
    wrong.tensors[3 + 2 * head + 1][0] -= 3.0_f32.ln();
    wrong.tensors[3 + 2 * head + 1][1] += 2.0_f32.ln();
    let right = trainer.rescaled(&wrong);
    let spread = |parameters: &Parameters<f32>| {
        let mut inference = Inference::new(&trainer.dimensions, &trainer.normalisation, parameters);
        inference.step(&[0.0]).stddevs(0).to_vec()
    };
    let (wrong_spread, right_spread) = (spread(&wrong), spread(&right));
    assert!(wrong_spread[0] < 0.2 && wrong_spread[1] > 3.5, "{wrong_spread:?}");
    // Some 400 held-out episodes: the standard error of a spread is 3.5 %.
    assert!((right_spread[0] - 0.5).abs() < 0.06 && (right_spread[1] - 2.0).abs() < 0.25, "{right_spread:?}");
    assert!(trainer.nll_of(&right) < trainer.nll_of(&wrong) - 0.5);
    assert!(trainer.nll_of(&right) <= trainer.held_out_nll() + 1e-4, "no other factor is better");
}

#[test]
fn the_rate_falls_along_half_a_cosine() {
    assert_eq!(Schedule::Constant.share(70, 100), 1.0);
    let share = |epoch| Schedule::Cosine.share(epoch, 100);
    assert!(share(1) > 0.999 && (share(50) - 0.5).abs() < 0.01 && share(100) < 1e-3 && share(100) > 0.0);
    assert!((1..100).all(|epoch| share(epoch + 1) < share(epoch)));
}

#[test]
fn what_was_seen_at_the_first_step_is_remembered_at_the_last() {
    // The value to tell at step 8 is shown at step 1 only, among distractors.
    let mut rng = Seed(12).stream(Purpose::Test, 0);
    let steps = 8;
    let data: Vec<Sequence> = (0..1200)
        .map(|_| {
            let secret = normal(&mut rng);
            let shown = |step: usize, rng: &mut Rng| if step == 0 { [secret, 1.0] } else { [normal(rng), 0.0] };
            Sequence {
                observations: (0..steps).flat_map(|step| shown(step, &mut rng)).collect(),
                targets: vec![secret; steps],
                mask: (0..steps).map(|step| f32::from(u8::from(step + 1 == steps))).collect(),
                classes: vec![],
                steps,
            }
        })
        .collect();
    let mut settings = config(&[16], 1);
    settings.clip_norm = Some(1.0);
    let mut trainer = Trainer::new(settings, layout(2, 1, &[]), &data, Seed(12)).unwrap();
    let marginal = 0.5 * (2.0 * std::f64::consts::PI * std::f64::consts::E).ln() / steps as f64;
    let before = trainer.held_out_nll();
    while !trainer.finished() && trainer.curve().len() < 60 {
        trainer.epoch().unwrap();
    }
    let after = trainer.held_out_nll();
    assert!(before > 0.8 * marginal, "untrained, it knows no more than the marginal: {before} {marginal}");
    // A spread of a tenth of the secret's would save ln 10 nats at the one step of eight that counts.
    assert!(after < marginal - 10.0_f64.ln() / steps as f64, "{after} {marginal}");
}

#[test]
fn a_run_that_was_stopped_ends_with_the_same_weights() {
    for (dropout, weight_decay) in [(0.0, 0.0), (0.25, 0.01)] {
        let (mut config, layout, data) = small_problem();
        (config.dropout, config.weight_decay) = (dropout, weight_decay);
        let straight = train(config.clone(), 4);
        let dir = tempfile::tempdir().unwrap();
        let mut first = Trainer::new(config, layout.clone(), &data, Seed(1)).unwrap();
        first.save(dir.path()).unwrap();
        let mut second = Trainer::resume(dir.path(), &layout, &data).unwrap();
        let reports = [second.epoch().unwrap(), second.epoch().unwrap()];
        second.save(dir.path()).unwrap();
        assert_eq!([first.epoch().unwrap(), first.epoch().unwrap()], reports);
        let mut third = Trainer::resume(dir.path(), &layout, &data).unwrap();
        assert_eq!(third.checkpoint(BTreeMap::new()), second.checkpoint(BTreeMap::new()));
        third.epoch().unwrap();
        third.epoch().unwrap();
        assert_eq!(third.parameters(), &straight);
        first.epoch().unwrap();
        first.epoch().unwrap();
        let checkpoints = [first.checkpoint(BTreeMap::new()), third.checkpoint(BTreeMap::new())];
        assert_eq!(checkpoints[0], checkpoints[1], "best weights and curve too");
    }
}

#[test]
fn a_training_state_of_other_data_or_another_layout_is_refused() {
    let (config, layout, mut data) = small_problem();
    let dir = tempfile::tempdir().unwrap();
    Trainer::new(config, layout.clone(), &data, Seed(1)).unwrap().save(dir.path()).unwrap();
    let mut other = layout.clone();
    other.robot = "jaco".into();
    assert!(matches!(Trainer::resume(dir.path(), &other, &data).err(), Some(Error::Robot { .. })));
    let changes: [fn(&mut Sequence); 4] = [
        |s| s.observations[0] += 1.0,
        |s| s.targets[0] += 1.0,
        |s| s.mask[0] = 1.0 - s.mask[0],
        |s| s.classes[0] = (s.classes[0] + 1) % 3,
    ];
    for change in changes {
        let kept = data[3].clone();
        change(&mut data[3]);
        assert!(matches!(Trainer::resume(dir.path(), &layout, &data).err(), Some(Error::OtherData { .. })));
        data[3] = kept;
    }
    assert!(Trainer::resume(dir.path(), &layout, &data).is_ok());
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut config, _, _) = small_problem();
            config.dropout = 0.1;
            train(config, 3)
        })
    };
    let one = with_threads(1);
    assert_eq!(one, with_threads(2));
    assert_eq!(one, with_threads(5));
}

#[test]
fn training_stops_when_held_out_episodes_get_worse() {
    // Nothing to learn and few episodes: the network can only learn them by heart.
    let (mut config, layout, data) = small_problem();
    (config.patience, config.max_epochs, config.network.hidden) = (3, 200, vec![32]);
    let mut trainer = Trainer::new(config, layout, &data, Seed(1)).unwrap();
    while !trainer.finished() {
        trainer.epoch().unwrap();
    }
    let last = trainer.curve().last().unwrap().clone();
    assert!(last.epoch < 200 && last.epoch == last.best_epoch + 3, "{last:?}");
    let smallest = trainer.curve().iter().map(|row| row.held_out_nll).fold(f64::INFINITY, f64::min);
    assert_eq!(last.best_held_out_nll, smallest);
    let facts = trainer.checkpoint(BTreeMap::new()).facts;
    assert_eq!((facts.best_epoch, facts.held_out_nll), (last.best_epoch, Some(smallest)));
    assert_ne!(&trainer.checkpoint(BTreeMap::new()).parameters, trainer.parameters(), "the best, not the last");
    assert_eq!(curve_csv(trainer.curve()).lines().count(), last.epoch + 1);
}

#[test]
fn clipping_bounds_the_first_step_of_plain_gradients() {
    let (mut config, layout, data) = small_problem();
    let unclipped = Trainer::new(config.clone(), layout.clone(), &data, Seed(1)).unwrap().epoch().unwrap();
    config.clip_norm = Some(1e-9);
    let mut trainer = Trainer::new(config, layout, &data, Seed(1)).unwrap();
    let before = trainer.parameters().clone();
    let clipped = trainer.epoch().unwrap();
    // Adam's ε of 1e-8 is larger than gradients this small: the weights hardly move.
    let moved = trainer.parameters().tensors.iter().flatten().zip(before.tensors.iter().flatten());
    let moved = moved.map(|(now, before)| (now - before).abs()).fold(0.0, f32::max);
    assert!(moved < 5e-3, "{moved}");
    assert!(unclipped.gradient_norm > 0.1 && clipped.gradient_norm > 0.1, "the norm reported is that before clipping");
}

#[test]
fn every_step_drops_other_units() {
    let (mut config, layout, data) = small_problem();
    (config.learning_rate, config.dropout, config.chunks) = (1e-12, 0.5, 1);
    let mut losses = |dropout: f64| {
        config.dropout = dropout;
        let mut trainer = Trainer::new(config.clone(), layout.clone(), &data, Seed(1)).unwrap();
        [0, 1].map(|_| trainer.step(&[0, 1, 2]).unwrap().loss)
    };
    let [first, second] = losses(0.0);
    assert!((first - second).abs() < 1e-6, "the weights do not move: {first} {second}");
    let [first, second] = losses(0.5);
    assert!((first - second).abs() > 1e-3, "{first} {second}");
}

#[test]
fn settings_out_of_range_are_refused() {
    let (good, layout, data) = small_problem();
    let refuse = |change: &dyn Fn(&mut TrainConfig)| {
        let mut bad = good.clone();
        change(&mut bad);
        Trainer::new(bad, layout.clone(), &data, Seed(1)).err().unwrap().to_string()
    };
    assert_eq!(refuse(&|c| c.learning_rate = 0.0), "learning_rate is 0, expected above 0 and finite");
    assert_eq!(refuse(&|c| c.held_out = 1.0), "held_out is 1, expected in (0, 1)");
    assert_eq!(refuse(&|c| c.dropout = 1.0), "dropout is 1, expected in [0, 1)");
    assert_eq!(refuse(&|c| c.network.components = 0), "network.components is 0, expected at least 1");
    let two = Trainer::new(good.clone(), layout.clone(), &data[..1], Seed(1)).err().unwrap().to_string();
    assert!(two.ends_with("both parts need at least one"), "{two}");
}
