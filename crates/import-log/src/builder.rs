//! From the tables of a mapping to tracks.

use measured_log::Robot;

use crate::Error;
use crate::mapping::{
    Actor, Axes, Mapping, Order, RateAxes, RawEpisodes, RawJoints, RawPose, RawRate, RawScalar, RawWrench, Scalar,
    Vector,
};
use crate::plan::{Kind, Part, Pick, PoseGeometry, Quantity, RateGeometry, Stamp, Track, WrenchGeometry};
use crate::rigid::{RawRigid, Rigid};
use crate::units::Dimension;

/// Makes tracks of the tables of a mapping.
pub(crate) struct Builder<'a> {
    mapping: &'a Mapping,
    kind: Kind,
    clock: Option<&'a str>,
    pub(crate) tracks: Vec<Track>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(mapping: &'a Mapping, kind: Kind, clock: Option<&'a str>) -> Self {
        Self { mapping, kind, clock, tracks: Vec::new() }
    }

    fn factor(&self, key: String, dimension: Dimension, unit: Option<&str>) -> Result<f64, Error> {
        dimension.factor(unit).map_err(|reason| self.mapping.wrong(key, reason))
    }

    fn frame(&self, quantity: Quantity, name: Option<&str>) -> Result<Option<Rigid>, Error> {
        let Some(name) = name else { return Ok(None) };
        let frames = &self.mapping.raw.frames;
        let frame = frames.get(name).ok_or_else(|| {
            let reason = format!("expected the name of a table [frames.NAME], found {}", crate::error::excerpt(name));
            self.mapping.wrong(format!("{}.frame", quantity.key()), reason)
        })?;
        let resolved =
            frame.resolve().map_err(|(key, reason)| self.mapping.wrong(format!("frames.{name}.{key}"), reason));
        resolved.map(Some)
    }

    fn mount(&self, quantity: Quantity, mount: Option<&RawRigid>) -> Result<Option<Rigid>, Error> {
        let resolved = mount.map(RawRigid::resolve).transpose();
        resolved.map_err(|(key, reason)| self.mapping.wrong(format!("{}.mount.{key}", quantity.key()), reason))
    }

    /// The places of the `names.len()` components of a vector; `places` are those in a list.
    fn picks(&self, key: &str, vector: &Vector, names: &[(&'static str, Option<usize>)]) -> Result<Vec<Pick>, Error> {
        match vector {
            Vector::Whole(path) => Ok(names
                .iter()
                .map(|(name, place)| Pick::Value { path: path.clone(), part: Part::Of(*place, name) })
                .collect()),
            Vector::Parts(parts) if parts.len() == names.len() => {
                let mut picks = vec![Pick::Constant(0.0); names.len()];
                for (i, (_, place)) in names.iter().enumerate() {
                    picks[i] = pick(&parts[place.unwrap_or(i)]);
                }
                Ok(picks)
            }
            Vector::Parts(parts) => {
                let reason = format!("expected {} entries, found {}", names.len(), parts.len());
                Err(self.mapping.wrong(key, reason))
            }
        }
    }

    fn track(
        &mut self,
        quantity: Quantity,
        (topic, at, stamp, offset_secs): (Option<&String>, &str, Option<&String>, f64),
        picks: Vec<Pick>,
        factors: Vec<f64>,
    ) -> Result<&mut Track, Error> {
        let key = |name: &str| format!("{}.{name}", quantity.key());
        let (needs_topic, has_topic) = (self.kind == Kind::Messages, topic.is_some());
        if needs_topic && !has_topic && !picks.iter().all(|pick| matches!(pick, Pick::Constant(_))) {
            return Err(self.mapping.wrong(key("topic"), "expected the topic of the messages, found none"));
        }
        if has_topic && !needs_topic {
            return Err(self.mapping.wrong(key("topic"), "expected none, as a table has no topics, found one"));
        }
        let offset_secs = offset_secs + self.mapping.raw.clock.offset_secs;
        if !(-1e6..=1e6).contains(&offset_secs) {
            let reason = format!("expected a shift of at most 1e6 s, found {offset_secs}");
            return Err(self.mapping.wrong(key("offset_secs"), reason));
        }
        let stamp = match (stamp.map(String::as_str).or(self.clock), self.kind) {
            (Some(column), Kind::Table) => Stamp::Field(column.into()),
            (None, Kind::Table) => {
                return Err(self
                    .mapping
                    .wrong("clock.stamp", "expected the name of the column with the time, found none"));
            }
            (None | Some("header"), Kind::Messages) => Stamp::Header,
            (Some("log"), Kind::Messages) => Stamp::Log,
            (Some("publish"), Kind::Messages) => Stamp::Publish,
            (Some(path), Kind::Messages) => Stamp::Field(path.into()),
        };
        self.tracks.push(Track {
            quantity,
            topic: topic.cloned(),
            at: at.into(),
            picks,
            factors,
            names: None,
            angles: false,
            stamp,
            offset_secs,
        });
        let last = self.tracks.len() - 1;
        Ok(&mut self.tracks[last])
    }

    pub(crate) fn pose(&mut self, quantity: Quantity, raw: &RawPose) -> Result<PoseGeometry, Error> {
        let key = |name: &str| format!("{}.{name}", quantity.key());
        let unit = self.factor(key("unit"), Dimension::Length, raw.unit.as_deref())?;
        let mut picks = self.picks(&key("position"), &raw.position, &XYZ)?;
        let mut factors = vec![unit; 3];
        let mut angles = false;
        match (&raw.orientation, &raw.rpy) {
            (Some(_), Some(_)) => {
                return Err(self.mapping.wrong(key("rpy"), "expected orientation or rpy, found both"));
            }
            (Some(orientation), None) => {
                picks.extend(self.orientation(&key("order"), &key("orientation"), orientation, raw.order)?);
                let turn = if raw.conjugate { -1.0 } else { 1.0 };
                factors.extend([turn, turn, turn, 1.0]);
            }
            (None, Some(rpy)) => {
                let unit = self.factor(key("angle_unit"), Dimension::Angle, raw.angle_unit.as_deref())?;
                picks.extend(self.picks(&key("rpy"), rpy, &XYZ)?);
                factors.extend([unit; 3]);
                angles = true;
            }
            (None, None) => {}
        }
        for (name, given) in [("order", raw.order.is_some()), ("conjugate", raw.conjugate)] {
            if given && raw.orientation.is_none() {
                return Err(self.mapping.wrong(key(name), "expected beside orientation, found alone"));
            }
        }
        let geometry = PoseGeometry {
            frame: self.frame(quantity, raw.frame.as_deref())?,
            mount: self.mount(quantity, raw.mount.as_ref())?,
        };
        if geometry.mount.is_some() && picks.len() == 3 {
            let reason = "expected orientation or rpy beside it, to know where the mount points, found neither";
            return Err(self.mapping.wrong(key("mount"), reason));
        }
        let source = (raw.topic.as_ref(), raw.at.as_str(), raw.stamp.as_ref(), raw.offset_secs);
        self.track(quantity, source, picks, factors)?.angles = angles;
        Ok(geometry)
    }

    fn orientation(
        &self,
        order_key: &str,
        key: &str,
        vector: &Vector,
        order: Option<Order>,
    ) -> Result<Vec<Pick>, Error> {
        let places = match order {
            Some(Order::Xyzw) => [Some(0), Some(1), Some(2), Some(3)],
            Some(Order::Wxyz) => [Some(1), Some(2), Some(3), Some(0)],
            None if matches!(vector, Vector::Parts(_)) || self.kind == Kind::Table => {
                let reason = "expected \"xyzw\" or \"wxyz\" for a list of four, found none";
                return Err(self.mapping.wrong(order_key, reason));
            }
            None => [None; 4],
        };
        let names: Vec<(&'static str, Option<usize>)> = ["x", "y", "z", "w"].into_iter().zip(places).collect();
        self.picks(key, vector, &names)
    }

    pub(crate) fn joints(
        &mut self,
        quantity: Quantity,
        raw: Option<&RawJoints>,
        dimension: Dimension,
        joints: usize,
    ) -> Result<(), Error> {
        let Some(raw) = raw else { return Ok(()) };
        let key = |name: &str| format!("{}.{name}", quantity.key());
        if joints == 0 {
            let reason = format!("expected no joints for log.robot = \"none\", found {}", quantity.key());
            return Err(self.mapping.wrong(quantity.key(), reason));
        }
        let unit = self.factor(key("unit"), dimension, raw.unit.as_deref())?;
        let picks: Vec<Pick> = match (&raw.values, &raw.names, &raw.order) {
            (Vector::Whole(path), Some(_), Some(order)) => {
                if let Some(twice) = order.iter().enumerate().find(|(i, name)| order[..*i].contains(name)) {
                    let reason = format!("expected different joints, found {} twice", crate::error::excerpt(twice.1));
                    return Err(self.mapping.wrong(key("order"), reason));
                }
                let named = |name: &String| Pick::Value { path: path.clone(), part: Part::Named(name.clone()) };
                order.iter().map(named).collect()
            }
            (Vector::Whole(path), None, None) => {
                let place = |i| Pick::Value { path: path.clone(), part: Part::Of(Some(i), "") };
                (0..joints).map(place).collect()
            }
            (Vector::Parts(parts), None, None) => parts.iter().map(pick).collect(),
            _ => {
                let reason = "expected names and order together, beside one path of values";
                return Err(self.mapping.wrong(key("order"), reason));
            }
        };
        if picks.len() != joints {
            let robot = if self.mapping.header.robot == Robot::Sawyer { "sawyer" } else { "jaco" };
            let reason = format!("expected the {joints} joints of log.robot = \"{robot}\", found {}", picks.len());
            return Err(self.mapping.wrong(key(if raw.order.is_some() { "order" } else { "values" }), reason));
        }
        let source = (raw.topic.as_ref(), raw.at.as_str(), raw.stamp.as_ref(), raw.offset_secs);
        self.track(quantity, source, picks, vec![unit; joints])?.names.clone_from(&raw.names);
        Ok(())
    }

    pub(crate) fn wrench(&mut self, raw: &RawWrench) -> Result<WrenchGeometry, Error> {
        let quantity = Quantity::Wrench;
        let sign = if raw.of == Actor::World { 1.0 } else { -1.0 };
        let unit = self.factor("wrench.unit".into(), Dimension::Force, raw.unit.as_deref())?;
        let mut picks = self.picks("wrench.force", &raw.force, &XYZ)?;
        let mut factors = vec![sign * unit; 3];
        if let Some(torque) = &raw.torque {
            let unit = self.factor("wrench.torque_unit".into(), Dimension::Torque, raw.torque_unit.as_deref())?;
            picks.extend(self.picks("wrench.torque", torque, &XYZ)?);
            factors.extend([sign * unit; 3]);
        }
        let geometry = WrenchGeometry {
            axes: raw.axes,
            frame: self.frame(quantity, raw.frame.as_deref())?,
            mount: self.mount(quantity, raw.mount.as_ref())?,
        };
        let refuse = |key: &str, reason: &str| Err(self.mapping.wrong(format!("wrench.{key}"), reason));
        if raw.axes == Axes::World {
            if geometry.mount.is_some() {
                return refuse("mount", "expected only for axes = \"tool\" or \"sensor\", found with axes = \"world\"");
            }
        } else {
            if geometry.frame.is_some() {
                return refuse("frame", "expected only for axes = \"world\", found with axes of the tool");
            }
            if raw.axes == Axes::Sensor && geometry.mount.is_none() {
                return refuse("mount", "expected the pose of the sensor in the tool's frame, found none");
            }
            if self.mapping.raw.tool.as_ref().is_none_or(|tool| tool.orientation.is_none() && tool.rpy.is_none()) {
                let reason = "expected tool.orientation or tool.rpy, to turn the wrench to the world, found neither";
                return refuse("axes", reason);
            }
        }
        let source = (raw.topic.as_ref(), raw.at.as_str(), raw.stamp.as_ref(), raw.offset_secs);
        self.track(quantity, source, picks, factors)?;
        Ok(geometry)
    }

    pub(crate) fn rate(
        &mut self,
        quantity: Quantity,
        raw: &RawRate,
        dimension: Dimension,
    ) -> Result<RateGeometry, Error> {
        let key = |name: &str| format!("{}.{name}", quantity.key());
        let unit = self.factor(key("unit"), dimension, raw.unit.as_deref())?;
        let picks = self.picks(&key("value"), &raw.value, &XYZ)?;
        let in_object_axes = raw.axes == RateAxes::Object;
        let turned = self.mapping.raw.object.as_ref().is_some_and(|o| o.orientation.is_some() || o.rpy.is_some());
        if in_object_axes && !turned {
            return Err(self.mapping.wrong(key("axes"), "expected object.orientation or object.rpy, found neither"));
        }
        let frame = self.frame(quantity, raw.frame.as_deref())?;
        let source = (raw.topic.as_ref(), raw.at.as_str(), raw.stamp.as_ref(), raw.offset_secs);
        self.track(quantity, source, picks, vec![unit; 3])?;
        Ok(RateGeometry { in_object_axes, frame })
    }

    pub(crate) fn scalar(
        &mut self,
        quantity: Quantity,
        raw: Option<&RawScalar>,
        dimension: Option<Dimension>,
    ) -> Result<(), Error> {
        let Some(raw) = raw else { return Ok(()) };
        let unit = match dimension {
            Some(dimension) => self.factor(format!("{}.unit", quantity.key()), dimension, raw.unit.as_deref())?,
            None if raw.unit.is_some() => {
                let reason = "expected none, as an action has no unit, found one";
                return Err(self.mapping.wrong(format!("{}.unit", quantity.key()), reason));
            }
            None => 1.0,
        };
        let source = (raw.topic.as_ref(), raw.at.as_str(), raw.stamp.as_ref(), raw.offset_secs);
        self.track(quantity, source, vec![pick(&raw.value)], vec![unit])?;
        Ok(())
    }

    pub(crate) fn label(&mut self, episodes: &RawEpisodes) -> Result<(), Error> {
        let RawEpisodes::Change(raw) = episodes else { return Ok(()) };
        let picks = vec![Pick::Value { path: raw.value.clone(), part: Part::All }];
        let source = (raw.topic.as_ref(), raw.at.as_str(), raw.stamp.as_ref(), raw.offset_secs);
        self.track(Quantity::Label, source, picks, vec![1.0])?;
        Ok(())
    }
}

const XYZ: [(&str, Option<usize>); 3] = [("x", Some(0)), ("y", Some(1)), ("z", Some(2))];

fn pick(scalar: &Scalar) -> Pick {
    match scalar {
        Scalar::Constant(value) => Pick::Constant(*value),
        Scalar::Path(path) => Pick::Value { path: path.clone(), part: Part::All },
    }
}
