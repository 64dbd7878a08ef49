//! A mapping from what a source holds, with guesses and gaps marked.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::columns::{Columns, guess};
use crate::error::{excerpt, open};
use crate::import::Source;
use crate::mapping::FILL;
use crate::survey::{Survey, Topic};
use crate::table::{Csv, is_parquet};
use crate::{Error, bag, lerobot, mcap_file, parquet_file};

/// Lines of comments that list what was found at most.
const LISTED: usize = 200;

/// A mapping in TOML for the first of `sources`: what it holds, what each thing may be, and `# FILL` where nobody but the owner knows.
///
/// # Errors
///
/// [`Error`] where the source cannot be read.
pub fn draft(kind: Source, sources: &[PathBuf]) -> Result<String, Error> {
    let path = sources.first().cloned().unwrap_or_default();
    match kind {
        Source::Table => table(&path),
        Source::Lerobot => {
            let info = lerobot::info(&path)?;
            let mut names = Vec::new();
            for file in lerobot::files(&path)?.iter().take(1) {
                for (name, _) in parquet_file::columns(file, open(file)?)? {
                    match info.elements.get(&name).filter(|elements| !elements.is_empty()) {
                        Some(elements) => names.extend(elements.iter().map(|element| format!("{name}[{element}]"))),
                        None => names.push(name),
                    }
                }
            }
            Ok(columns_text(&path, &guess(&names), info.fps.map(|fps| 1.0 / fps), &names))
        }
        Source::Mcap | Source::Ros2 => {
            let mut survey = Survey::default();
            match kind {
                Source::Mcap => mcap_file::read(&path, &mut survey)?,
                _ => bag::read(&path, &mut survey)?,
            }
            Ok(topics_text(&path, &survey))
        }
    }
}

fn table(path: &Path) -> Result<String, Error> {
    let file = open(path)?;
    if is_parquet(&file, path)? {
        let names: Vec<String> = parquet_file::columns(path, file)?.into_iter().map(|(name, _)| name).collect();
        return Ok(columns_text(path, &guess(&names), None, &names));
    }
    let mut csv = Csv::open(path, file, None)?;
    let names = csv.names.clone();
    let columns = guess(&names);
    let mut times = Vec::new();
    if let Some((name, _)) = &columns.time
        && let Some(column) = names.iter().position(|other| other == name)
    {
        while times.len() < 200 && csv.next()? {
            let cell = String::from_utf8_lossy(csv.record.get(column).unwrap_or_default()).replace(',', ".");
            times.extend(cell.parse::<f64>().ok().filter(|time| time.is_finite()));
        }
    }
    let unit = columns.time.as_ref().map_or(1.0, |(_, unit)| seconds(unit));
    let mut text = columns_text(path, &columns, median_step(&times).map(|step| step * unit), &names);
    if csv.separator == b';' {
        text.push_str(
            "\n[table]\nseparator = \";\"\ndecimal = \".\"                 # GUESS: \",\" for a decimal comma\n",
        );
    }
    Ok(text)
}

fn seconds(unit: &str) -> f64 {
    crate::units::Dimension::Time.factor(Some(unit)).unwrap_or(1.0)
}

/// The middle one of the positive steps.
pub(crate) fn median_step(times: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    // Ten digits: what rounding of times leaves.
    steps.get(steps.len() / 2).and_then(|step| format!("{step:.9}").parse().ok()).filter(|step| *step > 0.0)
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

fn head(path: &Path) -> String {
    let name = whole_file::one_line(&path.file_name().unwrap_or_default().to_string_lossy(), 200);
    format!("# Drafted from {name}. GUESS marks what was guessed, FILL what you alone know.\nversion = 1\n")
}

/// The header of the log.
fn log_text(text: &mut String, robot: &str, period_secs: Option<f64>) {
    let (period, mark) = match period_secs {
        Some(period) => (period, "# GUESS: the usual step of the source"),
        None => (0.02, "# FILL"),
    };
    let _ = writeln!(
        text,
        "\n[log]\n\
         robot = \"{robot}\"                  {FILL}: sawyer, jaco, or none for a free object and a ball as tool\n\
         period_secs = {period:?}           {mark}\n\
         tool_radius_m = 0.02            {FILL}: of the ball that pushes\n\
         gravity_mps2 = 9.81\n\n\
         [log.table]\n\
         height_m = 0.0                  {FILL}\n\
         friction = {{ mean = 0.4, stddev = 0.2 }}  {FILL}: of object and table\n\n\
         [log.object]\n\
         shape = \"box\"                   {FILL}: box, cylinder, sphere, prism\n\
         size_m = [0.08, 0.06, 0.05]     {FILL}\n\
         mass_kg = {{ mean = 0.5, stddev = 0.25 }}  {FILL}\n\
         com_m = [0.0, 0.0, 0.0]\n\n\
         [log.split]\n\
         holdout_fraction = 0.3"
    );
}

fn columns_text(path: &Path, columns: &Columns, period_secs: Option<f64>, names: &[String]) -> String {
    let mut text = head(path);
    match &columns.time {
        Some((name, unit)) => {
            let mark = if columns.time_is_sure { "" } else { "  # GUESS" };
            let _ = writeln!(text, "clock = {{ stamp = {}, unit = \"{unit}\" }}{mark}", quoted(name));
        }
        None => {
            let _ = writeln!(text, "clock = {{ stamp = \"\", unit = \"s\" }}  {FILL}: the column with the time");
        }
    }
    match &columns.episode {
        Some(name) => {
            let _ = writeln!(text, "episodes = {{ change = {{ value = {} }} }}", quoted(name));
        }
        None => text.push_str("episodes = \"source\"             # GUESS: each file is one; or change, gap, still\n"),
    }
    log_text(&mut text, columns.robot(), period_secs);
    for section in columns.sections() {
        let _ = write!(text, "\n{section}");
    }
    comments(&mut text, "Columns that are not used", &columns.unused(names));
    text
}

fn comments(text: &mut String, title: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n# {title}:");
    for line in lines.iter().take(LISTED) {
        let _ = writeln!(text, "#   {}", whole_file::one_line(line, 300));
    }
    if lines.len() > LISTED {
        let _ = writeln!(text, "#   and {} more", lines.len() - LISTED);
    }
}

fn topics_text(path: &Path, survey: &Survey) -> String {
    let mut text = head(path);
    let chosen = survey.chosen();
    let stamped = !chosen.is_empty() && chosen.iter().all(|found| survey.topics[&found.topic].stamped(&found.at));
    let clock = if stamped { "header" } else { "log" };
    let _ = writeln!(text, "clock = {{ stamp = \"{clock}\" }}       # GUESS: header, log, publish, or a path");
    match survey.episode() {
        Some((topic, field)) => {
            let (topic, field) = (quoted(topic), quoted(&field));
            let _ = writeln!(
                text,
                "episodes = {{ change = {{ topic = {topic}, value = {field}, stamp = \"log\" }} }}  # GUESS"
            );
        }
        None => text.push_str("episodes = \"source\"             # GUESS: each file is one; or change, gap, still\n"),
    }
    let period = chosen.iter().filter_map(|found| survey.topics[&found.topic].step_secs()).reduce(f64::min);
    log_text(&mut text, "none", period);
    text.push_str("\n[grid]\nsample = \"linear\"               # GUESS: or hold, nearest\n");
    for found in &chosen {
        let _ = write!(text, "\n{}", found.section(survey.topics[&found.topic].stamped(&found.at) != stamped));
    }
    if !chosen.iter().any(|found| found.role == "object") {
        let _ = write!(
            text,
            "\n# [object]                       {FILL}: no topic looks like the pose of the object\n\
             # topic = \"\"\n# position = \"pose.position\"\n# orientation = \"pose.orientation\"\n"
        );
    }
    let line = |(name, topic): (&String, &Topic)| {
        let problem = topic.problem.as_ref().map_or_else(String::new, |problem| format!(", not decoded: {problem}"));
        format!("{} ({}{problem}) {}", excerpt(name), topic.kind, topic.fields().join(", "))
    };
    comments(&mut text, "What the source holds", &survey.topics.iter().map(line).collect::<Vec<_>>());
    text
}
