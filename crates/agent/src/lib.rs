//! Algorithm 1 of Hayashi et al. (ICRA 2019): search from the belief, act, observe, let the network suggest, update, prune.
//!
//! [`Agent::run`] plays one episode on a [`World`] with one [`Method`] and returns its [`Episode`]; a [`Watcher`] may look on. The world is simulated
//! ([`SimulatedWorld`]) or another program ([`ExternalWorld`]).

mod agent;
mod belief_errors;
mod births;
mod error;
mod external;
mod method;
mod record;
mod watch;
mod world;

pub use agent::Agent;
pub use belief_errors::BeliefErrors;
pub use error::Error;
pub use external::{
    ExternalEpisode, ExternalWorld, LINE_LIMIT_BYTES, PROTOCOL, Timeouts, WorldAddress, WorldError, WorldIdentity,
};
pub use method::Method;
pub use record::{Episode, Reason, StepRecord};
pub use watch::{Glimpse, Watcher};
pub use world::{SimulatedWorld, World, WorldStep};
