//! How often `log check` sees what is wrong with a log, and how often it accuses a good one.
//!
//! Every good log is spoilt in every way that it can be, one at a time. A fault *can be seen* in a log if the rules of rest, contact and force, at the readings that the
//! log was spoilt from, tell it from the good log by a margin: a cube's exchanged lengths cannot, nor the sign of a force that was not measured.

mod spoil;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use log_check::{Check, Kind, Reading, check};
use measured_log::{Channel, Format, Log, Notes};
use rayon::prelude::*;
use serde::Serialize;
use statistics::wilson95;

use spoil::{away, change, clip, glitch, has_part, jitter, turn_one};

/// A way to spoil a log.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// Its numbers stand for something else: what the reading makes of them.
    Meant(Reading, Kind),
    /// All forces and torques read 0.
    DeadSensor,
    /// One force is 1000 N.
    Glitch,
    /// The largest 3 % of forces are cut off.
    Clipped,
    /// One axis of the forces reads 0.
    DeadAxis,
    /// The object is 0.2 m away in three rows.
    Away,
    /// The tracker's frame is turned by 90° in one episode.
    OneTurned,
    /// Times of arrival: up to a third of a period late.
    Jitter,
    /// Times too long by [`STRETCH`].
    Stretched,
    /// An episode twice.
    Repeated,
    /// Gravity in multiples of g.
    GravityInG,
}

/// All, with the names of the table.
fn faults() -> Vec<(&'static str, Fault)> {
    use Fault::Meant;
    let geometry = |reading| Meant(reading, Kind::Geometry);
    let wrench = |axes| Meant(Reading::Wrench(axes), Kind::WrenchAxes);
    vec![
        ("quaternion as its conjugate", geometry(Reading::Conjugate)),
        ("quaternion as w, x, y, z", geometry(Reading::RealLast)),
        ("tracker's frame turned by 90°", geometry(Reading::TrackerTurned(1))),
        ("tracker's frame turned by 180°", geometry(Reading::TrackerTurned(2))),
        ("object's axes turned by 90°", geometry(Reading::BodyTurned(1))),
        ("y of the tracker's frame mirrored", geometry(Reading::Mirrored(1))),
        ("sign of object_y_m", geometry(Reading::PositionMirrored(1))),
        ("object_x_m and object_y_m exchanged", geometry(Reading::PositionSwapped)),
        ("object's positions in cm", geometry(Reading::PositionScaled(100.0))),
        ("object's positions in mm", geometry(Reading::PositionScaled(1000.0))),
        ("two lengths exchanged", geometry(Reading::LengthsSwapped(0, 1))),
        ("half lengths for lengths", geometry(Reading::LengthsScaled(0.5))),
        ("diameter for the cylinder's radius", geometry(Reading::RadiusScaled(2.0))),
        ("diameter for the tool's radius", geometry(Reading::ToolRadiusScaled(2.0))),
        ("pose of the lower face", Meant(Reading::OriginAt(1.0), Kind::Height)),
        ("wrench reversed", wrench([(0, -1), (1, -1), (2, -1)])),
        ("wrench in a hand's axes, z down", wrench([(0, 1), (1, -1), (2, -1)])),
        ("wrench turned by 90° about z", wrench([(1, -1), (0, 1), (2, 1)])),
        ("forces in kilograms-force", Meant(Reading::ForceScaled(1.0 / 9.81), Kind::ForceUnit)),
        ("forces in millinewtons", Meant(Reading::ForceScaled(1000.0), Kind::ForceUnit)),
        ("torques about the wrist, 0.12 m above", Meant(Reading::TorqueAbout([0.0, 0.0, 0.12]), Kind::TorquePoint)),
        ("added mass in grams", Meant(Reading::AddedMassScaled(1000.0), Kind::AddedMass)),
        ("dead force sensor", Fault::DeadSensor),
        ("one force of 1000 N", Fault::Glitch),
        ("the largest 3 % of forces cut off", Fault::Clipped),
        ("dead axis of forces", Fault::DeadAxis),
        ("object 0.2 m away in three rows", Fault::Away),
        ("tracker's frame turned in one episode", Fault::OneTurned),
        ("times of arrival", Fault::Jitter),
        ("times 1 % long", Fault::Stretched),
        ("an episode twice", Fault::Repeated),
        ("gravity in multiples of g", Fault::GravityInG),
    ]
}

/// What was found of a fault.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// The fault.
    pub fault: String,
    /// Logs that were spoilt so.
    pub logs: usize,
    /// Logs in which it can be seen.
    pub visible: usize,
    /// Of these: in which the kind was suspected.
    pub caught: usize,
    /// Of these: in which the first reading that was named mends it.
    pub mended: usize,
}

/// The table.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Version of the project.
    pub version: &'static str,
    /// Its commit.
    pub commit: String,
    /// The logs: last two parts of their folders.
    pub logs: Vec<String>,
    /// A row a fault.
    pub rows: Vec<Row>,
    /// Good logs that were accused, and of what.
    pub accused: Vec<(String, Vec<Kind>)>,
}

/// Spoils every log in every way, and checks it.
///
/// # Errors
///
/// A folder that holds no log, or one of an arm.
pub fn run(folders: &[PathBuf], commit: String) -> Result<Table> {
    let logs = read(folders)?;
    let good: Vec<Check> = logs.par_iter().map(|(_, log)| check(log, None)).collect();
    let accused =
        logs.iter().zip(&good).filter(|(_, check)| !check.suspicions.is_empty()).map(|((folder, _), check)| {
            (name(folder), check.suspicions.iter().map(|suspicion| suspicion.kind).collect())
        });
    let rows = faults().into_iter().map(|(name, fault)| {
        let tried: Vec<Option<[bool; 3]>> =
            logs.par_iter().zip(&good).map(|((_, log), good)| one(&fault, log, good)).collect();
        let count = |index: usize| tried.iter().flatten().filter(|found| found[index]).count();
        Row {
            fault: name.into(),
            logs: tried.iter().flatten().count(),
            visible: count(0),
            caught: count(1),
            mended: count(2),
        }
    });
    Ok(Table {
        version: env!("CARGO_PKG_VERSION"),
        commit,
        rows: rows.collect(),
        accused: accused.collect(),
        logs: folders.iter().map(|folder| name(folder)).collect(),
    })
}

fn read(folders: &[PathBuf]) -> Result<Vec<(PathBuf, Log)>> {
    let one = |folder: &PathBuf| -> Result<(PathBuf, Log)> {
        let log = measured_log::read(folder)?;
        let arm = log.header.robot != measured_log::Robot::None;
        anyhow::ensure!(!arm, "{}: expected a log with robot = \"none\"", folder.display());
        Ok((folder.clone(), log))
    };
    folders.iter().map(one).collect()
}

/// Writes every log, spoilt in every way that it can be, into `out`: folders named after the log and the fault. How many.
///
/// # Errors
///
/// As [`run`], and a folder that is there or cannot be written.
pub fn write(folders: &[PathBuf], out: &Path) -> Result<usize> {
    whole_file::check_folder(out)?;
    if std::fs::read_dir(out).is_ok_and(|mut inside| inside.next().is_some()) {
        bail!("{}: expected a new folder for the spoilt logs, found one that holds something", out.display());
    }
    let mut count = 0;
    for (folder, log) in read(folders)? {
        let name = name(&folder).replace(['/', '\\'], "-");
        for (fault, spoilt) in faults() {
            let Some((spoilt, _)) = spoil(&spoilt, &log) else { continue };
            let words: Vec<&str> =
                fault.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
            let place = out.join(format!("{name}-{}", words.join("-")));
            let notes = Notes::from([("", format!("Spoilt: {fault}"))]);
            measured_log::write(&place, &spoilt, Format::Parquet, &notes)?;
            count += 1;
        }
    }
    Ok(count)
}

fn name(folder: &Path) -> String {
    let parts: Vec<_> = folder.iter().map(|part| part.to_string_lossy()).collect();
    parts[parts.len().saturating_sub(2)..].join("/")
}

/// Whether a fault can be seen in a log, is caught, and mended; `None` where the log cannot be spoilt so.
fn one(fault: &Fault, log: &Log, good: &Check) -> Option<[bool; 3]> {
    let (spoilt, kind) = spoil(fault, log)?;
    let found = check(&spoilt, None);
    let visible = visible(fault, log, good, &found);
    let suspicion = found.suspicions.iter().find(|suspicion| suspicion.kind == kind);
    let mended = suspicion.is_some_and(|suspicion| {
        suspicion.readings.first().is_some_and(|reading| near(&check(&reading.apply(&spoilt), None), good))
    });
    Some([visible, visible && suspicion.is_some(), visible && mended])
}

/// Whether a log keeps the rules as well as another.
fn near(mended: &Check, good: &Check) -> bool {
    let angle = |check: &Check| check.forces.map_or(1.0, |forces| forces.cosine);
    mended.fit.cost() < good.fit.cost() + SAME && angle(mended) > angle(good) - SAME
}

/// What rules may differ by in logs that are the same for them.
const SAME: f64 = 0.3;
/// What a fault has to change in the cost of poses, and in the cosine of forces, to be seen.
const SEEN: f64 = 1.0;
const SEEN_COSINE: f64 = 0.6;
/// By which share times are too long.
const STRETCH: f64 = 0.01;
/// Share of onsets at which a tool touches the object where it tells of one episode.
const MET: f64 = 0.8;

fn visible(fault: &Fault, log: &Log, good: &Check, spoilt: &Check) -> bool {
    let rises = spoilt.fit.cost() - good.fit.cost() >= SEEN;
    let forces = good.forces.filter(|forces| forces.cosine > SEEN_COSINE);
    match fault {
        Fault::Meant(Reading::Wrench(_), _) => {
            forces.is_some_and(|forces| spoilt.forces.is_some_and(|found| forces.cosine - found.cosine > SEEN_COSINE))
        }
        // What rolls needs any small force, so that a unit that makes forces smaller is not seen.
        Fault::Meant(Reading::ForceScaled(factor), _) => {
            forces.is_some_and(|forces| *factor > 1.0 || !good.may_roll && (0.5..2.0).contains(&forces.strength))
        }
        Fault::Meant(Reading::TorqueAbout(_), _) => forces.is_some() && has(spoilt, "wrist_tx_nm"),
        Fault::Meant(Reading::AddedMassScaled(_), _) => true,
        Fault::Meant(..) => rises,
        // Motion has to tell when it was, by more than its noise; it follows the unevenness that the good log has.
        Fault::Jitter => spoilt
            .followed
            .zip(good.clock.as_ref().zip(spoilt.clock.as_ref()))
            .is_some_and(|(followed, (own, all))| followed.tells((own.jitter_secs / all.jitter_secs).powi(2).min(1.0))),
        // The sensors' own rate has to be the header's, and to be known that well.
        Fault::Stretched => good.clock.as_ref().is_some_and(|clock| {
            clock.margin() < STRETCH && (clock.period_secs / log.header.period_secs - 1.0).abs() < STRETCH
        }),
        // The tool has to tell where the object is.
        Fault::OneTurned => good.fit.touch.is_some_and(|touch| touch.met > MET),
        Fault::DeadSensor
        | Fault::Glitch
        | Fault::Clipped
        | Fault::DeadAxis
        | Fault::Away
        | Fault::Repeated
        | Fault::GravityInG => true,
    }
}

fn has(check: &Check, column: &str) -> bool {
    check.sensors.iter().any(|sensor| sensor.column == column)
}

/// A spoilt log and what it has to be suspected of; `None` where it cannot be spoilt so, or is no valid log then.
fn spoil(fault: &Fault, log: &Log) -> Option<(Log, Kind)> {
    let mut spoilt = log.clone();
    let has = |channel: Channel| log.has(channel);
    let force = Channel::WristForce(measured_log::Axis::X);
    let kind = match fault {
        Fault::Meant(reading, kind) => {
            has_part(log, reading).then_some(())?;
            spoilt = reading.apply(log);
            *kind
        }
        Fault::DeadSensor => {
            has(force).then_some(())?;
            change(&mut spoilt, |channel, _, value| {
                if matches!(channel, Channel::WristForce(_) | Channel::WristTorque(_)) { 0.0 } else { value }
            });
            Kind::DeadSensor
        }
        Fault::Glitch => {
            has(force).then_some(())?;
            glitch(&mut spoilt)?;
            Kind::Outliers
        }
        Fault::Clipped => {
            has(force).then_some(())?;
            clip(&mut spoilt)?;
            Kind::Clipped
        }
        Fault::DeadAxis => {
            has(force).then_some(())?;
            let axis = Channel::WristForce(measured_log::Axis::Y);
            change(&mut spoilt, |channel, _, value| if channel == axis { 0.0 } else { value });
            Kind::DeadSensor
        }
        Fault::Away => {
            away(&mut spoilt)?;
            Kind::Outliers
        }
        Fault::OneTurned => {
            turn_one(&mut spoilt)?;
            Kind::Geometry
        }
        Fault::Jitter => {
            jitter(&mut spoilt)?;
            Kind::Jitter
        }
        Fault::Stretched => {
            spoilt
                .episodes
                .iter_mut()
                .for_each(|episode| episode.time_secs.iter_mut().for_each(|secs| *secs *= 1.0 + STRETCH));
            Kind::Rate
        }
        Fault::Repeated => {
            let mut copy = spoilt.episodes[spoilt.episodes.len() / 2].clone();
            copy.id = spoilt.episodes.last()?.id + 1;
            spoilt.episodes.push(copy);
            Kind::Repeated
        }
        Fault::GravityInG => {
            spoilt.header.gravity_mps2 = 1.0;
            Kind::Gravity
        }
    };
    spoilt.checked(Path::new("log.toml"), Path::new("samples.csv")).ok()?;
    Some((spoilt, kind))
}

impl Table {
    /// As Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = String::from(
            "| fault | logs | can be seen | caught (95 %) | mended by the first reading |\n|---|---|---|---|---|\n",
        );
        for row in &self.rows {
            let share = if row.visible == 0 {
                "–".into()
            } else {
                let [low, high] = wilson95(row.caught as u32, row.visible as u32).map(|share| 100.0 * share);
                format!("{} ({low:.0} to {high:.0} %)", row.caught)
            };
            let _ = writeln!(text, "| {} | {} | {} | {share} | {} |", row.fault, row.logs, row.visible, row.mended);
        }
        let _ = writeln!(
            text,
            "\nOf {} good logs {} are accused. Version {}, commit {}.",
            self.logs.len(),
            self.accused.len(),
            self.version,
            self.commit
        );
        for (log, kinds) in &self.accused {
            let _ = writeln!(text, "- {log}: {kinds:?}");
        }
        text
    }

    /// As JSON.
    ///
    /// # Errors
    ///
    /// None that occurs.
    pub fn json(&self) -> Result<String> {
        serde_json::to_string_pretty(self).context("cannot write the table")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spoilt_logs_are_written_under_the_names_of_their_faults() {
        let folder = tempfile::tempdir().unwrap();
        let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs/set-003");
        let count = write(std::slice::from_ref(&log), folder.path()).unwrap();
        let written: Vec<PathBuf> =
            std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(count > 20 && written.len() == count, "{count}, {}", written.len());
        let good = measured_log::read(&log).unwrap();
        for place in written {
            assert_ne!(measured_log::read(&place).unwrap(), good, "{}", place.display());
        }
        // What is there stays.
        assert!(write(&[log], folder.path()).is_err());
    }

    /// Read fifteen times a second.
    fn thin(log: &Log) -> Log {
        let mut log = log.clone();
        let rows = (1.0 / 15.0 / log.header.period_secs).round() as usize;
        log.header.period_secs *= rows as f64;
        for episode in &mut log.episodes {
            episode.time_secs = episode.time_secs.iter().step_by(rows).copied().collect();
            for cells in episode.channels.values_mut() {
                *cells = (0..cells.len()).step_by(rows).map(|row| cells.get(row)).collect();
            }
        }
        log
    }

    #[test]
    fn an_object_that_is_away_is_seen_at_fifteen_readings_a_second() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
        let logs: Vec<Log> =
            (0..12).map(|i| thin(&measured_log::read(&folder.join(format!("set-{i:03}"))).unwrap())).collect();
        let checked = |log: &Log| check(log, None).suspicions.iter().any(|found| found.kind == Kind::Outliers);
        assert!(logs.iter().all(|log| (0.05..0.09).contains(&log.header.period_secs) && !checked(log)));
        let caught = logs.iter().filter(|log| checked(&spoil(&Fault::Away, log).unwrap().0)).count();
        assert!(caught >= 11, "{caught} of 12");
    }

    /// Adds to x of the object where it rests longest.
    fn moved(log: &Log, way_m: &[f64]) -> Log {
        let x = measured_log::Channel::ObjectPosition(measured_log::Axis::X);
        let mut log = log.clone();
        let read = |episode: &measured_log::Episode| -> Vec<Option<f64>> {
            (0..episode.rows()).map(|row| episode.channels[&x].get(row)).collect()
        };
        let count = way_m.len() + 6;
        let places = log.episodes.iter().enumerate().flat_map(|(index, episode)| {
            let read = read(episode);
            (0..(read.len() + 1).saturating_sub(count))
                .filter_map(move |first| {
                    let values: Option<Vec<f64>> = read[first..first + count].iter().copied().collect();
                    let values = values?;
                    let range = |best: fn(f64, f64) -> f64| values.iter().copied().reduce(best).unwrap();
                    Some((range(f64::max) - range(f64::min), index, first + 3))
                })
                .collect::<Vec<_>>()
        });
        let (_, index, first) = places.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let mut cells = read(&log.episodes[index]);
        way_m.iter().enumerate().for_each(|(i, way)| cells[first + i] = cells[first + i].map(|value| value + way));
        log.episodes[index].channels.insert(x, cells.into_iter().collect());
        log
    }

    #[test]
    fn what_tips_or_hangs_on_a_spring_may_come_back() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs/set-001");
        let log = thin(&measured_log::read(&folder).unwrap());
        let accused = |way_m: &[f64]| {
            check(&moved(&log, way_m), None).suspicions.iter().any(|found| found.kind == Kind::Outliers)
        };
        // A cube that tips and falls back, a spring that lets go, and a tracker that is elsewhere.
        assert!(!accused(&[0.0115, 0.0228, 0.024, 0.017]) && !accused(&[0.06, 0.09, 0.07, 0.03]));
        assert!(accused(&[0.2, 0.2, 0.2]) && accused(&[0.05, 0.05, 0.05, 0.05]));
    }

    #[test]
    fn what_was_hidden_or_is_read_seldom_may_have_gone_there_and_back() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs/set-001");
        let log = thin(&measured_log::read(&folder).unwrap());
        let accused = |log: &Log| check(log, None).suspicions.iter().any(|found| found.kind == Kind::Outliers);
        let away = moved(&log, &[0.2, 0.2]);
        let differs = |a: &measured_log::Episode, b: &measured_log::Episode| a.channels != b.channels;
        let index = (0..log.episodes.len()).find(|i| differs(&away.episodes[*i], &log.episodes[*i])).unwrap();
        let x = measured_log::Channel::ObjectPosition(measured_log::Axis::X);
        let cells = |log: &Log, row: usize| log.episodes[index].channels[&x].get(row);
        let row = (0..log.episodes[index].rows()).find(|row| cells(&away, *row) != cells(&log, *row)).unwrap();
        // Hidden for two seconds before, or all times ten times as long.
        let mut hidden = away.clone();
        hidden.episodes[index].time_secs.iter_mut().skip(row).for_each(|secs| *secs += 2.0);
        let mut slow = away.clone();
        slow.header.period_secs *= 10.0;
        slow.episodes.iter_mut().flat_map(|episode| &mut episode.time_secs).for_each(|secs| *secs *= 10.0);
        assert!(accused(&away) && !accused(&hidden) && !accused(&slow));
    }

    #[test]
    fn what_can_be_seen_is_caught_and_good_logs_are_not_accused() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
        let logs: Vec<PathBuf> = (0..12).map(|i| folder.join(format!("set-{i:03}"))).collect();
        let table = run(&logs, String::new()).unwrap();
        assert!(table.accused.is_empty(), "{:?}", table.accused);
        for row in &table.rows {
            assert!(row.visible > 0, "{row:?}");
            assert!(row.caught as f64 >= 0.9 * row.visible as f64, "{row:?}");
        }
        assert!(table.markdown().contains("Of 12 good logs 0 are accused."));
    }
}
