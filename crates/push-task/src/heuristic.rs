//! The heuristic policy of the paper: move the tool towards the object's centre.

use pomdp::{Policy, Rng};

use crate::action::Action;
use crate::model::{Particle, PushModel};

/// Takes the action that most reduces the distance between the tool and the object's centre, among those that stay in reach.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeuristicPolicy;

impl HeuristicPolicy {
    /// The same for an object whose centre is known to be at `object_m`, base frame.
    #[must_use]
    pub fn action_towards(self, model: &PushModel, joints_rad: &[f64], object_m: [f64; 3]) -> Action {
        let tool = model.tool_position_m(joints_rad);
        let task = &model.config().task;
        let distance = |action: Action| {
            let direction = action.direction();
            let target: [f64; 3] = std::array::from_fn(|i| tool[i] + task.step_m * direction[i]);
            let squared = target.iter().zip(object_m).map(|(t, o)| (t - o) * (t - o)).sum::<f64>();
            if task.reach.contains(target) { squared } else { f64::INFINITY }
        };
        // Ties go to the lowest index, so that the policy is a function of the state.
        let mut best = (f64::INFINITY, Action::ALL[0]);
        for action in Action::ALL {
            let d = distance(action);
            if d < best.0 {
                best = (d, action);
            }
        }
        best.1
    }
}

impl Policy<PushModel> for HeuristicPolicy {
    fn action(&self, model: &PushModel, particle: &Particle, _rng: &mut Rng) -> Action {
        self.action_towards(model, &particle.state.joints_rad, particle.state.object.position_m)
    }
}
