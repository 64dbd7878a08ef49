//! See `fuzzing::targets::world_protocol`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let _ = fuzzing::targets::world_protocol::world_protocol(data);
});
