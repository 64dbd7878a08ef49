//! What the loop acts on.

use pomdp::{Outcome, Rng};
use push_task::{Action, ActionReport, Observation, Particle, PushModel};

use crate::Error;

/// What a world answers to an action.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldStep {
    /// Sensor values.
    pub observation: Observation,
    /// Joint positions after the action, rad: what the arm's own controller reports.
    pub joints_rad: Vec<f64>,
    /// Reward.
    pub reward: f64,
    /// Whether the task is over.
    pub outcome: Outcome,
    /// What happened, where the world can tell.
    pub report: ActionReport,
}

/// A world that can be acted on. The one here is simulated; whatever else can answer to an action may stand behind this trait.
pub trait World {
    /// Begins the episode; returns the first observation and the joint positions, rad.
    ///
    /// # Errors
    ///
    /// Where the world cannot start.
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error>;

    /// Executes an action.
    ///
    /// # Errors
    ///
    /// Where the world fails to answer.
    fn act(&mut self, action: Action) -> Result<WorldStep, Error>;

    /// True state and parameters, where the world knows them: for the oracle and for statistics, never for the methods.
    fn truth(&self) -> Option<&Particle>;
}

/// A world simulated by the scenario's true model.
#[derive(Debug)]
pub struct SimulatedWorld<'a> {
    model: &'a PushModel,
    start: Particle,
    particle: Particle,
    rng: Rng,
}

impl<'a> SimulatedWorld<'a> {
    /// A world that starts at `start`; `rng` is the stream of its sensor noise.
    #[must_use]
    pub fn new(model: &'a PushModel, start: Particle, rng: Rng) -> Self {
        Self { model, particle: start.clone(), start, rng }
    }
}

impl World for SimulatedWorld<'_> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), Error> {
        self.particle = self.start.clone();
        let observation = self.model.initial_observation(&mut self.particle, &mut self.rng);
        Ok((observation, self.particle.state.joints_rad.clone()))
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, Error> {
        let (step, report) = self.model.act(&mut self.particle, action, &mut self.rng);
        Ok(WorldStep {
            observation: step.observation,
            joints_rad: self.particle.state.joints_rad.clone(),
            reward: step.reward,
            outcome: step.outcome,
            report,
        })
    }

    fn truth(&self) -> Option<&Particle> {
        Some(&self.particle)
    }
}
