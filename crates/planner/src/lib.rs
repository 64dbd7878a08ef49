//! POMCP: partially observable Monte-Carlo planning (Silver and Veness, "Monte-Carlo planning in large POMDPs", NIPS 2010).
//!
//! [`Pomcp`] searches from any [`pomdp::Belief`], with any [`pomdp::Policy`] as rollout policy, and keeps its tree between
//! decisions. It holds no particles: the belief is filtered elsewhere, so a search sees only what can be sampled.
//!
//! # Example
//!
//! Two doors, one with a prize; looking costs a little and tells the truth.
//!
//! ```
//! use planner::{ActionPriors, Budget, Config, Exploration, Observations, Pomcp, RolloutDepth};
//! use pomdp::{Belief, Discretise, GenerativeModel, Outcome, Purpose, Rng, Seed, Step, UniformPolicy};
//! use rand::RngExt as _;
//!
//! #[derive(Clone, PartialEq, Debug)]
//! enum Action { Look, Open(usize) }
//!
//! struct Doors([Action; 3]);
//!
//! impl GenerativeModel for Doors {
//!     type State = usize;
//!     type Action = Action;
//!     type Observation = usize;
//!     fn actions(&self) -> &[Action] { &self.0 }
//!     fn step(&self, prize: &mut usize, action: &Action, _rng: &mut Rng) -> Step<usize> {
//!         match action {
//!             Action::Look => Step { observation: *prize, reward: -1.0, outcome: Outcome::Continue },
//!             Action::Open(door) => {
//!                 let reward = if door == prize { 10.0 } else { -10.0 };
//!                 Step { observation: 0, reward, outcome: Outcome::Terminal }
//!             }
//!         }
//!     }
//!     fn discount(&self) -> f64 { 0.95 }
//! }
//!
//! impl Discretise for Doors {
//!     type Key = usize;
//!     fn key(&self, observation: &usize) -> usize { *observation }
//! }
//!
//! /// Equally likely places of the prize.
//! struct OneOf(Vec<usize>);
//!
//! impl Belief for OneOf {
//!     type State = usize;
//!     fn sample(&self, rng: &mut Rng) -> &usize { &self.0[rng.random_range(0..self.0.len())] }
//! }
//!
//! let config = Config {
//!     budget: Budget::Simulations(2_000),
//!     exploration: Exploration::ReturnRange(1.0),
//!     depth: 5,
//!     rollout_depth: RolloutDepth::Full,
//!     action_priors: ActionPriors::Off,
//!     observations: Observations::Classes,
//!     nodes: 100_000,
//!     trees: 1,
//!     threads: 1,
//! };
//! let model = Doors([Action::Look, Action::Open(0), Action::Open(1)]);
//! let mut rng = Seed(1).stream(Purpose::Search, 0);
//! let mut planner = Pomcp::new(config)?;
//!
//! let report = planner.search(&model, &OneOf(vec![0, 1]), &UniformPolicy, 5, &mut rng);
//! assert_eq!(report.action, Action::Look);
//!
//! planner.prune(&Action::Look, &1);
//! let report = planner.search(&model, &OneOf(vec![1]), &UniformPolicy, 4, &mut rng);
//! assert_eq!(report.action, Action::Open(1));
//! # Ok::<(), planner::Error>(())
//! ```

mod branching;
mod config;
mod error;
mod export;
mod nodes;
mod parallel;
mod pomcp;
mod rollout;
mod simulate;
mod tree;
mod ucb;
mod widening;

pub use config::{ActionPriors, Budget, Config, Exploration, Observations, RolloutDepth};
pub use error::Error;
pub use export::{ExportLimit, TreeAction, TreeBranch, TreeNode};
pub use pomcp::{Planner, Pomcp, Pomcpow, SearchReport, Stop};
pub use ucb::ActionStats;
