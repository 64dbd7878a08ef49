//! Times of one training step (128 episodes of 30 steps) and of one inference step, for the network of the paper.
//!
//! `cargo run --release -p prior --example timing`

use pomdp::{Purpose, Rng, Seed};
use prior::fused::{Batch, Workspace};
use prior::{
    ClassTarget, Dimensions, GradientPath, Inference, Layout, NetworkConfig, Parameters, Sequence, TrainConfig,
    Trainer, Transform,
};
use rand::RngExt as _;
use std::time::Instant;

const BATCH: usize = 128;
const STEPS: usize = 30;
const BATCHES: usize = 8;

#[expect(clippy::disallowed_methods, reason = "a clock is what this program is for")]
fn now() -> Instant {
    Instant::now()
}

fn layout() -> Layout {
    let names = |prefix: &str, count: usize| (0..count).map(|i| format!("{prefix}{i}")).collect::<Vec<_>>();
    let classes = [("shape", 3), ("obstacle", 4)];
    let classes = classes.map(|(name, count)| ClassTarget { name: name.into(), labels: names("label", count) });
    Layout {
        robot: "sawyer".into(),
        observation: names("o", 20),
        continuous: names("y", 45),
        transforms: vec![Transform::Identity; 45],
        classes: classes.into(),
    }
}

fn episode(rng: &mut Rng) -> Sequence {
    let mut uniform = |count: usize| (0..count).map(|_| 2.0 * rng.random::<f32>() - 1.0).collect::<Vec<f32>>();
    Sequence {
        observations: uniform(STEPS * 20),
        targets: uniform(STEPS * 45),
        mask: vec![1.0; STEPS * 45],
        classes: vec![0; STEPS * 2],
        steps: STEPS,
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    // One held-out episode or so: an epoch is BATCHES steps and hardly anything else.
    let data: Vec<Sequence> = (0..BATCH * BATCHES).map(|_| episode(&mut rng)).collect();
    let network = NetworkConfig { hidden: vec![128, 128], components: 10, memory: true };
    for (gradient, threads, chunks) in [
        (GradientPath::Fused, 1, 1),
        (GradientPath::Fused, 1, 2),
        (GradientPath::Fused, 2, 2),
        (GradientPath::Fused, 2, 4),
        (GradientPath::Autodiff, 1, 1),
    ] {
        let config = TrainConfig {
            network: network.clone(),
            learning_rate: 1e-3,
            schedule: prior::Schedule::Constant,
            batch: BATCH,
            chunks,
            held_out: 0.004,
            max_epochs: 100,
            patience: 100,
            clip_norm: None,
            weight_decay: 0.0,
            dropout: 0.0,
            rescale: false,
            gradient,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        pool.install(|| {
            let mut trainer = Trainer::new(config, layout(), &data, Seed(1)).expect("valid settings");
            let rounds = if gradient == GradientPath::Fused { 5 } else { 2 };
            let times = (0..rounds).map(|_| {
                let start = now();
                trainer.epoch().expect("finite gradients");
                start.elapsed().as_secs_f64() * 1e3 / BATCHES as f64
            });
            println!("{gradient:?}, {threads} threads, {chunks} chunks: {:.1} ms a batch", median(times.collect()));
        });
    }
    let sizes = Dimensions::new(&network, &layout()).expect("valid sizes");
    let parameters = Parameters::initial(&sizes, Seed(1));
    let references: Vec<&Sequence> = data.iter().take(BATCH).collect();
    let batch = Batch::pack(&references, &sizes);
    let mut space = Workspace::new(&sizes);
    let forward = (0..7).map(|_| {
        let start = now();
        assert!(space.loss(&parameters, &batch).is_finite());
        start.elapsed().as_secs_f64() * 1e3
    });
    println!("forward pass and loss alone, 1 thread: {:.1} ms a batch", median(forward.collect()));

    let references: Vec<&Sequence> = data.iter().collect();
    let mut inference = Inference::new(&sizes, &prior::Normalisation::fit(&layout(), &references), &parameters);
    let observation: Vec<f64> = data[0].observations[..20].iter().map(|&v| f64::from(v)).collect();
    let times = (0..25).map(|_| {
        let start = now();
        for _ in 0..1000 {
            assert!(inference.step(&observation).weights()[0] > 0.0);
        }
        start.elapsed().as_secs_f64() * 1e3
    });
    println!("inference: {:.1} µs a step", median(times.collect()));
    let mixture = inference.step(&observation).clone();
    let start = now();
    let values: f64 = (0..1000).map(|_| mixture.sample(&mut rng).values[0]).sum();
    println!("sample: {:.2} µs (checksum {values:.3})", start.elapsed().as_secs_f64() * 1e3);
}
