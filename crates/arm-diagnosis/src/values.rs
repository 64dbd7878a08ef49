//! Values of the parameters of what was found, with intervals.

use nalgebra::{DMatrix, DVector, Vector3};
use serde::Serialize;

use crate::estimate::Estimate;
use crate::features::Candidate;
use crate::group::is_friction;
use crate::prepared::Prepared;
use crate::search::{Found, Term};

/// Of a normal number, from its mean to the end of its 90 % interval, in standard deviations.
const NINETY: f64 = 1.644_853_626_951_472_2;

/// A parameter's value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Value {
    /// Name of the parameter.
    pub name: &'static str,
    /// SI.
    pub unit: &'static str,
    /// Best value.
    pub value: f64,
    /// From the 5 % to the 95 % quantile; of a value at its least, from there to the 95 % quantile.
    pub interval90: [f64; 2],
    /// What it cannot be less than.
    #[serde(skip)]
    pub least: f64,
}

/// Coefficients of a term with their covariance, those of a nuisance that is the same column added.
fn coefficients(found: &Found, estimate: &Estimate, features: &[usize]) -> (Vec<f64>, DMatrix<f64>) {
    let fit = &found.fit;
    let places: Vec<Vec<usize>> = features
        .iter()
        .map(|feature| {
            let alike =
                |column: &usize| *column == *feature || found.catalogue.features[*feature].twin == Some(*column);
            (0..fit.columns.len()).filter(|place| alike(&fit.columns[*place])).collect()
        })
        .collect();
    let sum = |places: &Vec<usize>| places.iter().map(|place| estimate.mean[*place]).sum();
    let values = places.iter().map(sum).collect();
    let matrix = DMatrix::from_fn(features.len(), features.len(), |i, j| {
        places[i].iter().flat_map(|a| places[j].iter().map(|b| estimate.covariance[(*a, *b)])).sum()
    });
    (values, matrix)
}

/// The parameters of a term.
pub(crate) fn values(prepared: &Prepared, found: &Found, estimate: &Estimate, term: &Term) -> Vec<Value> {
    let candidate = &found.catalogue.candidates[term.candidate];
    let (c, matrix) = coefficients(found, estimate, &candidate.features);
    let known = candidate.joint.map(|joint| &prepared.log.arm.joints()[joint]);
    let (friction, damping) = known.map_or((0.0, 0.0), |joint| (joint.friction, joint.damping));
    let own = |i: usize| (c[i], matrix[(i, i)].max(0.0).sqrt());
    let plus = |i: usize, more: f64| (c[i] + more, own(i).1);
    let wave = || {
        let amplitude = c[0].hypot(c[1]).max(1e-300);
        let (a, b) = (c[0] / amplitude, c[1] / amplitude);
        let along = (a * a * matrix[(0, 0)] + b * b * matrix[(1, 1)] + 2.0 * a * b * matrix[(0, 1)]).max(0.0).sqrt();
        let across = (b * b * matrix[(0, 0)] + a * a * matrix[(1, 1)] - 2.0 * a * b * matrix[(0, 1)]).max(0.0).sqrt();
        [(amplitude, along), (b.atan2(a), across / amplitude)]
    };
    let slides = known.is_some_and(|joint| joint.slides);
    let normal: Vec<(f64, f64)> = match candidate.effect.name {
        "joint_friction" => vec![plus(0, friction), plus(1, damping)],
        name if candidate.effect.extends_friction() && name != "presliding" => {
            let more = (2..c.len()).map(own);
            [plus(0, friction), plus(1, damping)].into_iter().chain(more).collect()
        }
        "presliding" => vec![plus(0, damping), plus(1, friction)],
        "torque_ripple" | "encoder_eccentricity" => wave().to_vec(),
        "reflected_inertia" => vec![plus(0, candidate.joint.map_or(0.0, |joint| prepared.reflected_inertia(joint)))],
        "torque_gain" => vec![plus(0, 1.0)],
        // The error of position times the stiffness that was said is what is compared.
        "servo_gain" => {
            let scale = (1.0 + c[0]).max(1e-3);
            vec![(1.0 / scale, own(0).1 / (scale * scale))]
        }
        "joint_elasticity" => {
            // Where it is at 0, as soft as may be.
            let at_zero = estimate.at_zero.iter().find(|(place, _)| found.fit.columns[*place] == candidate.features[0]);
            let give = at_zero.map_or(c[0], |(_, most)| *most).max(1e-12);
            return vec![inverse(candidate.effect.parameters[0], slides, give, own(0).1)];
        }
        "torque_saturation" | "command_delay" => Vec::new(),
        "payload" => payload(prepared, &c, &matrix),
        _ => (0..c.len()).map(own).collect(),
    };
    let mut values: Vec<Value> = normal
        .into_iter()
        .zip(candidate.effect.parameters)
        .map(|((value, stddev), parameter)| Value {
            name: parameter.name,
            unit: unit(parameter.unit, slides),
            value,
            interval90: [value - NINETY * stddev, value + NINETY * stddev],
            least: f64::NEG_INFINITY,
        })
        .collect();
    if is_friction(candidate.effect) || candidate.effect.name == "reflected_inertia" {
        // Their values are those of the columns, in order, and what the file says.
        for (value, feature) in values.iter_mut().zip(&candidate.features) {
            value.least = 0.0;
            let at_zero = estimate.at_zero.iter().find(|(place, _)| found.fit.columns[*place] == *feature);
            if let Some((_, most)) = at_zero {
                value.interval90[1] = value.value + most;
            }
            value.value = value.value.max(0.0);
            value.interval90 = value.interval90.map(|end| end.max(0.0));
        }
    }
    let settings_of: [fn(&Candidate) -> f64; 2] = [|candidate| candidate.setting, |candidate| candidate.curvature];
    for (parameter, of) in candidate.effect.parameters[values.len()..].iter().zip(settings_of) {
        let unit = unit(parameter.unit, slides);
        values.push(Value {
            name: parameter.name,
            unit,
            value: of(candidate),
            interval90: settings(found, term, of),
            least: 0.0,
        });
    }
    values
}

/// The unit of a joint that slides for that of one that turns.
fn unit(turning: &'static str, slides: bool) -> &'static str {
    const SLIDING: [(&str, &str); 9] = [
        ("1/(N m)", "1/N"),
        ("N m", "N"),
        ("N m s/rad", "N s/m"),
        ("rad/s", "m/s"),
        ("rad", "m"),
        ("kg m2", "kg"),
        ("N m/rad", "N/m"),
        ("N m/s", "N/s"),
        ("1", "1"),
    ];
    let found = SLIDING.iter().find(|(unit, _)| slides && *unit == turning);
    found.map_or(turning, |(_, unit)| unit)
}

fn inverse(parameter: crate::effect::Parameter, slides: bool, value: f64, stddev: f64) -> Value {
    let (low, high) = (value + NINETY * stddev, (value - NINETY * stddev).max(1e-3 * value));
    Value {
        name: parameter.name,
        unit: unit(parameter.unit, slides),
        value: 1.0 / value,
        interval90: [1.0 / low, 1.0 / high],
        least: 0.0,
    }
}

/// Settings whose evidence is within a factor of four, half way to the next ones.
fn settings(found: &Found, term: &Term, of: fn(&Candidate) -> f64) -> [f64; 2] {
    let all = &found.catalogue.candidates;
    let own = &all[term.candidate];
    let alike = |place: usize| all[place].effect.name == own.effect.name && all[place].joint == own.joint;
    let mut grid: Vec<f64> = (0..all.len()).filter(|place| alike(*place)).map(|place| of(&all[place])).collect();
    grid.sort_by(f64::total_cmp);
    let near = term.rivals.iter().filter(|(place, gain)| alike(*place) && term.gain - gain < 4.0_f64.ln());
    let (mut low, mut high) = (of(own), of(own));
    for (place, _) in near {
        low = low.min(of(&all[*place]));
        high = high.max(of(&all[*place]));
    }
    let below = grid.iter().copied().filter(|setting| *setting < low).fold(f64::NAN, f64::max);
    let above = grid.iter().copied().filter(|setting| *setting > high).fold(f64::NAN, f64::min);
    let middle = |a: f64, b: f64| if b.is_nan() { a } else { (a * b).abs().sqrt() };
    [middle(low, below), middle(high, above)]
}

/// Mass and its centre in the frame of the tip, from mass and moment about the tip with the axes of the last joint.
fn payload(prepared: &Prepared, c: &[f64], matrix: &DMatrix<f64>) -> Vec<(f64, f64)> {
    let centre = |c: &[f64]| -> Vector3<f64> {
        let mass = if c[0].abs() < 1e-6 { 1e-6 } else { c[0] };
        prepared.log.arm.last_from_tip().rotation.inverse() * (Vector3::new(c[1], c[2], c[3]) / mass)
    };
    let at = centre(c);
    let mut all = vec![(c[0], matrix[(0, 0)].max(0.0).sqrt())];
    for axis in 0..3 {
        let slope = DVector::from_fn(4, |i, _| {
            let step = (1e-4 * c[i].abs()).max(1e-9);
            let mut beside = c.to_vec();
            beside[i] += step;
            (centre(&beside)[axis] - at[axis]) / step
        });
        let variance = (slope.transpose() * matrix.view((0, 0), (4, 4)) * &slope)[(0, 0)];
        all.push((at[axis], variance.max(0.0).sqrt()));
    }
    all
}
