//! How a diagnosis decides, learnt from logs of other engines: answers of `diagnose` beside the truth of each log.
//!
//! What is learnt is judged on the engine that was left out, each in turn.
//!
//! Few logs hide what the catalogue lacks. So every log whose effect was compared teaches a second time, as if that effect were not in the catalogue: then
//! something else is missing. All of these together weigh as much as the logs that hide something else.

use discrepancy::decision::{
    Decision, EFFECT_FEATURES, LOG_FEATURES, Probabilities, Scale, Score, effect_features, log_features, standardised,
};
use nalgebra::DVector;

use crate::choice::{self, Choice};
use crate::example::{Example, Kind};

/// Prior variances of a weight of a standardised feature, of which the one is taken that predicts engines best that were left out.
const VARIANCES: [f64; 4] = [0.03, 0.1, 0.3, 1.0];
/// That of an offset: hardly any prior.
const OFFSET: f64 = 100.0;
/// The same around a weight that an earlier decision had learnt. Chosen on 127 logs that the decision of 320 others had not seen, a tenth left out in turn: mean −ln p 0.757 with
/// 0.003, 0.761 with 0.01, 0.793 with 0.1, and 0.798 without the earlier decision.
const LEARNT_WEIGHT: f64 = 0.003;
/// The same around an offset, which other logs may need elsewhere.
const LEARNT_OFFSET: f64 = 0.1;

/// The decision that examples teach. How far weights may go is what predicts best the engines among them that are left out, each in turn. `earlier`: one
/// that had learnt from others, which it begins from; features that this did not have begin without a weight.
#[must_use]
pub fn learn(examples: &[&Example], earlier: Option<&Decision>, provenance: serde_json::Value) -> Decision {
    let loss = |variance: f64| -> f64 {
        let left_out = |engine: &&str| -> f64 {
            let (own, others): (Vec<&Example>, Vec<&Example>) =
                examples.iter().copied().partition(|example| example.truth.engine == **engine);
            let decision = regress(&others, earlier, variance, serde_json::Value::Null);
            own.iter().map(|example| -example.of_right(&decision.probabilities(&example.findings)).ln()).sum()
        };
        engines(examples).iter().map(left_out).sum()
    };
    let best = VARIANCES.into_iter().map(|variance| (loss(variance), variance)).min_by(|a, b| a.0.total_cmp(&b.0));
    regress(examples, earlier, best.map_or(VARIANCES[0], |(_, variance)| variance), provenance)
}

/// Share of the true values that an interval is to hold.
const HELD: f64 = 0.9;
/// No interval says anything that is wider than this many times what the bootstrap says.
const WIDEST: f64 = 100.0;

/// The width at which intervals hold that share of the true values of a further log like these (split conformal prediction: Vovk et al., "Algorithmic
/// Learning in a Random World", 2005); 1 where nothing is known.
fn width(examples: &[&Example]) -> f64 {
    let mut off: Vec<f64> = examples.iter().flat_map(|example| example.off.iter().copied()).collect();
    off.sort_by(f64::total_cmp);
    let place = (HELD * (off.len() + 1) as f64).ceil() as usize;
    // Of few none is wide enough; the widest has to do.
    off.get(place.min(off.len()).saturating_sub(1)).map_or(1.0, |width| width.clamp(f64::EPSILON, WIDEST))
}

/// The engines of examples, each once.
fn engines<'a>(examples: &[&'a Example]) -> Vec<&'a str> {
    let mut engines: Vec<&str> = examples.iter().map(|example| example.truth.engine.as_str()).collect();
    engines.sort_unstable();
    engines.dedup();
    engines
}

/// Means and standard deviations of features; `earlier`: those that stay, so that weights mean what they did.
fn scales(names: &[&str], rows: &[Vec<f64>], earlier: Option<&[Scale]>) -> Vec<Scale> {
    let n = rows.len().max(1) as f64;
    let scale = |index: usize| {
        if let Some(known) = earlier.into_iter().flatten().find(|(name, ..)| name == names[index]) {
            return known.clone();
        }
        let mean = rows.iter().map(|row| row[index]).sum::<f64>() / n;
        let variance = rows.iter().map(|row| (row[index] - mean).powi(2)).sum::<f64>() / n;
        // What all examples have in common says nothing.
        (names[index].to_string(), mean, variance.sqrt().max(1e-6))
    };
    (0..names.len()).map(scale).collect()
}

/// Priors of an offset and of weights.
fn priors(names: &[&str], earlier: Option<(&[Scale], &Score)>, variance: f64) -> Vec<choice::Prior> {
    let Some((scales, score)) = earlier else {
        return std::iter::once((0.0, OFFSET)).chain(names.iter().map(|_| (0.0, variance))).collect();
    };
    let weight = |name: &&str| {
        let known = scales.iter().position(|(other, ..)| other == name);
        known.map_or((0.0, variance), |place| (score.weights[place], LEARNT_WEIGHT))
    };
    std::iter::once((score.offset, LEARNT_OFFSET)).chain(names.iter().map(weight)).collect()
}

fn regress(
    examples: &[&Example],
    earlier: Option<&Decision>,
    variance: f64,
    provenance: serde_json::Value,
) -> Decision {
    let of_effects = |example: &Example| -> Vec<Vec<f64>> {
        example.findings.iter().map(|found| effect_features(found, &example.findings).to_vec()).collect()
    };
    let of_log = |example: &Example| log_features(&example.findings).to_vec();
    let rows: Vec<Vec<f64>> = examples.iter().flat_map(|example| of_effects(example)).collect();
    let effect_scales = scales(&EFFECT_FEATURES, &rows, earlier.map(|earlier| &*earlier.effect_features));
    let rows: Vec<Vec<f64>> = examples.iter().map(|example| of_log(example)).collect();
    let log_scales = scales(&LOG_FEATURES, &rows, earlier.map(|earlier| &*earlier.log_features));
    // Offset and weights of the score of an effect, of nothing and of something else, one after another.
    let sizes = [EFFECT_FEATURES.len(), LOG_FEATURES.len(), LOG_FEATURES.len()].map(|count| 1 + count);
    let firsts = [0, sizes[0], sizes[0] + sizes[1]];
    let alternative = |class: usize, standard: Vec<f64>| {
        let mut x = DVector::zeros(sizes.iter().sum());
        x[firsts[class]] = 1.0;
        x.rows_mut(firsts[class] + 1, standard.len()).copy_from_slice(&standard);
        x
    };
    let choice = |example: &Example, weight: f64| {
        let rows = of_effects(example);
        let effects = rows.iter().map(|row| alternative(0, standardised(row, &effect_scales).collect()));
        let log: Vec<f64> = standardised(&of_log(example), &log_scales).collect();
        let alternatives = effects.chain([alternative(1, log.clone()), alternative(2, log)]).collect();
        Choice { alternatives, chosen: example.right(), weight }
    };
    let withheld: Vec<Example> = examples.iter().filter_map(|example| example.without_truth()).collect();
    let outside = examples.iter().filter(|example| example.truth.kind() == Kind::Outside).count();
    let weight = outside as f64 / withheld.len().max(1) as f64;
    let choices: Vec<Choice> = (examples.iter().map(|example| choice(example, 1.0)))
        .chain(withheld.iter().map(|example| choice(example, weight.min(1.0))))
        .collect();
    let of_effect = earlier.map(|earlier| (&*earlier.effect_features, &earlier.effect));
    let of_none = earlier.map(|earlier| (&*earlier.log_features, &earlier.none));
    let of_unknown = earlier.map(|earlier| (&*earlier.log_features, &earlier.unknown));
    let priors = [
        priors(&EFFECT_FEATURES, of_effect, variance),
        priors(&LOG_FEATURES, of_none, variance),
        priors(&LOG_FEATURES, of_unknown, variance),
    ];
    let theta = choice::fit(&choices, &priors.concat());
    let score = |class: usize| Score {
        offset: theta[firsts[class]],
        weights: theta.rows(firsts[class] + 1, sizes[class] - 1).iter().copied().collect(),
    };
    Decision {
        provenance,
        effect: score(0),
        none: score(1),
        unknown: score(2),
        effect_features: effect_scales,
        log_features: log_scales,
        width: width(examples),
    }
}

/// An example with what a decision says of it.
#[derive(Clone, Debug)]
pub struct Judgement<'a> {
    /// The log and its answer.
    pub example: &'a Example,
    /// What it shows.
    pub found: Probabilities,
    /// Width of its intervals.
    pub width: f64,
}

impl<'a> Judgement<'a> {
    /// By a decision that was made from other logs.
    #[must_use]
    pub fn new(example: &'a Example, decision: &Decision) -> Self {
        Self { example, found: decision.probabilities(&example.findings), width: decision.width }
    }
}

/// Every example of `judged` by what the other engines of `taught` teach.
#[must_use]
pub fn leave_one_engine_out<'a>(
    taught: &[Example],
    judged: &'a [Example],
    earlier: Option<&Decision>,
) -> Vec<Judgement<'a>> {
    let of_engine = |engine: &str| {
        let others: Vec<&Example> = taught.iter().filter(|example| example.truth.engine != engine).collect();
        let decision = learn(&others, earlier, serde_json::Value::Null);
        let own = judged.iter().filter(|example| example.truth.engine == engine);
        own.map(|example| Judgement::new(example, &decision)).collect::<Vec<_>>()
    };
    engines(&judged.iter().collect::<Vec<_>>()).into_iter().flat_map(of_engine).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::example::tests::example;
    use crate::judge::judge;

    #[test]
    fn what_tells_effects_from_nothing_on_some_engines_is_used_on_another() {
        let mut examples = Vec::new();
        for engine in ["a", "b", "c"] {
            for size in 0..10 {
                examples.push(example(engine, true, "table_tilt", 200.0 + f64::from(size)));
                examples.push(example(engine, false, "tether", 2.0 + f64::from(size)));
            }
        }
        let judged = judge(&leave_one_engine_out(&examples, &examples, None));
        assert_eq!((judged.effects, judged.none, judged.false_alarms), ([30, 30], [30, 30], 0));
        assert!(judged.calibration_error < 0.2 && judged.sure_and_wrong == 0, "{judged:?}");
        // On an engine where evidence says nothing the answers are wrong, and the table says so.
        examples.extend((0..10).map(|_| example("d", false, "tether", 300.0)));
        let judged = leave_one_engine_out(&examples, &examples, None);
        let own: Vec<_> = judged.into_iter().filter(|judgement| judgement.example.truth.engine == "d").collect();
        assert_eq!(judge(&own).false_alarms, 10);
    }

    #[test]
    fn what_was_learnt_earlier_stays_where_little_speaks_against_it() {
        let of = |count: usize, engine: &str| -> Vec<Example> {
            let effect = (0..count).map(|size| example(engine, true, "table_tilt", 200.0 + size as f64));
            effect.chain((0..count).map(|size| example(engine, false, "tether", 2.0 + size as f64))).collect()
        };
        let all: Vec<Example> = ["a", "b"].iter().flat_map(|engine| of(20, engine)).collect();
        let mut earlier = learn(&all.iter().collect::<Vec<_>>(), None, serde_json::Value::Null);
        // As if it had not known this feature.
        let forgotten = earlier.log_features.remove(1);
        for score in [&mut earlier.none, &mut earlier.unknown] {
            score.weights.remove(1);
        }
        let few: Vec<Example> = ["a", "b"].iter().flat_map(|engine| of(1, engine)).collect();
        let few: Vec<&Example> = few.iter().collect();
        let later = learn(&few, Some(&earlier), serde_json::Value::Null);
        let alone = learn(&few, None, serde_json::Value::Null);
        assert_eq!(later.log_features[1].0, forgotten.0);
        assert_eq!(later.effect_features, earlier.effect_features);
        let away = |decision: &Decision| -> f64 {
            decision.effect.weights.iter().zip(&earlier.effect.weights).map(|(a, b)| (a - b).abs()).sum()
        };
        assert!(away(&later) < 0.1 * away(&alone), "{} {}", away(&later), away(&alone));
    }

    #[test]
    fn intervals_are_as_wide_as_nine_in_ten_true_values_ask_for() {
        let mut all = vec![example("a", true, "table_tilt", 100.0); 19];
        all.iter_mut().enumerate().for_each(|(place, example)| example.off = vec![0.1 * place as f64]);
        // Of 19 and a further one 18 lie within: the 18th, 1.7.
        let width_of = |all: &[Example]| width(&all.iter().collect::<Vec<_>>());
        assert!((width_of(&all) - 1.7).abs() < 1e-12);
        assert_eq!((width_of(&all[..3]), width_of(&[])), (0.2, 1.0));
    }
}
