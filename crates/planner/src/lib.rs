#![doc = include_str!("../README.md")]
//!
//! # API boundary
//!
//! Everything that is re-exported here; there are no public modules. The crate is made to be published: breaking changes follow semantic
//! versioning. The search that a seed leads to may change with any version.
//!
//! # What was decided, and why
//!
//! - **Exploration.** The constant decides more than anything else: on RockSample(7, 8) at 2^10 simulations a move, c = 5, 10, 20, 40
//!   return 6.3, 12.7, 18.2 and 18.9 (± 0.5, n = 200). [`Exploration::ReturnRange`] uses the range of the returns at the root. The range of
//!   each node's own returns was tried and left: factors 0.4, 0.8, 1.6 return 12.2, 16.8, 18.5 with it and 12.6, 18.1, 18.7 with
//!   the root's (± 0.7, n = 100; likewise at 2^13), and it costs 16 bytes a node. Below a factor of 0.8 the rover checks rocks for ever.
//! - **Parallelism.** Independent trees, merged at the root, on scoped threads: no shared writes, so the result is that of one thread bit for
//!   bit.
//! - **Speed.** A simulation allocates nothing but new nodes in two growing arrays. Branches are a binary search tree threaded through the
//!   nodes, without hashing. The random generator takes 3 to 5 % of a search: its own buffer of four blocks is enough. A table of
//!   1/√n in place of the root and the division in UCB1 changed the time by +2 and −3 %, and was left out.
//! - **Bias.** The value of a root is the mean return of simulations that explore: below the optimum at any finite count. Decisions are
//!   what the tests compare with exact values. With the mean backup, those for horizons 1 to 5 of Tiger and for the infinite one that
//!   ends on opening lose nothing; for 10 and 20 the few simulations below an opened door weigh more than what there is to gain.
//! - **Backup.** [`Backup::Watkins`] cuts returns where a simulation explored, without memory of its own. At 2^18 simulations, ten actions
//!   deep, with rollouts that listen, decisions for Tiger's horizons 10, 20 and infinity lose nothing (6.6934, 11.8796, 19.3714). The
//!   root's value for horizon 10 is 6.44 ± 0.03 then and 6.60 ± 0.02 at 2^20 (n = 4); for 20 it is 3.1 ± 0.1 (n = 8) and 6.0 ± 0.1 (n = 2):
//!   still below. The mean stays the default, for where rollouts tell much a maximum over few visits does not help. Mean and Watkins return
//!   19.3 ± 0.4 and 18.7 ± 0.5 on RockSample(7, 8), −8.0 ± 0.4 and −8.7 ± 0.4 on Tag at 2^10 simulations (n = 200), 20.2 ± 0.6 and
//!   20.0 ± 0.6 and −7.4 ± 0.6 and −7.5 ± 0.6 at 2^13 (n = 100). Full maxima (MaxUCT, Keller and Helmert, ICAPS 2013) decide on Tiger as
//!   well, but overestimate: 9.1 ± 0.5 on RockSample and −15.1 ± 0.6 on Tag at 2^10. Mixtures of mean and maximum lost Tiger before they
//!   regained RockSample.
//!
//! # Planted faults
//!
//! Each was planted in the source, the tests of this crate run, and at least the named one failed:
//!
//! | fault | test |
//! |---|---|
//! | backup without the discount | `a_leaf_value_stands_for_what_a_cut_rollout_leaves_out` |
//! | backup discounted once too often | `terminal_and_diverged_worlds_end_a_simulation_without_further_reward` |
//! | UCB bound with the wrong sign | `ucb::the_bound_trades_mean_against_visits` |
//! | ties always go to the first action | `ucb::ties_are_shared_evenly` |
//! | range of returns forgets the kept means | `the_range_of_returns_starts_from_the_kept_means` |
//! | illegal actions counted as visits | `ucb::illegal_actions_are_neither_chosen_nor_counted` |
//! | priors at the root only | `priors_are_asked_for_at_every_new_node` |
//! | initial visits without their value | `priors_count_as_visits_and_illegal_actions_are_never_taken` |
//! | the return passes where the simulation explored, the best value elsewhere | `a_return_is_cut_where_its_simulation_explored` |
//! | Watkins' backup never used | the same |
//! | the best value passes even where the simulation took the best action | `ucb::a_return_passes_where_the_action_is_the_best_and_the_best_value_passes_elsewhere` |
//! | values of illegal and unvisited actions count as the best | the same |
//! | rollout without the discount | `rollout::the_return_is_the_geometric_sum_to_the_cut` |
//! | leaf value not discounted | `rollout::a_cut_rollout_adds_the_discounted_leaf_value_and_an_ended_or_full_one_does_not` |
//! | leaf value after the end of the episode | the same |
//! | a simulation goes on after the end of the episode | `terminal_and_diverged_worlds_end_a_simulation_without_further_reward` |
//! | one action beyond the horizon | `simulations_stop_at_the_smaller_of_depth_and_remaining_horizon` |
//! | one simulation more than the budget | `a_simulation_clones_the_root_state_once` |
//! | last simulation may overrun the transitions | `a_budget_of_transitions_is_never_overrun_and_nearly_used` |
//! | one node more than the limit | `a_full_tree_stops_growing_and_goes_on_searching` |
//! | a smaller key goes to the wrong side | `tree::pruning_keeps_exactly_the_subtree` |
//! | pruning follows the first action, not the executed one | `a_pruned_tree_keeps_the_statistics_of_the_history_that_happened` |
//! | pruning keeps nodes of other branches | `tree::pruning_keeps_exactly_the_subtree` |
//! | merged values not weighted by visits | `ucb::merged_means_are_those_of_all_returns` |
//! | every tree draws the same stream | `parallel::results_come_in_the_order_of_the_trees_for_any_number_of_threads` |
//! | results in the order of the threads | the same |
//! | likelihood weights ignored | `values_of_continuous_observations_are_the_exact_ones` |
//! | branches drawn evenly, not by visits | the same |
//! | one branch too few by widening | `a_branch_per_visit_at_most_and_few_where_configured_so` |
//! | reward of another state than the one drawn | `widening::a_simulation_goes_on_from_a_weighted_state_with_the_reward_that_led_to_it` |
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

pub use config::{ActionPriors, Backup, Budget, Config, Exploration, Observations, RolloutDepth};
pub use error::Error;
pub use export::{ExportLimit, TreeAction, TreeBranch, TreeNode};
pub use pomcp::{Planner, Pomcp, Pomcpow, SearchReport, Stop};
pub use ucb::ActionStats;
