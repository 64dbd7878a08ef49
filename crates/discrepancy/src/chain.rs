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
use crate::search::{NEAR, Search, added_kind};
use crate::study::Study;

/// So many effects make a chain. One alone is compared with its rivals in all episodes.
const LEAST: usize = 2;

/// What a link has to gain, as a share of what those before it did: errors of all of them are at their size in all others. Of 32 simulated logs of one to
/// three effects spurious ones gained up to 2.6 %, true ones 4.5 % and more.
pub(crate) const LEAST_SHARE: f64 = 0.03;

/// Coordinates of an effect of what is thrown, and kinds that are fitted beside another one: most have fewer.
const COORDINATES: usize = 3;
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
    /// What the first one gains over the one in whose place it came when all links were known, in the episodes of the screening.
    pub(crate) exchanged: f64,
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
        self.exchange_links(&part, &mut links);
        self.reserve = 0;
        links
    }

    /// Puts near rivals in the places of links before the last one: what was compared while others hid is compared again where all are known.
    fn exchange_links(&self, part: &Study, links: &mut [Link]) {
        let held = links.iter().filter(|link| link.holds).count();
        if held < LEAST {
            return;
        }
        let mut at = links[held - 1].quick[0].clone();
        for place in 0..held - 1 {
            let link = &links[place];
            let lead = link.quick[0].log_evidence();
            let near = |rival: &&Fit| {
                added_kind(rival).is_some_and(|kind| at.model.parts.iter().all(|part| part.kind() != kind))
                    && lead - rival.log_evidence() < NEAR
            };
            let rivals: Vec<(usize, &Fit)> = link.quick.iter().enumerate().filter(|(_, rival)| near(rival)).collect();
            let mut best: Option<(usize, Fit)> = None;
            for (index, rival) in rivals {
                let Some((model, x)) = replaced(&at, place, rival) else { continue };
                if !self.affords_both(part, &model) {
                    break;
                }
                let fit = fit(part, model, Begin::at(&x), Effort::Quick);
                let lead = best.as_ref().map_or(at.log_evidence(), |(_, best)| best.log_evidence());
                if fit.log_evidence() > lead {
                    best = Some((index, fit));
                }
            }
            if let Some((index, fit)) = best {
                links[place].exchanged =
                    lead - links[place].quick[index].log_evidence() + fit.log_evidence() - at.log_evidence();
                let rival = links[place].quick.remove(index);
                links[place].quick.insert(0, rival);
                links[held - 1].quick[0] = fit.clone();
                at = fit;
            }
        }
    }

    /// What could be added to `base`, which knows the episodes of the screening alone, as `part` does. `known`: what was compared before.
    pub(crate) fn link(&self, screening: &Screening, part: &Study, base: &Fit, known: &[Fit]) -> Link {
        let promises = promise_known(part, base, self.promises(screening, part, base), known);
        let quick = self.quick(screening, part, base, &promises);
        Link { promises, quick, base: base.clone(), holds: false, exchanged: 0.0 }
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
        let rival = |(rank, fit): (usize, &Fit)| Rival {
            gain: share
                * (fit.log_evidence() - link.base.log_evidence() + if rank == 0 { link.exchanged } else { 0.0 }),
            // Nothing is decided by those of further effects.
            heldout: if first { self.heldout(fit) } else { Heldout::default() },
            fit: fit.clone(),
            whole: false,
        };
        let mut rivals: Vec<Rival> = link.quick.iter().enumerate().map(rival).collect();
        first_of_each(&mut rivals, |rival| added_kind(&rival.fit));
        rivals
    }
}

/// The model of `at` with the last effect of `rival` in place of its own there, and where both are.
fn replaced(at: &Fit, place: usize, rival: &Fit) -> Option<(Model, Vec<f64>)> {
    let other = rival.model.parts.last()?;
    let own = &rival.x[rival.x.len() - other.coordinates.len()..];
    let first = at.x.len() - at.model.parts.iter().map(|part| part.coordinates.len()).sum::<usize>();
    let (mut model, mut x) = (at.model.clone(), at.x[..first].to_vec());
    let mut from = first;
    for (index, part) in at.model.parts.iter().enumerate() {
        let to = from + part.coordinates.len();
        x.extend_from_slice(if index == place { own } else { &at.x[from..to] });
        from = to;
    }
    model.parts[place] = other.clone();
    Some((model, x))
}
