//! `cargo xtask rerun`: a recording for the Rerun viewer of an episode.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use clap::Parser;

/// Makes a recording for the Rerun viewer of an episode of `demo`.
#[derive(Debug, Parser)]
#[command(name = "to-rerun", version, after_help = EXAMPLES)]
struct Arguments {
    /// Folder of the episode, or its trace.json.
    episode: PathBuf,
    /// The recording [default: episode.rrd beside trace.json].
    #[arg(long)]
    out: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask rerun runs/demo/D4-sawyer-surmise-mixture";

/// How a recording of the viewer begins.
const MAGIC: &[u8] = b"RRF";

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let episode = &arguments.episode;
    let trace_file = if episode.is_dir() { episode.join("trace.json") } else { episode.clone() };
    let trace = recording::read(&trace_file)?;
    let out = arguments.out.clone().unwrap_or_else(|| trace_file.with_file_name("episode.rrd"));
    whole_file::check_file(&out)?;
    // A recording is replaced by a newer one, and nothing else is.
    if std::fs::read(&out).is_ok_and(|there| !there.starts_with(MAGIC)) {
        bail!("{}: exists, and is not a recording of the viewer: choose another --out", out.display());
    }
    let bytes = recording::viewer::recording(&trace)?;
    whole_file::write(&out, &bytes, whole_file::Existing::Replace)
        .with_context(|| format!("cannot write {}", out.display()))?;
    program::say!(
        "written to {}: open it with the viewer of Rerun 0.36.3 (pip install rerun-sdk==0.36.3)",
        out.display()
    );
    Ok(())
}
