//! Disk, permissions, cores, memory.

use std::path::{Path, PathBuf};

use super::probe::ask;
use super::{Check, State};

/// Free space, GB, for a first build of the release programs, and for one over an earlier build.
const FIRST_BUILD_GB: f64 = 6.0;
const NEXT_BUILD_GB: f64 = 1.0;
/// Free space, GB, for results: the largest shipped dataset and all runs of `eval --all` stay below it.
const RUNS_GB: f64 = 1.0;
/// Memory, GB, below which compilers that run side by side may be killed.
const MEMORY_GB: f64 = 4.0;

const GB: f64 = 1e9;

pub(crate) fn checks(root: &Path) -> Vec<Check> {
    let target = crate::built::folder();
    let built = crate::built::path("eval").is_file();
    let build_gb = if built { NEXT_BUILD_GB } else { FIRST_BUILD_GB };
    let runs = root.join("runs");
    let mut checks = vec![
        Check::new(
            "disk for the build",
            free(&target, build_gb),
            "compiled programs",
            format!("free {build_gb} GB there, or set CARGO_TARGET_DIR to a folder that has them"),
        )
        .required(),
        Check::new(
            "disk for runs",
            free(&runs, RUNS_GB),
            "datasets, priors, records",
            format!("free {RUNS_GB} GB there, or make runs/ a link to a folder that has them"),
        )
        .required(),
    ];
    for (name, folder, needed_for) in
        [("writing the build", &target, "compiled programs"), ("writing runs", &runs, "results without --out")]
    {
        let remedy = "change the owner or the permissions of the folder";
        checks.push(Check::new(name, writable(folder), needed_for, remedy).required());
    }
    let cores = std::thread::available_parallelism().map(|cores| cores.to_string());
    let cores = cores.map_err(|error| (State::Broken, error.to_string()));
    checks.push(Check::new(
        "cores",
        cores,
        "speed alone: results are the same on any number",
        "--threads N where they are not seen",
    ));
    checks.push(Check::new("memory", memory(), "compiling", "build with CARGO_BUILD_JOBS=1, or add swap space"));
    checks
}

/// The nearest folder at or above `path` that exists.
fn existing(path: &Path) -> PathBuf {
    path.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("/")).to_path_buf()
}

fn free(path: &Path, needed_gb: f64) -> Result<String, (State, String)> {
    let folder = existing(path);
    let text = ask("df", &["-Pk", &folder.display().to_string()])?;
    let Some(free_gb) = available(&text) else { return Err((State::Broken, format!("df says: {text}"))) };
    let found = format!("{free_gb:.0} GB in {}", folder.display());
    if free_gb >= needed_gb {
        Ok(found)
    } else {
        Err((State::Missing, format!("{free_gb:.1} GB in {}", folder.display())))
    }
}

/// Available space, GB, of what POSIX `df -Pk` prints: the fourth column of its second line.
fn available(text: &str) -> Option<f64> {
    let kibibytes: f64 = text.lines().nth(1)?.split_whitespace().nth(3)?.parse().ok()?;
    Some(kibibytes * 1024.0 / GB)
}

fn writable(path: &Path) -> Result<String, (State, String)> {
    let folder = existing(path);
    // Permissions do not tell what a read-only disk or a quota forbids: writing does.
    let probe = folder.join(format!(".surmise-doctor-{}", std::process::id()));
    let tried = std::fs::write(&probe, b"probe").and_then(|()| std::fs::remove_file(&probe));
    match tried {
        Ok(()) => Ok(folder.display().to_string()),
        Err(error) => Err((State::Broken, format!("{}: {error}", folder.display()))),
    }
}

/// Memory of the machine; of other systems than Linux nothing is known without a further library.
fn memory() -> Result<String, (State, String)> {
    let Ok(text) = std::fs::read_to_string("/proc/meminfo") else { return Ok("unknown".into()) };
    let kibibytes = |key: &str| -> Option<f64> {
        text.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
    };
    let (Some(total), Some(free)) = (kibibytes("MemTotal:"), kibibytes("MemAvailable:")) else {
        return Ok("unknown".into());
    };
    let [total, free] = [total, free].map(|kibibytes| kibibytes * 1024.0 / GB);
    let found = format!("{total:.1} GB, {free:.1} free");
    if total >= MEMORY_GB { Ok(found) } else { Err((State::Missing, found)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_free_space_of_df_is_read() {
        let text = "Filesystem 1024-blocks Used Available Capacity Mounted on\n/dev/sda1 100 60 2000000 60% /";
        assert_eq!(available(text), Some(2.048));
        assert_eq!(available("nonsense"), None);
    }

    #[test]
    fn a_folder_that_does_not_exist_counts_as_the_one_above_it() {
        let folder = std::env::temp_dir();
        assert_eq!(existing(&folder.join("surmise-none/deeper")), folder);
        assert!(writable(&folder.join("surmise-none")).is_ok());
    }
}
