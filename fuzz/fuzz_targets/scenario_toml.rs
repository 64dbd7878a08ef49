//! See `fuzzing::targets::scenario_toml`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::scenario_toml::scenario_toml(data);
});
