//! `cargo xtask ci`: exactly what CI runs; with `--all-features` also what is too slow for it.

use std::process::ExitCode;

use anyhow::{Context as _, Result};

use crate::built::{cargo, root};

/// What to check.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Also checks what is behind cargo features, which CI leaves out: the writer of recordings for the Rerun viewer, with 400 crates.
    #[arg(long)]
    all_features: bool,
}

pub(crate) fn run(options: &Options) -> Result<ExitCode> {
    let root = root();
    let mut steps: Vec<&[&str]> = vec![
        &["fmt", "--all", "--check"],
        &["clippy", "--release", "--workspace", "--all-targets", "--", "--deny", "warnings"],
        &["test", "--release", "--workspace"],
    ];
    if options.all_features {
        steps.push(&["check", "--release", "--package", "recording", "--features", "rerun", "--all-targets"]);
    }
    for step in steps {
        program::say!("cargo {}", step.join(" "));
        if !cargo(&root).args(step).status().context("cannot run cargo")?.success() {
            return Ok(ExitCode::FAILURE);
        }
    }
    Ok(ExitCode::SUCCESS)
}
