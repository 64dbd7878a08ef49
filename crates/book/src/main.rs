//! `cargo xtask docs`: the book and the API docs in one folder.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result, bail};
use book::{Page, Taken, build, check, copy_folder, outdated, pages};
use clap::Parser;
use whole_file::Existing;

/// Builds the book and the API docs into one folder.
#[derive(Debug, Parser)]
#[command(name = "docs", version, after_help = "Examples:\n  cargo xtask docs --no-api")]
struct Arguments {
    /// Folder of the documentation [default: target/docs].
    #[arg(long)]
    out: Option<PathBuf>,
    /// Leaves out the API docs, which take a minute or more.
    #[arg(long)]
    no_api: bool,
    /// Instead of building, writes the pages of docs/src that are made from the code.
    #[arg(long, conflicts_with_all = ["out", "no_api", "check"])]
    write: bool,
    /// Instead of building, says which of those pages are out of date.
    #[arg(long, conflicts_with_all = ["out", "no_api"])]
    check: bool,
    #[command(flatten)]
    project: program::Project,
}

/// Crates that are nobody's library.
const NO_LIBRARY: [&str; 3] = ["end-to-end", "fuzzing", "xtask"];

fn main() -> ExitCode {
    match run(&program::parse()) {
        Ok(code) => code,
        Err(error) => {
            program::complain(&error);
            let bad_input = error.is::<Taken>() || error.is::<scenario::Error>() || program::is_denied(&error);
            if bad_input { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    let root = scenario::project_root(arguments.project.root.as_deref())?;
    if arguments.write || arguments.check {
        return made_pages(&root, arguments.write);
    }
    let out = arguments.out.clone().unwrap_or_else(|| root.join("target/docs"));
    check(&out)?;
    program::say!("the book");
    build(&root, &out)?;
    if !arguments.no_api {
        program::say!("the API docs");
        copy_folder(&api(&root)?, &out.join("api"))?;
    }
    program::out!("{}", out.join("index.html").display());
    Ok(ExitCode::SUCCESS)
}

/// Writes the pages that are made from the code, or says which are out of date.
fn made_pages(root: &Path, write: bool) -> Result<ExitCode> {
    let pages = pages(root, &menu(root)?)?;
    let old: Vec<&Page> = outdated(root, &pages);
    for page in &old {
        let path = root.join(&page.path);
        if write {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
            }
            whole_file::write(&path, page.text.as_bytes(), Existing::Replace)?;
        }
        program::out!("{}", page.path.display());
    }
    if write || old.is_empty() {
        program::say!(
            "{} pages and pictures, {} of them {}",
            pages.len(),
            old.len(),
            if write { "written" } else { "out of date" }
        );
        return Ok(ExitCode::SUCCESS);
    }
    program::say!("out of date: `cargo xtask docs --write` writes them anew");
    Ok(ExitCode::FAILURE)
}

fn cargo(root: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    command
}

/// Says that whoever calls has built the programs, as `cargo xtask ci` does.
const BUILT: &str = "SURMISE_BUILT";

/// What the programs say of themselves. They are built first: their help is what the page of commands shows.
fn menu(root: &Path) -> Result<String> {
    if std::env::var_os(BUILT).is_none() {
        let built = cargo(root).args(["build", "--release", "--quiet", "--workspace", "--bins"]).status();
        if !built.context("cannot run cargo")?.success() {
            bail!("the programs do not build");
        }
    }
    let xtask = beside("xtask")?.with_extension(std::env::consts::EXE_EXTENSION);
    let output =
        Command::new(&xtask).arg("describe").output().with_context(|| format!("cannot run {}", xtask.display()))?;
    if !output.status.success() {
        bail!("{}: {}", xtask.display(), String::from_utf8_lossy(&output.stderr));
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// A file or folder beside this program.
fn beside(name: &str) -> Result<PathBuf> {
    Ok(std::env::current_exe().context("where this program lies")?.with_file_name(name))
}

/// Makes the API docs; their folder.
fn api(root: &Path) -> Result<PathBuf> {
    // With the profile of the programs, whose dependencies are checked already where lints were run.
    let mut doc = cargo(root);
    doc.args(["doc", "--no-deps", "--release", "--workspace", "--lib", "--quiet"]);
    doc.args(NO_LIBRARY.iter().flat_map(|name| ["--exclude", name]));
    if !doc.status().context("cannot run cargo")?.success() {
        bail!("the API docs do not build");
    }
    // target/release/docs → target/doc
    let target = beside("")?;
    let target = target.ancestors().nth(1).map(|target| target.join("doc"));
    target.filter(|doc| doc.is_dir()).context("cannot find what cargo doc has written")
}
