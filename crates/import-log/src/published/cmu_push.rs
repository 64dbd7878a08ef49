//! Pushes of a triangle from the data set of Zhou, Paolini, Bagnell and Mason.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use super::rotate;
use crate::Error;
use crate::error::{excerpt, read};
use measured_log::{
    Axis, Channel, Component, Episode, Header, Log, MAX_FILE_BYTES, MAX_ROWS, Noise, Notes, Number, Object, Robot,
    Shape, SplitConfig, Table,
};

/// The authors' friction force between triangle and hard board, N (`demo_rand_multi_push.m`; 5.0 N on their wooden board).
pub const HARD_BOARD_N: f64 = 4.2;

const MASS_KG: f64 = 1.518;
const GRAVITY_MPS2: f64 = 9.81;
/// From the right angle to the centre of the shape: the centroid at half height, mm.
const CENTRE_MM: [f64; 3] = [50.0, 50.0, 25.0];

/// Pushes of an aluminium triangle by a robot's point finger (Zhou, Paolini, Bagnell, Mason, ICRA 2016;
/// github.com/robinzhoucmu/MLab_EXP, PushExp/sensor_log, Apache-2.0). `source` is one text file, plain or gzip. Its
/// name or folder holds the feet in mm as `x1_x2_x3_y1_y2_y3`, or `patch` for a triangle that lies on its face.
/// `friction_force_n` is the force of friction between triangle and board: [`HARD_BOARD_N`], or that of another board.
///
/// Each row is a moment when the force sensor or the robot was read, so no reading is resampled. The object's pose is
/// known before (first row) and after the push (last row, though the cameras looked later, when the robot was away).
/// The first force is subtracted as the authors do, and forces are turned from sensor axes to base axes.
///
/// # Errors
///
/// [`Error`] where the source cannot be read or has another layout.
pub fn cmu_push(source: &Path, friction_force_n: f64) -> Result<(Log, Notes), Error> {
    let feet = feet(source)?;
    let text = unpack(source)?;
    let mut numbers = Numbers { path: source, words: text.split_ascii_whitespace(), read: 0 };
    let pushes = numbers.count(MAX_ROWS)?;
    let (mut episodes, mut bottoms, mut rows) = (Vec::new(), Vec::new(), 0);
    for id in 0..pushes {
        let push = Push::read(&mut numbers)?;
        rows += push.forces.len() + push.tools.len();
        if rows > MAX_ROWS {
            return Err(numbers.wrong(&format!("at most {MAX_ROWS} readings"), "more"));
        }
        bottoms.extend([push.before[2], push.after[2]]);
        episodes.push(push.episode(id as u64));
    }
    if let Some(word) = numbers.words.next() {
        numbers.read += 1;
        return Err(numbers.wrong("the end of the file", &excerpt(word)));
    }
    bottoms.sort_by(f64::total_cmp);
    let table_m = bottoms.get(bottoms.len() / 2).map_or(0.0, |mm| mm / 1000.0);
    let log = Log { header: header(table_m, friction_force_n, feet), episodes };
    log.checked(source, source)?;
    Ok((log, notes(friction_force_n)))
}

/// The file's text, unpacked where it is gzip, of bounded size.
fn unpack(path: &Path) -> Result<String, Error> {
    let bytes = read(path, MAX_FILE_BYTES)?;
    let mut plain = Vec::new();
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut unpacked = flate2::read::MultiGzDecoder::new(bytes.as_slice()).take(MAX_FILE_BYTES + 1);
        unpacked.read_to_end(&mut plain).map_err(Error::io("unpack", path))?;
        if plain.len() as u64 > MAX_FILE_BYTES {
            let found = plain.len() as u64;
            return Err(Error::TooLarge {
                path: path.to_owned(),
                what: "bytes unpacked",
                limit: MAX_FILE_BYTES,
                found,
            });
        }
    } else {
        plain = bytes;
    }
    String::from_utf8(plain).map_err(|e| Error::Syntax {
        path: path.to_owned(),
        reason: format!("expected UTF-8 text, found another byte at {}", e.utf8_error().valid_up_to()),
    })
}

/// The feet that the name of the file or of its folder gives, m, from the centroid.
fn feet(path: &Path) -> Result<Vec<[f64; 2]>, Error> {
    let name = |path: Option<&Path>| path.and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
    for name in [name(Some(path)), name(path.parent())].into_iter().flatten() {
        let name = name.strip_prefix("wood_").unwrap_or(&name).split("__").next().unwrap_or_default().to_string();
        if name == "patch" {
            return Ok(Vec::new());
        }
        let mm: Vec<f64> = name.split('_').map_while(|part| part.parse().ok()).collect();
        if let [x1, x2, x3, y1, y2, y3] = mm[..]
            && name.split('_').count() == 6
        {
            let centred = |x: f64, y: f64| [(x - CENTRE_MM[0]) / 1000.0, (y - CENTRE_MM[1]) / 1000.0];
            return Ok(vec![centred(x1, y1), centred(x2, y2), centred(x3, y3)]);
        }
    }
    Err(Error::Source {
        path: path.to_owned(),
        place: "in its name or that of its folder".into(),
        expected: "the feet in mm as x1_x2_x3_y1_y2_y3, or patch".into(),
        found: "neither".into(),
    })
}

/// The numbers of a file, one after the other.
struct Numbers<'a> {
    path: &'a Path,
    words: std::str::SplitAsciiWhitespace<'a>,
    read: usize,
}

impl<'a> Numbers<'a> {
    fn wrong(&self, expected: &str, found: &str) -> Error {
        Error::Source {
            path: self.path.to_owned(),
            place: format!("number {}", self.read),
            expected: expected.into(),
            found: found.into(),
        }
    }

    fn word(&mut self, expected: &str) -> Result<&'a str, Error> {
        self.read += 1;
        self.words.next().ok_or_else(|| self.wrong(expected, "the end of the file"))
    }

    fn next(&mut self) -> Result<f64, Error> {
        let word = self.word("a number")?;
        word.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| self.wrong("a finite number", &excerpt(word)))
    }

    fn array<const N: usize>(&mut self) -> Result<[f64; N], Error> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.next()?;
        }
        Ok(values)
    }

    fn count(&mut self, most: usize) -> Result<usize, Error> {
        let expected = format!("a count of 1 to {most}");
        let word = self.word(&expected)?;
        word.parse().ok().filter(|n| (1..=most).contains(n)).ok_or_else(|| self.wrong(&expected, &excerpt(word)))
    }

    /// A date in whole nanoseconds: a float would round it to 0.2 microseconds.
    fn nanoseconds(&mut self) -> Result<i64, Error> {
        let word = self.word("a date in seconds")?;
        let parse = || {
            let (whole, part) = word.split_once('.').unwrap_or((word, ""));
            let digits = part.len() <= 9 && part.bytes().all(|b| b.is_ascii_digit());
            let part: i64 = if digits { format!("{part:0<9}").parse().ok()? } else { return None };
            whole.parse::<u32>().ok().map(|whole| i64::from(whole) * 1_000_000_000 + part)
        };
        parse().ok_or_else(|| self.wrong("a date in seconds with at most 9 decimals", &excerpt(word)))
    }
}

/// What was read at a date: force, tool.
type Read = (Option<[f64; 2]>, Option<[f64; 7]>);

/// One push as it stands in the file: mm, N, quaternions w first.
struct Push {
    before: [f64; 7],
    after: [f64; 7],
    /// Date, force in the axes of the sensor.
    forces: Vec<(i64, [f64; 2])>,
    /// Date, position and orientation of the tool.
    tools: Vec<(i64, [f64; 7])>,
}

impl Push {
    fn read(numbers: &mut Numbers<'_>) -> Result<Self, Error> {
        let (before, after) = (numbers.array()?, numbers.array()?);
        let mut forces = Vec::new();
        for _ in 0..numbers.count(MAX_ROWS)? {
            forces.push((numbers.nanoseconds()?, numbers.array()?));
        }
        let mut tools = Vec::new();
        for _ in 0..numbers.count(MAX_ROWS)? {
            tools.push((numbers.nanoseconds()?, numbers.array()?));
        }
        Ok(Self { before, after, forces, tools })
    }

    /// Rows in order of the dates; readings of one date share a row.
    #[expect(clippy::cast_precision_loss, reason = "nanoseconds of a few seconds")]
    fn episode(&self, id: u64) -> Episode {
        let mut rows: BTreeMap<i64, Read> = BTreeMap::new();
        for (date, force) in &self.forces {
            rows.entry(*date).or_default().0 = Some(*force);
        }
        for (date, tool) in &self.tools {
            rows.entry(*date).or_default().1 = Some(*tool);
        }
        let start = rows.keys().next().copied().unwrap_or(0);
        let zero = self.forces.first().map_or([0.0; 2], |(_, force)| *force);
        let mut yaw = self.tools.first().map_or(0.0, |(_, tool)| yaw(tool));
        let mut episode = Episode { id, ..Episode::default() };
        let last = rows.len().saturating_sub(1);
        for (row, (date, (force, tool))) in rows.into_iter().enumerate() {
            episode.time_secs.push((date - start) as f64 / 1e9);
            let mut push = |channel, value| episode.channels.entry(channel).or_default().push(value);
            if let Some(tool) = &tool {
                yaw = self::yaw(tool);
            }
            for (i, axis) in Axis::ALL.into_iter().enumerate() {
                push(Channel::Tool(axis), tool.map(|t| t[i] / 1000.0));
            }
            let force = force.map(|f| on_tool([f[0] - zero[0], f[1] - zero[1]], yaw));
            push(Channel::WristForce(Axis::X), force.map(|f| f[0]));
            push(Channel::WristForce(Axis::Y), force.map(|f| f[1]));
            let pose = match row {
                0 => Some(&self.before),
                _ if row == last => Some(&self.after),
                _ => None,
            };
            let pose = pose.map(|[x, y, z, qw, qx, qy, qz]| {
                let q = [*qx, *qy, *qz, *qw];
                let centre = rotate(q, CENTRE_MM);
                ([0, 1, 2].map(|i| ([x, y, z][i] + centre[i]) / 1000.0), q)
            });
            for (i, axis) in Axis::ALL.into_iter().enumerate() {
                push(Channel::ObjectPosition(axis), pose.map(|(centre, _)| centre[i]));
            }
            for (i, component) in Component::ALL.into_iter().enumerate() {
                push(Channel::ObjectOrientation(component), pose.map(|(_, q)| q[i]));
            }
        }
        episode
    }
}

/// Angle of the tool about z, rad; its z axis is up.
fn yaw(tool: &[f64; 7]) -> f64 {
    2.0 * tool[6].atan2(tool[3])
}

/// Force of the object on the tool, turned from sensor axes to base axes. The sensor is mounted at 45 degrees and is
/// left-handed in the plane. This is `R_tool` and the turn by the robot's pose in the authors' `ExtractFromLog.m` and
/// `ComputeWrench.m`, which give the force on the object: the opposite sign.
fn on_tool([fx, fy]: [f64; 2], yaw: f64) -> [f64; 2] {
    let s = std::f64::consts::FRAC_1_SQRT_2;
    let [x, y] = [s * (fx + fy), s * (fx - fy)];
    [yaw.cos() * x - yaw.sin() * y, yaw.sin() * x + yaw.cos() * y]
}

fn header(table_m: f64, friction_force_n: f64, feet_m: Vec<[f64; 2]>) -> Header {
    Header {
        robot: Robot::None,
        period_secs: 0.01,
        tool_radius_m: Some(0.001),
        tool_friction: Some(Number::Uncertain { mean: 0.4, stddev: 0.1 }),
        gravity_mps2: GRAVITY_MPS2,
        table: Table {
            height_m: table_m.into(),
            friction: Number::Uncertain { mean: friction_force_n / (MASS_KG * GRAVITY_MPS2), stddev: 0.03 },
        },
        object: Object {
            shape: Shape::Prism {
                outline_m: vec![[-0.05, -0.05], [0.1, -0.05], [-0.05, 0.1]],
                height_m: 0.05.into(),
                feet_m,
            },
            mass_kg: MASS_KG.into(),
            com_m: [Number::Fixed(0.0); 3],
            inertia_kgm2: None,
            restitution: None,
        },
        noise: Noise::default(),
        split: SplitConfig { holdout_fraction: 0.3 },
    }
}

fn notes(friction_force_n: f64) -> Notes {
    let text = |note: &str| note.to_string();
    Notes::from([
        (
            "",
            text(
                "Pushes of a triangle, imported from the data of Zhou, Paolini, Bagnell, Mason, ICRA 2016\n\
                 (github.com/robinzhoucmu/MLab_EXP, PushExp/sensor_log, Apache-2.0; changed: units, axes, one table of rows).\n\
                 Files named below are theirs. A row is a moment when the force sensor (100 Hz) or the robot (33 Hz) was read.",
            ),
        ),
        (
            "robot",
            text("The arm is not modelled: its tool is a finger on a known path. Base frame of their robot, z up."),
        ),
        ("period_secs", text("Median step of the force sensor.")),
        (
            "tool_radius_m",
            text(
                "Not published: a point finger (push_exp.yaml) whose reported point lies on the edge while it pushes\n\
                 (0.0 and 0.1 mm outside on average); so a radius below the 1 mm to which poses are known.",
            ),
        ),
        (
            "tool_friction",
            text(
                "Not published: the tangent of the rms angle, 22 degrees, between force and edge normal in these data.",
            ),
        ),
        ("gravity_mps2", text("Standard; the authors take 9.8.")),
        (
            "table.height_m",
            text(
                "Median height of the tracked origin, which the authors put at the bottom of the triangle (push_exp.cpp lifts\n\
                 the finger from it by a part of the height).",
            ),
        ),
        (
            "table.friction",
            format!(
                "{friction_force_n} N / (m g): 4.2 N on the hard, 5.0 N on the wooden board (demo_rand_multi_push.m).\n\
                 The stddev is a guess of this import: about a tenth."
            ),
        ),
        (
            "object.outline_m",
            text("Right triangle with legs of 150 mm (obj_geo.txt); the origin is moved to its centroid, (50, 50) mm."),
        ),
        ("object.height_m", text("50 mm (obj_geo.txt), as 1.518 kg of aluminium (2700 kg/m3) on 112.5 cm2 confirm.")),
        (
            "object.feet_m",
            text("From the name of the folder: x1_x2_x3_y1_y2_y3 in mm, as Tri_pts_set in demo_multilog_robot_exp.m."),
        ),
        ("object.mass_kg", text("demo_rand_multi_push.m.")),
        ("object.com_m", text("Tri_com in demo_rand_multi_push.m: the centroid.")),
        ("noise.[]", text("None is published.")),
        ("split.holdout_fraction", text("A choice of this import.")),
    ])
}
