//! See `fuzzing::targets::model_toml`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::model_toml::model_toml(data);
});
