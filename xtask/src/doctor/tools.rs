//! Programs of others: the toolchain, which everything needs, and what some commands can use.

use std::path::Path;

use super::probe::{ask, at_least, version};
use super::{Check, State};

/// Rust and C.
pub(crate) fn toolchain() -> Vec<Check> {
    let needed = env!("CARGO_PKG_RUST_VERSION");
    let rustc = ask("rustc", &["--version"]).and_then(|text| match version(&text) {
        Some(found) if at_least(found, needed) => Ok(format!("{found}, needs {needed}")),
        Some(found) => Err((State::Broken, format!("{found} is older than {needed}"))),
        None => Err((State::Broken, text)),
    });
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let of = |text: String| version(&text).map_or_else(|| text.clone(), String::from);
    let ci = "cargo xtask ci";
    vec![
        Check::new("rustc", rustc, "everything", "rustup update stable (https://rustup.rs)").required(),
        Check::new("cargo", ask(&cargo, &["--version"]).map(of), "everything", "https://rustup.rs").required(),
        Check::new(
            "C compiler",
            c_compiler(),
            "linking, and the C parts of zstd and blake3",
            "apt install gcc libc6-dev, or set CC",
        )
        .required(),
        Check::new("rustfmt", ask(&cargo, &["fmt", "--version"]).map(of), ci, "rustup component add rustfmt"),
        Check::new("clippy", ask(&cargo, &["clippy", "--version"]).map(of), ci, "rustup component add clippy"),
        Check::new("git", ask("git", &["--version"]).map(of), "the commit in results", "apt install git"),
    ]
}

/// Compiles a program: a compiler without the headers of the C library is of no use.
fn c_compiler() -> Result<String, (State, String)> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let version = ask(&compiler, &["--version"])?;
    let stem = std::env::temp_dir().join(format!("surmise-doctor-{}", std::process::id()));
    let (source, program) = (stem.with_extension("c"), stem.with_extension("out"));
    let written = std::fs::write(&source, "#include <stdlib.h>\nint main(void) { return EXIT_SUCCESS; }\n");
    written.map_err(|error| (State::Broken, format!("{}: {error}", source.display())))?;
    let compiled = ask(&compiler, &[&source.display().to_string(), "-o", &program.display().to_string()]);
    for file in [source, program] {
        // What was not made cannot be removed.
        let _ = std::fs::remove_file(file);
    }
    compiled.map(|_| version.lines().next().unwrap_or_default().to_string())
}

/// What some commands can use.
pub(crate) fn optional(root: &Path, python: &str) -> Vec<Check> {
    let modules = format!("{python} -m pip install mujoco numpy");
    vec![
        Check::new(
            "python modules",
            modules_of(python),
            "MuJoCo as the world (eval --all --python), peers of bench",
            modules,
        ),
        Check::new(
            "Slurm",
            slurm(),
            "--executor slurm",
            "on a cluster: docs/src/guides/cluster.md; for a try on one machine: tests/slurm/install.sh",
        ),
        Check::new(
            "HyperQueue",
            hyper_queue(),
            "--executor hq",
            "https://github.com/It4innovations/hyperqueue/releases, then hq server start: docs/src/guides/cluster.md",
        ),
        Check::new("Chromium", chromium(), "looking at the pages of reports without a screen", "apt install chromium"),
        rerun(root),
    ]
}

/// Tells of each module its version, or why it cannot be used.
const MODULES: &str = "
import importlib
import platform
print('python', platform.python_version())
for name in ('mujoco', 'numpy'):
    try:
        print(name, importlib.import_module(name).__version__)
    except ModuleNotFoundError:
        print('missing', name)
    except Exception as error:
        print('broken', name, error)
";

fn modules_of(python: &str) -> Result<String, (State, String)> {
    let text = ask(python, &["-c", MODULES])?;
    let lines: Vec<&str> = text.lines().collect();
    let found = lines.join(", ");
    if lines.iter().any(|line| line.starts_with("broken")) {
        Err((State::Broken, found))
    } else if lines.iter().any(|line| line.starts_with("missing")) {
        Err((State::Missing, found))
    } else {
        Ok(found)
    }
}

/// All three commands, and a controller that answers.
fn slurm() -> Result<String, (State, String)> {
    let absent: Vec<&str> = ["sbatch", "srun", "squeue"].into_iter().filter(|program| !in_path(program)).collect();
    match absent.as_slice() {
        [] => {
            ask("squeue", &["--noheader", "--name", "surmise-none"])?;
            ask("sbatch", &["--version"])
        }
        absent => Err((State::Missing, format!("no {} in PATH", absent.join(", ")))),
    }
}

fn hyper_queue() -> Result<String, (State, String)> {
    let found = ask("hq", &["--version"])?;
    ask("hq", &["server", "info"]).map(|_| found)
}

fn chromium() -> Result<String, (State, String)> {
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];
    match names.into_iter().find(|name| in_path(name)) {
        Some(name) => ask(name, &["--version"]),
        None => Err((State::Missing, "no chromium or google-chrome in PATH".into())),
    }
}

/// A recording opens in a viewer of its own minor version alone: the one of the library in Cargo.lock, if there is one.
fn rerun(root: &Path) -> Check {
    let lock = std::fs::read_to_string(root.join("Cargo.lock")).unwrap_or_default();
    // All crates of rerun have one version; which of them are linked is up to the program that writes recordings.
    let library = ["rerun", "re_sdk", "re_log_encoding", "re_chunk"].iter().find_map(|package| locked(&lock, package));
    let found = ask("rerun", &["--version"]).and_then(|text| {
        let minor = |version: &str| version.splitn(3, '.').take(2).map(String::from).collect::<Vec<_>>();
        match (version(&text), library) {
            (Some(viewer), Some(library)) if minor(viewer) != minor(library) => {
                Err((State::Broken, format!("{viewer}, recordings are of {library}")))
            }
            (Some(viewer), _) => Ok(viewer.into()),
            (None, _) => Err((State::Broken, text)),
        }
    });
    let remedy = match library {
        Some(library) => {
            format!("cargo install rerun-cli --locked --version {library}, or pip install rerun-sdk=={library}")
        }
        None => "cargo install rerun-cli --locked, or pip install rerun-sdk".into(),
    };
    Check::new("rerun viewer", found, "looking at recordings", remedy)
}

/// Version of a package in a lock file.
fn locked<'a>(lock: &'a str, package: &str) -> Option<&'a str> {
    let (_, after) = lock.split_once(&format!("name = \"{package}\"\nversion = \""))?;
    after.split('"').next()
}

fn in_path(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_a_locked_package_is_found() {
        let lock = "[[package]]\nname = \"other\"\nversion = \"1.0.0\"\n\n[[package]]\nname = \"rerun\"\nversion = \"0.27.2\"\n";
        assert_eq!(locked(lock, "rerun"), Some("0.27.2"));
        assert_eq!(locked(lock, "re_sdk"), None);
    }

    #[test]
    fn a_compiler_that_compiles_is_good() {
        assert!(c_compiler().is_ok());
    }
}
