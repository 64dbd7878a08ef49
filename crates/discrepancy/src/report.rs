//! What a diagnosis says: the contract of `report.json`.

use measured_log::Log;
use physics_model::EffectKind;
use serde::Serialize;

use crate::decision::{Decision, Probabilities};
use crate::diagnosis::{Diagnosis, Settings};
use crate::evidence::Evidence;
use crate::findings::Findings;
use crate::interval::{bootstrap, middle_90, widen};
use crate::likelihood::NOISE_FLOOR;
use crate::locate::Cell;
use crate::noise::SensorNoise;
use crate::nominal::Nominal;
use crate::rival::Rival;
use crate::separate;
use crate::split::{Plain, Split};
use crate::terms::LackingForce;
use crate::thin::Thinned;
use crate::touch::ContactGap;
use crate::verdict::closed_fraction;
use crate::warning::{Warning, check, held_fixed, warnings};

/// The verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Effects of the catalogue explain what the nominal model lacks.
    Effect,
    /// The nominal model, re-tuned, lacks nothing that shows.
    None,
    /// Something is missing that the catalogue has not.
    Unknown,
}

/// A named effect.
#[derive(Clone, Debug, Serialize)]
pub struct NamedEffect {
    /// Name in the catalogue.
    pub name: &'static str,
    /// What it does, in a line.
    pub description: &'static str,
    /// Probability that it is right ([`crate::decision`]). Where the verdict is `effect`, those of all that were compared add up to more than one half.
    pub confidence: f64,
    /// Gain in ln evidence over the model without it; of one of several of what is thrown what the episodes of the screening say for all.
    pub log_evidence: f64,
    /// Fitted values.
    pub parameters: Vec<Value>,
}

/// A value with its interval.
#[derive(Clone, Debug, Serialize)]
pub struct Value {
    /// Name, without its unit.
    pub name: String,
    /// Key in scenario and model files.
    pub key: String,
    /// Unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
    /// 90 % interval.
    pub interval90: [f64; 2],
}

/// A rival of the first round.
#[derive(Clone, Debug, Serialize)]
pub struct RankedEffect {
    /// Name.
    pub name: &'static str,
    /// Gain in ln evidence.
    pub log_evidence: f64,
    /// That it is the right one.
    pub probability: f64,
    /// Held-out mean square with it.
    pub heldout: f64,
}

/// Held-out comparison.
#[derive(Clone, Debug, Serialize)]
pub struct Heldout {
    /// Mean square of the white residuals of the re-tuned nominal model.
    pub before: f64,
    /// With the named effects.
    pub after: f64,
    /// What noise alone leaves.
    pub noise_floor: f64,
    /// (before − after) / (before − floor); 1 where there is nothing to close.
    pub closed_fraction: f64,
    /// Unit of the three.
    pub unit: &'static str,
    /// Of each held-out episode that nothing was chosen by: number in the log, before, after.
    pub episodes: Vec<(u64, f64, f64)>,
    /// The same by channel, in units of the sensors' noise alone: what another simulator's replay of these episodes can be compared with.
    pub plain: Vec<Plain>,
}

/// A re-tuned value of the nominal model.
#[derive(Clone, Debug, Serialize)]
pub struct Retuned {
    /// Key in `log.toml`.
    pub key: String,
    /// Prior mean and standard deviation.
    pub prior: [f64; 2],
    /// Value.
    pub value: f64,
    /// 90 % interval.
    pub interval90: [f64; 2],
}

/// `report.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of the contract.
    pub version: u32,
    /// The verdict.
    pub verdict: Verdict,
    /// A sentence.
    pub summary: String,
    /// Named effects, in the order in which they were accepted.
    pub effects: Vec<NamedEffect>,
    /// Names that the data do not tell apart: with odds above 1 to 20 beside the most probable one, which is the first. Where nothing is named, those
    /// of them whose evidence is above 0: what the log leans to.
    pub confusion_set: Vec<&'static str>,
    /// Fitted rivals of the first round, those among them that gain more than what was named but explain held-out episodes worse.
    pub ranking: Vec<RankedEffect>,
    /// Where the re-tuned nominal model disagrees.
    pub located: Vec<Cell>,
    /// Where the accepted model still does.
    pub remaining: Vec<Cell>,
    /// For a gap that the catalogue does not explain: where it acts, and what the force on the object that is lacking follows.
    pub description: Option<String>,
    /// The latter in numbers; `None` where no gap is left, or too little moves to say.
    pub lacking_force: Option<LackingForce>,
    /// How much of such a gap lies where only one of simulation and measurement has the tool touch the object; `None` without a sensor at the tool, or of few episodes.
    pub contact_gap: Option<ContactGap>,
    /// Held-out comparison.
    pub heldout: Heldout,
    /// Probabilities of the effects that were compared for the first place, the most probable first, of nothing and of something else: they add up to 1.
    pub probabilities: Probabilities,
    /// What speaks for each effect that each round of the search compared: what the decision is made of.
    pub findings: Vec<Vec<Findings>>,
    /// By how much intervals are wider than those of the bootstrap, see [`Decision::width`].
    pub interval_width: f64,
    /// The nominal model, re-tuned.
    pub retuned: Vec<Retuned>,
    /// Held-out episodes before and after, for plots.
    pub evidence: Evidence,
    /// What the log's own readings say against it, and what against the answer: to be read first.
    pub warnings: Vec<Warning>,
    /// Why the verdict is `unknown`.
    pub reason: Option<String>,
    /// Model file that the diagnosis began with.
    pub model: Option<String>,
    /// Effects that the model had before, from that file.
    pub effects_in_model: Vec<&'static str>,
    /// What to record next to tell the confusion set apart.
    pub next_experiment: String,
    /// Noise of each sensor that was used, and where it comes from.
    pub noise: Vec<SensorNoise>,
    /// How many episodes were fitted, chose between models, and are reported.
    pub split: Split,
    /// Seed of the hold-out split, of the bootstrap and of the test of what is left.
    pub seed: u64,
    /// Part of how many that was held out, counted from 1, as on the command line; `None`: the share that the log says.
    pub fold: Option<[usize; 2]>,
    /// Episodes of the log that cannot be simulated: without a pose of the object, or without a row after it.
    pub left_out: Vec<u64>,
    /// What of the log was simulated: rows a tick, the tick (s), episodes out of how many.
    pub thinned: Thinned,
    /// Simulated episodes of the search; what [`Self::warn`] simulates is not counted.
    pub rollouts: usize,
    /// Duration, s.
    pub seconds: f64,
}

/// A reading that lowers the held-out error to this share is how the log is meant.
const MENDS: f64 = 0.7;

impl Report {
    /// Which noise was used.
    #[must_use]
    pub fn noise_sentence(&self) -> String {
        let sentences: Vec<String> = self.noise.iter().map(SensorNoise::sentence).collect();
        format!("Noise: {}.", sentences.join("; "))
    }

    /// Which episodes were left out, if any.
    #[must_use]
    pub fn left_out_sentence(&self) -> Option<String> {
        let ids: Vec<String> = self.left_out.iter().map(u64::to_string).collect();
        (!ids.is_empty()).then(|| {
            format!(
                "Episodes left out, because they lack a pose of the object before the tool moves or a row after it: {}",
                ids.join(", ")
            )
        })
    }

    /// Adds what the log's own readings say against it, and numbers given as exact that would explain as much as what was found.
    pub fn warn(&mut self, log: &Log, nominal: &Nominal) {
        self.warnings = warnings(log, nominal, &check(log, nominal.tool()), self.seed);
        // What is wrong with a log is no effect, and no experiment tells more before it is mended.
        let mends = |warning: &Warning| warning.heldout.is_some_and(|[before, after]| after < MENDS * before);
        if self.warnings.iter().any(mends) {
            self.next_experiment =
                "Mend the log first, as \"Check the log\" says, and diagnose it again: `cargo xtask log check LOG --fix COPY` writes a mended copy."
                    .into();
        }
        if self.verdict != Verdict::None {
            let errors = [self.heldout.before, self.heldout.after];
            self.warnings.extend(held_fixed(log, nominal, errors, self.seed));
        }
    }

    /// What a diagnosis says.
    #[must_use]
    pub fn new(diagnosis: &Diagnosis, settings: &Settings, seconds: f64) -> Self {
        let [before, after] = diagnosis.reported.errors();
        let mut samples = bootstrap(&diagnosis.model, &diagnosis.pieces, settings.seed).unwrap_or_default();
        let interval_width = Decision::shipped().width;
        widen(&mut samples, &diagnosis.model, unexplained_share(diagnosis), interval_width);
        let effects = effects(diagnosis, &samples);
        let verdict = diagnosis.verdict;
        let ranking = ranking(diagnosis);
        let mut confusion_set = confusion_set(&diagnosis.probabilities, settings.confusion);
        if effects.is_empty() {
            // Of what is not named those that the evidence favours.
            let favoured = |name: &&str| ranking.iter().any(|rival| rival.name == *name && rival.log_evidence > 0.0);
            confusion_set.retain(favoured);
        }
        let summary = summary(verdict, &effects, [before, after], diagnosis.probabilities.none);
        let description = diagnosis.is_open().then(|| describe(diagnosis));
        Self {
            version: 1,
            verdict,
            summary,
            reason: diagnosis.reason.clone(),
            warnings: Vec::new(),
            model: None,
            effects_in_model: diagnosis.effects_in_model.clone(),
            next_experiment: separate::next_experiment(
                verdict,
                !effects.is_empty(),
                &confusion_set,
                before,
                separate::telling(diagnosis, &confusion_set),
                diagnosis.contact_gap.as_ref().and_then(ContactGap::next_experiment),
            ),
            confusion_set,
            ranking,
            located: diagnosis.located.clone(),
            remaining: diagnosis.remaining.clone(),
            description,
            lacking_force: diagnosis.lacking_force.clone(),
            contact_gap: diagnosis.contact_gap.clone(),
            heldout: Heldout {
                before,
                after,
                noise_floor: NOISE_FLOOR,
                closed_fraction: closed_fraction(before, after),
                unit: "chi2 per sample",
                episodes: diagnosis.reported.episodes.clone(),
                plain: diagnosis.reported.plain.clone(),
            },
            probabilities: diagnosis.probabilities.clone(),
            findings: diagnosis.findings.clone(),
            interval_width,
            retuned: retuned(diagnosis, &samples),
            effects,
            evidence: diagnosis.evidence.clone(),
            noise: diagnosis.noise.clone(),
            split: diagnosis.split,
            seed: settings.seed,
            fold: settings.fold.map(|[part, parts]| [part + 1, parts]),
            left_out: diagnosis.left_out.clone(),
            thinned: diagnosis.thinned,
            rollouts: diagnosis.rollouts,
            seconds,
        }
    }
}

/// By how much the model is still off where the object goes, as a share of how far it does; 0 without an effect.
fn unexplained_share(diagnosis: &Diagnosis) -> f64 {
    let parts = &diagnosis.model.model.parts;
    let named = |found: &&Findings| parts.iter().any(|part| part.kind().name() == found.effect);
    let found = diagnosis.findings.iter().flatten().find(named);
    found.map_or(0.0, |found| found.motion_share[1])
}

fn effects(diagnosis: &Diagnosis, samples: &[Vec<f64>]) -> Vec<NamedEffect> {
    let model = &diagnosis.model.model;
    let fitted = diagnosis.effects(&diagnosis.model.x);
    let resampled: Vec<_> = samples.iter().map(|x| diagnosis.effects(x)).collect();
    (model.parts.iter().enumerate())
        .map(|(place, part)| {
            let kind = part.kind();
            let parameters = (part.coordinates.iter())
                .map(|coordinate| {
                    let parameter = &kind.parameters()[coordinate.index];
                    let values = resampled.iter().map(|effects| effects[place].values()[coordinate.index]).collect();
                    Value {
                        name: bare(parameter.name).into(),
                        key: parameter.name.into(),
                        unit: parameter.unit,
                        value: fitted[place].values()[coordinate.index],
                        interval90: middle_90(values),
                    }
                })
                .collect();
            NamedEffect {
                name: kind.name(),
                description: kind.description(),
                confidence: diagnosis.confidences[place],
                log_evidence: diagnosis
                    .rounds
                    .get(place)
                    .and_then(|round| round.rival(kind.name()))
                    .map_or(0.0, |rival| rival.gain),
                parameters,
            }
        })
        .collect()
}

/// A key without the unit at its end.
fn bare(key: &str) -> &str {
    match key.rsplit_once('_') {
        Some((name, unit)) if !matches!(unit, "x" | "y" | "z" | "ratio" | "share" | "0" | "1" | "2") => name,
        _ => key,
    }
}

/// Names that are not told apart: those whose odds beside the most probable one are above one to `confusion`.
fn confusion_set(probabilities: &Probabilities, confusion: f64) -> Vec<&'static str> {
    let (_, most) = probabilities.best();
    let near = probabilities.effects.iter().filter(|(_, probability)| confusion * probability > most);
    near.filter_map(|(name, _)| EffectKind::ALL.iter().map(|kind| kind.name()).find(|kind| kind == name)).collect()
}

fn ranking(diagnosis: &Diagnosis) -> Vec<RankedEffect> {
    let Some(round) = diagnosis.rounds.first() else { return Vec::new() };
    let mut rivals: Vec<&Rival> = round.rivals.iter().chain(round.passed_over_kinds()).collect();
    rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let heldout = |kind| diagnosis.ranking.iter().find(|(other, _)| *other == kind).map_or(f64::NAN, |found| found.1);
    (rivals.into_iter())
        .map(|rival| RankedEffect {
            name: rival.kind().name(),
            log_evidence: rival.gain,
            probability: diagnosis.probabilities.of(rival.kind().name()),
            heldout: heldout(rival.kind()),
        })
        .collect()
}

fn retuned(diagnosis: &Diagnosis, samples: &[Vec<f64>]) -> Vec<Retuned> {
    (diagnosis.tunables.iter().enumerate())
        .map(|(index, tunable)| Retuned {
            key: tunable.key.clone(),
            prior: [tunable.mean, tunable.stddev],
            value: tunable.value(diagnosis.model.x[index]),
            interval90: middle_90(samples.iter().map(|x| tunable.value(x[index])).collect()),
        })
        .collect()
}

fn summary(verdict: Verdict, effects: &[NamedEffect], [before, after]: [f64; 2], none: f64) -> String {
    let names: Vec<&str> = effects.iter().map(|effect| effect.name).collect();
    let (comes, it) = if names.len() > 1 { ("come", "them") } else { ("comes", "it") };
    let names = match names.as_slice() {
        [before @ .., first, last] => [before, &[&format!("{first} and {last}")]].concat().join(", "),
        names => names.concat(),
    };
    match verdict {
        Verdict::Effect => {
            // What few episodes meet may leave the others as they were, or hit one of them harder.
            let goes = if after < before { "falls" } else { "goes" };
            format!(
                "The model lacks {names}. With {it} the held-out error {goes} from {before:.2} to {after:.2} (noise alone gives 1)."
            )
        }
        Verdict::None if before <= separate::OPEN => {
            format!("The re-tuned model explains this log: its held-out error is {before:.2} (noise alone gives 1).")
        }
        Verdict::None => format!(
            "No missing effect shows in this log, but its held-out error is {before:.2} (noise alone gives 1). Engines and real contacts can differ by \
             as much: that nothing is missing has a probability of {none:.2}."
        ),
        Verdict::Unknown if effects.is_empty() => {
            format!(
                "The model lacks something that no effect of the catalogue explains: its held-out error is {before:.2} (noise alone gives 1)."
            )
        }
        Verdict::Unknown => format!(
            "The model lacks something that no effect of the catalogue explains. Nearest {comes} {names}: with {it} the held-out error \
             goes from {before:.2} to {after:.2} (noise alone gives 1)."
        ),
    }
}

/// Cells that a description of what is left names.
const LARGEST: usize = 3;

fn describe(diagnosis: &Diagnosis) -> String {
    let remaining = &diagnosis.remaining;
    // The largest shares, and what stands out most: it may have decided.
    let surest = remaining.iter().enumerate().skip(LARGEST).min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value));
    let surer = |p_value: f64| remaining.iter().take(LARGEST).all(|cell| p_value < cell.p_value);
    let surest = surest.map(|(_, cell)| cell).filter(|cell| surer(cell.p_value));
    let worst: Vec<String> = (remaining.iter().take(LARGEST).chain(surest))
        .map(|cell| {
            let (channel, phase) = (cell.channel.name(), cell.phase.name());
            format!(
                "{channel}, {phase}: {:.0} % of what is left, mean square {:.1}",
                100.0 * cell.share,
                cell.mean_square
            )
        })
        .collect();
    let follows = diagnosis.lacking_force.iter().map(LackingForce::sentence);
    let touches = diagnosis.contact_gap.iter().filter_map(ContactGap::sentence);
    worst.into_iter().chain(follows).chain(touches).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_open_is_said() {
        assert!(summary(Verdict::None, &[], [36.95; 2], 0.42).ends_with("has a probability of 0.42."));
    }

    #[test]
    fn what_is_nearly_as_probable_is_not_told_apart() {
        let effects = [("table_tilt", 0.6), ("constant_force", 0.2), ("adhesion", 0.02)];
        let effects = effects.map(|(name, probability)| (name.to_string(), probability)).to_vec();
        let found = Probabilities { effects, none: 0.1, unknown: 0.08 };
        assert_eq!(confusion_set(&found, 20.0), ["table_tilt", "constant_force"]);
        assert!(confusion_set(&Probabilities { effects: Vec::new(), none: 1.0, unknown: 0.0 }, 20.0).is_empty());
    }
}
