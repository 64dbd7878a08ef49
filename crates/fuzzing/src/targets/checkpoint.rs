//! A trained prior: `prior.json` and its weights.

use std::collections::BTreeMap;
use std::path::Path;

use pomdp::{Purpose, Seed};
use prior::normalise::Scale;
use prior::{
    Baseline, Checkpoint, ClassTarget, Dimensions, Layout, NetworkConfig, Normalisation, Parameters, Schedule,
    TrainConfig, TrainingFacts, Transform,
};
use serde_json::Value;

use crate::Verdict;
use crate::parts::{join, split};
use crate::verdict::{folder, put, refused};

/// Name of the weights where a manifest names none that is a plain file.
pub(super) const WEIGHTS: &str = "weights.safetensors";

/// Loads the two files as they are, and once more with the recorded size and hash put right, so that what lies behind them sees the bytes too. What
/// is accepted can be saved and loaded again to the same, and its network takes a step.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn checkpoint(data: &[u8]) -> Verdict {
    once_more_with_its_hash(data, load)
}

/// Loads a manifest and weights as they are, and if they are refused with the recorded size and hash put right.
pub(super) fn once_more_with_its_hash(data: &[u8], load: fn(&[u8], &[u8]) -> Verdict) -> Verdict {
    let [manifest, weights] = split::<2>(data);
    let verdict = load(manifest, weights);
    if let Some(manifest) = matching(manifest, weights)
        && verdict == Verdict::Refused
    {
        return load(&manifest, weights);
    }
    verdict
}

fn load(manifest: &[u8], weights: &[u8]) -> Verdict {
    let folder = folder();
    let dir = folder.path();
    put(&dir.join("prior.json"), manifest);
    put(&dir.join(named(manifest).as_deref().unwrap_or(WEIGHTS)), weights);
    let checkpoint = match Checkpoint::load(dir, None) {
        Ok(checkpoint) => checkpoint,
        // The weights may have any name in the folder.
        Err(error) => return refused(&error, &[&dir.display().to_string()]),
    };
    check(&checkpoint, &dir.join("copy"));
    Verdict::Accepted
}

fn check(checkpoint: &Checkpoint, copy: &Path) {
    checkpoint.save(copy).unwrap_or_else(|error| panic!("what was loaded cannot be saved: {error}"));
    let again = Checkpoint::load(copy, Some(&checkpoint.layout)).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again.weights_hash(), checkpoint.weights_hash(), "a prior loads again to the same");
    assert_eq!((again.layout, again.network), (checkpoint.layout.clone(), checkpoint.network.clone()));
    let mut inference = checkpoint.inference().unwrap_or_else(|error| panic!("{error}"));
    let observation = vec![0.0; checkpoint.layout.observation.len()];
    let mut rng = Seed(1).stream(Purpose::Suggestion, 0);
    let draw = inference.step(&observation).sample(&mut rng);
    let values = checkpoint.layout.invert(&draw.values, &observation);
    assert_eq!(values.len(), checkpoint.layout.continuous.len(), "one value a target");
    for (class, target) in draw.classes.iter().zip(&checkpoint.layout.classes) {
        assert!(*class < target.labels.len(), "class {class} of {target:?}");
    }
}

/// The plain file that a manifest names.
pub(super) fn named(manifest: &[u8]) -> Option<String> {
    let manifest: Value = serde_json::from_slice(manifest).ok()?;
    let name = manifest.get("weights")?.get("name")?.as_str()?;
    let plain = name.len() < 200 && name.starts_with("weights") && !name.contains(['/', '\\', '\0']);
    plain.then(|| name.to_owned())
}

/// The manifest with size and hash of the weights.
fn matching(manifest: &[u8], weights: &[u8]) -> Option<Vec<u8>> {
    let mut manifest: Value = serde_json::from_slice(manifest).ok()?;
    let entry = manifest.get_mut("weights")?.as_object_mut()?;
    entry.insert("bytes".into(), weights.len().into());
    entry.insert("blake3".into(), blake3::hash(weights).to_hex().as_str().into());
    Some(manifest.to_string().into_bytes())
}

/// Two small networks: files of a real one, fifty times as long, would leave most changes in the weights.
///
/// # Panics
///
/// If no files can be written.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    [small(&[3, 4]), small(&[])].iter().map(saved).collect()
}

fn saved(checkpoint: &Checkpoint) -> Vec<u8> {
    let folder = folder();
    checkpoint.save(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let manifest = read("prior.json");
    let weights = read(&named(&manifest).unwrap_or_default());
    join(&[&manifest, &weights])
}

fn small(labels: &[usize]) -> Checkpoint {
    let names = |prefix: &str, count: usize| (0..count).map(|i| format!("{prefix}_{i}")).collect::<Vec<_>>();
    let classes: Vec<ClassTarget> = labels
        .iter()
        .map(|count| ClassTarget { name: format!("of_{count}"), labels: names("label", *count) })
        .collect();
    let layout = Layout {
        robot: "sawyer".into(),
        observation: names("observation", 3),
        continuous: names("target", 3),
        transforms: vec![Transform::Identity, Transform::Log, Transform::MinusObservation(1)],
        classes,
    };
    let network = NetworkConfig { hidden: vec![3, 2], components: 2, memory: true };
    let scale = Scale { mean: 0.25, stddev: 2.0 };
    let structures: usize = labels.iter().product();
    let config = TrainConfig {
        network: network.clone(),
        learning_rate: 0.001,
        schedule: Schedule::Cosine,
        batch: 16,
        chunks: 4,
        held_out: 0.1,
        max_epochs: 3,
        patience: 2,
        clip_norm: Some(5.0),
        weight_decay: 0.0,
        dropout: 0.0,
        rescale: false,
    };
    let dimensions = Dimensions::new(&network, &layout).unwrap_or_else(|error| panic!("{error}"));
    Checkpoint {
        normalisation: Normalisation { observation: vec![scale; 3], continuous: vec![scale; 3] },
        baseline: Baseline {
            labels: labels.to_vec(),
            structures: vec![1.0 / structures as f64; structures],
            continuous: vec![vec![scale; 3]; structures],
        },
        facts: TrainingFacts {
            config,
            seed: 1,
            data_blake3: "d0".into(),
            training_episodes: 9,
            training_transitions: 90,
            held_out_episodes: 1,
            held_out_transitions: 10,
            best_epoch: 0,
            held_out_nll: None,
            curve: Vec::new(),
        },
        provenance: BTreeMap::from([("commit".into(), "c0ffee".into())]),
        parameters: Parameters::initial(&dimensions, Seed(1)),
        layout,
        network,
    }
}
