//! What to call it, and which model to keep: from the probabilities of a [`Decision`] to an effect, nothing, or something that the catalogue has not.

use crate::decision::{Decision, Probabilities};
use crate::findings::Findings;
use crate::fit::Fit;
use crate::likelihood::NOISE_FLOOR;
use crate::report::Verdict;
use crate::rival::Round;

/// An unknown gap is shown with the nearest effect if that is right with this probability or more.
const WORTH_TELLING: f64 = 0.2;

pub(crate) fn closed_fraction(before: f64, after: f64) -> f64 {
    let gap = before - NOISE_FLOOR;
    if gap > 0.0 { ((before - after) / gap).min(1.0) } else { 1.0 }
}

/// What was decided.
#[derive(Clone, Debug)]
pub(crate) struct Decided {
    pub(crate) verdict: Verdict,
    /// Of the best effect.
    pub(crate) probabilities: Probabilities,
    /// That each effect of the model is right.
    pub(crate) confidences: Vec<f64>,
    /// The model to keep.
    pub(crate) model: Fit,
    /// Why it is `unknown`.
    pub(crate) reason: Option<String>,
}

/// Decides from what a search accepted and compared. `findings`: what speaks for the first rival of each round, the first of which stands for the log.
pub(crate) fn decide(decision: &Decision, accepted: Fit, rounds: &[Round], findings: &[Findings]) -> Decided {
    let each: Vec<Probabilities> = findings.iter().map(|findings| decision.probabilities(findings)).collect();
    let probabilities = each[0];
    let verdict = probabilities.verdict();
    let null = || rounds[0].base.clone();
    let told = match verdict {
        Verdict::Effect => true,
        Verdict::Unknown => probabilities.effect >= WORTH_TELLING,
        Verdict::None => false,
    };
    let lead = rounds[0].rivals.first().filter(|rival| rival.whole).map(|rival| rival.fit.clone());
    let mut model = match (told, accepted.model.parts.is_empty()) {
        (false, _) => null(),
        (true, false) => accepted,
        (true, true) => lead.unwrap_or_else(null),
    };
    // A further effect is named if it is more probable right than not; several that were found at once stand or fall together.
    let doubted = |place: usize| each.get(place).is_some_and(|further| further.effect <= 0.5);
    if model.model.parts.len() == 2 && doubted(1) && rounds.len() > 1 && !rounds[1].base.model.parts.is_empty() {
        model = rounds[1].base.clone();
    }
    let confidence = |place: usize| each.get(place).map_or(probabilities.effect, |found| found.effect);
    let confidences: Vec<f64> = (0..model.model.parts.len()).map(confidence).collect();
    let reason = (verdict == Verdict::Unknown).then(|| {
        format!(
            "noise and contacts alone explain this log with probability {:.2}, the best effect that was tried ({}) with {:.2}",
            probabilities.none, findings[0].effect, probabilities.effect
        )
    });
    Decided { verdict, probabilities, confidences, model, reason }
}
