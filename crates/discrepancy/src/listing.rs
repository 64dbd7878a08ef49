//! All effects that a diagnosis may name, as `diagnose --list-effects` and the page of effects in the book have them.

use physics_model::EffectKind;
use physics_model::effect::Sheet;
use serde::Serialize;

use crate::separate::look_alikes;

/// An effect with what it is confused with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// What the docs of the effect say.
    pub effect: Sheet,
    /// Whether a diagnosis names it. How stiff contacts are is re-tuned and told, and is no effect.
    pub named: bool,
    /// Effects that leave similar traces, and how to tell them apart.
    pub look_alikes: Vec<LookAlike>,
}

/// An effect that leaves similar traces.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LookAlike {
    /// Its name.
    pub name: &'static str,
    /// What to record, or to look at, to tell the two apart.
    pub tell_apart: &'static str,
}

/// All effects as JSON: those of objects and their world, and those that a log of joints may show.
#[derive(Serialize)]
pub struct List {
    /// See [`effects`].
    pub effects: Vec<Entry>,
    /// Of joints and arms.
    pub joint_effects: Vec<JointEntry>,
}

/// An effect of a joint or an arm.
#[derive(Serialize)]
pub struct JointEntry {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub summary: &'static str,
    /// Whether it is of one joint, rather than of the whole arm.
    pub of_joint: bool,
    /// Its values.
    pub parameters: Vec<JointParameter>,
    /// Motion that shows it.
    pub shows: &'static str,
    /// Effects that leave similar traces.
    pub look_alikes: Vec<LookAlike>,
}

/// A value of such an effect.
#[derive(Serialize)]
pub struct JointParameter {
    /// Its name.
    pub name: &'static str,
    /// SI; of a joint that turns.
    pub unit: &'static str,
    /// Where it is expected.
    pub plausible: &'static str,
}

/// All effects, of objects and of joints.
#[must_use]
pub fn list() -> List {
    let joint = |effect: &arm_diagnosis::Effect| JointEntry {
        name: effect.name,
        summary: effect.summary,
        of_joint: effect.of_joint,
        parameters: (effect.parameters.iter())
            .map(|value| JointParameter { name: value.name, unit: value.unit, plausible: effect.plausible(value) })
            .collect(),
        shows: effect.shows,
        look_alikes: effect.look_alikes.iter().map(|(name, tell_apart)| LookAlike { name, tell_apart }).collect(),
    };
    List { effects: effects(), joint_effects: arm_diagnosis::EFFECTS.iter().map(joint).collect() }
}

/// All effects, in the order of the catalogue.
#[must_use]
pub fn effects() -> Vec<Entry> {
    let entry = |kind: &EffectKind| {
        let look_alikes = look_alikes(kind.name()).map(|(name, tell_apart)| LookAlike { name, tell_apart });
        Entry { effect: kind.sheet(), named: crate::candidate::is_named(*kind), look_alikes: look_alikes.collect() }
    };
    EffectKind::ALL.iter().map(entry).collect()
}

/// Said of what is re-tuned.
pub const NEVER_NAMED: &str = "Re-tuned and told by a diagnosis, never named: contacts of engines differ by as much.";

/// Columns of a line of text.
const COLUMNS: usize = 100;

/// All effects as text for a terminal.
#[must_use]
pub fn text() -> String {
    let mut text = String::new();
    for entry in effects() {
        let effect = &entry.effect;
        text += &format!("{}\n", effect.name);
        let mut say = |said: &str| text += &wrapped(said);
        say(&effect.summary);
        say(&effect.equation);
        for row in &effect.parameters {
            let unit = if row.unit == "–" { String::new() } else { format!(" in {}", row.unit) };
            let neutral = if row.neutral == "–" { String::new() } else { format!("; no effect at: {}", row.neutral) };
            say(&format!("{} = {}{unit}: {}{neutral}", row.symbol, row.keys.join(", "), row.plausible));
        }
        say(&effect.shows);
        if !entry.named {
            say(NEVER_NAMED);
        }
        for other in &entry.look_alikes {
            say(&format!("Looks like {}. To tell: {}.", other.name, other.tell_apart));
        }
        text.push('\n');
    }
    text += &format!("{} effects. The book shows what each does to a push: cargo xtask docs\n", EffectKind::ALL.len());
    text + &of_joints()
}

/// Those that a log of joints alone may show.
fn of_joints() -> String {
    let mut text = String::from("\nOf an arm, by a log of its joints:\n\n");
    for effect in arm_diagnosis::EFFECTS {
        let place = if effect.of_joint { "of a joint" } else { "of the arm" };
        text += &format!("{} ({place})\n", effect.name);
        let mut say = |said: &str| text += &wrapped(said);
        say(effect.summary);
        for value in effect.parameters {
            let unit = if value.unit == "1" { String::new() } else { format!(" in {}", value.unit) };
            say(&format!("{}{unit}: {}", value.name, effect.plausible(value)));
        }
        say(&format!("{}.", effect.shows));
        for (name, tell_apart) in effect.look_alikes {
            say(&format!("Looks like {name}. To tell: {tell_apart}."));
        }
        text.push('\n');
    }
    text
}

/// Lines that begin with four spaces; further ones of the same paragraph with six.
fn wrapped(paragraph: &str) -> String {
    let (mut lines, mut line) = (String::new(), "    ".to_owned());
    for word in paragraph.split_whitespace() {
        if line.chars().count() + word.chars().count() >= COLUMNS {
            lines += &format!("{}\n", line.trim_end());
            line = "      ".into();
        }
        line += word;
        line.push(' ');
    }
    lines + line.trim_end() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_listed_with_its_parameters_and_its_look_alikes() {
        let text = text();
        for kind in EffectKind::ALL {
            assert!(text.lines().any(|line| line == kind.name()), "{}", kind.name());
        }
        assert!(text.contains("torque_delay (of the arm)\n"), "{text}");
        assert!(text.contains("    delay in s: within about 0.02\n"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= COLUMNS), "{text}");
        assert!(text.contains("c = coefficient_nspm in N·s/m: 0.1 to 2; no effect at: 0"), "{text}");
        assert!(text.contains("Looks like quadratic_drag. To tell: push and release at three speeds"), "{text}");
        assert_eq!(wrapped(&"word ".repeat(30)).lines().count(), 2);
    }
}
