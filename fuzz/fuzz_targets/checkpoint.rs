//! See `fuzzing::targets::checkpoint`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::checkpoint::checkpoint(data);
});
