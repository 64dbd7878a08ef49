//! What an effect has to show to be named.

use std::ops::Range;

use crate::fit::Fit;
use crate::interval::{bootstrap, widen};
use crate::likelihood::NOISE_FLOOR;
use crate::rival::{Heldout, Rival, Round};

/// Share of resamples in which a strength has to have the same sign.
const SAME_SIGN: f64 = 0.95;
/// A strength below this, in standard deviations of what is plausible (0.13 mm of an offset, 0.04 % of a scale, 33 g of a payload, less than the catalogue
/// calls plausible of any), is as good as none, however surely it is not 0: what no model is right about shows in long logs.
pub(crate) const NEGLIGIBLE: f64 = 0.01;
/// By chance an effect that no held-out episode shows may explain them worse by this much in ln p.
const HELDOUT_SLACK: f64 = 1.0;
/// The same as a share of the gain: the place of a patch is not known exactly.
const HELDOUT_SHARE: f64 = 0.02;
/// The same of a body in the way: what meets it goes another way a millimetre beside its place.
const HELDOUT_SHARE_OF_BODIES: f64 = 0.1;

/// Standard errors by which the gain of all episodes has to be above 0 where it has to be steady.
const STEADY: f64 = 2.5;

/// Share of what the fitted episodes gain that the held-out ones have to there.
const KEPT: f64 = 0.1;
/// The same where the gain is not plain.
const MOSTLY_KEPT: f64 = 0.5;

/// What is asked of an effect.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked {
    /// Least gain in ln evidence.
    pub(crate) least: f64,
    /// A gain below this might be made of what single episodes do: each held-out one has to gain at least half as much as a fitted one.
    pub(crate) plain: f64,
    /// Whether held-out episodes have to gain a tenth of what the fitted ones do.
    pub(crate) kept: bool,
    /// Whether most episodes have to gain, and held-out ones to have a gap: a ball goes another way at the least provocation, and what explains some of
    /// that hits a few episodes and misses others. Where nothing rolls, a drift or an obstacle may rightly show in few.
    pub(crate) steady: bool,
}

/// The episodes of a search.
pub(crate) struct Episodes {
    /// Places of the pieces of each fitted one.
    pub(crate) fitted: Vec<Range<usize>>,
    /// The same of those held out.
    pub(crate) heldout: Vec<Range<usize>>,
    /// Residuals of each held-out piece.
    pub(crate) counts: Vec<usize>,
}

/// Whether a rival that is fitted to all episodes gains more than `least` in ln evidence, not by one odd episode, and lasts.
pub(crate) fn convinces(rival: &Rival, round: &Round, episodes: &Episodes, asked: Asked, seed: u64) -> bool {
    may_convince(rival, episodes, asked, seed) && agrees(rival, round, episodes, asked)
}

/// Whether a rival might convince beside a second effect that is missing: what that one does may well hit what was held out harder.
pub(crate) fn may_convince(rival: &Rival, episodes: &Episodes, asked: Asked, seed: u64) -> bool {
    rival.whole && rival.gain.is_finite() && rival.gain > asked.least && lasts(&rival.fit, &episodes.fitted, seed)
}

/// Whether both effects of `second` convince together, beside the model that the first one was added to.
pub(crate) fn both_convince([first, second]: [&Round; 2], episodes: &Episodes, asked: Asked) -> bool {
    let Some(pair) = second.rivals.first() else { return false };
    let gain = pair.fit.log_evidence() - first.base.log_evidence();
    agrees(&Rival { gain, ..pair.clone() }, first, episodes, Asked { kept: true, ..asked })
}

/// Whether what was held out is explained better than by another model, of which these are the sums of squares.
pub(crate) fn better_heldout(found: &Heldout, other: &Heldout) -> bool {
    other.gains(found).iter().sum::<f64>() > 0.0
}

/// Whether each effect is there whichever episodes are left out: some strength of it is more than negligible, with the same sign, in nearly all
/// resamples; and it is no error of the engine.
pub(crate) fn lasts(fit: &Fit, groups: &[Range<usize>], seed: u64) -> bool {
    let Some(mut samples) = bootstrap(fit, groups, seed) else { return false };
    widen(&mut samples, fit, 0.0, 1.0);
    let mut first = fit.model.tunables + fit.model.errors;
    !fit.model.parts.is_empty()
        && fit.model.parts.iter().all(|part| {
            let own = first;
            first += part.coordinates.len();
            // A body in the way has no sign.
            let lasts = part.begin.is_some()
                || part.strengths().any(|index| {
                    let beyond = |sign: f64| samples.iter().filter(|x| sign * x[own + index] > NEGLIGIBLE).count();
                    beyond(1.0).max(beyond(-1.0)) as f64 >= SAME_SIGN * samples.len() as f64
                });
            lasts && !part.is_engine_error(&fit.x[own..first])
        })
}

/// Whether what was held out is explained no worse, and the effect shows in more than one episode, whether fitted or held out: an odd one names
/// nothing.
fn agrees(rival: &Rival, round: &Round, episodes: &Episodes, asked: Asked) -> bool {
    let heldout = round.before.gains(&rival.heldout);
    let [before, after] = [&round.base, &rival.fit].map(|fit| fit.residuals.costs());
    let fitted: Vec<f64> = before.iter().zip(&after).map(|(before, after)| before - after).collect();
    let of_episodes = |gains: &[f64], pieces: &[Range<usize>]| -> Vec<f64> {
        pieces.iter().map(|piece| gains[piece.clone()].iter().sum()).collect()
    };
    let gains = [of_episodes(&fitted, &episodes.fitted), of_episodes(&heldout, &episodes.heldout)].concat();
    let most = gains.iter().copied().fold(0.0, f64::max);
    let body = rival.fit.model.parts.last().is_some_and(|part| part.begin.is_some());
    let share = if body { HELDOUT_SHARE_OF_BODIES } else { HELDOUT_SHARE };
    let slack = HELDOUT_SLACK.max(share * rival.gain);
    // What the fitted episodes gained the held-out ones should, too.
    let expected = fitted.iter().sum::<f64>() * episodes.heldout.len() as f64 / episodes.fitted.len().max(1) as f64;
    let (least, least_kept) = if rival.gain < asked.plain {
        (asked.least, Some(MOSTLY_KEPT))
    } else {
        (asked.plain, asked.kept.then_some(KEPT))
    };
    let kept = least_kept.is_none_or(|share| heldout.iter().sum::<f64>() > share * expected);
    let gap = round.before.squares.iter().sum::<f64>() > NOISE_FLOOR * episodes.counts.iter().sum::<usize>() as f64;
    let steady = !asked.steady || (gap && gains.iter().sum::<f64>() > STEADY * standard_error_of_sum(&gains));
    steady && kept && heldout.iter().sum::<f64>() > -slack && gains.iter().sum::<f64>() - most > 0.5 * least
}

/// Of a sum of independent gains that scatter as these do.
fn standard_error_of_sum(gains: &[f64]) -> f64 {
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    (gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() * n / (n - 1.0).max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::likelihood::cell_cost;
    use crate::model::Model;

    /// A fit that leaves residuals of this size in each of four episodes.
    fn leaves(size: f64) -> Fit {
        let residuals = vec![DVector::from_element(20, size); 4].into();
        Fit::new(Model::nominal(0, 0), Vec::new(), Vec::new(), residuals, Vec::new())
    }

    /// Two held-out episodes with residuals of this size.
    fn left_of(size: f64) -> Heldout {
        let square = 20.0 * size * size;
        Heldout { squares: vec![square; 2], costs: vec![cell_cost(square, 20); 2], raw: Vec::new() }
    }

    /// A round that finds `found` beside `base` in what was fitted, and as much in two held-out episodes.
    fn round(base: f64, found: f64) -> Round {
        let heldout = left_of;
        let rival = Rival {
            gain: leaves(found).log_evidence() - leaves(base).log_evidence(),
            heldout: heldout(found),
            fit: leaves(found),
            whole: true,
        };
        Round {
            promises: Vec::new(),
            rivals: vec![rival],
            passed_over: Vec::new(),
            base: leaves(base),
            before: heldout(base),
            hasty: true,
        }
    }

    #[test]
    fn a_pair_is_compared_with_no_effect_not_with_the_first_one() {
        let pieces = |count: usize| (0..count).map(|place| place..place + 1).collect();
        let episodes = Episodes { fitted: pieces(4), heldout: pieces(2), counts: vec![20; 2] };
        let asked = Asked { least: 10.0, plain: 0.0, kept: false, steady: false };
        assert!(both_convince([&round(3.0, 2.5), &round(2.5, 1.0)], &episodes, asked));
        // Held-out episodes that the first one spoilt and the second does not mend.
        let mut second = round(2.5, 1.0);
        second.rivals[0].heldout = left_of(3.0);
        assert!(!both_convince([&round(3.0, 2.5), &second], &episodes, asked));
    }

    #[test]
    fn a_gain_that_is_not_plain_has_to_be_kept_by_what_was_held_out() {
        let pieces = |count: usize| (0..count).map(|place| place..place + 1).collect();
        let episodes = Episodes { fitted: pieces(4), heldout: pieces(2), counts: vec![20; 2] };
        let mut round = round(1.5, 1.0);
        let gain = round.rivals[0].gain;
        let agrees = |round: &Round, plain: f64| {
            agrees(&round.rivals[0], round, &episodes, Asked { least: 5.0, plain, kept: false, steady: false })
        };
        assert!(agrees(&round, 2.0 * gain) && agrees(&round, 0.5 * gain));
        // Held-out episodes that gain a third as much each: enough for what is plain.
        round.rivals[0].heldout = left_of(1.33);
        assert!(!agrees(&round, 2.0 * gain) && agrees(&round, 0.5 * gain));
    }

    #[test]
    fn what_one_episode_shows_is_no_plain_gain() {
        let pieces = |count: usize| (0..count).map(|place| place..place + 1).collect();
        let episodes = Episodes { fitted: pieces(4), heldout: pieces(2), counts: vec![20; 2] };
        let mut round = round(3.0, 3.0);
        let mut residuals = leaves(3.0).residuals;
        residuals[0] = DVector::from_element(20, 0.5);
        residuals[1] = DVector::from_element(20, 2.5);
        round.rivals[0].fit = Fit::new(Model::nominal(0, 0), Vec::new(), Vec::new(), residuals, Vec::new());
        // 42 of the 47 it gains are of one episode.
        let gain = round.rivals[0].fit.log_evidence() - round.base.log_evidence();
        round.rivals[0].gain = gain;
        let agrees = |plain: f64| {
            agrees(&round.rivals[0], &round, &episodes, Asked { least: 5.0, plain, kept: false, steady: false })
        };
        assert!(!agrees(40.0), "{gain}");
        assert!(agrees(5.0));
    }

    #[test]
    fn the_error_of_a_sum_is_that_of_its_terms_times_the_root_of_their_number() {
        // Standard deviation √(16/3) with n − 1 in the denominator, times √4.
        let error = standard_error_of_sum(&[3.0, 7.0, 3.0, 7.0]);
        assert!((error - (16.0_f64 / 3.0).sqrt() * 2.0).abs() < 1e-12, "{error}");
    }
}
