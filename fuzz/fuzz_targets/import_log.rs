//! See `fuzzing::targets::import_log`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::import_log::import_log(data);
});
