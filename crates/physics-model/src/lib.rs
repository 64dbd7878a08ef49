//! Rapier worlds built from (s, Θ), and robot models read from URDF: the simulator behind planning, belief and data.
//!
//! [`PushModel`] is the pushing task as a [`pomdp::GenerativeModel`]: every action restores a fresh rapier world from the
//! particle's (s, Θ), moves the tool along a minimum-jerk path and reads the sensors. A transition is therefore a pure function
//! of (s, Θ, action, random stream): bit for bit the same whatever ran before, on any thread.
//!
//! All quantities are SI; vectors are in the base frame of the robot, z up, unless their name says otherwise.

pub mod action;
pub mod config;
mod contact;
pub mod effect;
pub mod effects;
pub mod error;
pub mod feasible;
mod force;
mod friction;
pub mod heuristic;
pub mod model;
mod motion;
mod perturb;
pub mod reward;
pub mod robot;
pub mod sampling;
pub mod sensor;
pub mod state;
pub mod theta;
pub mod world;

pub use action::Action;
pub use config::PushConfig;
pub use error::Impossible;
pub use heuristic::HeuristicPolicy;
pub use model::{ActionReport, Particle, PushModel};
pub use sampling::WorldDistribution;
pub use sensor::{Observation, ObservationKey};
pub use state::{BodyState, State};
pub use theta::{ObjectShape, ObjectTheta, ObstacleTheta, Theta};
