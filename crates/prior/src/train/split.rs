//! Which episodes are held out, and which data this is.

use crate::Sequence;
use pomdp::{Purpose, Seed};
use rand::RngExt as _;

/// Whether episode number `episode` is held out: a stream per episode, so that more data does not move the old.
#[must_use]
pub fn is_held_out(seed: Seed, episode: usize, share: f64) -> bool {
    seed.stream(Purpose::Split, episode as u64).random::<f64>() < share
}

/// blake3 of all sequences, in hexadecimal.
pub(super) fn data_hash(data: &[Sequence]) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut bytes = Vec::new();
    for sequence in data {
        bytes.clear();
        bytes.extend((sequence.steps as u64).to_le_bytes());
        for values in [&sequence.observations, &sequence.targets, &sequence.mask] {
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes.extend(&sequence.classes);
        hasher.update(&bytes);
    }
    hasher.finalize().to_hex().to_string()
}
