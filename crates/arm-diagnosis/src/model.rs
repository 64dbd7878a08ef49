//! The model that was found, as files: `model.toml` with every value, and the robot's URDF as far as that has words for it.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use urdf_file::Dynamics;

use crate::diagnosis::{Diagnosis, InJoint, NamedEffect};
use crate::effect::Effect;
use crate::group::is_friction;
use crate::log::Log;

#[derive(Serialize)]
struct ModelFile<'a> {
    version: u32,
    robot: &'a str,
    effect: Vec<Entry<'a>>,
}

#[derive(Serialize)]
struct Entry<'a> {
    name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    joint: Option<&'a str>,
    confidence: f64,
    values: std::collections::BTreeMap<&'a str, f64>,
    intervals90: std::collections::BTreeMap<&'a str, [f64; 2]>,
}

impl<'a> Entry<'a> {
    fn new(effect: &NamedEffect, joint: &'a InJoint) -> Self {
        Self {
            name: joint.form,
            joint: joint.joint_name.as_deref(),
            confidence: effect.confidence,
            values: joint.parameters.iter().map(|value| (value.name, value.value)).collect(),
            intervals90: joint.parameters.iter().map(|value| (value.name, value.interval90)).collect(),
        }
    }
}

/// Text of `model.toml`: the named effects, an entry for each joint.
///
/// # Errors
///
/// Where a value is none that TOML holds.
pub fn model_toml(log: &Log, diagnosis: &Diagnosis) -> Result<String, toml::ser::Error> {
    let effects =
        diagnosis.effects.iter().flat_map(|effect| effect.joints.iter().map(move |joint| Entry::new(effect, joint)));
    toml::to_string(&ModelFile { version: 1, robot: &log.header.robot, effect: effects.collect() })
}

/// Text of `model.urdf`: the robot's file with the friction and the payload that were found; what the format cannot say stands in a comment. None where the
/// robot's file is no URDF.
#[must_use]
pub fn model_urdf(log: &Log, folder: &Path, diagnosis: &Diagnosis) -> Option<String> {
    let text = std::fs::read_to_string(folder.join(&log.header.robot)).ok()?;
    let mut joints: Vec<(&str, Dynamics)> = Vec::new();
    let (mut elements, mut unsaid) = (String::new(), Vec::new());
    for effect in &diagnosis.effects {
        for joint in &effect.joints {
            let value = |name: &str| joint.parameters.iter().find(|value| value.name == name).map(|value| value.value);
            let friction = Effect::find(joint.form).is_some_and(is_friction);
            if let (true, Some(name), Some(coulomb), Some(viscous)) =
                (friction, &joint.joint_name, value("coulomb"), value("viscous"))
            {
                joints.push((name, Dynamics { damping: viscous.max(0.0), friction: coulomb.max(0.0) }));
            }
            if let ("payload", Some(mass)) = (joint.form, value("mass").filter(|mass| *mass > 0.0)) {
                // A file that an earlier diagnosis wrote has one already.
                let name = (1..)
                    .map(|i| format!("surmise_payload_{i}"))
                    .find(|name| !text.contains(name.as_str()))
                    .unwrap_or_default();
                let at = ["com_x", "com_y", "com_z"].map(|name| value(name).unwrap_or(0.0));
                let _ = write!(
                    elements,
                    "  <link name=\"{name}\"><inertial><origin xyz=\"{} {} {}\"/><mass value=\"{mass}\"/>\
                     <inertia ixx=\"{i}\" ixy=\"0\" ixz=\"0\" iyy=\"{i}\" iyz=\"0\" izz=\"{i}\"/></inertial></link>\n  \
                     <joint name=\"{name}\" type=\"fixed\"><parent link=\"{}\"/><child link=\"{name}\"/></joint>\n",
                    at[0],
                    at[1],
                    at[2],
                    escaped(log.arm.tip()),
                    // Of a ball of 4 cm: the log hardly says more.
                    i = 0.4 * mass * 0.04 * 0.04,
                );
            }
            if joint.form != "joint_friction" && joint.form != "payload" {
                let place = joint.joint_name.as_deref().unwrap_or("the arm");
                unsaid.push(format!("{} of {place}", joint.form));
            }
        }
    }
    let changed = urdf_file::with_dynamics(&text, &joints)?;
    let mut note = String::from("  <!-- Friction and payload as `diagnose` found them.");
    if !unsaid.is_empty() {
        // Two hyphens would end the comment.
        let _ =
            write!(note, " URDF cannot say, or not in full: {}; see model.toml.", without_dashes(&unsaid.join(", ")));
    }
    note.push_str(" -->\n");
    urdf_file::with_elements(&changed, &format!("{note}{elements}"))
}

/// Text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Text for a comment, which two dashes would end.
fn without_dashes(text: &str) -> String {
    let mut text = text.replace('>', " ");
    while text.contains("--") {
        text = text.replace("--", "-");
    }
    text
}
