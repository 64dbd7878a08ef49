#![doc = include_str!("../README.md")]
//!
//! # API boundary
//!
//! Everything that is re-exported here; there are no public modules. The crate is made to be published: breaking changes follow semantic
//! versioning. The search that a seed leads to may change with any version.
//!
//! # Design
//!
//! - **Exploration.** No other setting decides as much. On RockSample(7, 8) at 2^10 simulations a decision, c = 5, 10, 20 and 40 return
//!   6.3, 12.7, 18.2 and 18.9 (± 0.5, n = 200). [`Exploration::ReturnRange`] scales c by the range of the returns at the root. The range
//!   at each node returns no more and costs 16 bytes a node.
//! - **Parallelism.** Independent trees run on scoped threads and are merged at the root. They share no writes, so the result is that of
//!   one thread, bit for bit.
//! - **Speed.** A simulation allocates nothing but new nodes, in two growing arrays. Branches are a binary search tree threaded through
//!   the nodes, without hashing. The random generator takes 3 to 5 % of a search. A table of 1/√n for UCB1 brought nothing.
//! - **Bias.** The value of a root is the mean return of simulations that explore, so it lies below the optimum at any finite count.
//!   The tests therefore compare decisions with exact values. With the mean backup, decisions for Tiger are optimal for horizons 1 to 5 and
//!   for the infinite horizon that ends on opening. At horizons 10 and 20 they are not.
//! - **Backup.** [`Backup::Watkins`] cuts returns where a simulation explored, and needs no memory of its own. With it, decisions are optimal
//!   for Tiger's horizons 10, 20 and infinity too, at 2^18 simulations. Full maxima (MaxUCT, Keller and Helmert, ICAPS 2013) decide as well
//!   on Tiger but overestimate elsewhere. The mean stays the default: where rollouts are informative, a maximum over few visits does not help.
//!
//! | backup | RockSample(7, 8), 2^10 | 2^13 | Tag, 2^10 | 2^13 |
//! |---|---|---|---|---|
//! | mean | 19.3 ± 0.4 | 20.2 ± 0.6 | −8.0 ± 0.4 | −7.4 ± 0.6 |
//! | Watkins | 18.7 ± 0.5 | 20.0 ± 0.6 | −8.7 ± 0.4 | −7.5 ± 0.6 |
//! | maximum | 9.1 ± 0.5 | | −15.1 ± 0.6 | |
//!
//! Mean return ± standard error; 200 episodes at 2^10 simulations a decision, 100 at 2^13.
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
//! | a search goes on that would not pay | `a_search_ends_early_where_more_would_not_pay_and_spends_its_budget_where_actions_tie` |
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

mod believing;
mod branching;

mod config;
mod error;
mod export;
mod gain;
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
pub use gain::EarlyStop;
pub use pomcp::{Planner, Pomcp, Pomcpow, SearchReport, Stop};
pub use ucb::{ActionStats, Choice};
