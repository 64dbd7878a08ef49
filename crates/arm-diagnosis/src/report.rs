//! The answer in a file and on the terminal.

use serde::Serialize;

use crate::decision::Verdict;
use crate::diagnosis::{Diagnosis, InJoint, NamedEffect};
use crate::effect::Effect;
use crate::group::is_friction;
use crate::log::Log;
use crate::values::Value;

/// Content of `report.json`.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    /// In a sentence.
    pub summary: String,
    /// Names of the joints, in the order of the columns.
    pub joints: Vec<&'a str>,
    /// What was found.
    #[serde(flatten)]
    pub diagnosis: &'a Diagnosis,
    /// What to do next.
    pub next_experiment: String,
    /// Of the pieces that were held out.
    pub seed: u64,
    /// How long it took.
    pub seconds: f64,
}

impl<'a> Report<'a> {
    /// Of a diagnosis of a log that took so long.
    #[must_use]
    pub fn new(log: &'a Log, diagnosis: &'a Diagnosis, seed: u64, seconds: f64) -> Self {
        Self {
            summary: summary(diagnosis),
            joints: log.arm.joints().iter().map(|joint| joint.name.as_str()).collect(),
            diagnosis,
            next_experiment: next_experiment(diagnosis),
            seed,
            seconds,
        }
    }

    /// Text of `report.json`.
    ///
    /// # Errors
    ///
    /// Where a value is none that JSON holds.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// What the terminal shows, a line each.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let diagnosis = self.diagnosis;
        let mut lines = vec![self.summary.clone()];
        for effect in &diagnosis.effects {
            lines.push(format!("  {} (confidence {:.2}): {}", effect.name, effect.confidence, effect.summary));
            lines.extend(effect.joints.iter().map(|joint| format!("    {}", in_joint(effect, joint))));
        }
        if diagnosis.effects.is_empty() && !diagnosis.considered.is_empty() {
            let best = &diagnosis.considered[0];
            lines.push(format!(
                "  the evidence favours {}, but too little to name it ({:.2})",
                best.name, best.probability
            ));
        } else if diagnosis.confusion_set.len() > 1 {
            lines.push(format!("  this log does not tell apart: {}", diagnosis.confusion_set.join(", ")));
        }
        for cell in diagnosis.located.iter().filter(|cell| cell.share > 0.05).take(3) {
            let joint = self.joints[cell.joint];
            lines.push(format!(
                "  {:3.0} % of the gap: {joint}, {} ({:.0} % of the rows)",
                100.0 * cell.share,
                cell.phase,
                100.0 * cell.rows
            ));
        }
        let heldout = &diagnosis.heldout;
        lines.push(format!(
            "  held out ({} of {} pieces): {:.2} to {:.2} variances of noise; {:.1} % of the squared torque error is gone",
            heldout.pieces[1],
            heldout.pieces[0] + heldout.pieces[1],
            heldout.before,
            heldout.after,
            (1e3 * heldout.closed_fraction).floor() / 10.0
        ));
        for (what, factor) in ["masses", "centres of mass", "inertias"].iter().zip(diagnosis.mass_uncertainty) {
            if factor > 1.5 {
                lines.push(format!("  the {what} of the robot's file are {factor:.0} times less certain than usual"));
            }
        }
        lines.extend(diagnosis.notes.iter().map(|note| format!("  assumed: {note}")));
        lines.push(format!("  next experiment: {}", self.next_experiment));
        lines
    }
}

fn summary(diagnosis: &Diagnosis) -> String {
    let [effect, none, unknown] = diagnosis.probabilities.map(|p| 100.0 * p);
    match diagnosis.verdict {
        Verdict::Effect => {
            let named: Vec<String> = diagnosis.effects.iter().map(named).collect();
            format!("effect: {}", named.join("; "))
        }
        Verdict::None => format!("none: the model explains the log ({none:.0} %)"),
        Verdict::Unknown => format!(
            "unknown: something is missing that no effect of the catalogue explains ({unknown:.0} %; an effect {effect:.0} %)"
        ),
    }
}

fn named(effect: &NamedEffect) -> String {
    let joints: Vec<&str> = effect.joints.iter().filter_map(|joint| joint.joint_name.as_deref()).collect();
    if joints.is_empty() { effect.name.to_owned() } else { format!("{} in {}", effect.name, joints.join(", ")) }
}

fn in_joint(effect: &NamedEffect, joint: &InJoint) -> String {
    let values: Vec<String> = joint.parameters.iter().map(value).collect();
    let form = if joint.form == effect.name { String::new() } else { format!(" [{}]", joint.form) };
    let place = joint.joint_name.as_ref().map_or_else(String::new, |name| format!("{name}{form}: "));
    format!("{place}{}", values.join(", "))
}

pub(crate) fn value(value: &Value) -> String {
    let digits = digits(value);
    let [low, high] = value.interval90;
    let unit = if value.unit == "1" { String::new() } else { format!(" {}", value.unit) };
    // What a fit that allows no negative value left out has no interval.
    if [value.value, low, high] == [0.0; 3] {
        return format!("{} = 0{unit} (left out)", value.name);
    }
    format!("{} = {:.digits$}{unit} (90 %: {low:.digits$} to {high:.digits$})", value.name, value.value)
}

/// So many decimals that the interval has two digits.
fn digits(value: &Value) -> usize {
    let width = value.interval90[1] - value.interval90[0];
    let scale = if width > 0.0 && width.is_finite() { width } else { value.value.abs().max(1e-9) };
    (1.0 - scale.log10().floor()).clamp(0.0, 9.0) as usize
}

/// What would tell apart what this log does not.
fn next_experiment(diagnosis: &Diagnosis) -> String {
    let has = |name: &str| diagnosis.confusion_set.iter().any(|other| other == name);
    let frictions =
        diagnosis.confusion_set.iter().filter_map(|name| Effect::find(name)).filter(|effect| is_friction(effect));
    let sentence = if diagnosis.verdict == Verdict::Unknown {
        "move one joint at a time, slowly and fast, and in several postures: the joint and the phase that are left alone say what it is"
    } else if diagnosis.verdict == Verdict::None {
        "none needed for these motions; faster and slower ones, and other postures, may show more"
    } else if has("load_friction") && has("directional_friction") {
        "lift and lower a known load with the joint at the same speed: friction that depends on direction then differs"
    } else if frictions.count() > 1 {
        "move the joint to and fro at many constant speeds from 0.01 rad/s up, and reverse it slowly"
    } else if has("payload") || has("torque_gain") || has("gravity_compensation") {
        "hold several postures, with and without a known weight at the tip"
    } else if diagnosis.confusion_set.len() > 1 {
        "repeat the motion at half and at twice the speed: what depends on angle, speed and acceleration then parts"
    } else {
        "a log of another motion, to prove the model on it"
    };
    sentence.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_decimals_of_their_intervals_and_what_is_left_out_has_none() {
        let of = |name, at, interval90| value(&Value { name, unit: "N m", value: at, interval90, least: 0.0 });
        assert_eq!(of("coulomb", 0.5049, [0.4412, 0.5671]), "coulomb = 0.50 N m (90 %: 0.44 to 0.57)");
        assert_eq!(of("coulomb", 0.0, [0.0, 0.031]), "coulomb = 0.000 N m (90 %: 0.000 to 0.031)");
        assert_eq!(of("coulomb", 0.0, [0.0, 0.0]), "coulomb = 0 N m (left out)");
    }
}
