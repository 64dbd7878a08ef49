//! One update: simulate and weigh, temper where that leaves too few particles, resample and smooth.

use pomdp::{Rng, StaticParameters};

use super::prediction::Prediction;
use super::round::{Offers, Posterior, Round, Trackable, Walker, mixture};
use super::simulate::{Simulated, each};
use super::temper::temper;
use crate::Error;
use crate::diagnostics::{log_effective_sample_size, log_sum_exp};
use crate::resample::resample;

/// A particle lighter than this is dropped: nothing can come of it, and smaller weights lose their digits.
const NEGLIGIBLE: f64 = 1e-100;

/// A new belief with its books.
pub(crate) struct Advance<M: StaticParameters> {
    pub(crate) states: Vec<M::State>,
    pub(crate) weights: Vec<f64>,
    pub(crate) effective_sample_size_before: f64,
    pub(crate) surprise: f64,
    pub(crate) log_evidence: f64,
    pub(crate) bridges: usize,
    pub(crate) temperature: f64,
    pub(crate) move_acceptance: f64,
    pub(crate) resampled: bool,
    pub(crate) reinvigorated: usize,
    pub(crate) proposed: usize,
    /// Structure, probability before and after, particles.
    pub(crate) books: Vec<(M::Structure, f64, f64, usize)>,
}

impl<M: Trackable> Round<'_, M> {
    /// The new belief; `None` where every weight vanished.
    pub(crate) fn run(&mut self, rng: &mut Rng) -> Result<Option<Advance<M>>, Error> {
        let pilot = self.pilot(rng);
        let offers = self.offers(pilot.len(), rng)?;
        let count = pilot.len() + offers.drawn;
        let plain = self.prediction.weights.iter().map(|w| w.ln());
        let share = offers.drawn as f64 / count as f64;
        let mut log_weights: Vec<f64> = plain
            .enumerate()
            .map(|(i, w)| w + (1.0 - share).ln() - mixture(share, self.log_ratio(i, &pilot[i].theta, None)))
            .collect();
        log_weights.extend(offers.log_ratios.iter().map(|r| -(count as f64).ln() - mixture(share, *r)));
        let likelihoods = || pilot.iter().chain(&offers.walkers).map(|w| w.log_likelihood);
        let joint = log_weights.iter().zip(likelihoods()).map(|(w, l)| w + l);
        let before = log_effective_sample_size(joint.clone());
        let log_evidence = log_sum_exp(joint.clone());

        let mut tempered = None;
        if before < self.config.tempering_share * count as f64 && self.config.max_bridges > 0 {
            tempered = temper(self, &pilot, &offers, rng);
        }
        let posterior = match tempered {
            Some(posterior) => posterior,
            None if log_evidence == f64::NEG_INFINITY => return Ok(None),
            None => {
                let log_weights = joint.map(|w| w - log_evidence).collect();
                let walkers = pilot.into_iter().chain(offers.walkers).collect();
                Posterior {
                    walkers,
                    log_weights,
                    log_evidence,
                    bridges: 0,
                    temperature: 1.0,
                    move_acceptance: 0.0,
                    moved: 0,
                    resampled: false,
                    fresh: false,
                }
            }
        };
        Ok(Some(self.finish(posterior, before, rng)))
    }

    /// Every particle of the belief, stepped as it is.
    fn pilot(&mut self, rng: &mut Rng) -> Vec<Walker<M::State>> {
        let simulated =
            each(self.prediction.states.len(), rng, |index, rng| self.step(self.prediction.states[index].clone(), rng));
        let walker = |(ancestor, simulated): (usize, Simulated<M::State>)| {
            self.tally.add(&simulated);
            let theta = self.prediction.theta(ancestor).to_vec();
            let Simulated { next, log_likelihood, .. } = simulated;
            Walker { ancestor, proposed: false, theta, next, log_likelihood }
        };
        simulated.into_iter().enumerate().map(walker).collect()
    }

    /// The proposals, each put on a state of the belief that it may go with and stepped.
    fn offers(&mut self, plain: usize, rng: &mut Rng) -> Result<Offers<M::State>, Error> {
        let share = self.config.proposal_share;
        let places = (share / (1.0 - share) * plain as f64) as usize;
        let affordable = self.config.max_transitions.saturating_sub(self.tally.transitions);
        let drawn = self.proposals.states.len().min(places).min(affordable);
        let mut offers = Offers { drawn, walkers: Vec::new(), log_ratios: Vec::new() };
        if drawn == 0 {
            return Ok(offers);
        }
        let density = self.proposals.log_density.ok_or(Error::ProposalDensity)?;
        let neighbours = self.prediction.neighbours();
        let made = each(drawn, rng, |index, rng| {
            let proposal = &self.proposals.states[index];
            let kind = self.prediction.structures.binary_search(&self.model.structure(proposal)).ok()?;
            let theta = self.model.parameters(proposal);
            let log_ratio = density(proposal) - self.prediction.log_density(kind, &theta);
            let ancestor = neighbours[kind].companion(&theta, rng);
            let start = self.model.with_parameters(&self.prediction.states[ancestor], &theta)?;
            let simulated = self.step(start, rng);
            Some((ancestor, theta, log_ratio, simulated))
        });
        for (ancestor, theta, log_ratio, simulated) in made.into_iter().flatten() {
            self.tally.add(&simulated);
            let Simulated { next, log_likelihood, .. } = simulated;
            offers.walkers.push(Walker { ancestor, proposed: true, theta, next, log_likelihood });
            // Where the caller's density is NaN, nothing can be said for the proposal.
            offers.log_ratios.push(if log_ratio.is_nan() { f64::INFINITY } else { log_ratio });
        }
        Ok(offers)
    }

    fn finish(&self, posterior: Posterior<M::State>, before: f64, rng: &mut Rng) -> Advance<M> {
        let Posterior { walkers, log_weights, log_evidence, bridges, temperature, move_acceptance, .. } = posterior;
        let Posterior { mut moved, mut resampled, fresh, .. } = posterior;
        let best = walkers.iter().map(|w| w.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
        let kinds = self.kinds(&walkers);
        let mut mass = vec![0.0; self.prediction.structures.len()];
        let exponentials: Vec<f64> = log_weights.iter().map(|w| w.exp()).collect();
        exponentials.iter().zip(&kinds).for_each(|(w, &kind)| mass[kind] += w);

        let mut chosen: Vec<(usize, f64)> =
            exponentials.iter().copied().enumerate().filter(|(_, w)| *w > NEGLIGIBLE).collect();
        let count = if fresh { walkers.len() } else { self.wanted(&exponentials, &walkers, rng) };
        let size = crate::effective_sample_size(&exponentials);
        let mut smooth = false;
        let low = size < self.config.resample_share * walkers.len() as f64;
        let many = chosen.len() > self.config.particles_max;
        if !fresh && (low || many || 2 * count <= chosen.len() || count >= 2 * chosen.len()) {
            chosen = resample(&exponentials, &kinds, mass.len(), count, self.quota(), rng);
            (resampled, smooth) = (true, true);
        }
        let proposed = chosen.iter().filter(|&&(i, _)| walkers[i].proposed).count();
        let mut particles = vec![0; mass.len()];
        chosen.iter().for_each(|&(i, _)| particles[kinds[i]] += 1);
        let weights: Vec<f64> = chosen.iter().map(|&(_, w)| w).collect();
        let states = if smooth {
            // The kernels have the moments of the weighted particles, which resampling would only blur.
            let kept: Vec<usize> = (0..walkers.len()).filter(|&i| exponentials[i] > 0.0).collect();
            let position = |i: usize| kept.binary_search(&i).expect("a weightless particle is never drawn");
            let positive = kept.iter().map(|&i| exponentials[i]).collect();
            let after = Prediction::new(self.model, kept.iter().map(|&i| walkers[i].next.clone()).collect(), positive);
            let smoothed = each(chosen.len(), rng, |at, rng| {
                after.smoothed(self.model, position(chosen[at].0), self.config.shrinkage(), rng)
            });
            moved = smoothed.iter().filter(|(_, moved)| *moved).count();
            smoothed.into_iter().map(|(state, _)| state).collect()
        } else {
            chosen.iter().map(|&(i, _)| walkers[i].next.clone()).collect::<Vec<_>>()
        };
        let states = each(states.len(), rng, |at, rng| {
            let mut state = states[at].clone();
            self.model.correct(&mut state, self.observation, rng);
            state
        });
        let structures = self.prediction.structures.iter().cloned().zip(&self.prediction.mass).zip(mass).zip(particles);
        Advance {
            states,
            weights,
            effective_sample_size_before: before,
            surprise: self.tally.own() - best,
            log_evidence,
            bridges,
            temperature,
            move_acceptance,
            resampled,
            reinvigorated: moved,
            proposed,
            books: structures.map(|(((structure, &prior), after), count)| (structure, prior, after, count)).collect(),
        }
    }
}
