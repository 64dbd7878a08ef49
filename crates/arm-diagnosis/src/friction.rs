//! Columns of the kinds of friction of a joint.

use crate::features::{Catalogue, read};
use crate::prepared::Prepared;

/// Of the Stribeck effect exp(−(v/v_s)^α): speeds v_s below which it shows, rad/s, and curvatures α.
/// α is 2 in the usual form; the fits of Duclusaud and Passault (ICRA 2025) begin at 1.35.
const STRIBECK_RPS: [f64; 6] = [0.01, 0.02, 0.04, 0.08, 0.16, 0.32];
const CURVATURE: [f64; 2] = [1.25, 2.0];
/// Spread of a share of load before the log is seen; of a quadratic one in units of the joint's typical torque.
const SHARE: f64 = 0.2;

/// Columns that the kinds of friction of a joint have in common.
struct Common {
    joint: usize,
    /// N·m; sign of the rate.
    scale: f64,
    signs: Vec<f64>,
    /// Places of Coulomb and viscous friction.
    coulomb: usize,
    viscous: usize,
}

/// Torque that the gear passes on, by who drives whom, with the sign of the rate, N·m.
struct Load {
    all: Vec<f64>,
    driving: Vec<f64>,
    driven: Vec<f64>,
}

impl Load {
    fn new(prepared: &Prepared, joint: usize, signs: &[f64]) -> Self {
        let (rigid, rates) = (&prepared.rigid[joint], &prepared.motion[joint].rate);
        let all: Vec<f64> =
            signs.iter().zip(rigid).map(|(sign, rigid)| sign * rigid.abs() / prepared.gain(joint)).collect();
        let part = |wanted: bool| {
            let own =
                |(tick, load): (usize, &f64)| if (rigid[tick] * rates[tick] > 0.0) == wanted { *load } else { 0.0 };
            all.iter().enumerate().map(own).collect()
        };
        Self { driving: part(true), driven: part(false), all }
    }
}

impl Catalogue {
    pub(crate) fn add_friction(&mut self, prepared: &Prepared, joint: usize) {
        let own = Some(joint);
        let (scale, usual) = (0.3 * prepared.scale[joint], prepared.usual_rate[joint]);
        let signs = prepared.signs(joint);
        let rates = &prepared.motion[joint].rate;
        // Added to what the file says: where that is something it may be too much.
        let known = &prepared.log.arm.joints()[joint];
        let (no_coulomb, no_viscous) = (known.friction <= 0.0, known.damping <= 0.0);
        let (more, faster) = (scale.max(known.friction), (scale / usual).max(known.damping));
        let coulomb = self.push(own, read(prepared, joint, &signs), more, no_coulomb);
        let viscous = self.push(own, read(prepared, joint, rates), faster, no_viscous);
        self.candidate("joint_friction", own, 0.0, vec![coulomb, viscous]);
        let common = Common { joint, scale, signs, coulomb, viscous };
        self.add_loaded(prepared, &common);
        self.add_drifting(prepared, &common);
        for setting in [5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02] {
            let bristle = self.push(own, read(prepared, joint, &dahl(prepared, joint, setting)), scale, true);
            self.candidate("presliding", own, setting, vec![viscous, bristle]);
        }
    }

    /// The laws of Duclusaud and Passault (ICRA 2025): with the Stribeck effect, with load, with both, by direction, quadratic in load.
    fn add_loaded(&mut self, prepared: &Prepared, common: &Common) {
        let &Common { joint, scale, ref signs, coulomb, viscous } = common;
        let own = Some(joint);
        let rates = &prepared.motion[joint].rate;
        let load = Load::new(prepared, joint, signs);
        let mut column = |series: Vec<f64>, stddev: f64| self.push(own, read(prepared, joint, &series), stddev, true);
        let all = column(load.all.clone(), SHARE);
        let [driving, driven] = [&load.driving, &load.driven].map(|load| column(load.clone(), SHARE));
        let shapes = STRIBECK_RPS.into_iter().flat_map(|setting| CURVATURE.map(|curvature| (setting, curvature)));
        let mut peak_columns = |(setting, curvature): (f64, f64)| {
            let slow = |series: &[f64]| -> Vec<f64> {
                series
                    .iter()
                    .zip(rates)
                    .map(|(value, rate)| value * (-(rate / setting).abs().powf(curvature)).exp())
                    .collect()
            };
            let square = |series: &[f64]| -> Vec<f64> {
                slow(&series.iter().map(|value| value * value.abs()).collect::<Vec<_>>())
            };
            let peak = column(slow(signs), scale);
            let loads = [&load.all, &load.driving, &load.driven].map(|load| column(slow(load), SHARE));
            let typical = prepared.scale[joint];
            let squares = [&load.driving, &load.driven].map(|load| column(square(load), SHARE / typical));
            ((setting, curvature), peak, loads, squares)
        };
        let peaks: Vec<_> = shapes.map(&mut peak_columns).collect();
        self.candidate("load_friction", own, 0.0, vec![coulomb, viscous, all]);
        self.candidate("directional_friction", own, 0.0, vec![coulomb, viscous, driving, driven]);
        for (shape, peak, [all_peak, driving_peak, driven_peak], [driving_square, driven_square]) in peaks {
            self.shaped("stribeck_friction", own, shape, vec![coulomb, viscous, peak]);
            let both = vec![coulomb, viscous, all, peak, all_peak];
            self.shaped("stribeck_load_friction", own, shape, both);
            let mut directed = vec![coulomb, viscous, driving, driven, peak, driving_peak, driven_peak];
            self.shaped("stribeck_directional_friction", own, shape, directed.clone());
            directed.extend([driving_square, driven_square]);
            self.shaped("quadratic_load_friction", own, shape, directed);
        }
    }

    fn add_drifting(&mut self, prepared: &Prepared, common: &Common) {
        let &Common { joint, scale, ref signs, coulomb, viscous } = common;
        let (own, usual) = (Some(joint), prepared.usual_rate[joint]);
        let last = prepared.elapsed_secs.last().copied().unwrap_or(1.0).max(1e-9);
        // From 0 to 1 over the log, quick at first or steadily.
        for share in [0.15, 0.4, 1.0, 4.0] {
            let grown = |series: &[f64]| -> Vec<f64> {
                let growth = |time: f64| (1.0 - (-time / (share * last)).exp()) / (1.0 - (-1.0 / share).exp());
                series.iter().zip(&prepared.elapsed_secs).map(|(value, time)| value * growth(*time)).collect()
            };
            let more = self.push(own, read(prepared, joint, &grown(signs)), scale, false);
            let rates = &prepared.motion[joint].rate;
            let slower = self.push(own, read(prepared, joint, &grown(rates)), scale / usual, false);
            self.candidate("drifting_friction", own, share * last, vec![coulomb, viscous, more, slower]);
        }
    }
}

/// Dahl's model (1968) in units of its Coulomb friction: z' = (v − |v| z) / width.
fn dahl(prepared: &Prepared, joint: usize, width: f64) -> Vec<f64> {
    let position = &prepared.motion[joint].position;
    let mut all = vec![0.0; position.len()];
    for span in prepared.ticks.spans() {
        let mut z = 0.0_f64;
        for tick in span.clone() {
            if tick > span.start {
                let moved: f64 = position[tick] - position[tick - 1];
                // Exact for a step in one direction.
                let end = moved.signum();
                z = end + (z - end) * (-moved.abs() / width).exp();
            }
            all[tick] = z;
        }
    }
    all
}
