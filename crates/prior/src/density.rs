//! The density of suggestions in the coordinates of a belief filter: what importance weights need.

use physics_model::config::ObstacleMobility;
use physics_model::state::BODY_LEN;
use physics_model::theta::THETA_LEN;
use physics_model::{ObjectShape, Theta};
use push_task::Particle;
use push_task::state::State;

use crate::features;
use crate::{Draw, Layout, Mixture};

/// Places of the obstacle's x, y and the z part of its quaternion among the values of a body.
const PLANE: [usize; 3] = [0, 1, 5];

/// An unchanged draw, for a filter that knows its density. An impossible value becomes NaN, so that the draw counts as
/// impossible. Moving it to the nearest possible value would change the density. Of the state only the obstacle's pose
/// in the plane is kept.
#[must_use]
pub fn raw_particle(layout: &Layout, draw: &Draw, observation: &[f64], joints: usize, table_height_m: f64) -> Particle {
    let plain = layout.invert(&draw.values, observation);
    let (state, targets) = plain.split_at(joints + 2 * BODY_LEN);
    let mut theta = features::theta_of_targets(targets, &draw.classes);
    if !(0.0..=1.0).contains(&theta.object.friction) {
        theta.object.friction = f64::NAN;
    }
    // In the frame of a sphere the centre of mass lies below the centre. The network has never seen one above, so such
    // a draw is impossible.
    if theta.object.shape == ObjectShape::Sphere && targets[3] > 0.0 {
        theta.object.com_m[2] = f64::NAN;
    }
    let half = theta.object.shape.half_extents_m(theta.object.size_m);
    for (com, half) in theta.object.com_m.iter_mut().zip(half) {
        if com.abs() > half {
            *com = f64::NAN;
        }
    }
    let mut state = State::from_slice(state, joints, theta.obstacle.is_some());
    if let (Some(body), Some(obstacle)) = (&mut state.obstacle, &theta.obstacle) {
        let z = plain[joints + BODY_LEN + PLANE[2]];
        let rest_m = table_height_m + obstacle.shape.half_height_m(obstacle.size_m);
        let yaw_rad = if z.abs() <= 1.0 { 2.0 * z.asin() } else { f64::NAN };
        *body = physics_model::BodyState::at_rest([body.position_m[0], body.position_m[1], rest_m], yaw_rad);
    }
    Particle::new(state, theta)
}

/// ln q of a particle's static parameters under `mixture`, with all else integrated out. q is the probability of its
/// shapes times the density of its parameters, in the coordinates of `PushModel`'s [`pomdp::StaticParameters`].
///
/// The mixture is one over written targets y; with coordinates x the density is that of y(x) times |dy/dx|. Sizes come first in the
/// order of elimination, then the centre of mass, whose bounds depend on them: the Jacobian is triangular.
#[must_use]
pub fn log_density(mixture: &Mixture, joints: usize, mobility: ObstacleMobility, particle: &Particle) -> f64 {
    let (targets, applies) = features::theta_row(&particle.theta);
    let width = joints + 2 * BODY_LEN + THETA_LEN;
    let (mut values, mut mask) = (vec![0.0; width], vec![false; width]);
    let first = joints + 2 * BODY_LEN;
    let mut log_jacobian = log_jacobian(&particle.theta);
    for (index, (target, applies)) in targets.iter().zip(applies).enumerate() {
        let mass = index == 0 || index == 8;
        values[first + index] = if mass { target.ln() } else { *target };
        // A fixed obstacle's mass is no coordinate of the filter's.
        mask[first + index] = applies && !(index == 8 && mobility == ObstacleMobility::Fixed);
    }
    if let (Some(body), ObstacleMobility::Fixed) = (&particle.state.obstacle, mobility) {
        let half_yaw = 0.5 * body.yaw_rad();
        for (place, value) in PLANE.into_iter().zip([body.position_m[0], body.position_m[1], half_yaw.sin()]) {
            values[joints + BODY_LEN + place] = value;
            mask[joints + BODY_LEN + place] = true;
        }
        log_jacobian += (0.5 * half_yaw.cos().abs()).ln();
    }
    mixture.log_density_masked(&values, &mask, &particle.theta.classes()) + log_jacobian
}

/// Σ ln |dy/dx| over friction, sizes and centre of mass; that of a mass is 0.
fn log_jacobian(theta: &Theta) -> f64 {
    let object = &theta.object;
    // y = 1 / (1 + exp(−x)): dy/dx = y (1 − y).
    let logistic = |share: f64| (share * (1.0 - share)).ln();
    // Written as widths: d(2r)/d(ln r) = 2r.
    let sizes = |shape: ObjectShape, size_m: [f64; 3]| -> f64 {
        let (extents, applies) = features::extents(shape, size_m);
        extents.iter().zip(applies).filter(|(_, applies)| *applies).map(|(extent, _)| extent.ln()).sum()
    };
    let com = match object.shape {
        ObjectShape::Sphere => logistic(-object.com_m[2] / object.size_m[0]) + object.size_m[0].ln(),
        shape => {
            let half = shape.half_extents_m(object.size_m);
            let each = object.com_m.iter().zip(half);
            each.map(|(com, half)| logistic(0.5 * (1.0 + com / half)) + (2.0 * half).ln()).sum()
        }
    };
    let obstacle = theta.obstacle.as_ref().map_or(0.0, |o| sizes(o.shape, o.size_m));
    logistic(object.friction) + sizes(object.shape, object.size_m) + com + obstacle
}
