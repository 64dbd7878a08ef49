//! See `fuzzing::targets::dataset_shard`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::dataset_shard::dataset_shard(data);
});
