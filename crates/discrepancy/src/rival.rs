//! What a round of the search compares.

use physics_model::EffectKind;

use crate::fit::Fit;
use crate::screen::Promise;

/// What a model leaves of the held-out episodes, piece by piece.
#[derive(Clone, Debug, Default)]
pub struct Heldout {
    /// Sums of squares.
    pub squares: Vec<f64>,
    /// −ln p, but for a constant.
    pub costs: Vec<f64>,
}

impl Heldout {
    /// What each piece gains in ln p from this model to another.
    pub(crate) fn gains(&self, after: &Self) -> Vec<f64> {
        self.costs.iter().zip(&after.costs).map(|(before, after)| before - after).collect()
    }
}

/// A fitted model with a further effect.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Its fit; the further effect is the last of the model's parts.
    pub fit: Fit,
    /// Whether it was fitted to all episodes, not to those of the screening alone.
    pub whole: bool,
    /// ln evidence over that of the model without; of what was fitted to the episodes of the screening alone what that promises for all.
    pub gain: f64,
    /// What it leaves of the held-out episodes; nothing where nothing is decided by them.
    pub heldout: Heldout,
}

impl Rival {
    /// The further effect.
    ///
    /// # Panics
    ///
    /// Never: a rival has one.
    #[must_use]
    pub fn kind(&self) -> EffectKind {
        self.fit.model.parts.last().expect("a rival has an effect").kind()
    }
}

/// What a round of the search compared.
#[derive(Debug)]
pub struct Round {
    /// What each candidate promised by a linear step.
    pub promises: Vec<Promise>,
    /// The fitted ones, the most probable first.
    pub rivals: Vec<Rival>,
    /// Those before the first one that convinced: more evidence, but what was held out, or other resamples, spoke against them.
    pub passed_over: Vec<Rival>,
    /// The model that they were added to, with the same errors; of several effects that were fitted together the nominal one.
    pub base: Fit,
    /// What that model leaves of the held-out episodes.
    pub before: Heldout,
    /// Whether the rivals were compared in haste: a second effect seemed to be missing.
    pub hasty: bool,
}

impl Round {
    /// Drops the rivals before the one at `place`, which convinces.
    pub(crate) fn pass_over(&mut self, place: usize) {
        self.passed_over.extend(self.rivals.drain(..place));
    }

    /// Those that were passed over, as far as no rival has their effect.
    pub(crate) fn passed_over_kinds(&self) -> impl Iterator<Item = &Rival> {
        self.passed_over.iter().filter(|rival| self.rivals.iter().all(|found| found.kind() != rival.kind()))
    }

    /// Of these the kind, and by how much more they explain all episodes than the first rival does, those held out among them: ln evidence of what was
    /// fitted, ln p of what was not.
    pub(crate) fn passed_over(&self) -> Vec<(EffectKind, f64)> {
        let Some(first) = self.rivals.first() else { return Vec::new() };
        let all = |rival: &Rival| rival.gain + self.before.gains(&rival.heldout).iter().sum::<f64>();
        self.passed_over_kinds().map(|rival| (rival.kind(), all(rival) - all(first))).collect()
    }

    /// The fit of the first rival, or that of the model without one.
    pub(crate) fn best(&self, found: bool) -> &Fit {
        self.rivals.first().filter(|_| found).map_or(&self.base, |rival| &rival.fit)
    }
}

/// The most probable first.
pub(crate) fn sort(rivals: &mut [Rival]) {
    rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
}

/// Keeps the first of each key.
pub(crate) fn first_of_each<T, K: PartialEq>(list: &mut Vec<T>, key: impl Fn(&T) -> K) {
    let mut keys = Vec::new();
    list.retain(|item| {
        let key = key(item);
        let first = !keys.contains(&key);
        keys.push(key);
        first
    });
}

/// Keeps those with one of the first `count` keys.
pub(crate) fn of_first<T, K: PartialEq>(list: &mut Vec<T>, count: usize, key: impl Fn(&T) -> K) {
    let mut keys = Vec::new();
    list.retain(|item| {
        let key = key(item);
        if keys.len() < count && !keys.contains(&key) {
            keys.push(key);
            return true;
        }
        keys.contains(&key)
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candidate::{candidates, tests::context};
    use crate::likelihood::Stack;
    use crate::model::Model;

    fn left_of(cost: f64) -> Heldout {
        Heldout { squares: Vec::new(), costs: vec![cost] }
    }

    /// A rival that gains so much and leaves such a −ln p of held-out residuals.
    fn rival(kind: EffectKind, gain: f64, left: f64) -> Rival {
        let candidate = candidates(&context()).into_iter().find(|candidate| candidate.kind() == kind).unwrap();
        let model = Model::nominal(0, 0).with(&candidate);
        let fit = Fit::new(model, Vec::new(), Vec::new(), Stack::default(), Vec::new());
        Rival { fit, whole: true, gain, heldout: left_of(left) }
    }

    #[test]
    fn what_held_out_episodes_speak_against_is_weighed_by_all_of_them() {
        use EffectKind as K;
        let rivals = vec![rival(K::TimeBase, 80.0, 104.0), rival(K::FrictionLevel, 40.0, 98.0)];
        let base = rival(K::Tether, 0.0, 100.0).fit;
        let mut round =
            Round { promises: Vec::new(), rivals, passed_over: Vec::new(), base, before: left_of(100.0), hasty: false };
        assert!(round.passed_over().is_empty());
        round.pass_over(1);
        let [(kind, more)] = round.passed_over()[..] else { panic!("one was passed over") };
        // 40 of what was fitted, less what the held-out ones say.
        assert_eq!(kind, K::TimeBase);
        assert!((30.0..40.0).contains(&more), "{more}");
        // Once it is a rival again it is no other.
        round.rivals.push(rival(K::TimeBase, 10.0, 100.0));
        assert!(round.passed_over().is_empty());
    }

    #[test]
    fn variants_of_a_kind_count_once() {
        let mut list = vec!["a1", "b1", "a2", "c1", "b2", "a1"];
        of_first(&mut list, 2, |item| item.chars().next());
        assert_eq!(list, ["a1", "b1", "a2", "b2", "a1"]);
        first_of_each(&mut list, |item| *item);
        assert_eq!(list, ["a1", "b1", "a2", "b2"]);
    }
}
