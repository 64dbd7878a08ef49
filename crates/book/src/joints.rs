//! The page of what a log of an arm's joints may show.

use arm_diagnosis::{EFFECTS, Effect};

use crate::Page;
use crate::markdown::{MADE, cell, escaped, table};

pub(crate) fn page() -> Page {
    let rows: Vec<Vec<String>> = EFFECTS
        .iter()
        .map(|effect| vec![format!("[`{0}`](#{0})", effect.name), place(effect).into(), cell(effect.summary)])
        .collect();
    let mut text = format!(
        "{MADE}\n# Effects of joints\n\nThis page describes the {} effects that `diagnose` can name by [a log of an arm's joints](joint-log.md).\n\n\
         Effects of a joint are named with the joints that have them. Symbols: τ is the torque that the gear passes on, v the speed of the joint, and q its angle. \
         What is plausible is the spread of the prior, or the settings that are tried. It scales with the *usual torque*, the root mean square of the joint's \
         torques in the log, and with its *usual speed*. A joint that slides has N where others have N m, and m for rad. \
         `cargo xtask diagnose --list-effects` prints this page too.\n\n{}",
        EFFECTS.len(),
        table(&["effect", "of", "what it is"], &rows)
    );
    for effect in EFFECTS {
        text += &section(effect);
    }
    Page::new("reference/joint-effects.md", text)
}

fn place(effect: &Effect) -> &'static str {
    if effect.of_joint { "a joint" } else { "the arm" }
}

fn section(effect: &Effect) -> String {
    let unit = |unit: &str| if unit == "1" { "–".to_owned() } else { cell(unit) };
    let rows: Vec<Vec<String>> = effect
        .parameters
        .iter()
        .map(|value| vec![format!("`{}`", value.name), unit(value.unit), cell(effect.plausible(value))])
        .collect();
    let mut text = format!(
        "\n## {}\n\n{}\n\nShown by: {}.\n\n",
        effect.name,
        table(&["value", "unit", "plausible"], &rows),
        escaped(effect.shows)
    );
    for (other, tell_apart) in effect.look_alikes {
        text += &format!("- Looks like [{other}](#{other}). To tell: {}.\n", escaped(tell_apart));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_joints_has_a_row_and_a_section() {
        let text = page().text;
        for effect in EFFECTS {
            assert!(text.contains(&format!("| [`{0}`](#{0}) | {1} |", effect.name, place(effect))), "{}", effect.name);
            assert!(text.contains(&format!("\n## {}\n", effect.name)), "{}", effect.name);
        }
        assert!(text.contains("| `delay` | s | within about 0.02 |"), "{text}");
    }
}
