//! Models and distributions of worlds as the scenarios have them: sensor noise, transition noise, any shape of object and obstacle.

#![allow(dead_code, reason = "each test program uses a part of it")]

use std::path::Path;
use std::sync::Arc;

use physics_model::config::ObstacleMobility;
use pomdp::Rng;
use push_task::{Coordinates, Observation, Particle, PushConfig, PushModel, WorldDistribution};
use rand_distr::{Distribution as _, StandardNormal};

/// A model with the worlds that it is for.
pub(crate) struct Worlds {
    pub(crate) model: PushModel,
    pub(crate) distribution: WorldDistribution,
    pub(crate) joints_rad: Vec<f64>,
}

impl Worlds {
    /// Those of an arm, with a change of the configuration.
    pub(crate) fn new(arm: &str, mobility: ObstacleMobility, change: impl FnOnce(&mut PushConfig)) -> Self {
        let read = |file: &str| -> toml::Table {
            let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
            toml::from_str(&std::fs::read_to_string(root.join("scenarios").join(file)).unwrap()).unwrap()
        };
        let (base, robot) = (read("base.toml"), read(&format!("robots/{arm}.toml")));
        let (model, joints_rad) = crate::support::model(arm, mobility);
        let mut config = model.config().clone();
        config.sensor.noise = robot["sensor"]["noise"].clone().try_into().unwrap();
        config.task.goal = robot["task"]["goal"].clone().try_into().unwrap();
        config.task.reach = robot["task"]["reach"].clone().try_into().unwrap();
        config.effects = base["effects"]["model"].clone().try_into().unwrap();
        config.transition_noise = read("presets/surmise.toml")["transition_noise"].clone().try_into().unwrap();
        change(&mut config);
        let mut distribution = base["distribution"].as_table().unwrap().clone();
        for body in ["object", "obstacle"] {
            let whole = distribution[body].as_table_mut().unwrap();
            whole.extend(robot["distribution"][body].as_table().unwrap().clone());
        }
        let mut distribution: WorldDistribution = distribution.try_into().unwrap();
        distribution.object.shape = [1.0 / 3.0; 3];
        distribution.obstacle.shape = [0.25; 4];
        let model = PushModel::new(config, Arc::new(model.robot().clone()));
        Self { model, distribution, joints_rad }
    }

    /// A world, and the first observation of it.
    pub(crate) fn draw(&self, rng: &mut Rng) -> (Particle, Observation) {
        let mut world = self.distribution.sample_possible(&self.model, &self.joints_rad, rng).unwrap();
        let observation = self.model.initial_observation(&mut world, rng);
        (world, observation)
    }

    pub(crate) fn coordinates(&self, first: &Observation) -> Coordinates<'_> {
        Coordinates::new(&self.model, &self.distribution, &self.joints_rad, first)
    }
}

/// As many standard normal numbers.
pub(crate) fn normals(count: usize, rng: &mut Rng) -> Vec<f64> {
    (0..count).map(|_| StandardNormal.sample(rng)).collect()
}
