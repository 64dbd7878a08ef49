//! Finds in logs of an arm's joints which effect the model of the arm lacks, and in which joint: friction of many kinds, motors, gears, clocks, loads.
//!
//! Torques are compared along the measured motion. Every hypothesis is a set of columns of torques that it would add, so that its evidence has a closed form, and
//! the whole catalogue is searched with every joint within seconds.

mod decision;
mod design;
mod diagnosis;
mod effect;
mod error;
mod estimate;
mod features;
mod fit;
mod friction;
mod gear;
mod group;
mod header;
mod kinds;
mod log;
mod masses;
mod model;
mod page;
mod prepared;
mod report;
mod samples;
mod search;
mod smooth;
mod stamps;
mod ticks;
mod values;

pub use effect::{EFFECTS, Effect, Parameter};
pub use error::Error;
pub use header::{Header, Noise, Numbers, Servo, is_joint_log};
pub use log::{Log, Readings};

pub use decision::{
    Decision, EFFECT_FEATURES, FORM_FEATURES, LOG_FEATURES, Logistic, Verdict, effect_features, form_features,
    log_features,
};
pub use diagnosis::{
    Cell, Considered, Diagnosis, HeldOut, InJoint, NamedEffect, Remainder, Settings, diagnose, diagnose_with,
};
pub use group::{Findings, Leftover, is_friction};
pub use kinds::Kind;
pub use model::{model_toml, model_urdf};
pub use page::page;
pub use report::Report;
pub use values::Value;
