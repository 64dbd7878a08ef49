//! Algorithm 1 of Hayashi et al. (ICRA 2019): search from the belief, act, observe, let the network suggest, update, prune.
//!
//! The loop is `Agent::play` in `agent.rs`, with the line numbers of the paper; what chooses actions and learns from their answers is a
//! `Controller`: the method of the paper, or one of its two baselines.
//!
//! [`Agent::run`] plays one episode on a [`World`] with one [`Method`] and returns its [`Episode`]; a [`Watcher`] may look on. The world is simulated
//! ([`SimulatedWorld`]) or another program ([`ExternalWorld`]).
//!
//! # Example
//!
//! ```
//! use agent::{Agent, Method, SimulatedWorld};
//! use pomdp::{Purpose, Seed};
//! use scenario::{Problem, Selection, find_root};
//!
//! let root = find_root(env!("CARGO_MANIFEST_DIR").as_ref())?;
//! let problem = Problem::assemble(&Selection { domain: "D1".into(), ..Selection::new(&root) }.load()?, &root)?;
//! let seed = Seed(1);
//! let start = problem.sample_world(&mut seed.stream(Purpose::World, 0))?;
//! let mut world = SimulatedWorld::new(&problem.truth, start, seed.stream(Purpose::Truth, 0));
//! let episode = Agent::new(&problem, Method::Heuristic, None)?.run(&mut world, seed)?;
//! assert!(!episode.steps.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod agent;
mod belief_errors;
mod controller;
mod episode_log;
mod error;
mod external;
mod method;
mod network;
mod proposals;
mod record;
mod teacher;
mod watch;
mod world;

pub use agent::Agent;
pub use belief_errors::BeliefErrors;
pub use controller::history;
pub use error::Error;
pub use external::{
    ExternalEpisode, ExternalWorld, LINE_LIMIT_BYTES, PROTOCOL, Timeouts, WorldAddress, WorldError, WorldIdentity,
};
pub use method::Method;
pub use network::Network;
pub use record::{Episode, Reason, StepRecord};
pub use teacher::Estimate;
pub use watch::{StepView, Watcher};
pub use world::{SimulatedWorld, World, WorldStep};
