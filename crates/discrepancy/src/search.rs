//! The search for effects: rounds of screening, quick fits, fits with care, and a decision.

use std::ops::Range;

use nalgebra::DVector;
use physics_model::EffectKind;

use crate::accept::{Asked, Episodes, better_heldout, both_convince, convinces, lasts, may_convince};
use crate::begin::in_all;
use crate::candidate::Candidate;
use crate::chain::{LEAST_SHARE, Link};
use crate::diagnosis::Settings;
use crate::fit::{Begin, Effort, Fit, STEPS, fit};
use crate::likelihood::{Stack, mean_square, trimmed_mean};
use crate::locate::{Cell, locate};
use crate::model::Model;
use crate::rival::{Heldout, Rival, Round, first_of_each, of_first, sort};
use crate::screen::{Promise, Screening};
use crate::study::Study;
use crate::trial::Kind;

mod quick;
mod retune;

/// What a further effect has to gain, as a share of what those before it did; less, down to the latter, where held-out episodes gain as well. So 2 of 9 pairs of
/// seeds 17 and 18 are found whose second effect gains less than a hundredth, and none of the 35 logs of seed 18 with one effect that gain most gets a second name.
const SECOND_SHARE: f64 = 0.01;
const LEAST_SECOND_SHARE: f64 = 0.0025;
/// Rivals nearer than this in ln evidence on the episodes of the screening are fitted with care.
const NEAR: f64 = 60.0;
/// What keeps this share of what it promised in the episodes of the screening says what others would keep.
const MOST_KEEP: f64 = 0.5;
/// If an effect gains more than this in ln evidence of the episodes of the screening, a model without was no place to learn errors at.
const FAR: f64 = 100.0;

/// The search for effects.
pub(crate) struct Search<'a> {
    /// Episodes that models are fitted to.
    pub(crate) study: Study<'a>,
    /// Those held out, by which models are chosen.
    pub(crate) kept: Study<'a>,
    /// Those held out for the report; `None`: the same.
    pub(crate) reported: Option<Study<'a>>,
    /// Those of the screening, with errors learnt where re-tuning alone leads.
    pub(crate) part: Study<'a>,
    /// What it may do.
    pub(crate) settings: &'a Settings,
    /// Simulated episodes that something later needs.
    pub(crate) reserve: usize,
}

impl Search<'_> {
    /// What a model leaves of the held-out episodes.
    pub(crate) fn heldout(&self, fit: &Fit) -> Heldout {
        let raw = self.kept.raw(&fit.model.hypothesis(&fit.x));
        let white = self.kept.white(&raw, fit.model.engine_errors(&fit.x));
        Heldout { squares: white.iter().map(DVector::norm_squared).collect(), costs: white.costs(), raw }
    }

    /// Error of a kind in the held-out episodes, as a share of what it does there: root mean squares, both in its unit. 0 without such readings.
    pub(crate) fn heldout_share(&self, raw: &[Vec<f64>], kind: Kind) -> f64 {
        let (mut error, mut signal) = (0.0, 0.0);
        for (index, raw) in self.kept.chosen.iter().zip(raw) {
            let trial = &self.study.simulator.trials[*index];
            let Some(does) = trial.signal(kind) else { continue };
            let errors = trial.errors(raw);
            let squares = errors.iter().filter(|(of, _)| *of == kind).map(|(_, error)| error * error);
            let count = squares.clone().count();
            error += squares.sum::<f64>() / count.max(1) as f64;
            signal += does;
        }
        if signal > 0.0 { (error / signal).sqrt() } else { 0.0 }
    }

    /// Mean square of such residuals in each held-out episode, as far as they are of some kinds; of those episodes that have any.
    pub(crate) fn heldout_errors(&self, stack: &Stack, episodes: &Episodes, of: &dyn Fn(Kind) -> bool) -> Vec<f64> {
        let one = |group: &Range<usize>| {
            let (mut square, mut count) = (0.0, 0_usize);
            for place in group.clone() {
                let blocks = &self.study.simulator.trials[self.kept.chosen[place]].blocks;
                for (_, residual) in blocks.iter().zip(stack[place].iter()).filter(|(block, _)| of(block.kind)) {
                    square += residual * residual;
                    count += 1;
                }
            }
            (count > 0).then(|| square / count as f64)
        };
        episodes.heldout.iter().filter_map(one).collect()
    }

    /// Held-out episodes of the report.
    pub(crate) fn reported(&self) -> &Study<'_> {
        self.reported.as_ref().unwrap_or(&self.kept)
    }

    /// Adds effects to the nominal model, as re-tuned in the episodes of the screening, as long as one convinces and what it leaves stands out or another one
    /// promises enough; the model with them, and what was compared.
    pub(crate) fn effects(&mut self, screening: &Screening, null: &Fit, episodes: &Episodes) -> (Fit, Vec<Round>) {
        let settings = self.settings;
        let (mut accepted, mut rounds, mut explained) = (null.clone(), Vec::new(), 0.0);
        let within = |search: &Self| search.study.has_rounds();
        let mut links = if settings.effects > 2 { self.chain(screening, null) } else { Vec::new() };
        if let Some((accepted, rounds)) = self.together(screening, null, &links, episodes) {
            return (accepted, rounds);
        }
        links.truncate(1);
        while rounds.is_empty() || (accepted.model.parts.len() < settings.effects && within(self)) {
            let compared = rounds.last().map_or_else(Vec::new, Round::fits);
            let known = links.pop().unwrap_or_else(|| self.beside(screening, &accepted, &compared));
            let mut round = self.round(screening, &accepted, known);
            let mut found = settings.effects > 0 && self.choose(&mut round, episodes, explained);
            if !found && round.hasty {
                if let Some(pair) = self.both(screening, &mut round, episodes) {
                    accepted = pair.best(true).clone();
                    rounds.extend([round, pair]);
                    break;
                }
                self.compare(screening, &mut round);
                found = self.choose(&mut round, episodes, explained);
            }
            // Without another effect the same model, fitted with more care on the way.
            accepted = round.best(found).clone();
            explained += round.rivals.first().map_or(0.0, |best| best.gain);
            rounds.push(round);
            if !found {
                break;
            }
            // A third one is worth more than to ask which two it was.
            if settings.effects == 2
                && let [first, second] = rounds.as_mut_slice()
            {
                self.exchange(screening, [first, second], episodes);
                accepted = second.best(true).clone();
            }
            let cells = self.left(&accepted);
            let another = self.stands_out(&cells) || self.promised(screening, &accepted) > self.asked(explained).least;
            if !another {
                break;
            }
        }
        // One that was fitted in haste for the sake of a second is compared with its rivals if there is none.
        if let [first, ..] = rounds.as_mut_slice()
            && accepted.model.parts.len() == 1
            && first.hasty
        {
            self.compare(screening, first);
            let found = self.choose(first, episodes, 0.0);
            accepted = first.best(found).clone();
        }
        (accepted, rounds)
    }

    /// Drops the rivals before the best one that convinces beside effects that gained so much, and says whether one does.
    fn choose(&self, round: &mut Round, episodes: &Episodes, explained: f64) -> bool {
        let asked = self.asked(explained);
        let best = round.rivals.iter().position(|rival| convinces(rival, round, episodes, asked, self.settings.seed));
        round.pass_over(best.unwrap_or(0));
        best.is_some()
    }

    /// What is asked of an effect beside others that gained so much.
    pub(crate) fn asked(&self, explained: f64) -> Asked {
        let rolls = self.study.simulator.nominal.rolls();
        let threshold = if rolls { self.settings.threshold_rolling } else { self.settings.threshold };
        // The errors of a solver grow with what it is asked to explain; links of a chain are asked more (see there).
        let shares = if self.settings.effects > 2 { [LEAST_SHARE; 2] } else { [LEAST_SECOND_SHARE, SECOND_SHARE] };
        let [least, plain] = shares.map(|share| threshold.max(share * explained));
        Asked { least, plain, kept: rolls, steady: rolls }
    }

    /// The round of a second effect beside the first rival, which does not convince alone, if both do together: the rivals before that one are dropped then.
    fn both(&mut self, screening: &Screening, round: &mut Round, episodes: &Episodes) -> Option<Round> {
        let (asked, seed) = (self.asked(0.0), self.settings.seed);
        let first = round.rivals.iter().position(|rival| may_convince(rival, episodes, asked, seed))?;
        if self.settings.effects < 2 || !self.study.has_rounds() {
            return None;
        }
        let Rival { fit, gain, .. } = round.rivals[first].clone();
        let known = self.beside(screening, &fit, &round.fits());
        let mut second = self.round(screening, &fit, known);
        if !self.choose(&mut second, episodes, gain) || !both_convince([round, &second], episodes, asked) {
            return None;
        }
        round.pass_over(first);
        self.exchange(screening, [round, &mut second], episodes);
        Some(second)
    }

    /// Fits with care what was fitted in haste and what is near it.
    fn compare(&self, screening: &Screening, round: &mut Round) {
        let without = round.base.log_evidence();
        let near = NEAR * self.share(screening);
        let lead = round.rivals.first().map_or(0.0, |first| first.gain);
        let mut change = None;
        for rival in &mut round.rivals {
            if lead - rival.gain < near && self.affords(&self.study, &rival.fit.model) {
                let fit = fit(&self.study, rival.fit.model.clone(), Begin::at(&rival.fit.x), Effort::Full);
                let gain = fit.log_evidence() - without - self.finer_steps(&round.base, &fit);
                change.get_or_insert(gain - rival.gain);
                *rival = Rival { heldout: self.heldout(&fit), gain, fit, whole: true };
            } else {
                // What care brings the first it might bring the others.
                rival.gain += change.unwrap_or(0.0);
            }
        }
        round.hasty = false;
        sort(&mut round.rivals);
        self.tune(round);
    }

    /// Puts a rival of the first effect in its place where that does better beside the second: which of those it was is plainer there.
    fn exchange(&self, screening: &Screening, [first, second]: [&mut Round; 2], episodes: &Episodes) {
        let Some((pair, _)) = second.rivals.split_first_mut() else { return };
        let Some((added, own)) = pair.fit.added().map(|(added, own)| (added.clone(), own.to_vec())) else { return };
        let part = self.study.part(&screening.places);
        let beside = |rival: &Rival| -> Option<Fit> {
            let x = [rival.fit.x.as_slice(), &own].concat();
            let model = rival.fit.model.with(&added);
            self.affords(&part, &model).then(|| fit(&part, model, Begin::at(&x), Effort::Quick))
        };
        // Beside a second effect what spoke against those passed over is another question.
        first.passed_over.clear();
        let Some((lead, others)) = first.rivals.split_first_mut() else { return };
        let Some(as_found) = beside(lead) else { return };
        let mut best: Option<(usize, Fit)> = None;
        // Bounces come with finer steps, which no other model has.
        let comparable = |rival: &Rival| rival.kind() != added.kind() && rival.kind() != EffectKind::Restitution;
        for (index, rival) in others.iter_mut().enumerate().filter(|(_, rival)| comparable(rival)) {
            let Some(fit) = beside(rival) else { break };
            let more = fit.log_evidence() - as_found.log_evidence();
            rival.gain = lead.gain + self.share(screening) * more;
            if more > 0.0 && best.as_ref().is_none_or(|(_, best)| fit.log_evidence() > best.log_evidence()) {
                best = Some((index, fit));
            }
        }
        let mut most = lead.gain;
        let best = best.filter(|(_, fit)| self.affords(&self.study, &fit.model));
        if let Some((index, begin)) = best {
            let fit = fit(&self.study, begin.model, Begin::at(&begin.x), Effort::Full);
            let heldout = self.heldout(&fit);
            // In all episodes, as far as those of the screening do not say.
            let more = fit.log_evidence() - pair.fit.log_evidence();
            others[index].gain = lead.gain + more;
            if more > 0.0
                && better_heldout(&heldout, &pair.heldout)
                && lasts(&fit, &episodes.fitted, self.settings.seed)
            {
                *pair = Rival { heldout, gain: pair.gain, fit, whole: true };
                most = others[index].gain;
                first.rivals.swap(0, index + 1);
            }
        }
        // No rival that was not better in all episodes comes before what is kept.
        let [_, others @ ..] = first.rivals.as_mut_slice() else { return };
        others.iter_mut().for_each(|rival| rival.gain = rival.gain.min(most));
        sort(others);
    }

    /// How many times as much all episodes say as those of the screening.
    pub(crate) fn share(&self, screening: &Screening) -> f64 {
        self.study.chosen.len() as f64 / screening.places.len() as f64
    }

    /// Whether a quick fit of a model to the episodes of a study is within the budget.
    pub(crate) fn affords(&self, study: &Study, model: &Model) -> bool {
        self.study.affords((model.simulated() + STEPS + 1) * study.rollouts())
    }

    /// Whether it is, and after it one to all episodes.
    fn affords_both(&self, part: &Study, model: &Model) -> bool {
        let rollouts = part.rollouts() + self.study.rollouts();
        self.study.affords((model.simulated() + STEPS + 1) * rollouts + self.reserve)
    }

    /// What a model leaves, by channel and phase.
    fn left(&self, fit: &Fit) -> Vec<Cell> {
        self.study.charge();
        locate(self.study.simulator, &self.study.chosen, fit, self.settings.seed)
    }

    /// Whether another effect is worth looking for.
    fn stands_out(&self, cells: &[Cell]) -> bool {
        cells.iter().any(|cell| cell.p_value < self.settings.another)
    }

    /// The most that another effect promises beside those of a model, by a linear step: nothing is simulated for it.
    fn promised(&self, screening: &Screening, fit: &Fit) -> f64 {
        let part = self.study.part(&screening.places);
        let promises = self.promises(screening, &part, &fit.part(&screening.places));
        promises.first().map_or(0.0, |best| best.gain)
    }

    /// What promises most beside the effects of a model, which knows the episodes of the screening alone, as `part` does.
    pub(crate) fn promises(&self, screening: &Screening, part: &Study, fit: &Fit) -> Vec<Promise> {
        let mut promises = screening.promises(part, fit, self.study.chosen.len());
        // What is there already is fitted with it; a second patch or body is another one.
        let there: Vec<EffectKind> = fit.model.parts.iter().map(Candidate::kind).collect();
        promises.retain(|promise| promise.candidate.tied_to_a_place() || !there.contains(&promise.candidate.kind()));
        // In a chain friction is re-tuned with everything else.
        if self.settings.effects > 2 && !there.is_empty() && self.study.simulator.nominal.tunes("table.friction") {
            promises.retain(|promise| promise.candidate.kind() != EffectKind::FrictionLevel);
        }
        promises
    }

    /// What the episodes of the screening say of what could be added to `base`, beside which `compared` was looked at before.
    fn beside(&self, screening: &Screening, base: &Fit, compared: &[Fit]) -> Link {
        if base.model.parts.is_empty() {
            return self.link(screening, &self.part, base, compared);
        }
        self.link(screening, &self.study.part(&screening.places), &base.part(&screening.places), compared)
    }

    /// Compares in all episodes what could be added to `base`, which in the first round knows those of the screening alone. `link`: what these say.
    fn round(&mut self, screening: &Screening, base: &Fit, link: Link) -> Round {
        let first = base.model.parts.is_empty();
        let Link { promises, mut quick, base: begin, .. } = link;
        let before = begin.log_evidence();
        let base = if first { self.without_effect(base, quick.first()) } else { base.clone() };
        let kinds = if first { self.settings.quick_fits } else { self.settings.fits };
        of_first(&mut quick, kinds, added_kind);
        let first_kind = quick.first().and_then(added_kind);
        let lead = quick.first().map_or(0.0, Fit::log_evidence);
        let without = base.log_evidence();
        let share = self.share(screening);
        // Where the best alone leaves much of the episodes of the screening, a second effect is the question, not by how much the first one leads.
        let hasty = first && quick.first().is_some_and(|best| leaves_much(best, &self.part, self.settings));
        let effort = if hasty { Effort::Quick } else { Effort::Full };
        let fully = |quick: Fit| -> Rival {
            if !self.affords(&self.study, &quick.model) {
                return Rival {
                    heldout: self.heldout(&quick),
                    gain: share * (quick.log_evidence() - before),
                    fit: quick,
                    whole: false,
                };
            }
            let begin = if first { in_all(&self.study, &base, &quick) } else { Begin::at(&quick.x) };
            let fit = fit(&self.study, quick.model, begin, effort);
            Rival {
                heldout: self.heldout(&fit),
                gain: fit.log_evidence() - without - self.finer_steps(&base, &fit),
                fit,
                whole: true,
            }
        };
        let alone = hasty || !first;
        let mut rivals: Vec<Rival> = (quick.into_iter().enumerate())
            .map(|(rank, quick)| {
                // Those far behind need no exact optimum: what they gain in the episodes of the screening they gain in all.
                let gain = quick.log_evidence();
                let affordable = !alone && self.study.has_rounds();
                // Whether a body in the way moves is seen where it is met, which may be in few episodes.
                let near = lead - gain < NEAR || added_kind(&quick) == first_kind;
                if rank == 0 || (near && affordable) {
                    fully(quick)
                } else {
                    Rival { heldout: self.heldout(&quick), fit: quick, gain: share * (gain - before), whole: false }
                }
            })
            .collect();
        if alone
            && let [first, others @ ..] = rivals.as_mut_slice()
            && first.whole
        {
            // What the others gain in the episodes of the screening is not what a fit to all does, but by how much less than the first it is: unless that
            // keeps too little of what it promised to say so.
            let (kept, promised) = (first.gain, share * (lead - before));
            if kept > MOST_KEEP * promised {
                others.iter_mut().for_each(|other| other.gain += kept - promised);
            }
        }
        loop {
            sort(&mut rivals);
            // Unless those before do not keep what they promise.
            match rivals.first() {
                Some(first) if !first.whole && self.affords(&self.study, &first.fit.model) => {
                    let first = rivals.swap_remove(0);
                    rivals.push(fully(first.fit));
                }
                _ => break,
            }
        }
        // A third effect is worth more.
        if !hasty && self.settings.effects == 2 {
            self.compare_nearest(&mut rivals, share, &fully);
        }
        first_of_each(&mut rivals, Rival::kind);
        let mut round = Round { promises, rivals, passed_over: Vec::new(), before: self.heldout(&base), base, hasty };
        self.tune(&mut round);
        round
    }

    /// Fits the rival that is nearest to the best one to all episodes, too: beside another effect, or where the first ones have used up what more than the
    /// best may cost, it was fitted to those of the screening alone.
    fn compare_nearest(&self, rivals: &mut Vec<Rival>, share: f64, fully: &dyn Fn(Fit) -> Rival) {
        if let [best, second, ..] = rivals.as_slice()
            && best.whole
            && !second.whole
            && best.gain - second.gain < NEAR * share
            && second.gain > self.settings.threshold
            && self.affords(&self.study, &second.fit.model)
        {
            let second = rivals.remove(1);
            rivals.push(fully(second.fit));
            sort(rivals);
        }
    }

    /// The model without an effect, which knew the episodes of the screening alone, fitted to all. How large errors are is learnt where the model is nearly
    /// right: with what explains most, if that gains much.
    fn without_effect(&mut self, base: &Fit, best: Option<&Fit>) -> Fit {
        let best = best.filter(|best| best.log_evidence() - base.log_evidence() > FAR);
        self.learn_errors(best.unwrap_or(base));
        let effort = if best.is_some() { Effort::Quick } else { Effort::Full };
        fit(&self.study, base.model.clone(), Begin::at(&base.x), effort)
    }

    /// Learns in all episodes how large errors are where a model is right.
    pub(crate) fn learn_errors(&mut self, right: &Fit) {
        let hypothesis = right.model.hypothesis(&right.x);
        self.study.learn_errors(&hypothesis);
        self.kept.learn_errors(&hypothesis);
        self.reported.iter_mut().for_each(|reported| reported.learn_errors(&hypothesis));
    }
}

/// Kind of a fit's last effect.
pub(crate) fn added_kind(fit: &Fit) -> Option<EffectKind> {
    fit.model.parts.last().map(Candidate::kind)
}

/// Whether a fit leaves more than noise in most episodes.
fn leaves_much(fit: &Fit, study: &Study, settings: &Settings) -> bool {
    trimmed_mean(study.groups().into_iter().map(|group| mean_square(&fit.residuals[group])).collect())
        > settings.unexplained
}
