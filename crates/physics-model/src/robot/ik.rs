//! Inverse kinematics by damped least squares.
//!
//! Levenberg-Marquardt with the damping of Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method" (IEEE
//! T-RO 27(5), 2011): λ = residual + a small bias, so that it is cautious far from the target and quadratic close to it. A step that
//! would break a joint limit puts that joint on the limit and the others make up for it.

use nalgebra::{Matrix6, Vector6};

use super::chain::{Chain, Frame, Jacobian, JointVector};
use super::{IkError, JointLimit};
use crate::state::MAX_JOINTS;

/// How [`super::Robot::solve_ik_with`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkOptions {
    /// Distance to the target, m, at which it stops.
    pub position_tolerance_m: f64,
    /// Angle to the target, rad, at which it stops.
    pub rotation_tolerance_rad: f64,
    /// Most iterations.
    pub max_iterations: u32,
    /// Share of the way to the home posture that an iteration goes within the null space, while it is still far from the target. Only a
    /// redundant arm has one: without the pull its posture drifts when the tool goes in circles.
    pub home_pull: f64,
}

impl Default for IkOptions {
    /// 0.1 µm and 1 µrad, so that errors do not add up over an episode; 60 iterations; pull 0.1.
    fn default() -> Self {
        Self { position_tolerance_m: 1e-7, rotation_tolerance_rad: 1e-6, max_iterations: 60, home_pull: 0.1 }
    }
}

/// Bias of the damping: (m, rad)².
const DAMPING_BIAS: f64 = 1e-9;
/// Share of ½‖error‖² that goes into the damping.
const DAMPING_SHARE: f64 = 0.05;
/// Longest joint step of one iteration, rad.
const LONGEST_STEP_RAD: f64 = 0.5;
/// Distance or angle above which the null space pulls.
const PULL_ABOVE: f64 = 1e-3;

/// What is sought.
pub(super) struct Problem<'a> {
    pub(super) chain: &'a Chain,
    pub(super) limits: &'a [JointLimit],
    pub(super) home: &'a [f64],
    /// Last segment ← tool.
    pub(super) segment_from_tool: &'a Frame,
    pub(super) base_from_target: &'a Frame,
}

impl Problem<'_> {
    /// Joint positions, rad, from `seed`; the first `n` places of the result count.
    pub(super) fn solve(&self, seed: &[f64], options: &IkOptions) -> Result<JointVector, IkError> {
        let n = self.limits.len();
        let target = self.base_from_target;
        if !seed.iter().chain(target.position.iter()).chain(target.rotation.iter()).all(|v| v.is_finite()) {
            return Err(IkError::NotFinite);
        }
        let mut q = JointVector::zeros();
        for (j, limit) in self.limits.iter().enumerate() {
            q[j] = seed[j].clamp(limit.lower_rad, limit.upper_rad);
        }
        let mut iterations = 0;
        loop {
            let posture = self.chain.posture(&q.as_slice()[..n]);
            let tool = posture.frame(n - 1).then(self.segment_from_tool);
            let position = target.position - tool.position;
            let turn = Frame { rotation: target.rotation * tool.rotation.transpose(), position };
            let rotation = turn.quaternion().scaled_axis();
            let (position_error_m, rotation_error_rad) = (position.norm(), rotation.norm());
            if position_error_m <= options.position_tolerance_m && rotation_error_rad <= options.rotation_tolerance_rad
            {
                return Ok(q);
            }
            if iterations == options.max_iterations {
                return Err(IkError::NotConverged { position_error_m, rotation_error_rad, iterations });
            }
            iterations += 1;
            let error = Vector6::new(position.x, position.y, position.z, rotation.x, rotation.y, rotation.z);
            let mut pull = JointVector::zeros();
            if n > 6 && position_error_m.max(rotation_error_rad) > PULL_ABOVE {
                for j in 0..n {
                    pull[j] = options.home_pull * (self.home[j] - q[j]);
                }
            }
            let jacobian = posture.jacobian_at(n, &tool.position);
            q += self.limited_step(&q, &jacobian, &error, &pull);
            for (j, limit) in self.limits.iter().enumerate() {
                // Only rounding: the step keeps the limits.
                q[j] = q[j].clamp(limit.lower_rad, limit.upper_rad);
            }
        }
    }

    /// The damped step towards `error`, with `pull` in the null space, that keeps all limits.
    fn limited_step(
        &self,
        q: &JointVector,
        jacobian: &Jacobian,
        error: &Vector6<f64>,
        pull: &JointVector,
    ) -> JointVector {
        let n = self.limits.len();
        let damping = DAMPING_BIAS + DAMPING_SHARE * 0.5 * error.norm_squared();
        let mut free = *jacobian;
        let mut wanted = *error;
        let mut step = JointVector::zeros();
        let mut stuck = [false; MAX_JOINTS];
        loop {
            let pull = JointVector::from_fn(|j, _| if stuck[j] { 0.0 } else { pull[j] });
            // step = pull + Jᵀ (J Jᵀ + λ)⁻¹ (error − J pull): towards the target first, the pull only in the null space.
            let gram = free * free.transpose() + Matrix6::identity() * damping;
            let Some(factor) = gram.cholesky() else { return JointVector::zeros() };
            let mut moving = pull + free.tr_mul(&factor.solve(&(wanted - free * pull)));
            let longest = moving.amax();
            if longest > LONGEST_STEP_RAD {
                moving *= LONGEST_STEP_RAD / longest;
            }
            let mut again = false;
            for j in 0..n {
                if stuck[j] {
                    continue;
                }
                step[j] = moving[j];
                let limit = &self.limits[j];
                if !limit.contains(q[j] + step[j]) {
                    let kept = (q[j] + step[j]).clamp(limit.lower_rad, limit.upper_rad) - q[j];
                    step[j] = kept;
                    stuck[j] = true;
                    wanted -= free.column(j) * kept;
                    free.column_mut(j).fill(0.0);
                    again = true;
                }
            }
            if !again {
                return step;
            }
        }
    }
}
