//! How wrong the masses of a robot's file may be, and a payload: columns, priors, and what a log says of their spreads.

use arm_dynamics::{Mass, PARAMETERS};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::design::Columns;
use crate::features::{Catalogue, nuisance};
use crate::fit::Fit;
use crate::group::coefficient;
use crate::prepared::Prepared;
use crate::search::Found;

/// Sizes of a payload's prior, of the arm's mass, and how far from the tip its centre usually is, m.
const PAYLOAD_SHARES: [f64; 5] = [0.01, 0.03, 0.1, 0.3, 1.0];
const PAYLOAD_M: f64 = 0.07;

/// Factors by which the masses of a file may be worse than usual, and what is plausible of their logarithms to base 2: a standard deviation about 0.
const MASS_FACTORS: [f64; 6] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
const LOG2_STDDEV: f64 = 1.0;

/// Factors by which a file's masses, their centres and their inertias are worse than usual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MassFactors(pub(crate) [f64; 3]);

impl MassFactors {
    pub(crate) fn log_prior(&self) -> f64 {
        self.0.iter().map(|factor| -0.5 * (factor.log2() / LOG2_STDDEV).powi(2)).sum()
    }

    /// The same with another value in a place.
    fn with(&self, place: usize, factor: f64) -> Self {
        let mut other = *self;
        other.0[place] = factor;
        other
    }

    /// All that are on the grid.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let each = || MASS_FACTORS.into_iter();
        each().flat_map(move |mass| {
            each().flat_map(move |centre| each().map(move |inertia| Self([mass, centre, inertia])))
        })
    }
}

impl Catalogue {
    pub(crate) fn add_masses(&mut self, prepared: &Prepared) {
        let count = prepared.joints();
        let total: f64 = prepared.log.arm.masses().map(|mass| mass.mass_kg).sum();
        let columns: Vec<Vec<Vec<f64>>> = (0..count).into_par_iter().map(|link| regressor(prepared, link)).collect();
        for (link, mass) in prepared.log.arm.masses().enumerate() {
            // A link without a mass in the file has one all the same.
            let weight = mass.mass_kg.max(0.02 * total / count as f64);
            let inertia = (mass.central_kgm2().trace() / 3.0).max(weight * 0.03_f64.powi(2));
            for (way, numbers) in mass_ways(mass, weight).iter().enumerate() {
                let stddev = match way {
                    0 => nuisance::MASS * weight,
                    1..=3 => nuisance::COM_M,
                    _ => nuisance::INERTIA * inertia,
                };
                self.masses.push(self.features.len());
                self.nuisance(None, combined(&columns[link], numbers), stddev);
            }
            self.mass_ways.push(mass_ways(mass, weight));
        }
        self.add_payload(prepared, &columns[count - 1], total);
    }

    /// A payload near the tip, of several sizes: one prior for all would make a light one pay for what a heavy one may do.
    fn add_payload(&mut self, prepared: &Prepared, columns: &[Vec<f64>], total: f64) {
        self.payload_ways = payload_ways(prepared.log.arm.last_from_tip().translation.vector);
        let mut sizes = PAYLOAD_SHARES.map(|share| (share * total).max(0.02)).to_vec();
        sizes.dedup();
        for heavy in sizes {
            let mut features = Vec::new();
            for (way, numbers) in self.payload_ways.clone().iter().enumerate() {
                let stddev = match way {
                    0 => heavy,
                    1..=3 => heavy * PAYLOAD_M,
                    _ => heavy * PAYLOAD_M.powi(2),
                };
                features.push(self.push(None, combined(columns, numbers), stddev, false));
            }
            self.candidate("payload", None, heavy, features);
        }
    }

    /// Factor from the prior spread of a payload's column to that of the heaviest payload's; 1 of other columns.
    pub(crate) fn wider(&self, column: usize) -> f64 {
        let payloads = || self.candidates.iter().filter(|candidate| candidate.effect.name == "payload");
        let Some(own) = payloads().find(|payload| payload.features.contains(&column)) else { return 1.0 };
        payloads().map(|payload| payload.setting / own.setting).fold(1.0, f64::max)
    }
}

impl Found {
    /// Masses of the links as they were fitted, a payload's included, in the frames of the joints.
    pub(crate) fn masses(&self, prepared: &Prepared) -> Vec<Mass> {
        let last = prepared.joints() - 1;
        let payloads = self.catalogue.candidates.iter().filter(|candidate| candidate.effect.name == "payload");
        let file = prepared.log.arm.masses().enumerate();
        let fitted = |(link, mass): (usize, &Mass)| {
            let mut numbers = mass.numbers();
            for (way, change) in self.catalogue.mass_ways[link].iter().enumerate() {
                let much = coefficient(self, self.catalogue.masses[link * PARAMETERS + way]);
                numbers.iter_mut().zip(change).for_each(|(number, change)| *number += much * change);
            }
            for payload in payloads.clone().filter(|_| link == last) {
                for (feature, change) in payload.features.iter().zip(&self.catalogue.payload_ways) {
                    let much = coefficient(self, *feature);
                    numbers.iter_mut().zip(change).for_each(|(number, change)| *number += much * change);
                }
            }
            Mass::from_numbers(&numbers)
        };
        file.map(fitted).collect()
    }
}

/// The factors of masses that some columns ask for, one after the other from a start.
pub(crate) fn best_factors(
    start: MassFactors,
    all: &Columns,
    catalogue: &Catalogue,
    columns: &[usize],
) -> Option<MassFactors> {
    let mut factors = start;
    for place in 0..3 {
        let fits = MASS_FACTORS.par_iter().filter_map(|factor| {
            let other = factors.with(place, *factor);
            let fit = Fit::new(all, columns.to_vec(), &stddevs(catalogue, columns, &other))?;
            Some((other, fit.log_evidence + other.log_prior()))
        });
        factors = fits.collect::<Vec<_>>().into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    }
    Some(factors)
}

/// Prior standard deviations, those of masses times their factors.
pub(crate) fn stddevs(catalogue: &Catalogue, columns: &[usize], factors: &MassFactors) -> Vec<f64> {
    columns
        .iter()
        .map(|column| {
            let way = catalogue.masses.iter().position(|mass| mass == column).map(|place| place % PARAMETERS);
            let factor = match way {
                None => 1.0,
                Some(0) => factors.0[0],
                Some(1..=3) => factors.0[1],
                Some(_) => factors.0[2],
            };
            catalogue.features[*column].stddev * factor
        })
        .collect()
}

/// Columns times numbers.
fn combined(columns: &[Vec<f64>], numbers: &[f64; PARAMETERS]) -> Vec<f64> {
    let mut values = vec![0.0; columns[0].len()];
    for (column, number) in columns.iter().zip(numbers).filter(|(_, number)| **number != 0.0) {
        values.iter_mut().zip(column).for_each(|(value, torque)| *value += number * torque);
    }
    values
}

/// How the last link's numbers change by a kilogram at the tip, which is at `tip`, m; by a kg·m of moment about the tip along each axis; by an inertia.
fn payload_ways(tip: Vector3<f64>) -> Vec<[f64; PARAMETERS]> {
    let mut ways = vec![[0.0; PARAMETERS]; PARAMETERS];
    ways[0] = Mass::about_centre(1.0, tip, Matrix3::zeros()).numbers();
    for axis in 0..3 {
        ways[1 + axis] = moved(&tip, axis, 1.0);
    }
    for (way, numbers) in ways.iter_mut().enumerate().skip(4) {
        numbers[way] = 1.0;
    }
    ways
}

/// How numbers change where the centre of `mass_kg`, now at `centre`, moves along an axis, by a metre.
fn moved(centre: &Vector3<f64>, axis: usize, mass_kg: f64) -> [f64; PARAMETERS] {
    let step = Vector3::ith(axis, 1.0);
    let inertia: Matrix3<f64> =
        Matrix3::identity() * (2.0 * centre.dot(&step)) - centre * step.transpose() - step * centre.transpose();
    Mass { mass_kg: 0.0, moment_kgm: step * mass_kg, inertia_kgm2: inertia * mass_kg }.numbers()
}

/// In which ways a link's mass may be wrong, as changes of its numbers: all of it too light, by a kilogram; its centre elsewhere, by a metre along each axis;
/// another inertia about its centre. Errors of a file are of these kinds, so each has a spread of its own.
fn mass_ways(mass: &Mass, weight: f64) -> [[f64; PARAMETERS]; PARAMETERS] {
    let mut ways = [[0.0; PARAMETERS]; PARAMETERS];
    let numbers = mass.numbers();
    ways[0] = numbers.map(|number| number / mass.mass_kg.max(weight));
    // A link that weighs next to nothing in the file may weigh something all the same, as a point.
    ways[0][0] = 1.0;
    for axis in 0..3 {
        ways[1 + axis] = moved(&mass.centre_m(), axis, weight);
    }
    for (way, numbers) in ways.iter_mut().enumerate().skip(4) {
        numbers[way] = 1.0;
    }
    ways
}

/// The ten columns of a link's mass.
fn regressor(prepared: &Prepared, link: usize) -> Vec<Vec<f64>> {
    let (count, windows) = (prepared.joints(), prepared.windows.len());
    let gravity = prepared.gravity_vector();
    let mut columns = vec![vec![0.0; count * windows]; PARAMETERS];
    for (window, ticks) in prepared.windows.iter().enumerate() {
        for tick in ticks.clone() {
            let [q, rate, acceleration] = prepared.state(tick);
            let torques = prepared.log.arm.motion(&q, &rate, &acceleration, &gravity).regressor(link);
            for (column, torques) in columns.iter_mut().zip(&torques) {
                for joint in 0..count {
                    column[joint * windows + window] += prepared.gain(joint) * torques[joint] / ticks.len() as f64;
                }
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(mass: &Mass, change: &[f64; PARAMETERS], much: f64) -> Mass {
        let mut numbers = mass.numbers();
        numbers.iter_mut().zip(change).for_each(|(number, change)| *number += much * change);
        Mass::from_numbers(&numbers)
    }

    #[test]
    fn a_link_that_is_heavier_keeps_its_centre_and_one_that_is_elsewhere_its_inertia() {
        let own = Matrix3::new(0.03, 0.002, -0.001, 0.002, 0.05, 0.004, -0.001, 0.004, 0.06);
        let centre = Vector3::new(0.1, -0.2, 0.3);
        let mass = Mass::about_centre(2.0, centre, own);
        let ways = mass_ways(&mass, 2.0);
        let heavier = changed(&mass, &ways[0], 0.4);
        assert!((heavier.mass_kg - 2.4).abs() < 1e-12 && (heavier.centre_m() - centre).norm() < 1e-12);
        assert!((heavier.central_kgm2() - own * 1.2).norm() < 1e-12);
        for axis in 0..3 {
            let step = Vector3::ith(axis, 1e-6);
            let beside = changed(&mass, &ways[1 + axis], 1e-6);
            let expected = Mass::about_centre(2.0, centre + step, own);
            assert!((beside.centre_m() - expected.centre_m()).norm() < 1e-12);
            // Steiner's terms are quadratic in the step.
            assert!((beside.inertia_kgm2 - expected.inertia_kgm2).norm() < 1e-11);
        }
    }

    #[test]
    fn a_payload_at_the_tip_is_a_point_there_and_its_moment_moves_it() {
        let tip = Vector3::new(0.0, 0.05, 0.2);
        let ways = payload_ways(tip);
        let point = changed(&Mass::zero(), &ways[0], 1.5);
        assert!((point.centre_m() - tip).norm() < 1e-12 && point.central_kgm2().norm() < 1e-12);
        let beside = changed(&point, &ways[3], 1.5e-6);
        assert!((beside.centre_m() - tip - Vector3::new(0.0, 0.0, 1e-6)).norm() < 1e-12);
    }
}
