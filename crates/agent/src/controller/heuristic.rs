//! The lower bound: the heuristic policy, without search or belief.

use belief::Particles;
use push_task::{Action, HeuristicPolicy, Observation, Particle, PushModel};

use crate::controller::{Controller, Decision, Update};
use crate::{Error, WorldStep};

/// Moves the tool towards the object where it was last measured. It knows the arm's joints and the object's centre, nothing else.
pub(crate) struct HeuristicController<'a> {
    model: &'a PushModel,
    observation: Observation,
    joints_rad: Vec<f64>,
}

impl<'a> HeuristicController<'a> {
    /// After the first observation, with joint positions, rad.
    pub(crate) fn new(model: &'a PushModel, (observation, joints_rad): (&Observation, &[f64])) -> Self {
        Self { model, observation: observation.clone(), joints_rad: joints_rad.to_vec() }
    }
}

impl Controller for HeuristicController<'_> {
    fn decide(&mut self, _: Option<&Particle>, _: usize) -> Result<Decision, Error> {
        let (centre_m, _) = self.observation.object_pose();
        let action = HeuristicPolicy.action_towards(self.model, &self.joints_rad, centre_m);
        Ok(Decision { action, search: None })
    }

    fn update(&mut self, _: Action, answer: &WorldStep) -> Result<Update, Error> {
        self.observation.clone_from(&answer.observation);
        self.joints_rad.clone_from(&answer.joints_rad);
        Ok(Update::NoBelief)
    }

    fn prune(&mut self, _: Action, _: &Observation) {}

    fn belief(&self) -> Option<&Particles<Particle>> {
        None
    }
}
