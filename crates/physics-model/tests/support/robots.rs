//! The arms of the scenarios.

use std::path::Path;

use physics_model::robot::{Robot, RobotConfig};

/// The arm of `scenarios/robots/NAME.toml`.
pub(crate) fn robot(name: &str) -> Robot {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let text = std::fs::read_to_string(root.join(format!("scenarios/robots/{name}.toml"))).unwrap();
    let file: toml::Table = toml::from_str(&text).unwrap();
    let config: RobotConfig = file["robot"].clone().try_into().unwrap();
    Robot::load(&config, root).unwrap()
}
