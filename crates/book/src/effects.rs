//! The page of effects and its pictures.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use discrepancy::listing::{Entry, NEVER_NAMED, effects};
use physics_model::EffectKind;
use scenario::{Problem, Selection};

use crate::Page;
use crate::markdown::{MADE, cell, escaped, table};
use crate::picture::picture;

pub(crate) fn pages(root: &Path) -> Result<Vec<Page>> {
    let selection = Selection { domain: "D1".into(), ..Selection::new(root) };
    let problem = Problem::assemble(&selection.load()?, root)?;
    let robot = Arc::new(problem.model.robot().clone());
    let entries = effects();
    let mut text = introduction(&entries);
    let mut pages = Vec::new();
    for (kind, entry) in EffectKind::ALL.iter().zip(&entries) {
        let picture = picture(*kind, &robot)?;
        text += &section(entry, &picture.caption);
        pages.push(Page::new(&format!("reference/effects/{}.svg", kind.name()), picture.svg));
    }
    pages.push(Page::new("reference/effects.md", text));
    Ok(pages)
}

fn introduction(entries: &[Entry]) -> String {
    let rows: Vec<Vec<String>> = entries
        .iter()
        .map(|entry| vec![format!("[`{0}`](#{0})", entry.effect.name), cell(&entry.effect.summary)])
        .collect();
    format!(
        "{MADE}\n# Effects\n\nThis page describes the {} physical effects that a scenario can add. `diagnose` can name all but `contact_compliance`.\n\n\
         Each picture shows one push with the effect and without it. A box of 8 × 6 × 5 cm and 0.5 kg lies on a table with friction 0.3. A ball of \
         2 cm radius pushes it by 12 cm at 0.3 m/s, stops, waits, and moves back by 4 cm. What is drawn is what the sensors read, without noise. Forces above 4 N, such as the knock at contact onset, are cut off. Where another \
         scene shows an effect better, the line under the picture says so. \
         `cargo xtask diagnose --list-effects` prints this page in a terminal, and with `--json` for programs.\n\n{}",
        entries.len(),
        table(&["effect", "what it is"], &rows)
    )
}

fn section(entry: &Entry, caption: &str) -> String {
    let effect = &entry.effect;
    let rows: Vec<Vec<String>> = effect
        .parameters
        .iter()
        .map(|row| {
            let keys: Vec<String> = row.keys.iter().map(|key| format!("`{key}`")).collect();
            let [symbol, unit, plausible, neutral, source] =
                [&row.symbol, &row.unit, &row.plausible, &row.neutral, &row.source].map(|text| cell(text));
            vec![symbol, keys.join(", "), unit, plausible, neutral, source]
        })
        .collect();
    let head = ["symbol", "key", "unit", "plausible", "no effect at", "source"];
    let mut text = format!(
        "\n## {name}\n\n{}\n\n> {}\n\n{}\n{}\n\n{}\n",
        escaped(&effect.summary),
        escaped(&effect.equation),
        table(&head, &rows),
        escaped(&effect.shows),
        escaped(&effect.acts),
        name = effect.name,
    );
    if !entry.named {
        text += &format!("\n{NEVER_NAMED}\n");
    }
    for other in &entry.look_alikes {
        text += &format!("\n- Looks like [{0}](#{0}). To tell: {1}.", other.name, escaped(other.tell_apart));
    }
    if !entry.look_alikes.is_empty() {
        text.push('\n');
    }
    let alternative = caption.replace('`', "");
    text + &format!("\n![{0}: {alternative}](effects/{0}.svg)\n\n*Drawn: {caption}*\n", effect.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_a_section_and_a_picture() {
        let root = scenario::find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        let pages = pages(&root).unwrap();
        let (page, pictures) = pages.split_last().unwrap();
        assert_eq!(pictures.len(), EffectKind::ALL.len());
        for (kind, picture) in EffectKind::ALL.iter().zip(pictures) {
            let name = kind.name();
            assert!(
                page.text.contains(&format!("\n## {name}\n")) && page.text.contains(&format!("(effects/{name}.svg)"))
            );
            assert!(picture.text.starts_with("<svg") && picture.text.len() < 40_000, "{name}: {}", picture.text.len());
        }
    }
}
