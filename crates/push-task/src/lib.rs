//! The pushing task: an arm pushes an object of unknown parameters into a goal region, with or without an obstacle.
//!
//! [`PushModel`] is the task as a [`pomdp::GenerativeModel`]. Every action restores a fresh [`physics_model::world::World`] from the particle's
//! (s, Θ), moves the tool along a minimum-jerk path and reads the sensors. A transition is therefore a pure function of (s, Θ, action, random
//! stream): bit for bit the same whatever ran before, on any thread.
//!
//! [`config`] and [`WorldDistribution`] are what a scenario says of the task. [`HeuristicPolicy`] and [`GoalPolicy`] are rollout policies.
//!
//! All quantities are SI; vectors are in the base frame of the robot, z up, unless their name says otherwise.
//!
//! # Example
//!
//! ```
//! // An action moves the tool by a fixed length in one of ten directions.
//! use push_task::Action;
//!
//! assert_eq!(Action::UP.direction(), [0.0, 0.0, 1.0]);
//! assert_eq!(Action::ALL.len(), 10);
//! ```

pub mod action;
pub mod config;
pub mod coordinates;
mod drive;
mod footprint;
mod force;
pub mod goal;
pub mod heuristic;
mod history;
pub mod model;
mod perturb;
pub mod reward;
mod route;
pub mod sampling;
mod scene;
pub mod sensor;
mod simulation;
pub mod state;
mod transition_noise;
mod way;

pub use action::Action;
pub use config::PushConfig;
pub use coordinates::Coordinates;
pub use goal::GoalPolicy;
pub use heuristic::HeuristicPolicy;
pub use history::History;
pub use model::{ActionReport, Answer, Particle, PushModel};
pub use sampling::WorldDistribution;
pub use sensor::{Observation, ObservationKey};
pub use state::State;
pub use transition_noise::STEP_COORDINATES;
