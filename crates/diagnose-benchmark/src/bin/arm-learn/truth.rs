//! What a simulated log hides.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result};
use arm_diagnosis::{Considered, Diagnosis, Effect, InJoint, is_friction};
use serde::Deserialize;
use serde_json::Value as Json;

/// Change of torques, mean square in variances of the noise, from which an effect counts as shown.
const SHOWS: f64 = 3.0;

/// An entry of truth.json.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Truth {
    pub(crate) effect: String,
    joints: Vec<usize>,
    parameters: BTreeMap<String, Json>,
    pub(crate) engine: String,
    pub(crate) motion: String,
    pub(crate) servo: bool,
    visible: f64,
}

/// Logs of a folder, by name.
pub(crate) fn read_truths(set: &Path) -> Result<BTreeMap<String, Truth>> {
    let path = set.join("truth.json");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

impl Truth {
    pub(crate) fn is_none(&self) -> bool {
        self.effect == "none"
    }

    pub(crate) fn is_outside(&self) -> bool {
        self.effect.starts_with("outside")
    }

    /// Whether it changes the readings.
    pub(crate) fn shows(&self) -> bool {
        self.visible >= SHOWS
    }

    /// Whether a kind of friction is hidden.
    pub(crate) fn is_friction(&self) -> bool {
        Effect::find(&self.effect).is_some_and(is_friction)
    }

    /// Whether an effect is the hidden one, in a joint that has it.
    pub(crate) fn is(&self, one: &Considered) -> bool {
        one.name == self.effect && self.is_kin(one)
    }

    /// The same with all kinds of friction taken for one.
    pub(crate) fn is_kin(&self, one: &Considered) -> bool {
        let Some(effect) = Effect::find(&one.name) else { return false };
        let place = !effect.of_joint || one.joints.first().is_some_and(|joint| self.joints.contains(joint));
        place && (one.name == self.effect || (is_friction(effect) && self.is_friction()))
    }

    fn number(&self, key: &str, place: usize) -> Option<f64> {
        match self.parameters.get(key)? {
            Json::Array(list) => list.get(place)?.as_f64(),
            value => value.as_f64(),
        }
    }
}

/// How far the values of the hidden effect are off, in halves of their intervals, by parameter; empty where it was not found.
pub(crate) fn off(truth: &Truth, diagnosis: &Diagnosis) -> BTreeMap<String, f64> {
    let found = diagnosis.found.iter().find(|effect| effect.name == truth.effect);
    let mut all = BTreeMap::new();
    for joint in found.map_or(&[][..], |effect| effect.joints.as_slice()) {
        let place = joint.joint.map_or(Some(0), |index| truth.joints.iter().position(|other| *other == index));
        let Some(place) = place.filter(|_| joint.form == truth.effect) else { continue };
        for (name, value) in values(truth, place, joint) {
            all.insert(format!("{name} {}", joint.joint.map_or_else(String::new, |index| index.to_string())), value);
        }
    }
    all
}

fn values(truth: &Truth, place: usize, joint: &InJoint) -> Vec<(&'static str, f64)> {
    let key = |name: &str| -> Option<f64> {
        let number = |key: &str| truth.number(key, place);
        match (truth.effect.as_str(), name) {
            // What drifts has no one value.
            ("drifting_friction", _) => None,
            (_, "coulomb") => number("coulomb_nm"),
            (_, "viscous") => number("viscous_nmsprad"),
            (_, "peak") => number("peak_nm"),
            (_, "load") => number("load_share"),
            (_, "driving") => number("driving_share"),
            (_, "driven") => number("driven_share"),
            ("reflected_inertia", _) => number("inertia_kgm2"),
            ("torque_ripple", "amplitude") => number("amplitude_nm"),
            ("torque_gain", _) => number("gain"),
            ("torque_offset", _) => number("offset_nm"),
            ("encoder_offset", _) => number("offset_rad"),
            ("encoder_eccentricity", "amplitude") => number("amplitude_rad"),
            ("joint_elasticity", _) => number("stiffness_nmprad"),
            ("backlash", "play") => number("gap_rad"),
            ("backlash", "stiffness") => number("stiffness_nmprad"),
            ("torque_delay", _) => number("delay_secs"),
            ("payload", "mass") => number("mass_kg"),
            ("payload", "com_x") => truth.number("com_in_tip_m", 0),
            ("payload", "com_y") => truth.number("com_in_tip_m", 1),
            ("payload", "com_z") => truth.number("com_in_tip_m", 2),
            ("gravity_compensation", _) => number("share"),
            ("base_tilt", "slope_x") => truth.number("gravity_in_base_mps2", 0).map(|g| g / 9.81),
            ("base_tilt", "slope_y") => truth.number("gravity_in_base_mps2", 1).map(|g| g / 9.81),
            _ => None,
        }
    };
    let inside = |value: &arm_diagnosis::Value| {
        let truth = key(value.name)?;
        let end = if truth > value.value { value.interval90[1] } else { value.interval90[0] };
        Some((value.name, (truth - value.value) / (end - value.value)))
    };
    joint.parameters.iter().filter_map(inside).collect()
}
