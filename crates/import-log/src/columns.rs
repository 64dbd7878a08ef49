//! What columns may be, by their names.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::mapping::FILL;

/// Words for a quantity; what stands first wins.
const ROLES: [(&str, &[&str]); 3] = [
    ("command", &["command", "commanded", "cmd", "desired", "target", "goal", "setpoint", "reference", "ref"]),
    ("tool", &["tool", "tcp", "ee", "eef", "effector", "gripper", "hand", "flange", "probe", "finger", "pusher"]),
    ("object", &["object", "obj", "block", "box", "cube", "puck", "slider", "body", "marker", "ball"]),
];

/// Units as names of columns write them, and as a mapping does.
const UNITS: [(&str, &str); 22] = [
    ("m", "m"),
    ("cm", "cm"),
    ("mm", "mm"),
    ("rad", "rad"),
    ("deg", "deg"),
    ("degrees", "deg"),
    ("n", "N"),
    ("mn", "mN"),
    ("nm", "Nm"),
    ("mnm", "mNm"),
    ("kg", "kg"),
    ("g", "g"),
    ("s", "s"),
    ("sec", "s"),
    ("secs", "s"),
    ("ms", "ms"),
    ("us", "us"),
    ("ns", "ns"),
    ("mps", "m/s"),
    ("rps", "rad/s"),
    ("dps", "deg/s"),
    ("rpm", "rpm"),
];

const TIMES: [&str; 5] = ["time", "t", "timestamp", "stamp", "clock"];
const EPISODES: [&str; 6] = ["episode", "trial", "push", "toss", "rollout", "run"];

fn words(name: &str) -> Vec<String> {
    let lower = name.to_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(String::from).collect()
}

/// The quantity that a name speaks of.
pub(crate) fn role(name: &str) -> Option<&'static str> {
    let words = words(name);
    let speaks =
        |list: &[&str]| words.iter().any(|word| list.contains(&word.trim_end_matches(|c: char| c.is_ascii_digit())));
    ROLES.iter().find(|(_, list)| speaks(list)).map(|(role, _)| *role)
}

/// Column names of one vector by component, with the unit that they end in.
#[derive(Debug, Default)]
struct Parts {
    columns: BTreeMap<usize, String>,
    unit: Option<&'static str>,
}

/// What the columns of a table may be.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    /// The column with the time, and its unit.
    pub(crate) time: Option<(String, &'static str)>,
    pub(crate) time_is_sure: bool,
    pub(crate) episode: Option<String>,
    action: Option<String>,
    added_mass: Option<(String, Option<&'static str>)>,
    /// By quantity and key, such as `object` and `orientation`.
    vectors: BTreeMap<(&'static str, &'static str), Parts>,
}

/// Guesses what the columns are.
pub(crate) fn guess(names: &[String]) -> Columns {
    let mut columns = Columns::default();
    for name in names {
        let words = words(name);
        let unit = words.last().and_then(|last| UNITS.iter().find(|(word, _)| word == last)).map(|(_, unit)| *unit);
        let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
        if let Some((key, part)) = component(&words, unit, role(name)) {
            let parts = columns.vectors.entry(key).or_default();
            parts.columns.entry(part).or_insert_with(|| name.clone());
            parts.unit = parts.unit.or(unit);
        } else if has(&["mass"]) && has(&["added", "weight", "payload"]) {
            columns.added_mass.get_or_insert((name.clone(), unit));
        } else if words == ["action"] {
            columns.action.get_or_insert_with(|| name.clone());
        } else if has(&TIMES) && columns.time.is_none() {
            columns.time = Some((name.clone(), unit.unwrap_or("s")));
            columns.time_is_sure = unit.is_some();
        } else if has(&EPISODES) {
            columns.episode.get_or_insert_with(|| name.clone());
        }
    }
    columns
}

/// The vector that a column is a part of, and which.
fn component(
    words: &[String],
    unit: Option<&'static str>,
    role: Option<&'static str>,
) -> Option<((&'static str, &'static str), usize)> {
    let has = |word: &str| words.iter().any(|other| other == word);
    let at = |list: [&str; 3]| list.iter().position(|word| has(word));
    let joint = words.iter().any(|word| word.starts_with("joint")) || has("q");
    if joint && role.is_none() {
        let digits = |word: &String| word.trim_start_matches(|c: char| c.is_alphabetic()).parse().ok();
        let index: usize = words.iter().find_map(digits)?;
        let effort = has("torque") || has("effort") || unit == Some("Nm");
        let rate = has("velocity") || has("vel") || unit == Some("rad/s");
        return (!rate).then_some(((if effort { "joint_torques" } else { "joints" }, "values"), index));
    }
    if let Some(role) = role.filter(|role| *role != "command") {
        let turn = ["qx", "qy", "qz", "qw"].iter().position(|word| has(word));
        if let Some(part) = turn {
            return Some(((role, "orientation"), part));
        }
        if let Some(part) = at(["roll", "pitch", "yaw"]).or_else(|| at(["rx", "ry", "rz"])) {
            return Some(((role, "rpy"), part));
        }
    }
    if role == Some("object") {
        if let Some(part) = at(["vx", "vy", "vz"]) {
            return Some((("object_velocity", "value"), part));
        }
        if let Some(part) = at(["wx", "wy", "wz"]) {
            return Some((("object_spin", "value"), part));
        }
    }
    let axis = at(["x", "y", "z"]);
    if let Some(part) = at(["fx", "fy", "fz"]).or(axis.filter(|_| has("force"))) {
        return Some((("wrench", "force"), part));
    }
    let torque = at(["tx", "ty", "tz"]).or_else(|| at(["mx", "my", "mz"]));
    if let Some(part) = torque.or(axis.filter(|_| has("torque")))
        && (role.is_none() || unit == Some("Nm"))
    {
        return Some((("wrench", "torque"), part));
    }
    let position = axis.or_else(|| at(["px", "py", "pz"]))?;
    Some(((role?, "position"), position))
}

impl Columns {
    fn whole(&self, section: &'static str, key: &'static str, count: usize) -> Option<(Vec<String>, Option<&str>)> {
        let parts = self.vectors.get(&(section, key))?;
        let names: Vec<String> = (0..count).map_while(|part| parts.columns.get(&part).cloned()).collect();
        (names.len() == count && parts.columns.len() == count).then_some((names, parts.unit))
    }

    /// The arm whose number of joints there is.
    pub(crate) fn robot(&self) -> &'static str {
        if self.whole("joints", "values", 7).is_some() {
            "sawyer"
        } else if self.whole("joints", "values", 6).is_some() {
            "jaco"
        } else {
            "none"
        }
    }

    /// The tables of a mapping for what is whole.
    pub(crate) fn sections(&self) -> Vec<String> {
        let joints = match self.robot() {
            "sawyer" => 7,
            "jaco" => 6,
            _ => 0,
        };
        let mut sections = Vec::new();
        for section in ["command", "tool", "object"] {
            let Some((names, unit)) = self.whole(section, "position", 3) else { continue };
            let mut text = format!("[{section}]\n");
            line(&mut text, "position", &names, "unit", unit, "m");
            if let Some((names, _)) = self.whole(section, "orientation", 4) {
                let _ = writeln!(text, "orientation = {}\norder = \"xyzw\"", list(&names));
            } else if let Some((names, unit)) = self.whole(section, "rpy", 3) {
                line(&mut text, "rpy", &names, "angle_unit", unit, "rad");
            }
            sections.push(text);
        }
        for section in ["joints", "joint_torques"] {
            if let Some((names, unit)) = self.whole(section, "values", joints).filter(|_| joints > 0) {
                let mut text = format!("[{section}]\n");
                line(&mut text, "values", &names, "unit", unit, if section == "joints" { "rad" } else { "Nm" });
                sections.push(text);
            }
        }
        if let Some((names, unit)) = self.whole("wrench", "force", 3) {
            let mut text = String::from("[wrench]\n");
            line(&mut text, "force", &names, "unit", unit, "N");
            if let Some((names, unit)) = self.whole("wrench", "torque", 3) {
                line(&mut text, "torque", &names, "torque_unit", unit, "Nm");
            }
            text.push_str(
                "of = \"world\"                    # GUESS: the force of the world on the tool, or of the tool\n",
            );
            text.push_str("axes = \"world\"                  # GUESS: world, tool, or sensor with its mount\n");
            sections.push(text);
        }
        for (section, other) in [("object_velocity", "m/s"), ("object_spin", "rad/s")] {
            if let Some((names, unit)) = self.whole(section, "value", 3) {
                let mut text = format!("[{section}]\n");
                line(&mut text, "value", &names, "unit", unit, other);
                text.push_str("axes = \"world\"                  # GUESS: world or object\n");
                sections.push(text);
            }
        }
        if let Some((name, unit)) = &self.added_mass {
            let (unit, mark) = (unit.unwrap_or("kg"), if unit.is_some() { "" } else { "  # GUESS" });
            sections.push(format!("[added_mass]\nvalue = {}\nunit = \"{unit}\"{mark}\n", quoted(name)));
        }
        if let Some(name) = self.action.as_ref().filter(|_| joints > 0) {
            sections.push(format!("[action]\nvalue = {}\n", quoted(name)));
        }
        if !sections.iter().any(|text| text.starts_with("[object]")) {
            sections.push(format!(
                "# [object]                       {FILL}: no columns look like the pose of the object\n\
                 # position = [\"\", \"\", \"\"]\n# orientation = [\"\", \"\", \"\", \"\"]\n# order = \"xyzw\"\n"
            ));
        }
        sections
    }

    /// The names that no table uses.
    pub(crate) fn unused(&self, names: &[String]) -> Vec<String> {
        let sections = self.sections().join("\n");
        let heads = [self.time.as_ref().map(|(name, _)| name), self.episode.as_ref()];
        let used = |name: &String| sections.contains(&quoted(name)) || heads.contains(&Some(name));
        names.iter().filter(|name| !used(name)).cloned().collect()
    }
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

fn list(names: &[String]) -> String {
    let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    format!("[{}]", names.join(", "))
}

fn line(text: &mut String, key: &str, names: &[String], unit_key: &str, unit: Option<&str>, other: &str) {
    let mark = if unit.is_some() { "" } else { "                      # GUESS" };
    let _ = writeln!(text, "{key} = {}\n{unit_key} = \"{}\"{mark}", list(names), unit.unwrap_or(other));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sections(names: &[&str]) -> (Columns, String) {
        let names: Vec<String> = names.iter().map(|name| (*name).to_string()).collect();
        let columns = guess(&names);
        let text = columns.sections().join("\n");
        (columns, text)
    }

    #[test]
    fn names_of_others_are_understood() {
        let (columns, text) = sections(&[
            "t_ms", "Trial", "tcp_x_mm", "tcp_y_mm", "tcp_z_mm", "block.qw", "block.qx", "block.qy", "block.qz",
            "block.px", "block.py", "block.pz", "ft_fx", "ft_fy", "ft_fz", "remark",
        ]);
        assert_eq!(columns.time, Some(("t_ms".into(), "ms")));
        assert_eq!(columns.episode.as_deref(), Some("Trial"));
        assert!(
            text.contains("[tool]\nposition = [\"tcp_x_mm\", \"tcp_y_mm\", \"tcp_z_mm\"]\nunit = \"mm\"\n"),
            "{text}"
        );
        let turned = "orientation = [\"block.qx\", \"block.qy\", \"block.qz\", \"block.qw\"]\norder = \"xyzw\"";
        assert!(text.contains(turned) && text.contains("unit = \"m\"                      # GUESS"), "{text}");
        assert!(text.contains("force = [\"ft_fx\""), "{text}");
        let names: Vec<String> = ["t_ms", "remark", "ft_fx"].map(String::from).into();
        assert_eq!(columns.unused(&names), ["remark"]);
    }

    #[test]
    fn an_arm_is_told_by_its_joints() {
        let (columns, text) =
            sections(&["joint_0_deg", "joint_1_deg", "joint_2_deg", "joint_3_deg", "joint_4_deg", "joint_5_deg"]);
        assert_eq!(columns.robot(), "jaco");
        assert!(text.contains("unit = \"deg\"\n"), "{text}");
    }
}
