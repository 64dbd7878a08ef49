//! The density of suggestions in plain coordinates: what importance weights need.

use physics_model::ObjectShape;
use physics_model::config::ObstacleMobility;
use physics_model::state::BODY_LEN;
use physics_model::theta::THETA_LEN;
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

/// ln q of what a network can say of the start of an episode, in plain coordinates: shapes, ln masses, friction, sizes, and the place of an obstacle
/// that cannot move. The rest is integrated out, as in [`push_task::Coordinates::log_density`].
#[must_use]
pub fn log_density_of_start(mixture: &Mixture, joints: usize, mobility: ObstacleMobility, start: &Particle) -> f64 {
    let (targets, applies) = features::theta_row(&start.theta);
    let width = joints + 2 * BODY_LEN + THETA_LEN;
    let (mut values, mut mask) = (vec![0.0; width], vec![false; width]);
    let first = joints + 2 * BODY_LEN;
    for (index, (target, applies)) in targets.iter().zip(applies).enumerate() {
        let mass = index == 0 || index == 8;
        values[first + index] = if mass { target.ln() } else { *target };
        // The centre of mass, and the mass of what cannot move.
        let left_out = (1..4).contains(&index) || (index == 8 && mobility == ObstacleMobility::Fixed);
        mask[first + index] = applies && !left_out;
    }
    // Widths are written twice the radius.
    let radii = [Some(start.theta.object.shape), start.theta.obstacle.as_ref().map(|o| o.shape)];
    let round = radii.into_iter().flatten().filter(|shape| *shape != ObjectShape::Box).count();
    let mut log_jacobian = round as f64 * std::f64::consts::LN_2;
    if let (Some(body), ObstacleMobility::Fixed) = (&start.state.obstacle, mobility) {
        let half_yaw = 0.5 * body.yaw_rad();
        for (place, value) in PLANE.into_iter().zip([body.position_m[0], body.position_m[1], half_yaw.sin()]) {
            values[joints + BODY_LEN + place] = value;
            mask[joints + BODY_LEN + place] = true;
        }
        log_jacobian += (0.5 * half_yaw.cos().abs()).ln();
    }
    mixture.log_density_masked(&values, &mask, &start.theta.classes()) + log_jacobian
}
