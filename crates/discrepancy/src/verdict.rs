//! What to call it: an effect, nothing, or something that the catalogue has not.

use std::ops::Range;

use crate::diagnosis::{Diagnosis, Settings};
use crate::likelihood::{NOISE_FLOOR, mean_square, trimmed_mean};
use crate::report::Verdict;

/// A model that closes more of the gap than this explains it, whatever the solver's errors leave.
const CLOSED: f64 = 0.95;

/// The same where what is left is small.
const NEARLY_CLOSED: f64 = 0.9;

/// A mean square that nothing explains, whatever share of the gap is closed: of 1200 logs in which an effect was named rightly none had 3.
const HOPELESS: f64 = 10.0;

/// What closes less than this of the held-out gap comes near nothing.
const LEAST_CLOSED: f64 = 0.2;

/// An effect that closes less than this of a gap stands for something else.
const HALF: f64 = 0.5;
/// Odd episodes that go their own way, each another one, as fast contacts do in another engine, are no missing effect: what is left has to stand out, if it can.
/// In the 28 fitted episodes of a log of 40 all that the catalogue does not have did; in 11 a weak magnet did not.
const LEAST_TO_STAND_OUT: usize = 20;
/// In fewer episodes than this a gap may be chance.
const LEAST_GAPS: usize = 3;

/// Held-out mean squares under the re-tuned nominal and the accepted model.
pub(crate) fn heldout_errors(diagnosis: &Diagnosis) -> [f64; 2] {
    let count = diagnosis.heldout_counts.iter().sum::<usize>().max(1) as f64;
    diagnosis.heldout.each_ref().map(|sums| sums.iter().sum::<f64>() / count)
}

pub(crate) fn closed_fraction(before: f64, after: f64) -> f64 {
    let gap = before - NOISE_FLOOR;
    if gap > 0.0 { ((before - after) / gap).min(1.0) } else { 1.0 }
}

/// The verdict, and why it is `unknown`.
pub(crate) fn verdict(diagnosis: &Diagnosis, settings: &Settings) -> (Verdict, Option<String>) {
    let [before, after] = heldout_errors(diagnosis);
    let closed_fraction = closed_fraction(before, after);
    let parts = &diagnosis.model.model.parts;
    let left = trimmed_mean(diagnosis.mean_squares.clone());
    let heldout = diagnosis.heldout_episodes.iter().map(|(_, before, after)| [*before, *after]);
    let of_models = |group: &Range<usize>| {
        [&diagnosis.nominal, &diagnosis.model].map(|fit| mean_square(&fit.residuals[group.clone()]))
    };
    let fitted = diagnosis.pieces.iter().map(of_models);
    // A body in the way shows in the episodes that meet it, whatever the others lack.
    let everywhere = parts.iter().any(|part| part.begin.is_none());
    // Of what was fitted, where the gap is plain: a cause that few episodes meet need not show in those held out.
    let chance = diagnosis.remaining.iter().map(|cell| cell.p_value).fold(1.0, f64::min);
    let few = diagnosis.pieces.len() < LEAST_TO_STAND_OUT;
    let shows = chance < settings.another || (few && closed_fraction < NEARLY_CLOSED);
    let odd = diagnosis.heldout_episodes.iter().map(|(_, _, after)| *after).fold(0.0, f64::max);
    let reason = if let Some(reason) = is_left(left, chance, closed_fraction, settings) {
        Some(reason)
    } else if everywhere && shows && stands_for_another(before, heldout, fitted, settings) {
        Some("the nearest effect closes less than half of the gap in a typical episode".into())
    } else if parts.is_empty() && odd > settings.odd {
        Some(format!("one held-out episode has a mean square of {odd:.1}; noise alone gives 1"))
    } else {
        None
    };
    let verdict = match (&reason, parts.is_empty()) {
        (Some(_), _) => Verdict::Unknown,
        (None, true) => Verdict::None,
        (None, false) => Verdict::Effect,
    };
    (verdict, reason)
}

/// Why what a model leaves is no noise, if it is none: much in most episodes, or little that all have in the same channel and phase, with this chance of standing
/// out under a right model.
fn is_left(trimmed_mean: f64, chance: f64, closed_fraction: f64, settings: &Settings) -> Option<String> {
    let much = trimmed_mean > settings.unexplained && closed_fraction < CLOSED;
    if much || trimmed_mean > HOPELESS {
        return Some(format!("most episodes still have a mean square of about {trimmed_mean:.2}; noise alone gives 1"));
    }
    let little = chance < settings.left_by_chance && closed_fraction < NEARLY_CLOSED;
    little.then(|| {
        format!(
            "what is left is small, but no chance: in one channel and phase it stands out as noise does in one log of {:.0}",
            chance.recip()
        )
    })
}

/// Whether the effects of a model that does not explain the gap are worth telling: they close a part of it. Which of several that do as well it is, the confusion set
/// says.
pub(crate) fn comes_near(diagnosis: &Diagnosis) -> bool {
    let [before, after] = heldout_errors(diagnosis);
    !diagnosis.model.model.parts.is_empty() && closed_fraction(before, after) > LEAST_CLOSED
}

/// Whether what is named closes so little of the gaps of typical episodes, of those held out or of those fitted, that something else makes them. Of each
/// episode: mean squares under the nominal and the accepted model.
fn stands_for_another(
    before: f64,
    heldout: impl Iterator<Item = [f64; 2]>,
    fitted: impl Iterator<Item = [f64; 2]>,
    settings: &Settings,
) -> bool {
    let of_heldout = before > settings.gap && typical_closing(heldout, settings.gap) < HALF;
    of_heldout || typical_closing(fitted, settings.unexplained) < HALF
}

/// Median over the episodes with a mean square above `gap` of the share of it that is closed; 1 where there are too few to say. Of each episode: mean
/// squares under the nominal and the accepted model.
fn typical_closing(episodes: impl Iterator<Item = [f64; 2]>, gap: f64) -> f64 {
    let plain = episodes.filter(|[before, _]| *before > gap);
    let mut closings: Vec<f64> = plain.map(|[before, after]| (before - after) / (before - NOISE_FLOOR)).collect();
    if closings.len() < LEAST_GAPS {
        return 1.0;
    }
    closings.sort_by(f64::total_cmp);
    closings[closings.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_closes_little_of_the_plain_gaps_stands_for_something_else() {
        // A magnet that three of six episodes meet, taken for a tilt.
        let met = [[1.2, 0.9], [2.0, 1.9], [1.3, 1.1], [1.1, 1.1], [5.0, 4.1], [13.0, 13.6]];
        assert!(typical_closing(met.into_iter(), 1.4) < HALF);
        // Two episodes are no rule, and one odd one of four is none.
        assert_eq!(typical_closing(met.into_iter().take(5), 1.4), 1.0);
        assert!(typical_closing([[3.0, 1.0], [4.0, 1.1], [2.0, 0.9], [9.0, 9.5]].into_iter(), 1.4) > HALF);
    }

    #[test]
    fn much_is_left_whatever_stands_out_and_little_where_it_stands_out() {
        let settings = Settings::default();
        let left = |trimmed_mean, chance, closed| is_left(trimmed_mean, chance, closed, &settings).is_some();
        assert!(left(1.5, 1.0, 0.5) && left(1.05, 0.001, 0.5));
        // Noise, as it comes; what is nearly closed.
        assert!(!left(1.05, 0.05, 0.5) && !left(1.05, 0.001, 0.95) && !left(1.5, 1.0, 0.96));
        assert!(left(1.5, 0.001, 0.93), "much is left");
        assert!(left(12.0, 1.0, 0.99), "whatever was there before");
    }
}
