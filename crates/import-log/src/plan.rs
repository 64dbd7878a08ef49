//! A mapping, resolved: which values are taken from where, and what is made of them.

use std::collections::BTreeMap;

use crate::Error;
use crate::builder::Builder;
use crate::mapping::{Axes, Mapping, Sampling};
use crate::rigid::{Rigid, from_rpy};
use crate::units::Dimension;

/// What a track measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Quantity {
    Command,
    Tool,
    Object,
    Joints,
    JointTorques,
    Wrench,
    ObjectVelocity,
    ObjectSpin,
    AddedMass,
    Action,
    /// What names the episode.
    Label,
}

impl Quantity {
    /// Its table in a mapping.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::Tool => "tool",
            Self::Object => "object",
            Self::Joints => "joints",
            Self::JointTorques => "joint_torques",
            Self::Wrench => "wrench",
            Self::ObjectVelocity => "object_velocity",
            Self::ObjectSpin => "object_spin",
            Self::AddedMass => "added_mass",
            Self::Action => "action",
            Self::Label => "episodes.change",
        }
    }
}

/// Which component of a vector is meant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Part {
    /// The value itself.
    All,
    /// An element of a list, or a field of a message; lists without an order of their elements have none.
    Of(Option<usize>, &'static str),
    /// The element that stands where this name stands in the list of names.
    Named(String),
}

/// Where one number is from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Pick {
    Constant(f64),
    Value { path: String, part: Part },
}

/// When a message was, by which clock.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Stamp {
    /// The stamp in its header.
    Header,
    /// When it was recorded.
    Log,
    /// When it was sent.
    Publish,
    /// A field or a column.
    Field(String),
}

/// Numbers that are read together.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) quantity: Quantity,
    pub(crate) topic: Option<String>,
    /// The part of the message that all paths begin at.
    pub(crate) at: String,
    pub(crate) picks: Vec<Pick>,
    /// To the units, order and signs of a log.
    pub(crate) factors: Vec<f64>,
    pub(crate) names: Option<String>,
    /// The last three numbers are roll, pitch and yaw.
    pub(crate) angles: bool,
    pub(crate) stamp: Stamp,
    pub(crate) offset_secs: f64,
}

impl Track {
    /// What is kept of the numbers that were picked; NaN is a missing one.
    pub(crate) fn convert(&self, picked: &mut Vec<f64>) {
        for (value, factor) in picked.iter_mut().zip(&self.factors) {
            *value *= factor;
        }
        if self.angles && picked.len() >= 3 {
            let last = picked.split_off(picked.len() - 3);
            picked.extend(from_rpy([last[0], last[1], last[2]]));
        }
    }

    /// Numbers that are taken from the list or message at `path` by their order.
    pub(crate) fn elements_of(&self, path: &str) -> usize {
        let same = |pick: &&Pick| matches!(pick, Pick::Value { path: other, part: Part::Of(..) } if other == path);
        self.picks.iter().filter(same).count()
    }

    /// Numbers that are kept.
    pub(crate) fn width(&self) -> usize {
        self.picks.len() + usize::from(self.angles)
    }

    /// Its numbers, where none of them is read.
    pub(crate) fn fixed(&self) -> Option<Vec<f64>> {
        let constant = |pick: &Pick| if let Pick::Constant(value) = pick { Some(*value) } else { None };
        let mut values = self.picks.iter().map(constant).collect::<Option<Vec<f64>>>()?;
        self.convert(&mut values);
        Some(values)
    }

    /// The key of the mapping that names its topic.
    pub(crate) fn topic_key(&self) -> String {
        format!("{}.topic", self.quantity.key())
    }
}

/// From the measured frame to the world and to the point that a log holds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PoseGeometry {
    pub(crate) frame: Option<Rigid>,
    pub(crate) mount: Option<Rigid>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct WrenchGeometry {
    pub(crate) axes: Axes,
    pub(crate) frame: Option<Rigid>,
    pub(crate) mount: Option<Rigid>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct RateGeometry {
    pub(crate) in_object_axes: bool,
    pub(crate) frame: Option<Rigid>,
}

/// A resolved mapping.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) tracks: Vec<Track>,
    pub(crate) poses: BTreeMap<Quantity, PoseGeometry>,
    pub(crate) wrench: Option<WrenchGeometry>,
    pub(crate) rates: BTreeMap<Quantity, RateGeometry>,
    pub(crate) sample: Sampling,
    pub(crate) near_secs: f64,
    /// Seconds of one unit of the clock.
    pub(crate) clock_unit_secs: f64,
}

/// What is asked of a mapping: a table or messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Table,
    Messages,
}

impl Plan {
    /// The index of the track of a quantity.
    pub(crate) fn index(&self, quantity: Quantity) -> Option<usize> {
        self.tracks.iter().position(|track| track.quantity == quantity)
    }
}

/// Resolves a mapping for a kind of source, whose clock is called `clock` where the mapping names none.
pub(crate) fn resolve(mapping: &Mapping, kind: Kind, clock: Option<&str>) -> Result<Plan, Error> {
    let raw = &mapping.raw;
    let wrong = |key: &str| {
        let key = key.to_string();
        move |reason: String| mapping.wrong(key, reason)
    };
    let clock_unit_secs = Dimension::Time.factor(raw.clock.unit.as_deref()).map_err(wrong("clock.unit"))?;
    let mut builder = Builder::new(mapping, kind, raw.clock.stamp.as_deref().or(clock));
    let mut poses = BTreeMap::new();
    for (quantity, pose) in
        [(Quantity::Command, &raw.command), (Quantity::Tool, &raw.tool), (Quantity::Object, &raw.object)]
    {
        if let Some(pose) = pose {
            poses.insert(quantity, builder.pose(quantity, pose)?);
        }
    }
    let joints = usize::from(mapping.header.robot.joints());
    builder.joints(Quantity::Joints, raw.joints.as_ref(), Dimension::Angle, joints)?;
    builder.joints(Quantity::JointTorques, raw.joint_torques.as_ref(), Dimension::Torque, joints)?;
    let wrench = raw.wrench.as_ref().map(|wrench| builder.wrench(wrench)).transpose()?;
    let mut rates = BTreeMap::new();
    for (quantity, rate, dimension) in [
        (Quantity::ObjectVelocity, &raw.object_velocity, Dimension::Speed),
        (Quantity::ObjectSpin, &raw.object_spin, Dimension::Spin),
    ] {
        if let Some(rate) = rate {
            rates.insert(quantity, builder.rate(quantity, rate, dimension)?);
        }
    }
    builder.scalar(Quantity::AddedMass, raw.added_mass.as_ref(), Some(Dimension::Mass))?;
    builder.scalar(Quantity::Action, raw.action.as_ref(), None)?;
    if builder.tracks.is_empty() {
        return Err(mapping.wrong("object", "expected it or another quantity, such as tool, found none"));
    }
    builder.label(&raw.episodes)?;
    let tracks = builder.tracks;
    let (sample, near_secs) = grid(mapping, kind, &tracks)?;
    Ok(Plan { tracks, poses, wrench, rates, sample, near_secs, clock_unit_secs })
}

/// How rows are made.
fn grid(mapping: &Mapping, kind: Kind, tracks: &[Track]) -> Result<(Sampling, f64), Error> {
    let raw = &mapping.raw;
    let default = if kind == Kind::Table { Sampling::Rows } else { Sampling::Linear };
    let sample = raw.grid.map_or(default, |grid| grid.sample);
    if sample == Sampling::Rows {
        if kind == Kind::Messages {
            let reason = "expected linear, hold or nearest: messages of different topics share no rows, found rows";
            return Err(mapping.wrong("grid.sample", reason));
        }
        for track in tracks.iter().filter(|track| track.fixed().is_none()) {
            if track.offset_secs != 0.0 || track.stamp != tracks[0].stamp {
                let key = format!("{}.offset_secs", track.quantity.key());
                let reason =
                    "expected grid.sample = \"linear\", \"hold\" or \"nearest\" for a clock of its own, found rows";
                return Err(mapping.wrong(key, reason));
            }
        }
    }
    let near = raw.grid.and_then(|grid| grid.near_secs).unwrap_or(2.0 * mapping.header.period_secs);
    if !(0.0..=60.0).contains(&near) {
        return Err(mapping.wrong("grid.near_secs", format!("expected 0 to 60 s, found {near}")));
    }
    Ok((sample, near))
}
