//! See `fuzzing::targets::measured_log`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::measured_log::measured_log(data);
});
