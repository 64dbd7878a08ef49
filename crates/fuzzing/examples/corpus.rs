//! Writes the valid inputs of all targets to `fuzz/corpus/TARGET/`, for libFuzzer to begin with.

use std::path::Path;

fn main() -> std::io::Result<()> {
    for target in fuzzing::TARGETS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target.name);
        std::fs::create_dir_all(&folder)?;
        for (number, seed) in (target.seeds)().iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{number}")), seed)?;
        }
    }
    Ok(())
}
