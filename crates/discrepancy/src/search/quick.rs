//! Fits to the episodes of the screening: what is compared before anything is fitted to all.

use crate::accept::NEGLIGIBLE;
use crate::begin::{are_twins, begin, follow, promise_in_place, shake};
use crate::candidate::Candidate;
use crate::fit::{Begin, Effort, Fit, fit};
use crate::rival::{first_of_each, of_first};
use crate::screen::{Promise, Screening, shortlist};
use crate::search::{Search, added_kind};
use crate::study::Study;

/// What promises less than this share of what another one gains is not fitted...
const HOPELESS: f64 = 0.1;
/// ... but for the first two kinds.
const LEAST_KINDS: usize = 2;

impl Search<'_> {
    /// Fits what promises most to the episodes of the screening, which `part` and `base` know alone; the best first.
    pub(crate) fn quick(&self, screening: &Screening, part: &Study, base: &Fit, promises: &[Promise]) -> Vec<Fit> {
        let before = base.log_evidence();
        let share = self.share(screening);
        let (mut quick, mut gained, mut kinds) = (Vec::<Fit>::new(), 0.0_f64, Vec::new());
        for (promise, begin) in self.begun(screening, part, base, promises) {
            let (kind, model) = (promise.candidate.kind(), base.model.with(&promise.candidate));
            let hopeless = kinds.len() >= LEAST_KINDS && promise.gain < HOPELESS * share * gained;
            // The best one has to be fitted to all episodes, too.
            if (hopeless && !kinds.contains(&kind)) || !self.affords_both(part, &model) {
                continue;
            }
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
            let fit = fit(part, model, begin, Effort::Quick);
            gained = gained.max(fit.log_evidence() - before);
            quick.push(fit);
        }
        quick.retain(|fit| fit.log_evidence().is_finite() && is_there(fit));
        let sort = |fits: &mut Vec<Fit>| fits.sort_by(|a, b| b.log_evidence().total_cmp(&a.log_evidence()));
        sort(&mut quick);
        // Half or one and a half times as strong an effect may lie beyond a ridge that no descent crosses.
        let within = |fit: &Fit| self.affords_both(part, &fit.model);
        if let Some(best) = quick.first_mut().filter(|best| within(best)) {
            shake(part, best);
        }
        if let Some(best) = quick.first().cloned() {
            self.follow_all(part, &best, promises, &mut quick);
            sort(&mut quick);
        }
        // Of one kind's several places the best.
        first_of_each(&mut quick, |fit| fit.model.parts.last().map(Candidate::variant));
        quick
    }

    /// Twins (a tilt and a force) reach the same optimum or neither: one that was found is where the other begins, even one that promised little.
    fn follow_all(&self, part: &Study, best: &Fit, promises: &[Promise], quick: &mut Vec<Fit>) {
        let Some(kind) = added_kind(best) else { return };
        let mut twins: Vec<&Candidate> = Vec::new();
        for promise in promises {
            let other = &promise.candidate;
            if are_twins([kind, other.kind()]) && twins.iter().all(|twin| twin.kind() != other.kind()) {
                twins.push(other);
            }
        }
        let parts = best.model.parts.len() - 1;
        for twin in twins {
            let place = quick.iter().position(|fit| added_kind(fit) == Some(twin.kind()));
            let model = match place {
                Some(place) => quick[place].model.clone(),
                None => {
                    let mut model = best.model.clone();
                    model.parts.truncate(parts);
                    model.with(twin)
                }
            };
            if !self.affords_both(part, &model) {
                continue;
            }
            let Some((cost, begin)) = follow(part, best, &model) else { continue };
            if place.is_some_and(|place| cost >= quick[place].cost()) {
                continue;
            }
            let again = fit(part, model, begin, Effort::Quick);
            match place {
                Some(place) if again.log_evidence() > quick[place].log_evidence() => quick[place] = again,
                Some(_) => {}
                None => quick.push(again),
            }
        }
        quick.retain(|fit| fit.log_evidence().is_finite() && is_there(fit));
    }

    /// What promises most, by what is simulated where fits begin: a linear step says little of what is far from linear, or of what another effect does in part.
    fn begun(&self, screening: &Screening, part: &Study, base: &Fit, promises: &[Promise]) -> Vec<(Promise, Begin)> {
        let first = base.model.parts.is_empty();
        let stated = screening.stated.as_ref().filter(|_| first);
        let (promises, looked, kept) = if first {
            (promise_in_place(part, base, promises), self.settings.looks, self.settings.quick_fits)
        } else {
            (promises.to_vec(), self.settings.begins, self.settings.fits)
        };
        let mut list = Vec::new();
        for promise in shortlist(&promises, looked) {
            let model = base.model.with(&promise.candidate);
            if self.affords_both(part, &model) {
                let begin = begin(part, base, stated, &model, &promise);
                list.push((begin.cost(part, &model), promise, begin));
            }
        }
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        of_first(&mut list, kept, |(_, promise, _)| promise.candidate.kind());
        list.into_iter().map(|(_, promise, begin)| (promise, begin)).collect()
    }
}

/// Whether a fit's last effect is more than negligible: what is as good as absent lasts nowhere, and is not worth a fit with care.
fn is_there(fit: &Fit) -> bool {
    let Some((part, own)) = fit.added() else { return false };
    part.begin.is_some() || part.strengths().any(|index| own[index].abs() > NEGLIGIBLE)
}
