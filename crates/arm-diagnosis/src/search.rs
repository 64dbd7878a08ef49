//! Which hypotheses a log asks for: forward by evidence, each choice looked at again when the others stand.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::design::{Columns, Design};
use crate::effect::EFFECTS;
use crate::features::{Candidate, Catalogue};
use crate::fit::Fit;
use crate::group::{FINER, coefficient, is_friction};
use crate::masses::{MassFactors, best_factors, stddevs};
use crate::prepared::{Prepared, rms};

/// Share of a joint's mean squared torque that its rigid arm has, at which half of a factor is believed.
const LEAST_RIGID: f64 = 0.05;
/// Hypotheses of a model, at most.
const MOST_TERMS: usize = 16;
/// Gain of evidence that a finer kind of friction must have over a simpler one: twenty to one, and [`FINER`] of what the simpler one leaves.
const AS_GOOD: f64 = 3.0;
/// Rounds in which each choice is looked at again.
const ROUNDS: usize = 3;

/// A hypothesis that a model has, what it brings, and others that would bring nearly as much.
#[derive(Clone, Debug)]
pub(crate) struct Term {
    /// Place in the catalogue.
    pub(crate) candidate: usize,
    /// ln of the evidence with it over that without, and with its prior.
    pub(crate) gain: f64,
    /// Places of others in its stead, with their gains, best first.
    pub(crate) rivals: Vec<(usize, f64)>,
}

/// A log's best model.
pub(crate) struct Found {
    pub(crate) catalogue: Catalogue,
    pub(crate) design: Design,
    pub(crate) all: Columns,
    pub(crate) terms: Vec<Term>,
    pub(crate) mass_factors: MassFactors,
    /// The fit with all terms, and the one without any.
    pub(crate) fit: Fit,
    pub(crate) null: Fit,
}

pub(crate) struct Search {
    catalogue: Catalogue,
    joints: usize,
    design: Design,
    all: Columns,
    mass_factors: MassFactors,
}

impl Search {
    /// Learns what no hypothesis explains, and how good the masses are.
    pub(crate) fn new(prepared: &Prepared, catalogue: Catalogue, mut design: Design) -> Option<Self> {
        let everything = everything(&catalogue);
        let mut factors = MassFactors([4.0; 3]);
        for round in 0..4 {
            let all = Columns::new(&design, &catalogue);
            if round >= 2 {
                factors = best_factors(factors, &all, &catalogue, &everything)?;
            }
            let fit = Fit::new(&all, everything.clone(), &stddevs(&catalogue, &everything, &factors))?;
            let left = left(&design.gap, &catalogue, &fit, prepared);
            let coefficients: Vec<(usize, f64)> =
                fit.columns.iter().copied().zip(fit.coefficients.iter().copied()).collect();
            design.learn(&left, fit.effective(), &coulomb(prepared, &catalogue, &coefficients), prepared);
        }
        let all = Columns::new(&design, &catalogue);
        Some(Self { catalogue, joints: prepared.joints(), design, all, mass_factors: factors })
    }

    pub(crate) fn run(self) -> Option<Found> {
        let mut chosen: Vec<usize> = Vec::new();
        for _ in 0..ROUNDS {
            let before = chosen.clone();
            while chosen.len() < MOST_TERMS {
                let Some((best, _)) = self.ranked(&chosen, None)?.into_iter().next().filter(|(_, gain)| *gain > 0.0)
                else {
                    break;
                };
                self.add(&mut chosen, best);
            }
            self.looked_at_again(&mut chosen, false)?;
            if chosen == before {
                break;
            }
        }
        let terms = self.looked_at_again(&mut chosen, true)?;
        let null = self.fit(&[])?;
        let fit = self.fit(&chosen)?;
        Some(Found {
            catalogue: self.catalogue,
            terms,
            mass_factors: self.mass_factors,
            fit,
            null,
            all: self.all,
            design: self.design,
        })
    }

    /// An extension of a joint's friction takes the place of the plain one.
    fn add(&self, chosen: &mut Vec<usize>, candidate: usize) {
        let added = &self.catalogue.candidates[candidate];
        chosen.retain(|other| {
            let other = &self.catalogue.candidates[*other];
            !(other.joint == added.joint && other.effect.name == "joint_friction" && added.effect.extends_friction())
        });
        chosen.push(candidate);
    }

    /// Takes each term out and puts the best one in; the terms with what they bring. Friction of several kinds at once is looked at last, with `compound`, and only
    /// in joints that have friction already: its many values explain a little of anything.
    fn looked_at_again(&self, chosen: &mut Vec<usize>, compound: bool) -> Option<Vec<Term>> {
        let mut terms = Vec::new();
        let mut place = 0;
        while place < chosen.len() {
            let mut others = chosen.clone();
            others.remove(place);
            let own = &self.catalogue.candidates[chosen[place]];
            let ranked = self.ranked(&others, own.joint.filter(|_| compound && is_friction(own.effect)))?;
            match ranked.first().copied() {
                Some((best, gain)) if gain > 0.0 => {
                    chosen[place] = best;
                    terms.push(Term { candidate: best, gain, rivals: ranked[1..].iter().take(400).copied().collect() });
                    place += 1;
                }
                _ => {
                    chosen.remove(place);
                }
            }
        }
        Some(terms)
    }

    fn fit(&self, chosen: &[usize]) -> Option<Fit> {
        let columns = columns(&self.catalogue, chosen);
        let stddevs = stddevs(&self.catalogue, &columns, &self.mass_factors);
        Fit::new(&self.all, columns, &stddevs)
    }

    /// All hypotheses that may join some, by ln of posterior odds, best first; friction of several kinds at once in one joint at most.
    fn ranked(&self, chosen: &[usize], compound_in: Option<usize>) -> Option<Vec<(usize, f64)>> {
        let fit = self.fit(chosen)?;
        let spreads = stddevs(&self.catalogue, &fit.columns, &self.mass_factors);
        let gain = |(place, candidate): (usize, &Candidate)| {
            let compound = candidate.effect.is_compound_friction() && candidate.joint != compound_in;
            if compound || !self.may_join(candidate, chosen) {
                return None;
            }
            let new = candidate.features.iter().filter(|feature| !fit.columns.contains(feature));
            let new: Vec<(usize, f64)> =
                new.map(|feature| (*feature, self.catalogue.features[*feature].stddev)).collect();
            if new.is_empty() {
                return None;
            }
            let (mut gain, coefficients) = fit.gain(&self.all, &spreads, &new)?;
            for ((feature, _), [value, stddev]) in new.iter().zip(&coefficients) {
                if self.catalogue.features[*feature].positive {
                    // Half of the prior is cut off, and what of the posterior is on the wrong side.
                    gain += std::f64::consts::LN_2 + log_cdf(value / stddev);
                }
            }
            Some((place, gain + self.log_prior(candidate, chosen)))
        };
        let mut ranked: Vec<(usize, f64)> = self
            .catalogue
            .candidates
            .par_iter()
            .enumerate()
            .filter_map(gain)
            .filter(|(_, gain)| gain.is_finite())
            .collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        self.prefer_simpler(&mut ranked);
        Some(ranked)
    }

    /// Brings to the front the kind of friction with the fewest values of those that explain the same joint as well as the first: which share of a load's friction
    /// is that of lifting, for one, looks like a gain of torque.
    fn prefer_simpler(&self, ranked: &mut [(usize, f64)]) {
        let Some(&(first, most)) = ranked.first() else { return };
        let own = &self.catalogue.candidates[first];
        if !own.effect.extends_friction() {
            return;
        }
        let size = |place: usize| self.catalogue.candidates[place].features.len();
        let rows = own.joint.map_or(0, |joint| self.design.fitted.of(joint).len()) as f64;
        // Twice a gain in evidence is what the sum of squares loses, in variances of what is left.
        let as_good_as = AS_GOOD.max(0.5 * rows * FINER / (1.0 - FINER));
        let as_good = ranked.iter().enumerate().filter(|(_, (place, gain))| {
            let other = &self.catalogue.candidates[*place];
            most - gain < as_good_as
                && other.joint == own.joint
                && is_friction(other.effect)
                && size(*place) < size(first)
        });
        if let Some((place, _)) = as_good.min_by_key(|(_, (place, _))| size(*place)) {
            ranked[..=place].rotate_right(1);
        }
    }

    /// Not the same effect twice in a place, nor two kinds of friction in one joint.
    fn may_join(&self, candidate: &Candidate, chosen: &[usize]) -> bool {
        chosen.iter().all(|other| {
            let other = &self.catalogue.candidates[*other];
            let same = other.effect.name == candidate.effect.name && other.joint == candidate.joint;
            let both_extend = other.joint == candidate.joint
                && candidate.effect.extends_friction()
                && other.effect.extends_friction();
            let less = other.joint == candidate.joint
                && other.effect.extends_friction()
                && candidate.effect.name == "joint_friction";
            !(same || both_extend || less)
        })
    }

    /// Each effect is as likely as any, in any joint and setting; one that a joint has already is likely in another.
    fn log_prior(&self, candidate: &Candidate, chosen: &[usize]) -> f64 {
        let same = |other: &usize| self.catalogue.candidates[*other].effect.name == candidate.effect.name;
        let settings = self
            .catalogue
            .candidates
            .iter()
            .filter(|other| other.effect.name == candidate.effect.name && other.joint == candidate.joint)
            .count();
        let settings = -(settings as f64).ln();
        if chosen.iter().any(same) {
            return settings - std::f64::consts::LN_2;
        }
        let joints = if candidate.joint.is_some() { self.joints as f64 } else { 1.0 };
        settings - (EFFECTS.len() as f64).ln() - joints.ln()
    }
}

/// Coulomb friction of each joint, N·m: what the file says, and what a fit with all kinds of friction at once has found.
fn coulomb(prepared: &Prepared, catalogue: &Catalogue, coefficients: &[(usize, f64)]) -> Vec<f64> {
    let found = |joint: usize| -> f64 {
        let own = |candidate: &&Candidate| candidate.joint == Some(joint);
        let constant = |candidate: &&Candidate| ["joint_friction", "presliding"].contains(&candidate.effect.name);
        let mut columns: Vec<usize> = Vec::new();
        for candidate in catalogue.candidates.iter().filter(own).filter(constant) {
            // Of plain friction the first column, of bristles the last.
            let column = if candidate.effect.name == "joint_friction" {
                candidate.features.first()
            } else {
                candidate.features.last()
            };
            columns.extend(column);
        }
        columns.sort_unstable();
        columns.dedup();
        coefficients.iter().filter(|(column, _)| columns.contains(column)).map(|(_, coefficient)| coefficient).sum()
    };
    (0..prepared.joints()).map(|joint| prepared.log.arm.joints()[joint].friction + found(joint)).collect()
}

/// ln of the normal distribution function; far out by its asymptote.
fn log_cdf(z: f64) -> f64 {
    if z > -8.0 { Normal::standard().cdf(z).ln() } else { -0.5 * z * z - (-z).ln() - 0.5 * std::f64::consts::TAU.ln() }
}

/// Nuisances, and the columns of some candidates.
pub(crate) fn columns(catalogue: &Catalogue, chosen: &[usize]) -> Vec<usize> {
    let mut columns = catalogue.nuisances.clone();
    for candidate in chosen {
        for feature in &catalogue.candidates[*candidate].features {
            if !columns.contains(feature) {
                columns.push(*feature);
            }
        }
    }
    columns
}

/// Nuisances and one setting of each effect in each joint: the best description at hand, whatever is true.
fn everything(catalogue: &Catalogue) -> Vec<usize> {
    let of = |candidate: &Candidate| {
        let alike: Vec<&Candidate> = catalogue
            .candidates
            .iter()
            .filter(|other| other.effect.name == candidate.effect.name && other.joint == candidate.joint)
            .collect();
        // Of many settings the middle; of a ripple's those that would pass for a drift, as many waves would take the noise for their own.
        if candidate.effect.name == "torque_ripple" {
            return candidate.setting <= 4.0;
        }
        // Of payloads the heaviest: a load that is heavier than the prior's would pass for poor masses.
        let place = if candidate.effect.name == "payload" { alike.len() - 1 } else { alike.len() / 2 };
        let middle = alike[place];
        middle.setting == candidate.setting && middle.curvature == candidate.curvature
    };
    let chosen: Vec<usize> =
        (0..catalogue.candidates.len()).filter(|place| of(&catalogue.candidates[*place])).collect();
    columns(catalogue, &chosen)
}

impl Found {
    /// Factors of torque as they were fitted, as far as a joint's torque tells them: in one that is nearly all friction, what is wrong with its small share
    /// passes for a factor, and friction would be divided by it.
    pub(crate) fn gains(&self, prepared: &Prepared) -> Vec<f64> {
        let gain = |joint: usize| {
            let told = told(rms(&prepared.rigid[joint]), rms(&prepared.measured[joint]));
            1.0 + told * self.value(&["torque_gain", "servo_gain"], Some(joint))
        };
        (0..prepared.joints()).map(|joint| gain(joint).clamp(0.2, 5.0)).collect()
    }

    /// Delay of torques as it was fitted, s.
    pub(crate) fn delay_secs(&self) -> f64 {
        self.value(&["torque_delay"], None)
    }

    /// Fitted value of the first column of the first effect with one of these names, its nuisance's included; 0 where there is none.
    fn value(&self, names: &[&str], joint: Option<usize>) -> f64 {
        let own = |candidate: &&Candidate| candidate.joint == joint && names.contains(&candidate.effect.name);
        let column = self.catalogue.candidates.iter().find(own).map(|candidate| candidate.features[0]);
        let twin = column.and_then(|column| self.catalogue.features[column].twin);
        column.into_iter().chain(twin).map(|column| coefficient(self, column)).sum()
    }
}

/// Share of a factor of torque that is believed, by the root mean squares of what the rigid arm needs in a joint and of what is measured there, N·m.
fn told(rigid_nm: f64, measured_nm: f64) -> f64 {
    let [rigid, least] = [rigid_nm.powi(2), LEAST_RIGID * measured_nm.powi(2)];
    let told = rigid.powi(2) / (rigid.powi(2) + least.powi(2));
    if told.is_finite() { told } else { 0.0 }
}

/// What a fit leaves of the gap, joint after joint, N·m.
pub(crate) fn left(gap: &[f64], catalogue: &Catalogue, fit: &Fit, prepared: &Prepared) -> Vec<f64> {
    let windows = prepared.windows.len();
    let mut left = gap.to_vec();
    for (column, coefficient) in fit.columns.iter().zip(fit.coefficients.iter()) {
        let feature = &catalogue.features[*column];
        let start = feature.joint.map_or(0, |joint| joint * windows);
        for (value, change) in left[start..].iter_mut().zip(&feature.values) {
            *value -= coefficient * change;
        }
    }
    left
}

#[cfg(test)]
mod tests {
    use super::told;

    #[test]
    fn a_factor_of_torque_is_believed_where_the_arm_itself_needs_torque() {
        // All of it, a tenth of the mean square, a wrist that is nearly all friction, and a joint that nothing moves.
        assert!(told(12.0, 12.0) > 0.99 && told(1.0, 10.0_f64.sqrt()) > 0.75);
        assert!(told(0.02, 0.6) < 0.001 && told(0.0, 0.0) == 0.0 && told(0.0, 1.0) == 0.0);
    }
}
