//! `log.toml` of a joint log.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, refuse};

/// Size of a header.
const MOST_BYTES: u64 = 4 << 20;

/// What `log.toml` says about a log of joints.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of the format: 1.
    pub version: u32,
    /// URDF file, relative to the log's folder.
    pub robot: String,
    /// Names of the joints in the order of the columns; by default those of the longest chain.
    pub joints: Option<Vec<String>>,
    /// Link at which a payload hangs; by default the last one.
    pub tip_link: Option<String>,
    /// Usual time between rows, s.
    pub period_secs: f64,
    /// Acceleration of free fall, m/s².
    #[serde(default = "standard_gravity")]
    pub gravity_mps2: f64,
    /// Standard deviations of the sensors, where known.
    #[serde(default)]
    pub noise: Noise,
    /// The controller of joints whose torques are not measured.
    pub servo: Option<Servo>,
    /// What is known of motors and gears.
    #[serde(default)]
    pub gear: Gear,
}

/// What is known of motors and gears, which a URDF has no words for.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gear {
    /// Inertia of the motors, seen through the gears, kg·m².
    pub reflected_inertia_kgm2: Option<Numbers>,
    /// Torque of a joint for each ampere of its motor, gear included, N·m/A; for logs of currents.
    pub torque_constant_nmpa: Option<Numbers>,
}

/// Standard deviations of readings; what is missing is estimated.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// rad.
    pub joint_position_rad: Option<Numbers>,
    /// rad/s.
    pub joint_velocity_rps: Option<Numbers>,
    /// N·m.
    pub joint_torque_nm: Option<Numbers>,
}

/// Torque = stiffness · (commanded − measured position) − damping · velocity.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Servo {
    /// N·m/rad.
    pub stiffness_nmprad: Numbers,
    /// N·m·s/rad.
    pub damping_nmsprad: Numbers,
}

/// One number for all joints, or one for each.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Numbers {
    /// The same for all.
    One(f64),
    /// One a joint.
    Each(Vec<f64>),
}

impl Numbers {
    /// Of one joint; none where the list is too short.
    #[must_use]
    pub fn of(&self, joint: usize) -> Option<f64> {
        match self {
            Self::One(value) => Some(*value),
            Self::Each(values) => values.get(joint).copied(),
        }
    }
}

fn standard_gravity() -> f64 {
    9.81
}

/// Whether `log.toml` in a folder is that of a joint log: it has no object, but a list of joints or an arm of one's own. A file that cannot be
/// read is none.
#[must_use]
pub fn is_joint_log(folder: &Path) -> bool {
    let Ok(bytes) = whole_file::read(&folder.join("log.toml"), MOST_BYTES) else { return false };
    let table: Option<toml::Table> = std::str::from_utf8(&bytes).ok().and_then(|text| text.parse().ok());
    table.is_some_and(|table| {
        let named = table.get("robot").and_then(toml::Value::as_str);
        let own = named.is_some_and(|robot| !["sawyer", "jaco", "none"].contains(&robot));
        !table.contains_key("object") && (own || table.contains_key("joints"))
    })
}

impl Header {
    /// Reads `log.toml` of a folder.
    ///
    /// # Errors
    ///
    /// [`Error`] if it cannot be read, has an unknown, missing or unfit key.
    pub fn read(folder: &Path) -> Result<Self, Error> {
        let path = folder.join("log.toml");
        let bytes = whole_file::read(&path, MOST_BYTES)
            .map_err(|error| Error::Read { path: path.clone(), source: error.source })?;
        let text = std::str::from_utf8(&bytes).map_err(|_| refuse(&path, "expected UTF-8 text"))?;
        let refused = |key: Option<String>, error: &toml::de::Error| {
            let line = whole_file::line_of(text, error.span().map_or(0, |span| span.start));
            let key = key.map_or(String::new(), |key| format!("key `{}`: ", whole_file::key_of(&key, error.message())));
            refuse(&path, &format!("line {line}: {key}{}", whole_file::plain(error.message())))
        };
        let source = toml::Deserializer::parse(text).map_err(|error| refused(None, &error))?;
        let header: Self = serde_path_to_error::deserialize(source).map_err(|error| {
            let key = whole_file::one_line(&error.path().to_string(), 200);
            refused(Some(key), &error.into_inner())
        })?;
        header.check(&path)?;
        Ok(header)
    }

    fn check(&self, path: &Path) -> Result<(), Error> {
        if self.version != 1 {
            return Err(refuse(path, &format!("version = {}, expected 1", self.version)));
        }
        if !(self.period_secs > 0.0 && self.period_secs <= 1.0) {
            return Err(refuse(
                path,
                &format!("period_secs = {:?}, expected seconds, above 0 and at most 1", self.period_secs),
            ));
        }
        if !(0.0..=100.0).contains(&self.gravity_mps2) {
            return Err(refuse(path, &format!("gravity_mps2 = {:?}, expected 0 to 100 m/s²", self.gravity_mps2)));
        }
        Ok(())
    }

    /// Checks lists against the number of joints.
    pub(crate) fn check_lists(&self, path: &Path, joints: usize) -> Result<(), Error> {
        let servo = self.servo.as_ref();
        let lists = [
            ("noise.joint_position_rad", self.noise.joint_position_rad.as_ref()),
            ("noise.joint_velocity_rps", self.noise.joint_velocity_rps.as_ref()),
            ("noise.joint_torque_nm", self.noise.joint_torque_nm.as_ref()),
            ("servo.stiffness_nmprad", servo.map(|servo| &servo.stiffness_nmprad)),
            ("servo.damping_nmsprad", servo.map(|servo| &servo.damping_nmsprad)),
            ("gear.reflected_inertia_kgm2", self.gear.reflected_inertia_kgm2.as_ref()),
            ("gear.torque_constant_nmpa", self.gear.torque_constant_nmpa.as_ref()),
        ];
        for (key, list) in lists {
            let Some(list) = list else { continue };
            if let Numbers::Each(values) = list
                && values.len() != joints
            {
                return Err(refuse(path, &format!("{key} has {} numbers, expected one, or {joints}", values.len())));
            }
            let positive =
                key.starts_with("noise") || key == "servo.stiffness_nmprad" || key == "gear.torque_constant_nmpa";
            let least = if positive { f64::MIN_POSITIVE } else { 0.0 };
            if let Some(wrong) =
                (0..joints).filter_map(|j| list.of(j)).find(|value| !(*value >= least && value.is_finite()))
            {
                let or = if key.starts_with("noise") { ", or no such key: then it is estimated" } else { "" };
                return Err(refuse(path, &format!("{key} has {wrong}, expected a positive number{or}")));
            }
        }
        Ok(())
    }
}
