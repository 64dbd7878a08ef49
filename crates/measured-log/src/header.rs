//! What `log.toml` says: the rig, the nominal model, the noise.

use serde::Deserialize;

use crate::Number;
use crate::error::Problem;
use crate::outline;

/// Whose measurements these are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Robot {
    /// Rethink Sawyer with a ball, 7 joints.
    Sawyer,
    /// Kinova Jaco with its open hand, 6 joints.
    Jaco,
    /// A free object and, if the log has command or tool columns, a kinematic ball; z up.
    None,
}

impl Robot {
    /// Number of joints.
    #[must_use]
    pub fn joints(self) -> u8 {
        match self {
            Self::Sawyer => 7,
            Self::Jaco => 6,
            Self::None => 0,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Sawyer => "sawyer",
            Self::Jaco => "jaco",
            Self::None => "none",
        }
    }
}

/// Content of `log.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The arm.
    pub robot: Robot,
    /// Nominal time between rows, s. Rows may be missing.
    pub period_secs: f64,
    /// Radius of the ball that is the tool, m. Required if `robot` is "none" and there is a tool.
    pub tool_radius_m: Option<f64>,
    /// Coefficient of friction of the contact pair tool–object.
    pub tool_friction: Option<Number>,
    /// Gravity along −z, m/s².
    pub gravity_mps2: f64,
    /// What the object stands on.
    pub table: Table,
    /// Nominal model of the object.
    pub object: Object,
    /// Standard deviations of the sensors, where known.
    pub noise: Noise,
    /// The part that is held out to measure the error before and after.
    pub split: SplitConfig,
}

/// A horizontal plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table {
    /// Its height, m, base frame.
    pub height_m: Number,
    /// Coefficient of friction of the contact pair object–table.
    pub friction: Number,
}

/// Nominal model of the object.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Geometry.
    pub shape: Shape,
    /// Mass, kg.
    pub mass_kg: Number,
    /// Centre of mass, m, from the centre of the shape, object axes.
    pub com_m: [Number; 3],
    /// Principal moments of inertia about the centre of mass, kg m², object axes. If absent: those of a uniform solid.
    pub inertia_kgm2: Option<[Number; 3]>,
    /// Coefficient of restitution.
    pub restitution: Option<Number>,
}

/// Geometry about the centre that the object's pose gives.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A cuboid.
    Box {
        /// Full lengths along the object's axes, m.
        size_m: [Number; 3],
    },
    /// Its axis is the object's z.
    Cylinder {
        /// Radius, m.
        radius_m: Number,
        /// Full height, m.
        height_m: Number,
    },
    /// A ball.
    Sphere {
        /// Radius, m.
        radius_m: Number,
    },
    /// An outline in the object's xy plane, extruded by half the height to both sides.
    Prism {
        /// Corners in order, m; the last is joined to the first.
        outline_m: Vec<[f64; 2]>,
        /// Full height, m.
        height_m: Number,
        /// The points that it stands on, m; empty where it stands on all of its lower face.
        feet_m: Vec<[f64; 2]>,
    },
}

/// Standard deviations of the readings; what is `None` is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// Of each coordinate of the object's position, m.
    pub object_position_m: Option<f64>,
    /// Of the object's orientation about each axis, rad.
    pub object_orientation_rad: Option<f64>,
    /// Of each component of the object's velocity, m/s.
    pub object_velocity_mps: Option<f64>,
    /// Of each component of the object's angular velocity, rad/s.
    pub object_spin_rps: Option<f64>,
    /// Of each coordinate of the tool, m.
    pub tool_position_m: Option<f64>,
    /// Of each joint position, rad.
    pub joint_position_rad: Option<f64>,
    /// Of each component of the force at the wrist, N.
    pub wrist_force_n: Option<f64>,
    /// Of each component of the torque at the wrist, N·m.
    pub wrist_torque_nm: Option<f64>,
    /// Of each joint torque, N·m.
    pub joint_torque_nm: Option<f64>,
}

impl Noise {
    /// Key and value of each entry.
    pub(crate) fn entries(&self) -> [(&'static str, Option<f64>); 9] {
        [
            ("object_position_m", self.object_position_m),
            ("object_orientation_rad", self.object_orientation_rad),
            ("object_velocity_mps", self.object_velocity_mps),
            ("object_spin_rps", self.object_spin_rps),
            ("tool_position_m", self.tool_position_m),
            ("joint_position_rad", self.joint_position_rad),
            ("wrist_force_n", self.wrist_force_n),
            ("wrist_torque_nm", self.wrist_torque_nm),
            ("joint_torque_nm", self.joint_torque_nm),
        ]
    }
}

/// How many episodes are held out.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplitConfig {
    /// Share of the episodes, between 0 and 1.
    pub holdout_fraction: f64,
}

impl Header {
    /// The first value that is out of range.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        within("period_secs", self.period_secs.into(), Range::From(SMALLEST), 10.0)?;
        within("gravity_mps2", self.gravity_mps2.into(), Range::From(0.0), 100.0)?;
        if let Some(radius) = self.tool_radius_m {
            within("tool_radius_m", radius.into(), Range::From(SMALLEST), 10.0)?;
        }
        if let Some(friction) = self.tool_friction {
            within("tool_friction", friction, Range::From(0.0), 10.0)?;
        }
        within("table.height_m", self.table.height_m, Range::Any, 100.0)?;
        within("table.friction", self.table.friction, Range::From(0.0), 10.0)?;
        self.object.check()?;
        for (key, stddev) in self.noise.entries() {
            if let Some(stddev) = stddev {
                within(&format!("noise.{key}"), stddev.into(), Range::From(SMALLEST), 1e6)?;
            }
        }
        let fraction = self.split.holdout_fraction;
        if !(fraction > 0.0 && fraction < 1.0) {
            return Err(Problem::key(
                "split.holdout_fraction",
                format!("expected a number between 0 and 1, both excluded, found {fraction}"),
            ));
        }
        Ok(())
    }
}

impl Shape {
    /// Half extent along each of its axes, m. The centre of mass lies within.
    #[must_use]
    pub fn reach_m(&self) -> [f64; 3] {
        match self {
            Self::Box { size_m } => size_m.map(|size| 0.5 * size.mean()),
            Self::Cylinder { radius_m, height_m } => [radius_m.mean(), radius_m.mean(), 0.5 * height_m.mean()],
            Self::Sphere { radius_m } => [radius_m.mean(); 3],
            Self::Prism { outline_m, height_m, .. } => {
                let reach = |axis: usize| outline_m.iter().map(|corner| corner[axis].abs()).fold(0.0, f64::max);
                [reach(0), reach(1), 0.5 * height_m.mean()]
            }
        }
    }
}

impl Object {
    fn check(&self) -> Result<(), Problem> {
        let length = |key: &str, value: Number| within(key, value, Range::From(SMALLEST), 10.0);
        match &self.shape {
            Shape::Box { size_m } => {
                for (i, value) in size_m.iter().enumerate() {
                    length(&format!("object.size_m[{i}]"), *value)?;
                }
            }
            Shape::Cylinder { radius_m, height_m } => {
                length("object.size_m[0]", *radius_m)?;
                length("object.size_m[1]", *height_m)?;
            }
            Shape::Sphere { radius_m } => length("object.size_m[0]", *radius_m)?,
            Shape::Prism { outline_m, height_m, feet_m } => {
                length("object.height_m", *height_m)?;
                outline::check_outline(outline_m).map_err(|reason| Problem::key("object.outline_m", reason))?;
                outline::check_feet(feet_m).map_err(|reason| Problem::key("object.feet_m", reason))?;
            }
        }
        within("object.mass_kg", self.mass_kg, Range::From(SMALLEST), 1e4)?;
        let reach_m = self.shape.reach_m();
        for (i, value) in self.com_m.iter().enumerate() {
            within(&format!("object.com_m[{i}]"), *value, Range::Any, reach_m[i])?;
        }
        if let Some(inertia) = &self.inertia_kgm2 {
            for (i, value) in inertia.iter().enumerate() {
                within(&format!("object.inertia_kgm2[{i}]"), *value, Range::From(SMALLEST_INERTIA), 1e6)?;
            }
            let mean = inertia.map(Number::mean);
            let sum: f64 = mean.iter().sum();
            // A thin plate reaches equality; the margin is for rounding.
            if let Some(i) = mean.iter().position(|m| *m > (sum - m) * (1.0 + 1e-9)) {
                return Err(Problem::key(
                    format!("object.inertia_kgm2[{i}]"),
                    format!("expected at most the sum of the other two, as of every body, found {}", mean[i]),
                ));
            }
        }
        if let Some(restitution) = self.restitution {
            within("object.restitution", restitution, Range::From(0.0), 1.0)?;
        }
        Ok(())
    }
}

/// Smallest accepted positive value, in the unit of its key. Nothing that robots push is smaller, and smaller values
/// make simulations overflow.
const SMALLEST: f64 = 1e-9;
/// The same for a moment of inertia, kg m²: a grain of sand.
const SMALLEST_INERTIA: f64 = 1e-15;

#[derive(Clone, Copy, PartialEq)]
enum Range {
    /// Either sign.
    Any,
    /// This or more.
    From(f64),
}

/// Refuses values that are not finite or out of range, and standard deviations of 0.
fn within(key: &str, number: Number, range: Range, limit: f64) -> Result<(), Problem> {
    let low = match range {
        Range::Any => -limit,
        Range::From(low) => low,
    };
    let mean = number.mean();
    if !(mean >= low && mean <= limit) {
        // As short as they are written: 1e-9, 0, 1e300.
        let [low, mean] = [low, mean].map(|number| format!("{number:?}"));
        let [low, mean] = [&low, &mean].map(|number| number.trim_end_matches(".0"));
        return Err(Problem::key(key, format!("expected {low} to {limit}, found {mean}")));
    }
    if let Number::Uncertain { stddev, .. } = number
        && !(stddev > 0.0 && stddev.is_finite())
    {
        return Err(Problem::key(format!("{key}.stddev"), format!("expected more than 0, found {stddev}")));
    }
    Ok(())
}
