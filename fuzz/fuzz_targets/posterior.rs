//! See `fuzzing::targets::posterior`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::posterior::posterior(data);
});
