//! Logs of an arm's joints, without an object.

use std::path::{Path, PathBuf};
use std::time::Instant;

use arm_diagnosis::{Diagnosis, Log, Report, Settings, diagnose, model_toml, model_urdf, page};
use discrepancy::Error;
use discrepancy::answer::{Place, check_place, owner};
use program::typed;
use whole_file::Existing;

use crate::folder;

/// What is written, the report last: with it all is there.
const FILES: [&str; 4] = ["model.urdf", "model.toml", "report.html", "report.json"];

/// Diagnoses the log in `measured`.
#[expect(clippy::disallowed_methods, reason = "the report says how long it took; nothing depends on it")]
pub(crate) fn run(measured: &Path, out: Option<&PathBuf>, seed: u64, json: bool) -> Result<(), Error> {
    let started = Instant::now();
    let log = Log::read(measured)?;
    let owner = owner(measured);
    let out = out.cloned().unwrap_or_else(|| folder::default(Path::new("runs/diagnose"), measured, &owner, &FILES));
    check_place(&out, &owner)?;
    let unfit = || Error::Unfit {
        log: measured.display().to_string(),
        reason: "expected at least 4 s in which joints move".into(),
    };
    let diagnosis = diagnose(&log, &Settings { seed, ..Settings::default() }).ok_or_else(unfit)?;
    let report = Report::new(&log, &diagnosis, seed, started.elapsed().as_secs_f64());
    let text = report.json().map_err(|error| Error::Model { reason: error.to_string() })?;
    let name = measured.display().to_string();
    let files = files(&log, measured, &diagnosis, &page(&name, &report), &text)?;
    let _place = Place::make(&out, &owner)?;
    if files.iter().all(|(file, _)| *file != FILES[0]) {
        // One of an earlier answer would pass for this one's.
        drop(std::fs::remove_file(out.join(FILES[0])));
    }
    for (file, text) in files {
        whole_file::write(&out.join(file), text.as_bytes(), Existing::Replace)?;
    }
    if json {
        program::show(&text);
        return Ok(());
    }
    for line in report.lines() {
        program::out!("{line}");
    }
    program::out!("{:.0} s", report.seconds);
    program::say!("open {} in a browser: where, what, how sure", typed(&out.join("report.html")));
    Ok(())
}

fn files<'a>(
    log: &Log,
    measured: &Path,
    diagnosis: &Diagnosis,
    page: &'a str,
    report: &'a str,
) -> Result<Vec<(&'static str, String)>, Error> {
    let model = model_toml(log, diagnosis).map_err(|error| Error::Model { reason: error.to_string() })?;
    let urdf = model_urdf(log, measured, diagnosis);
    let texts = [urdf, Some(model), Some(page.to_owned()), Some(report.to_owned())];
    Ok(FILES.into_iter().zip(texts).filter_map(|(file, text)| Some((file, text?))).collect())
}
