//! What to record next: the experiment that tells confusable effects apart.

use crate::diagnosis::Diagnosis;
use crate::report::Verdict;

/// Pairs that logs confuse, and what separates them (catalogue).
const PAIRS: &[(&str, &str, &str)] = &[
    ("viscous_damping", "quadratic_drag", "push and release at three speeds: drag grows with the square of the speed"),
    (
        "table_tilt",
        "constant_force",
        "repeat pushes with a known added weight: tilt scales with mass, a constant force does not",
    ),
    (
        "force_gain",
        "time_base",
        "let the object slide freely after a fast push: only the time base changes its deceleration",
    ),
    (
        "force_gain",
        "friction_level",
        "weigh the object or add a known weight: the gain scales all forces, friction only the table's",
    ),
    (
        "static_friction",
        "stribeck_friction",
        "start from rest by a slow ramp, then stop slowly: Stribeck shows at the end of a slide too",
    ),
    (
        "force_delay",
        "force_low_pass",
        "knock on the object: a late force is as sharp as the knock, a slow one is rounded",
    ),
    ("force_delay", "actuation_delay", "look at when the object starts to move: a late force does not shift it"),
    ("force_delay", "pose_delay", "compare with the tool's place at the first contact: only one of the two is late"),
    ("static_friction", "adhesion", "pull the tool back: what sticks to it follows, and the wrist is pulled"),
    (
        "static_friction",
        "backlash",
        "watch where a push begins again: static friction asks for a larger force first, with play the tool lags behind its command",
    ),
    ("anisotropic_friction", "table_tilt", "push in eight directions: tilt has one period per turn, anisotropy two"),
    ("friction_patch", "mass_leak", "repeat the same push elsewhere on the table"),
    ("tether", "friction_patch", "begin at different places: a tether grows with distance"),
    ("tether", "table_tilt", "begin far apart: a tether pulls towards one place, a tilt the same way everywhere"),
    (
        "tether",
        "constant_force",
        "begin far apart: a tether pulls towards one place, a constant force the same way everywhere",
    ),
    (
        "edge_rounding",
        "contact_compliance",
        "lay the object on a face and on an edge: soft contacts let it sink in both, round edges only on the edge",
    ),
    (
        "edge_rounding",
        "pressure_distribution",
        "let the object tumble: round edges change how it falls, a smaller sole does not",
    ),
    ("edge_rounding", "pose_scale", "read the height at rest on a face: only a wrong scale changes it"),
    ("com_offset", "pressure_distribution", "push left and right of the middle, and spin the object"),
    ("actuation_delay", "pose_delay", "look at when the force sets in: a late pose does not shift it"),
    ("actuator_gain", "pose_scale", "compare with the joint encoders in free motion"),
    ("pose_scale", "time_base", "read the height at rest: only a wrong scale changes it"),
    (
        "pose_rotation",
        "table_tilt",
        "carry the object at constant speed: in a turned frame it drifts in proportion to the distance",
    ),
    ("force_bias", "wrist_payload", "read the force without contact while the tool accelerates or turns"),
    ("force_bias", "force_drift", "read the force without contact for minutes"),
    ("contact_compliance", "actuation_delay", "push a light and a heavy object"),
    ("restitution", "contact_compliance", "hit at two speeds"),
    ("arm_compliance", "actuator_gain", "move freely: compliance shows only under load"),
    (
        "force_low_pass",
        "contact_compliance",
        "compare with the pose at contact: a slow force sensor does not move the object",
    ),
    (
        "time_base",
        "friction_level",
        "move freely along commands that change: only a wrong clock is early or late there",
    ),
    (
        "mass_leak",
        "force_drift",
        "weigh the object before and after, or read the force without contact: only a drift shows there",
    ),
    ("viscous_damping", "friction_level", "push at two speeds: friction does not grow with speed"),
    (
        "wrist_payload",
        "force_gain",
        "move freely in several directions: a payload is felt there, a gain has nothing to scale",
    ),
    (
        "joint_friction",
        "wrist_payload",
        "move freely back and forth at constant speed: friction changes its sign, weight does not",
    ),
    ("backlash", "actuation_delay", "reverse at two speeds: play takes the same distance, a delay the same time"),
    (
        "rolling_resistance",
        "viscous_damping",
        "let it roll with and without a known weight: damping slows a heavier one less, rolling resistance as much",
    ),
    ("hidden_obstacle", "friction_patch", "cross the place from all sides: a body stops the object, a patch slows it"),
    (
        "time_base",
        "force_low_pass",
        "move freely along commands that change: a slow force sensor leaves poses where they are",
    ),
];

/// What logs confuse an effect with, and what separates the two.
pub fn look_alikes(name: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    PAIRS.iter().filter_map(move |(a, b, how)| match (*a == name, *b == name) {
        (true, _) => Some((*b, *how)),
        (_, true) => Some((*a, *how)),
        _ => None,
    })
}

/// Of the episodes of a log the one that says most of which of two names it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telling {
    /// Number of the episode in the log.
    pub episode: u64,
    /// What it adds to the ln odds of the first name.
    pub ln_odds: f64,
}

/// Which episode tells the first two of a confusion set apart, where both were fitted to all.
pub(crate) fn telling(diagnosis: &Diagnosis, confusion_set: &[&str]) -> Option<Telling> {
    let [first, second, ..] = confusion_set else { return None };
    let round = diagnosis.rounds.first()?;
    let costs = |name: &str| -> Option<Vec<f64>> {
        let rival = round.rivals.iter().find(|rival| rival.whole && rival.kind().name() == name)?;
        let costs = rival.fit.residuals.costs();
        let of = |place: usize| costs.get(place).copied();
        (diagnosis.pieces.iter()).map(|group| group.clone().map(of).sum::<Option<f64>>()).collect()
    };
    let (first, second) = (costs(first)?, costs(second)?);
    let odds = first.iter().zip(&second).map(|(first, second)| second - first).zip(&diagnosis.fitted_ids);
    odds.map(|(ln_odds, id)| Telling { episode: *id, ln_odds })
        .max_by(|a, b| a.ln_odds.abs().total_cmp(&b.ln_odds.abs()))
}

/// A mean square, re-tuned, above which a gap is open.
pub(crate) const OPEN: f64 = 1.5;
/// One that no weak effect makes.
const FAR: f64 = 100.0;

/// What to do next; `named`: whether something was, or the confusion set is but what the evidence leans to. `before`: held-out mean square, re-tuned; `telling`: what
/// tells the first two apart; `contacts`: what to do about contacts of an unknown gap that begin apart.
#[must_use]
pub fn next_experiment(
    verdict: Verdict,
    named: bool,
    confusion_set: &[&str],
    before: f64,
    telling: Option<Telling>,
    contacts: Option<&str>,
) -> String {
    if verdict != Verdict::Effect && before > FAR {
        return format!(
            "First check log.toml and the samples. A held-out error of {before:.0} comes from a wrong unit, frame, sign or order of a quaternion \
             more often than from an effect."
        );
    }
    let first = confusion_set.first().filter(|_| named);
    let like = telling.map_or(String::new(), |Telling { episode, ln_odds }| {
        format!(" In this log episode {episode} tells most ({ln_odds:+.1} in ln odds): record more like it.")
    });
    for (place, other) in confusion_set.iter().enumerate().skip(1) {
        // What tells the first two apart says nothing of the first and a third.
        let like = if place == 1 { like.as_str() } else { "" };
        let pair = PAIRS.iter().find(|(a, b, _)| first == Some(a) && other == b || first == Some(b) && other == a);
        if let Some((a, b, how)) = pair {
            return format!("{a} or {b}: {how}.{like}");
        }
    }
    const DESIGNED: &str = "a designed set (eight directions, four speeds, known added weights)";
    match (verdict, confusion_set) {
        (Verdict::None, _) if before > OPEN => contacts
            .unwrap_or(
                "Engines and real contacts can differ by what is left, and that may hide an effect as large. Repeat the worst episodes and change one \
                 thing at a time: place, direction, speed, added weight, time.",
            )
            .into(),
        (Verdict::None, []) => format!("None is needed. Smaller effects would show in {DESIGNED}."),
        (Verdict::None, names) => {
            format!("None is needed. Whether there is a weak {} would show in {DESIGNED}.", names.join(" or "))
        }
        (Verdict::Unknown, _) => contacts
            .unwrap_or("Repeat the worst episodes and change one thing at a time: place, direction, speed, added weight, time.")
            .into(),
        (Verdict::Effect, [_]) => "None is needed for the name. More episodes would narrow the intervals.".into(),
        (Verdict::Effect, names) => format!("{}: {DESIGNED}.{like}", names.join(" or ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_of_effects_and_stand_once() {
        use physics_model::EffectKind;
        for (place, (a, b, _)) in PAIRS.iter().enumerate() {
            assert!(a != b && a.parse::<EffectKind>().is_ok() && b.parse::<EffectKind>().is_ok(), "{a}, {b}");
            assert!(!PAIRS[..place].iter().any(|(c, d, _)| (c, d) == (a, b) || (c, d) == (b, a)), "{a}, {b}");
        }
        assert_eq!(look_alikes("quadratic_drag").map(|(name, _)| name).collect::<Vec<_>>(), ["viscous_damping"]);
        assert!(look_alikes("viscous_damping").any(|(name, how)| name == "quadratic_drag" && how.contains("speed")));
    }

    #[test]
    fn a_pair_is_told_apart_only_if_one_of_it_is_named() {
        let pair = ["mass_leak", "force_drift"];
        assert!(
            next_experiment(Verdict::Effect, true, &pair, 3.0, None, None)
                .starts_with("mass_leak or force_drift: weigh")
        );
        assert!(next_experiment(Verdict::Unknown, true, &pair, 3.0, None, None).contains("weigh"));
        assert!(next_experiment(Verdict::Unknown, true, &pair, 300.0, None, None).contains("a wrong unit"));
        let telling = Some(Telling { episode: 7, ln_odds: 2.34 });
        assert!(
            next_experiment(Verdict::Effect, true, &pair, 3.0, telling, None).contains("episode 7 tells most (+2.3 in")
        );
        assert!(next_experiment(Verdict::Unknown, false, &pair, 3.0, None, None).starts_with("Repeat"));
        assert!(next_experiment(Verdict::Unknown, false, &pair, 3.0, None, Some("Knock.")).starts_with("Knock"));
        assert!(
            next_experiment(Verdict::None, false, &pair, 1.2, None, None)
                .contains("a weak mass_leak or force_drift would show")
        );
        assert!(next_experiment(Verdict::None, false, &[], 1.2, None, None).contains("Smaller effects"));
        // Nothing is closed where a gap is open.
        assert!(next_experiment(Verdict::None, false, &[], 3.0, None, None).contains("may hide an effect"));
        assert!(next_experiment(Verdict::None, false, &[], 3.0, None, Some("Knock.")).starts_with("Knock"));
    }
}
