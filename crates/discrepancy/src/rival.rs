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
    /// Residuals, standardised but not white.
    pub(crate) raw: Vec<Vec<f64>>,
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

    /// All that were compared.
    pub(crate) fn fits(&self) -> Vec<Fit> {
        self.rivals.iter().chain(&self.passed_over).map(|rival| rival.fit.clone()).collect()
    }

    /// The rival of this name that gains most.
    pub(crate) fn rival(&self, name: &str) -> Option<&Rival> {
        let named = self.rivals.iter().chain(&self.passed_over).filter(|rival| rival.kind().name() == name);
        named.max_by(|a, b| a.gain.total_cmp(&b.gain))
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

    /// A rival that gains so much.
    fn rival(kind: EffectKind, gain: f64) -> Rival {
        let candidate = candidates(&context()).into_iter().find(|candidate| candidate.kind() == kind).unwrap();
        let model = Model::nominal(0, 0).with(&candidate);
        let fit = Fit::new(model, Vec::new(), Vec::new(), Stack::default(), Vec::new());
        Rival { fit, whole: true, gain, heldout: Heldout::default() }
    }

    #[test]
    fn a_rival_is_found_by_its_name_also_where_it_was_passed_over() {
        use EffectKind as K;
        let rivals = vec![rival(K::TimeBase, 80.0), rival(K::FrictionLevel, 40.0), rival(K::FrictionLevel, 50.0)];
        let (promises, base) = (Vec::new(), rival(K::Tether, 0.0).fit);
        let mut round =
            Round { promises, rivals, passed_over: Vec::new(), base, before: Heldout::default(), hasty: false };
        round.pass_over(1);
        assert_eq!(round.rival("time_base").unwrap().gain, 80.0);
        assert_eq!(round.rival("friction_level").unwrap().gain, 50.0);
        assert!(round.rival("tether").is_none());
        assert_eq!(round.passed_over_kinds().count(), 1);
        // Once it is a rival again it is no other.
        round.rivals.push(rival(K::TimeBase, 10.0));
        assert_eq!(round.passed_over_kinds().count(), 0);
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
