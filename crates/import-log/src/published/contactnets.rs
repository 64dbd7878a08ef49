//! Tosses of a cube from the data set of ContactNets.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::rotate;
use crate::Error;
use crate::error::{excerpt, open};
use measured_log::{
    Axis, Channel, Component, Episode, Header, Log, MAX_ROWS, Noise, Notes, Number, Object, Readings, Robot, Shape,
    SplitConfig, Table,
};

const COLUMNS: [&str; 15] = [
    "toss",
    "t_s",
    "x_m",
    "y_m",
    "z_m",
    "qw",
    "qx",
    "qy",
    "qz",
    "vx_mps",
    "vy_mps",
    "vz_mps",
    "wx_body_rps",
    "wy_body_rps",
    "wz_body_rps",
];

/// Tosses of an acrylic cube onto a wooden board (Pfrommer, Halm, Posa: "ContactNets", CoRL 2020;
/// github.com/DAIRLab/contact-nets, BSD-3-Clause). `source` is a table with the columns `toss, t_s, x_m, …,
/// wz_body_rps`, or a folder with one `tosses_*.csv`. The angular velocity is turned from body to world axes; all else
/// is copied.
///
/// # Errors
///
/// [`Error`] where the source cannot be read or has another layout.
pub fn contactnets(source: &Path) -> Result<(Log, Notes), Error> {
    let path = locate(source)?;
    let file = open(&path)?;
    let wrong = |place: String, expected: &str, found: String| Error::Source {
        path: path.clone(),
        place,
        expected: expected.into(),
        found,
    };
    let broken = |e: csv::Error| wrong("as a table".into(), "CSV", e.to_string());
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
    let names = reader.headers().map_err(broken)?;
    if !names.iter().eq(COLUMNS) {
        let found = excerpt(&names.iter().collect::<Vec<_>>().join(","));
        return Err(wrong("row of names".into(), &COLUMNS.join(","), found));
    }
    let mut episodes: Vec<Episode> = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(broken)?;
        let place = |column: usize| format!("row {}, column {}", row + 1, COLUMNS[column]);
        if row >= MAX_ROWS {
            return Err(wrong(place(0), "the end of the table", format!("more than {MAX_ROWS} rows")));
        }
        let toss: u64 = record[0].parse().map_err(|_| wrong(place(0), "the number of a toss", excerpt(&record[0])))?;
        let mut numbers = [0.0; 14];
        for (i, number) in numbers.iter_mut().enumerate() {
            let cell = &record[i + 1];
            *number = cell
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| wrong(place(i + 1), "a finite number", excerpt(cell)))?;
        }
        if episodes.last().is_none_or(|last| last.id != toss) {
            episodes.push(Episode { id: toss, ..Episode::default() });
        }
        if let Some(episode) = episodes.last_mut() {
            append(episode, numbers);
        }
    }
    let log = Log { header: header(), episodes };
    log.checked(&path, &path)?;
    Ok((log, notes()))
}

fn locate(source: &Path) -> Result<PathBuf, Error> {
    if !source.is_dir() {
        return Ok(source.to_owned());
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(source).map_err(Error::io("list", source))? {
        let path = entry.map_err(Error::io("list", source))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with("tosses_") && name.ends_with(".csv") {
            found.push(path);
        }
    }
    match found.pop() {
        Some(path) if found.is_empty() => Ok(path),
        one => Err(Error::Source {
            path: source.to_owned(),
            place: "as a folder".into(),
            expected: "exactly one file tosses_*.csv".into(),
            found: (found.len() + usize::from(one.is_some())).to_string(),
        }),
    }
}

/// Appends a row: time, position, quaternion w first, velocity, angular velocity in body axes.
fn append(episode: &mut Episode, [t, x, y, z, qw, qx, qy, qz, vx, vy, vz, wx, wy, wz]: [f64; 14]) {
    let spin = rotate([qx, qy, qz, qw], [wx, wy, wz]);
    episode.time_secs.push(t);
    let channels: &mut BTreeMap<Channel, Readings> = &mut episode.channels;
    let mut push = |channel, value| channels.entry(channel).or_default().push(Some(value));
    for (i, axis) in Axis::ALL.into_iter().enumerate() {
        push(Channel::ObjectPosition(axis), [x, y, z][i]);
        push(Channel::ObjectVelocity(axis), [vx, vy, vz][i]);
        push(Channel::ObjectSpin(axis), spin[i]);
    }
    for (component, value) in Component::ALL.into_iter().zip([qx, qy, qz, qw]) {
        push(Channel::ObjectOrientation(component), value);
    }
}

/// The authors' nominal model.
fn header() -> Header {
    Header {
        robot: Robot::None,
        period_secs: 1.0 / 148.0,
        tool_radius_m: None,
        tool_friction: None,
        gravity_mps2: 9.81,
        table: Table { height_m: 0.0.into(), friction: Number::Uncertain { mean: 0.18, stddev: 0.03 } },
        object: Object {
            shape: Shape::Box { size_m: [Number::Fixed(0.1048); 3] },
            mass_kg: 0.37.into(),
            com_m: [Number::Fixed(0.0); 3],
            inertia_kgm2: Some([Number::Uncertain { mean: 0.00081, stddev: 0.00013 }; 3]),
            restitution: Some(0.125.into()),
        },
        noise: Noise::default(),
        split: SplitConfig { holdout_fraction: 0.3 },
    }
}

fn notes() -> Notes {
    let text = |note: &str| note.to_string();
    Notes::from([
        (
            "",
            text(
                "Tosses of an acrylic cube, imported from the data of Pfrommer, Halm, Posa, \"ContactNets\", CoRL 2020\n\
                 (github.com/DAIRLab/contact-nets, commit c3dc21c, Copyright (c) 2020 Dynamic Autonomy and Intelligent Robotics Lab,\n\
                 BSD-3-Clause). Readings as published, but for the angular velocity, which was turned from body to world axes.",
            ),
        ),
        ("robot", text("Recording starts after release: a free body, no input.")),
        ("period_secs", text("Cameras at 148 Hz (README of the data).")),
        ("gravity_mps2", text("The authors' model.")),
        ("table.height_m", text("Board frame: its top is at z = 0 (README).")),
        ("table.friction", text("The authors' 0.18; the stddev is the distance to the 0.15 of their later work.")),
        ("object.size_m", text("Twice the authors' half-width, 0.0524 m.")),
        ("object.mass_kg", text("The authors' model; free tosses do not tell the mass, so it is fixed.")),
        ("object.com_m", text("The authors' model takes the centre.")),
        (
            "object.inertia_kgm2",
            text(
                "The authors' model. Nobody says how it was found; a solid cube of this mass has 0.00068, one of thin walls 0.00113\n\
                 (5/18 m a^2): the stddev is that of a uniform distribution between the two.",
            ),
        ),
        ("object.restitution", text("The authors' model.")),
        ("noise.[]", text("None is published.")),
        ("split.holdout_fraction", text("A choice of this import.")),
    ])
}
