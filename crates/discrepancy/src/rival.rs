//! What a round of the search compares.

use physics_model::EffectKind;

use crate::fit::Fit;
use crate::screen::Promise;

/// A fitted model with a further effect.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Its fit; the further effect is the last of the model's parts.
    pub fit: Fit,
    /// Whether it was fitted to all episodes, not to those of the screening alone.
    pub whole: bool,
    /// ln evidence over that of the model without; of what was fitted to the episodes of the screening alone what that promises for all.
    pub gain: f64,
    /// Sums of squares of the held-out episodes; empty where nothing is decided by them.
    pub heldout: Vec<f64>,
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
    /// The model that they were added to, with the same errors; of several effects that were fitted together the nominal one.
    pub base: Fit,
    /// Sums of squares of the held-out episodes under that model.
    pub before: Vec<f64>,
    /// Whether the rivals were compared in haste: a second effect seemed to be missing.
    pub hasty: bool,
}

impl Round {
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

    #[test]
    fn variants_of_a_kind_count_once() {
        let mut list = vec!["a1", "b1", "a2", "c1", "b2", "a1"];
        of_first(&mut list, 2, |item| item.chars().next());
        assert_eq!(list, ["a1", "b1", "a2", "b2", "a1"]);
        first_of_each(&mut list, |item| *item);
        assert_eq!(list, ["a1", "b1", "a2", "b2"]);
    }
}
