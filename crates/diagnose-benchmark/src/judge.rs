//! How often decisions are right, on logs whose truth is known.

use discrepancy::are_twins_by_name;
use discrepancy::decision::Probabilities;
use serde::Serialize;

use crate::example::{Kind, Truth};
use crate::learn::Judgement;

/// Edges of the bins of that mean square in which names are counted. Two good engines without an effect differ by tens to hundreds (`tests/peers/worlds/gap.py`).
const EDGES: [f64; 2] = [30.0, 300.0];
/// Episodes of a log up to which it has few.
const FEW: usize = 11;

/// Counts of what is judged.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Judged {
    /// Logs with an effect of the catalogue that shows, and how many of them it is named in.
    pub effects: [u32; 2],
    /// Of the others, in how many an effect is named that does nearly the same.
    pub twins: u32,
    /// Logs whose most probable effect is right, whatever the verdict.
    pub first: u32,
    /// Logs with such an effect where it was among those that were compared.
    pub compared: u32,
    /// By how much the effect changes the readings, in bins: logs, compared, named.
    pub by_size: [[u32; 3]; 3],
    /// Logs of few episodes, and wrong names there with a confidence of 0.9 and more.
    pub few: [u32; 2],
    /// Logs whose effect does not show and is named nevertheless, rightly.
    pub slight: u32,
    /// The other logs without one that shows, and how many are called `none`.
    pub none: [u32; 2],
    /// Of these how many are called `effect`.
    pub false_alarms: u32,
    /// Logs with something outside the catalogue, and how many are called `unknown`.
    pub outside: [u32; 2],
    /// Wrong names with a confidence of 0.9 and more, of all logs.
    pub sure_and_wrong: u32,
    /// Logs.
    pub logs: u32,
    /// Parameters of what was named rightly, and how many 90 % intervals hold the truth.
    pub intervals: [u32; 2],
    /// Expected calibration error of the probability that the most probable effect is right, ten bins.
    pub calibration_error: f64,
    /// Of each tenth of that probability: mean, share that was right, number.
    pub reliability: Vec<(f64, f64, u32)>,
    /// Mean −ln probability of the right class.
    pub log_loss: f64,
    /// Means over the logs.
    pub rollouts: f64,
    /// Durations, s.
    pub seconds: f64,
}

/// Of logs whose effect was withheld from what was compared: how many, how many are called `unknown`, how many get a name, and one with a confidence of 0.9
/// and more.
#[must_use]
pub fn judge_withheld(judged: &[Judgement]) -> [u32; 4] {
    use discrepancy::Verdict;
    let count =
        |of: &dyn Fn(&Probabilities) -> bool| judged.iter().filter(|judgement| of(&judgement.found)).count() as u32;
    [
        judged.len() as u32,
        count(&|found| found.verdict() == Verdict::Unknown),
        count(&|found| found.verdict() == Verdict::Effect),
        count(&|found| found.best().1 >= 0.9),
    ]
}

/// Whether an effect does nearly the same as one of what is hidden.
fn names_twin(truth: &Truth, name: &str) -> bool {
    truth.effects.iter().any(|hidden| are_twins_by_name([&hidden.name, name]))
}

/// Counts over judged examples.
#[must_use]
pub fn judge(judged: &[Judgement]) -> Judged {
    use discrepancy::Verdict;
    let mut counts = Judged { logs: judged.len() as u32, ..Judged::default() };
    let mut bins = [(0.0, 0_u32, 0_u32); 10];
    for Judgement { example, found, width } in judged {
        let (verdict, (name, probability)) = (found.verdict(), found.best());
        let right = example.truth.names(name);
        match example.truth.kind() {
            Kind::Effect => {
                counts.effects[0] += 1;
                counts.first += u32::from(right);
                let compared = example.compares_truth();
                counts.compared += u32::from(compared);
                let size = example.truth.detectable.unwrap_or(0.0);
                let bin = &mut counts.by_size[EDGES.iter().filter(|edge| size >= **edge).count()];
                let named = right && verdict == Verdict::Effect;
                *bin = [bin[0] + 1, bin[1] + u32::from(compared), bin[2] + u32::from(named)];
                counts.effects[1] += u32::from(right && verdict == Verdict::Effect);
                counts.twins += u32::from(!right && verdict == Verdict::Effect && names_twin(&example.truth, name));
            }
            Kind::None if right && verdict == Verdict::Effect => counts.slight += 1,
            Kind::None => {
                counts.none[0] += 1;
                counts.none[1] += u32::from(verdict == Verdict::None);
                counts.false_alarms += u32::from(verdict == Verdict::Effect);
            }
            Kind::Outside => {
                counts.outside[0] += 1;
                counts.outside[1] += u32::from(verdict == Verdict::Unknown);
            }
        }
        let sure_and_wrong = u32::from(probability >= 0.9 && !right);
        counts.sure_and_wrong += sure_and_wrong;
        if example.truth.episodes <= FEW {
            counts.few = [counts.few[0] + 1, counts.few[1] + sure_and_wrong];
        }
        let bin = &mut bins[((probability * 10.0) as usize).min(9)];
        *bin = (bin.0 + probability, bin.1 + u32::from(right), bin.2 + 1);
        if right {
            counts.intervals[0] += example.off.len() as u32;
            counts.intervals[1] += example.off.iter().filter(|off| *off <= width).count() as u32;
        }
        counts.log_loss -= example.of_right(found).ln() / judged.len() as f64;
        counts.rollouts += example.rollouts as f64 / judged.len() as f64;
        counts.seconds += example.seconds / judged.len() as f64;
    }
    for (sum, right, count) in bins.into_iter().filter(|(_, _, count)| *count > 0) {
        let n = f64::from(count);
        let (mean, share) = (sum / n, f64::from(right) / n);
        counts.calibration_error += n / f64::from(counts.logs) * (mean - share).abs();
        counts.reliability.push((mean, share, count));
    }
    counts
}
