//! A resolved scenario to a ready problem: true world, model, first belief.

use std::path::Path;
use std::sync::Arc;

use physics_model::config::ArmConfig;
use physics_model::effect::{Effect, EffectConfig, Hooks};
use physics_model::robot::Robot;
use pomdp::Rng;
use push_task::config::{ForceSensing, PushConfig};
use push_task::{Observation, Particle, PushModel, WorldDistribution};

use crate::schema::InitialObstacle;
use crate::{Error, Scenario};

/// Everything that a trial needs.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The scenario.
    pub scenario: Scenario,
    /// The true world's simulator.
    pub truth: PushModel,
    /// The model that filters.
    pub model: PushModel,
    /// The same in the time steps of the search.
    pub search: PushModel,
    /// Where worlds come from.
    pub worlds: WorldDistribution,
    /// Where first beliefs come from.
    pub beliefs: WorldDistribution,
    /// Joint positions at the start of every episode.
    pub start_joints_rad: Vec<f64>,
}

/// Draws of a hypothesis, at most, until its own effects have not put the object into something.
const DISPLACED: usize = 100;

impl Problem {
    /// The same with another number of threads that search, at most as many as are allowed. No result depends on it, unless the budget of a search is a time.
    #[must_use]
    pub fn searched_by(&self, threads: usize) -> Self {
        let mut problem = self.clone();
        problem.scenario.planner.threads = threads.clamp(1, 1024);
        problem
    }

    /// Loads the arm and puts the parts together.
    ///
    /// # Errors
    ///
    /// A missing or faulty URDF; a start that the arm cannot take.
    pub fn assemble(scenario: &Scenario, root: &Path) -> Result<Self, Error> {
        let robot = Arc::new(Robot::load(&scenario.robot, root)?);
        let (joints, sensing) = (robot.joint_count(), scenario.sensor.force);
        // The key of the search tree takes the three distal torques, the readings hold six values.
        if sensing == ForceSensing::JointTorques && !(3..=6).contains(&joints) {
            return Err(Error::Task {
                name: scenario.name.clone(),
                problem: format!("sensor.force: joint_torques expects an arm of 3 to 6 joints, this one has {joints}"),
            });
        }
        let (arm, effects) = (&scenario.arm, &scenario.effects);
        let truth = PushModel::new(scenario.push_config(&arm.truth, &effects.truth), Arc::clone(&robot));
        let config = scenario.push_config(&arm.model, &effects.model);
        let model = PushModel::new(config.clone(), Arc::clone(&robot));
        let steps = scenario.agent.search_steps.filter(|_| follows_exactly(&model, &scenario.distribution));
        let search_world = steps.map_or_else(|| config.world.clone(), |steps| steps.of(&config.world));
        let search = PushModel::new(PushConfig { world: search_world, ..config }, robot);
        let start = scenario.task.tool_start_m;
        let start_joints_rad = truth.joints_for(&scenario.robot.home_rad, start).ok_or_else(|| Error::Task {
            name: scenario.name.clone(),
            problem: format!("task.tool_start_m: expected a point that the arm reaches, found {start:?}"),
        })?;
        let worlds = scenario.distribution.clone();
        let mut beliefs = worlds.clone();
        // A belief is about what the model knows of.
        beliefs.effects.retain(|kind, _| effects.model.iter().any(|effect| effect.kind() == *kind));
        if scenario.initial_belief.obstacle == InitialObstacle::None {
            beliefs.obstacle.shape = [0.0, 0.0, 0.0, 1.0];
        }
        Ok(Self { scenario: scenario.clone(), truth, model, search, worlds, beliefs, start_joints_rad })
    }

    /// Draws a true world.
    ///
    /// # Errors
    ///
    /// [`Error::Task`] where the distribution leaves no possible world.
    pub fn sample_world(&self, rng: &mut Rng) -> Result<Particle, Error> {
        self.worlds.sample_possible(&self.truth, &self.start_joints_rad, rng).ok_or_else(|| self.impossible())
    }

    /// Draws `count` particles of the first belief: Θ and obstacle from the distribution, the object where it was measured,
    /// within the noise of the sensor, standing on the table.
    ///
    /// # Errors
    ///
    /// [`Error::Task`] where no possible world agrees with the measurement.
    pub fn initial_particles(
        &self,
        count: usize,
        observation: &Observation,
        rng: &mut Rng,
    ) -> Result<Vec<Particle>, Error> {
        let (position, orientation) = self.model.unread_pose(observation.object_pose());
        let noise = &self.scenario.sensor.noise;
        let mut pinned = self.beliefs.clone();
        let pin = |value: f64, stddev: f64| push_task::sampling::TruncatedNormal {
            mean: value,
            stddev,
            low: value - 4.0 * stddev,
            high: value + 4.0 * stddev,
        };
        pinned.object.x_m = pin(position[0], noise.position_m);
        pinned.object.y_m = pin(position[1], noise.position_m);
        let [x, y, z, w] = orientation;
        let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
        pinned.object.yaw_rad = pin(yaw, noise.orientation_rad);
        let mut one = || {
            let mut particle = pinned.sample_possible(&self.model, &self.start_joints_rad, rng)?;
            self.model.displace(&mut particle);
            Some(particle)
        };
        let mut possible = || (0..DISPLACED).find_map(|_| one().filter(|particle| self.model.check(particle).is_ok()));
        (0..count).map(|_| possible().ok_or_else(|| self.impossible())).collect()
    }

    fn impossible(&self) -> Error {
        Error::Task {
            name: self.scenario.name.clone(),
            problem: "distribution: expected worlds without overlap, a thousand draws in a row had one".into(),
        }
    }
}

/// Whether the model's tool goes exactly where it is sent. Otherwise longer steps make more worlds diverge: of 500 episodes of D4 with a servo of 20,000 N·m/rad
/// 60 instead of 17 in 10 × 3 steps instead of 20 × 2, with commands that are 20 ms late 12 instead of none (heuristic, seed 91).
fn follows_exactly(model: &PushModel, distribution: &WorldDistribution) -> bool {
    let config = model.config();
    let effects: Vec<Box<dyn Effect>> = config.effects.iter().map(EffectConfig::build).collect();
    let commands = Hooks::of(&effects).contains(Hooks::COMMAND);
    config.arm == ArmConfig::Kinematic && !commands && distribution.effects.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Selection;

    fn problem(preset: &str, set: &[&str]) -> Problem {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let set = set.iter().map(|&entry| entry.into()).collect();
        let scenario = Selection { preset: preset.into(), set, ..Selection::new(&root) }.load().unwrap();
        Problem::assemble(&scenario, &root).unwrap()
    }

    #[test]
    fn the_search_has_the_world_in_steps_of_its_own() {
        let duration_secs = |model: &PushModel| {
            let world = &model.config().world;
            world.control_period_secs * f64::from(world.control_steps)
        };
        for (set, steps) in [
            (&[][..], 10),
            (&["world.control_steps=80"], 40),
            (&["world.control_steps=5"], 3),
            // Steps of twice 0.06 s would be longer than a world's may be.
            (&["world.control_period_secs=0.06"], 12),
        ] {
            let problem = problem("surmise", set);
            let (search, model) = (problem.search.config(), problem.model.config());
            assert_eq!(search.world.control_steps, steps, "{set:?}");
            assert!((duration_secs(&problem.search) - duration_secs(&problem.model)).abs() < 1e-12, "{set:?}");
            assert_eq!(&PushConfig { world: model.world.clone(), ..search.clone() }, model, "{set:?}");
        }
    }

    #[test]
    fn an_arm_that_does_not_follow_exactly_is_searched_in_the_steps_of_the_world() {
        for (preset, set) in [
            ("paper", &[][..]),
            ("surmise", &["arm.model={ dynamic = { stiffness_nmprad = 2000.0, damping_ratio = 1.0 } }"]),
            ("surmise", &["effects.model=[{ actuation_delay = { delay_secs = 0.02 } }]"]),
        ] {
            let problem = problem(preset, set);
            assert_eq!(problem.search.config(), problem.model.config(), "{set:?}");
        }
        // What takes no part in commands changes nothing.
        let tilted =
            problem("surmise", &["effects.model=[{ table_tilt = { slope_x_rad = 0.01, slope_y_rad = 0.0 } }]"]);
        assert_ne!(tilted.search.config(), tilted.model.config());
    }
}
