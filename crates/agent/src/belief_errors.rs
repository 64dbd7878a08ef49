//! How far beliefs are from the truth, where a world knows it.

use belief::Particles;
use push_task::Particle;
use serde::{Deserialize, Serialize};

/// Errors of the beliefs of an episode: of the first one, then of that after each update. The estimate of a number is its weighted mean.
/// Values have four significant digits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeliefErrors {
    /// |friction coefficient − true one|.
    pub friction: Vec<f64>,
    /// |ln mass − ln true mass|.
    pub log_mass: Vec<f64>,
    /// Distance of the centre of mass from the true one, m, in the object's frame.
    pub com_m: Vec<f64>,
    /// Mean of |full length − true one|, m, over the object's three axes: sizes that shapes share.
    pub size_m: Vec<f64>,
    /// Probability of the object's true shape.
    pub shape_probability: Vec<f64>,
    /// Probability of what is true: that there is an obstacle, or that there is none. (1 − p)² is its Brier score.
    pub obstacle_probability: Vec<f64>,
    /// Horizontal distance, m, of the obstacle from the true one, over the particles that have one; null where there is none on either
    /// side.
    pub obstacle_m: Vec<Option<f64>>,
}

impl BeliefErrors {
    /// Number of beliefs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.friction.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.friction.is_empty()
    }

    /// Adds the errors of a belief.
    pub(crate) fn push(&mut self, belief: &Particles<Particle>, truth: &Particle) {
        // What a filter has ruled out need not be a possible world.
        let weighted = || belief.iter().filter(|(_, weight)| *weight > 0.0);
        let mean = |value: &dyn Fn(&Particle) -> f64| weighted().map(|(p, weight)| weight * value(p)).sum::<f64>();
        let (object, true_obstacle) = (&truth.theta.object, truth.state.obstacle.as_ref());
        let share = |holds: &dyn Fn(&Particle) -> bool| mean(&|p| f64::from(u8::from(holds(p))));
        let com_m: [f64; 3] = std::array::from_fn(|i| mean(&|p| p.theta.object.com_m[i]) - object.com_m[i]);
        let half_m = |p: &Particle| p.theta.object.shape.half_extents_m(p.theta.object.size_m);
        let true_half_m = half_m(truth);
        let size_m = (0..3).map(|i| 2.0 * (mean(&|p| half_m(p)[i]) - true_half_m[i]).abs()).sum::<f64>() / 3.0;
        let with_obstacle = share(&|p| p.state.obstacle.is_some());
        let obstacle_m = true_obstacle.filter(|_| with_obstacle > 0.0).map(|body| {
            let off_m = |axis: usize| {
                let sum_m = mean(&|p| p.state.obstacle.as_ref().map_or(0.0, |o| o.position_m[axis]));
                sum_m / with_obstacle - body.position_m[axis]
            };
            off_m(0).hypot(off_m(1))
        });
        self.friction.push(rounded((mean(&|p| p.theta.object.friction) - object.friction).abs()));
        self.log_mass.push(rounded((mean(&|p| p.theta.object.mass_kg.ln()) - object.mass_kg.ln()).abs()));
        self.com_m.push(rounded(com_m.iter().map(|c| c * c).sum::<f64>().sqrt()));
        self.size_m.push(rounded(size_m));
        self.shape_probability.push(rounded(share(&|p| p.theta.object.shape == object.shape)));
        let present = true_obstacle.is_some();
        self.obstacle_probability.push(rounded(share(&|p| p.state.obstacle.is_some() == present)));
        self.obstacle_m.push(obstacle_m.map(rounded));
    }
}

/// Four significant digits: more than statistics over trials ask for, and a third of the bytes.
fn rounded(value: f64) -> f64 {
    // What is written is a number; what is not finite stays what it is.
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use physics_model::{BodyState, ObjectShape, ObjectTheta, ObstacleTheta, Theta};
    use push_task::State;

    use super::*;

    fn particle(shape: ObjectShape, size_m: [f64; 3], obstacle_at: Option<[f64; 3]>) -> Particle {
        let object = BodyState::at_rest([0.5, -0.1, 0.0], 0.0);
        let state =
            State { joints_rad: vec![0.0; 7], object, obstacle: obstacle_at.map(|at| BodyState::at_rest(at, 0.3)) };
        let theta = Theta {
            object: ObjectTheta { shape, mass_kg: 1.0, com_m: [0.0; 3], friction: 0.4, size_m },
            obstacle: obstacle_at.map(|_| ObstacleTheta { shape, mass_kg: 1.0, size_m: [0.05; 3] }),
            effects: vec![],
        };
        Particle::new(state, theta)
    }

    #[test]
    fn errors_are_those_of_the_weighted_mean() {
        let truth = particle(ObjectShape::Box, [0.1, 0.1, 0.1], Some([0.6, 0.0, 0.0]));
        let mut near = truth.clone();
        near.theta.object.friction = 0.3;
        near.theta.object.mass_kg = 2.0_f64.exp();
        near.theta.object.com_m = [0.003, 0.0, -0.004];
        near.state.obstacle.as_mut().unwrap().position_m = [0.64, 0.03, 0.2];
        // Its full lengths are 0.08, 0.08 and 0.1.
        let mut far = particle(ObjectShape::Cylinder, [0.04, 0.1, 0.0], None);
        far.theta.object.friction = 0.8;
        let belief = Particles::weighted(vec![near, far], vec![3.0, 1.0]).unwrap();
        let mut errors = BeliefErrors::default();
        errors.push(&belief, &truth);
        // Friction 0.75 · 0.3 + 0.25 · 0.8 = 0.425; ln mass 0.75 · 2; centre of mass 0.75 · 5 mm; lengths 2 · 0.25 · 0.02 / 3.
        assert_eq!((errors.friction[0], errors.log_mass[0]), (0.025, 1.5));
        assert_eq!((errors.com_m[0], errors.size_m[0]), (0.00375, 0.003333));
        assert_eq!((errors.shape_probability[0], errors.obstacle_probability[0]), (0.75, 0.75));
        // Height does not count: shapes rest at different ones.
        assert_eq!(errors.obstacle_m, [Some(0.05)]);
    }

    #[test]
    fn an_obstacle_that_either_side_lacks_has_no_distance() {
        let size_m = [0.1; 3];
        let with = particle(ObjectShape::Box, size_m, Some([0.6, 0.0, 0.0]));
        let without = particle(ObjectShape::Box, size_m, None);
        let mut errors = BeliefErrors::default();
        errors.push(&Particles::uniform(vec![without.clone()]).unwrap(), &with);
        errors.push(&Particles::uniform(vec![with]).unwrap(), &without);
        errors.push(&Particles::uniform(vec![without.clone()]).unwrap(), &without);
        assert_eq!((errors.len(), errors.is_empty()), (3, false));
        assert_eq!(errors.obstacle_m, [None; 3]);
        assert_eq!(errors.obstacle_probability, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn rounding_keeps_four_digits_of_any_size() {
        assert_eq!([0.123_456, 1.234_56e-7, 0.0, 98_765.4].map(rounded), [0.1235, 1.235e-7, 0.0, 98_770.0]);
        assert!(rounded(f64::NAN).is_nan());
    }
}
