//! The Python package against the program, with the extension as the workspace builds it. A wheel is built with fewer features, so that it would compile
//! the engine once more: `crates/python/check.sh` does that.

use std::path::{Path, PathBuf};
use std::process::Command;

use end_to_end::{program, root, skipped, stderr};

/// What the tests of the package need beside it.
const PACKAGES: [&str; 3] = ["numpy", "pandas", "polars"];

#[test]
fn the_python_package_answers_as_the_program_does_and_its_notebook_runs() {
    let diagnose = PathBuf::from(program("diagnose").get_program());
    let release = diagnose.parent().unwrap();
    // target/release → target/python
    let folder = release.with_file_name("python");
    let python = match environment(&folder.join("environment")) {
        Ok(python) => python,
        Err(reason) => return skipped(&reason),
    };
    let packages = folder.join("packages");
    assemble(release, &packages);
    let mut tests = Command::new(python);
    tests.current_dir(root()).args(["-m", "unittest", "discover", "--start-directory", "crates/python/tests"]);
    tests.env("PYTHONPATH", &packages).env("PYTHONDONTWRITEBYTECODE", "1").env("SURMISE_DIAGNOSE", &diagnose);
    let output = tests.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(!stderr(&output).contains("skipped"), "everything is there: {}", stderr(&output));
}

/// The interpreter of a virtual environment with the packages, made if need be; why there is none.
fn environment(folder: &Path) -> Result<PathBuf, String> {
    let python = folder.join("bin/python");
    let run = |program: &Path, arguments: &[&str]| -> Result<(), String> {
        let output = Command::new(program).args(arguments).output().map_err(|error| error.to_string())?;
        let last = stderr(&output).trim().lines().last().unwrap_or_default().to_string();
        if output.status.success() { Ok(()) } else { Err(last) }
    };
    let import = format!("import {}", PACKAGES.join(", "));
    if run(&python, &["-c", &import]).is_ok() {
        return Ok(python);
    }
    let system = Path::new("python3");
    run(system, &["-c", "import sys; assert sys.version_info >= (3, 9), 'it is older than 3.9'"])
        .map_err(|reason| format!("there is no python3 of 3.9 or later: {reason}"))?;
    let path = folder.to_str().ok_or("the target folder is no text")?;
    run(system, &["-m", "venv", "--clear", path])
        .map_err(|reason| format!("python3 makes no virtual environment: {reason}"))?;
    let install = [&["-m", "pip", "install", "--quiet"][..], &PACKAGES].concat();
    run(&python, &install).map_err(|reason| format!("{} cannot be installed: {reason}", PACKAGES.join(", ")))?;
    Ok(python)
}

/// The package as a wheel would unpack it.
fn assemble(release: &Path, packages: &Path) {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut build = Command::new(cargo);
    // All of the workspace: with the features that its programs and tests were built with nothing is compiled twice.
    build.current_dir(root()).args(["build", "--release", "--quiet", "--workspace", "--lib"]);
    let output = build.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let package = packages.join("surmise");
    if packages.exists() {
        std::fs::remove_dir_all(packages).unwrap();
    }
    std::fs::create_dir_all(&package).unwrap();
    for file in std::fs::read_dir(root().join("crates/python/python/surmise")).unwrap() {
        let path = file.unwrap().path();
        if path.is_file() {
            std::fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    let name = format!("{}_surmise{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    std::fs::copy(release.join(name), package.join("_surmise.abi3.so")).unwrap();
}
