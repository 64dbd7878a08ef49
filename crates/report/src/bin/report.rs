//! `cargo xtask report`: a run or an episode as a page.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, anyhow};
use clap::Parser;
use experiments::Archive;
use page::may_be_replaced;
use report::{Error, Suite, episode_figure, episode_page, run_page, suite_page};

/// Makes a self-contained HTML page of a run of `eval`, of all tables of `eval --all`, or of an episode of `demo`.
#[derive(Debug, Parser)]
#[command(name = "report", version, after_help = EXAMPLES)]
struct Arguments {
    /// Folder of the run: runs/eval/…, runs/all, runs/demo/…, or published ones: assets/results, assets/results/table1-surmise-D4.
    run: PathBuf,
    /// The page [default: report.html in that folder].
    #[arg(long)]
    out: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  cargo xtask report runs/demo/D4-sawyer-surmise-mixture
  cargo xtask report runs/eval/D4-sawyer-surmise";

fn main() -> ExitCode {
    program::finish(run(&program::parse()))
}

fn run(arguments: &Arguments) -> Result<()> {
    let folder = &arguments.run;
    let out = arguments.out.clone().unwrap_or_else(|| folder.join("report.html"));
    // A folder that is not there is another complaint.
    if arguments.out.is_some() {
        whole_file::check_file(&out)?;
    }
    if !may_be_replaced(&out) {
        return Err(anyhow!("{}: exists, and is not a page of this program: choose another --out", out.display()));
    }
    let page = if folder.join("trace.json").is_file() {
        let trace = recording::read(&folder.join("trace.json"))?;
        episode_page(&trace, &episode_figure(&trace).svg()?)
    } else if folder.join("run.json").is_file() {
        run_page(&Archive::read(folder)?)?
    } else {
        let suite = Suite::read(folder)?;
        if suite.is_empty() {
            return Err(Error::NoRun { path: folder.clone() }.into());
        }
        suite_page(&suite)
    };
    whole_file::write(&out, page.as_bytes(), whole_file::Existing::Replace).map_err(program::failed)?;
    program::say!("written to {}: open it in a browser", program::typed(&out));
    Ok(())
}
