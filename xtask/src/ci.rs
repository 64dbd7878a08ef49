//! `cargo xtask ci`: exactly what CI runs.

use std::process::ExitCode;

use anyhow::{Context as _, Result};

use crate::program::{cargo, root};

pub(crate) fn run() -> Result<ExitCode> {
    let root = root();
    let steps: [&[&str]; 3] = [
        &["fmt", "--all", "--check"],
        &["clippy", "--release", "--workspace", "--all-targets", "--", "--deny", "warnings"],
        &["test", "--release", "--workspace"],
    ];
    for step in steps {
        whole_file::say!("cargo {}", step.join(" "));
        if !cargo(&root).args(step).status().context("cannot run cargo")?.success() {
            return Ok(ExitCode::FAILURE);
        }
    }
    Ok(ExitCode::SUCCESS)
}
