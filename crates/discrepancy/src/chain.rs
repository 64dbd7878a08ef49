//! Several effects of what is thrown, one after another.
//!
//! Tosses show shape, centre of mass, bounces and the tracker's frame at once, and each hides some of the others. To fit every rival of each to all
//! episodes would cost more than the budget, and errors that are learnt where most is still missing hide the rest. So effects are looked for in the
//! episodes of the screening alone, as long as one lasts there; where all of them are, errors are learnt, and what they make together is fitted to all
//! episodes and has to convince there. If it does not, the last one is dropped.

use crate::accept::{Episodes, convinces, lasts};
use crate::begin::promise_known;
use crate::fit::{Begin, Effort, Fit, STEPS, fit};
use crate::model::Model;
use crate::rival::{Heldout, Rival, Round, first_of_each};
use crate::screen::{Promise, Screening};
use crate::search::{Search, added_kind};
use crate::study::Study;

/// So many effects make a chain. One alone is compared with its rivals in all episodes.
const LEAST: usize = 2;

/// What a link has to gain, as a share of what those before it did: errors of all of them are at their size in all others. Of 32 simulated logs of one to
/// three effects spurious ones gained up to 2.6 %, true ones 4.5 % and more.
pub(crate) const LEAST_SHARE: f64 = 0.03;

/// Coordinates of an effect of what is thrown, as most have them, and kinds that are fitted beside another one.
const COORDINATES: usize = 1;
const KINDS: usize = 3;

/// What is compared to be added to a model, in the episodes of the screening.
pub(crate) struct Link {
    /// What each candidate promises.
    pub(crate) promises: Vec<Promise>,
    /// Fits of the best ones, the most probable first.
    pub(crate) quick: Vec<Fit>,
    /// The model they are added to.
    pub(crate) base: Fit,
    /// Whether the first one is a link of a chain.
    pub(crate) holds: bool,
}

impl Link {
    /// What the first one gains in the episodes of the screening.
    fn gain(&self) -> f64 {
        self.quick.first().map_or(0.0, |best| best.log_evidence() - self.base.log_evidence())
    }
}

impl Search<'_> {
    /// Looks for several effects beside the nominal model `null`, which knows the episodes of the screening alone: what each link compared, the last of
    /// which may have found nothing.
    pub(crate) fn chain(&mut self, screening: &Screening, null: &Fit) -> Vec<Link> {
        let (mut links, mut gained) = (Vec::new(), 0.0);
        // What is done with them in the end: to learn errors, and to fit the model without them.
        let simulations = self.study.simulations_to_learn();
        self.reserve = simulations
            * (self.study.rollouts() + self.kept.rollouts() + self.reported.as_ref().map_or(0, Study::rollouts))
            + (null.model.tunables + STEPS + 1) * self.study.rollouts();
        let (mut part, mut at) = (self.part.clone(), null.clone());
        while at.model.parts.len() < self.settings.effects && self.affords_one_more(&part, &at.model) {
            if at.model.parts.len() == LEAST {
                // Most of what is wrong is known now.
                part.learn_errors(&at.model.hypothesis(&at.x));
                at = fit(&part, at.model, Begin::at(&at.x), Effort::Quick);
            }
            let known: Vec<Fit> = links.iter().rev().flat_map(|link: &Link| link.quick.iter().cloned()).collect();
            let mut link = self.link(screening, &part, &at, &known);
            let gain = self.share(screening) * link.gain();
            let least = self.asked(gained).least;
            link.holds = gain > least && link.quick.first().is_some_and(|best| self.lasts_in(best, &part));
            let best = link.quick.first().filter(|_| link.holds).cloned();
            links.push(link);
            match best {
                Some(best) => at = best,
                None => break,
            }
            gained += gain;
        }
        self.reserve = 0;
        links
    }

    /// What could be added to `base`, which knows the episodes of the screening alone, as `part` does. `known`: what was compared before.
    pub(crate) fn link(&self, screening: &Screening, part: &Study, base: &Fit, known: &[Fit]) -> Link {
        let promises = promise_known(part, base, self.promises(screening, part, base), known);
        let quick = self.quick(screening, part, base, &promises);
        Link { promises, quick, base: base.clone(), holds: false }
    }

    /// Whether the budget suffices to look for an effect beside those of a model, and for what they come to together.
    fn affords_one_more(&self, part: &Study, model: &Model) -> bool {
        let coordinates = model.simulated() + COORDINATES;
        let looked = KINDS * (coordinates + STEPS + 1) + part.simulations_to_learn();
        let fitted = (coordinates + STEPS + 1) * self.study.rollouts();
        self.study.affords(looked * part.rollouts() + fitted + self.reserve)
    }

    fn lasts_in(&self, fit: &Fit, study: &Study) -> bool {
        lasts(fit, &study.groups(), self.settings.seed)
    }

    /// The model with the effects of a chain, fitted to all episodes, and what was compared for each; nothing of a chain of one. Errors are learnt with
    /// them.
    pub(crate) fn together(
        &mut self,
        screening: &Screening,
        null: &Fit,
        links: &[Link],
        episodes: &Episodes,
    ) -> Option<(Fit, Vec<Round>)> {
        let found: Vec<&Fit> = links.iter().filter(|link| link.holds).map(|link| &link.quick[0]).collect();
        self.learn_errors(found.last().filter(|longest| longest.model.parts.len() >= LEAST)?);
        let base = fit(&self.study, null.model.clone(), Begin::at(&null.x), Effort::Quick);
        let before = self.heldout(&base);
        let beside = |promises, rivals| Round {
            promises,
            rivals,
            passed_over: Vec::new(),
            base: base.clone(),
            before: before.clone(),
            hasty: true,
        };
        let round = |link: &Link| beside(link.promises.clone(), self.rivals(screening, link));
        let without = beside(Vec::new(), Vec::new());
        for (place, begin) in found.into_iter().enumerate().rev() {
            if !self.affords(&self.study, &begin.model) {
                continue;
            }
            let fit = fit(&self.study, begin.model.clone(), Begin::at(&begin.x), self.effort(&begin.model));
            let gain = fit.log_evidence() - base.log_evidence();
            let all = Rival { heldout: self.heldout(&fit), gain, fit, whole: true };
            if convinces(&all, &without, episodes, self.asked(0.0), self.settings.seed) {
                return Some((all.fit, links[..=place].iter().map(round).collect()));
            }
        }
        Some((base.clone(), vec![round(&links[0])]))
    }

    /// With care, if the budget suffices.
    fn effort(&self, model: &Model) -> Effort {
        let twice = 2 * (model.simulated() + STEPS + 1) * self.study.rollouts();
        if self.study.affords(twice) { Effort::Full } else { Effort::Quick }
    }

    /// What a link compared, as if in all episodes.
    fn rivals(&self, screening: &Screening, link: &Link) -> Vec<Rival> {
        let share = self.share(screening);
        let first = link.base.model.parts.is_empty();
        let rival = |fit: &Fit| Rival {
            gain: share * (fit.log_evidence() - link.base.log_evidence()),
            // Nothing is decided by those of further effects.
            heldout: if first { self.heldout(fit) } else { Heldout::default() },
            fit: fit.clone(),
            whole: false,
        };
        let mut rivals: Vec<Rival> = link.quick.iter().map(rival).collect();
        first_of_each(&mut rivals, |rival| added_kind(&rival.fit));
        rivals
    }
}
