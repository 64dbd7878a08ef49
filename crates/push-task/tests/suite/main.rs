//! The pushing task, tested as its users see it. One program: each would compile the engine's generic code for itself.

mod coordinates;
mod determinism;
mod dynamic_arm;
mod effects_arm;
mod effects_catalogue;
mod hypotheses;
mod model;
mod replay;
mod support;
mod worlds;
