//! What a search does with its budget, its tree, its horizon and its generator, on small models with known answers.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

use planner::{
    ActionPriors, Budget, Config, Error, Exploration, ExportLimit, Observations, Pomcp, RolloutDepth, Stop, TreeNode,
};
use pomdp::{
    ActionPrior, Belief, Discretise, GenerativeModel, Outcome, Policy, Purpose, Rng, Seed, Step, UniformPolicy,
    conformance,
};
use proptest::prelude::*;

thread_local! {
    static CLONES: Cell<usize> = const { Cell::new(0) };
}

/// A count of steps whose clones are counted.
#[derive(Debug, PartialEq)]
struct Counted(usize);

impl Clone for Counted {
    fn clone(&self) -> Self {
        CLONES.with(|c| c.set(c.get() + 1));
        Self(self.0)
    }
}

/// Three actions and four equally likely observations; rewards come from a table, the world ends as told.
struct Noise {
    rewards: [f64; 3],
    discount: f64,
    /// Step at which the given action ends the world, and how.
    ending: Option<(usize, usize, Outcome)>,
    steps: AtomicUsize,
}

impl Noise {
    fn new(rewards: [f64; 3]) -> Self {
        Self { rewards, discount: 0.9, ending: None, steps: AtomicUsize::new(0) }
    }
}

impl GenerativeModel for Noise {
    type State = Counted;
    type Action = usize;
    type Observation = u8;

    fn actions(&self) -> &[usize] {
        &[0, 1, 2]
    }

    fn step(&self, state: &mut Counted, action: &usize, rng: &mut Rng) -> Step<u8> {
        self.steps.fetch_add(1, Ordering::Relaxed);
        state.0 += 1;
        let outcome = match self.ending {
            Some((step, fatal, outcome)) if step == state.0 && fatal == *action => outcome,
            _ => Outcome::Continue,
        };
        Step { observation: rng.random_range(0..4), reward: self.rewards[*action], outcome }
    }

    fn discount(&self) -> f64 {
        self.discount
    }
}

impl Discretise for Noise {
    type Key = u8;

    fn key(&self, observation: &u8) -> u8 {
        *observation
    }
}

/// One action, one observation, and an end at the third step.
struct OneAction(Outcome);

impl GenerativeModel for OneAction {
    type State = Counted;
    type Action = ();
    type Observation = ();

    fn actions(&self) -> &[()] {
        &[()]
    }

    fn step(&self, state: &mut Counted, (): &(), _rng: &mut Rng) -> Step<()> {
        state.0 += 1;
        Step { observation: (), reward: 0.0, outcome: if state.0 == 3 { self.0 } else { Outcome::Continue } }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl Discretise for OneAction {
    type Key = ();

    fn key(&self, (): &()) {}
}

struct Known(Counted);

impl Belief for Known {
    type State = Counted;

    fn sample(&self, _rng: &mut Rng) -> &Counted {
        &self.0
    }
}

fn config(budget: Budget, depth: usize) -> Config {
    Config {
        budget,
        exploration: Exploration::ReturnRange(1.0),
        depth,
        rollout_depth: RolloutDepth::Full,
        action_priors: ActionPriors::Off,
        observations: Observations::Classes,
        nodes: 1 << 24,
        trees: 1,
        threads: 1,
    }
}

fn rng(item: u64) -> Rng {
    Seed(1).stream(Purpose::Search, item)
}

const START: Known = Known(Counted(0));

#[test]
fn the_test_model_conforms() {
    conformance::check_generative_model(&Noise::new([1.0, 2.0, 3.0]), &[Counted(0)], 20);
}

#[test]
fn an_invalid_config_makes_no_planner() {
    let error = Pomcp::<Noise>::new(config(Budget::Transitions(3), 4)).err();
    let expected =
        Error::Config { key: "budget.transitions", value: "3".into(), limit: "at least depth × trees = 4".into() };
    assert_eq!(error, Some(expected));
}

#[test]
fn equal_seeds_give_equal_reports_and_other_seeds_others() {
    let run = |item| {
        let model = Noise::new([1.0, 1.1, 0.9]);
        let mut planner = Pomcp::new(config(Budget::Simulations(500), 6)).unwrap();
        let mut rng = rng(item);
        let first = planner.search(&model, &START, &UniformPolicy, 6, &mut rng);
        planner.prune(&first.action, &2);
        let second = planner.search(&model, &START, &UniformPolicy, 5, &mut rng);
        (first, second)
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_simulation_clones_the_root_state_once() {
    let model = Noise::new([1.0, 2.0, 3.0]);
    let mut planner = Pomcp::new(config(Budget::Simulations(300), 8)).unwrap();
    let before = CLONES.with(Cell::get);
    let report = planner.search(&model, &START, &UniformPolicy, 8, &mut rng(0));
    assert_eq!(CLONES.with(Cell::get) - before, 300);
    assert_eq!((report.simulations, report.transitions), (300, 300 * 8));
    assert_eq!(START.0, Counted(0), "the belief's state was stepped");
}

#[test]
fn a_pruned_tree_keeps_the_statistics_of_the_history_that_happened() {
    let model = Noise::new([1.0, 2.0, 3.0]);
    let search =
        |planner: &mut Pomcp<Noise>, horizon| planner.search(&model, &START, &UniformPolicy, horizon, &mut rng(5));
    let mut planner = Pomcp::new(config(Budget::Simulations(4000), 3)).unwrap();
    let first = search(&mut planner, 3);
    let taken = first.actions[2].visits;
    planner.prune(&2, &1);
    let second = search(&mut planner, 2);
    // Null: each of four observations follows with probability 1/4, so the child has n/4 visits less the one that created it;
    // the tolerance is 4 standard deviations.
    let tolerance = 4.0 * (taken as f64 * 3.0 / 16.0).sqrt();
    assert!((second.reused as f64 - (taken as f64 / 4.0 - 1.0)).abs() < tolerance, "{} of {taken}", second.reused);
    // A simulation adds exactly one visit of the root to what was kept.
    let visits: u64 = second.actions.iter().map(|a| a.visits).sum();
    assert_eq!(visits, second.reused + 4000);
    assert!(second.nodes < first.nodes, "a tree of depth 2 has fewer nodes than one of depth 3");
}

#[test]
fn reset_and_histories_never_simulated_start_afresh() {
    let model = Noise::new([1.0, 2.0, 3.0]);
    let mut planner = Pomcp::new(config(Budget::Simulations(100), 3)).unwrap();
    planner.prune(&0, &0);
    let mut reused = |prepare: fn(&mut Pomcp<Noise>)| {
        planner.search(&model, &START, &UniformPolicy, 3, &mut rng(0));
        prepare(&mut planner);
        planner.search(&model, &START, &UniformPolicy, 3, &mut rng(0)).reused
    };
    assert!(reused(|_| {}) >= 100);
    assert_eq!(reused(|p| p.prune(&1, &99)), 0);
    assert_eq!(reused(Pomcp::reset), 0);
}

#[test]
fn simulations_stop_at_the_smaller_of_depth_and_remaining_horizon() {
    for (depth, horizon) in [(1, 9), (9, 1), (4, 9), (9, 4), (9, 9)] {
        let model = Noise::new([1.0, 1.0, 1.0]);
        let mut planner = Pomcp::new(config(Budget::Simulations(50_000), depth)).unwrap();
        let report = planner.search(&model, &START, &UniformPolicy, horizon, &mut rng(0));
        let length = depth.min(horizon);
        assert_eq!(report.transitions, 50_000 * length);
        assert!(report.depth <= length);
        // Reward 1 a step: every return is (1 − γ^length) / (1 − γ).
        let expected = (1.0 - 0.9_f64.powi(length as i32)) / 0.1;
        assert!(report.actions.iter().all(|a| (a.value - expected).abs() < 1e-9), "{:?}", report.actions);
    }
}

#[test]
fn a_short_rollout_saves_transitions_and_counts_the_rest_as_zero() {
    let model = Noise::new([1.0, 1.0, 1.0]);
    let config = Config { rollout_depth: RolloutDepth::Actions(2), ..config(Budget::Simulations(1), 9) };
    let report = Pomcp::new(config).unwrap().search(&model, &START, &UniformPolicy, 9, &mut rng(0));
    assert_eq!(report.transitions, 3);
    let value = report.actions.iter().find(|a| a.visits == 1).unwrap().value;
    assert!((value - (1.0 + 0.9 + 0.81)).abs() < 1e-12);
}

#[test]
#[should_panic(expected = "remaining_horizon is 0")]
fn planning_without_an_action_left_is_a_bug() {
    let mut planner = Pomcp::new(config(Budget::Simulations(1), 1)).unwrap();
    planner.search(&Noise::new([0.0; 3]), &START, &UniformPolicy, 0, &mut rng(0));
}

#[test]
fn terminal_and_diverged_worlds_end_a_simulation_without_further_reward() {
    for ending in [Outcome::Terminal, Outcome::Diverged] {
        let model = Noise { ending: Some((1, 1, ending)), ..Noise::new([2.0, 5.0, 2.0]) };
        // Action 1 ends the world if taken first: worth exactly 5, against 2 + 0.9 · 5 = 6.5 for the others before it.
        let mut planner = Pomcp::new(config(Budget::Simulations(2000), 2)).unwrap();
        let report = planner.search(&model, &START, &UniformPolicy, 2, &mut rng(0));
        assert_ne!(report.action, 1);
        assert_eq!(report.actions[1].value, 5.0);
        let ended = report.actions[1].visits as usize;
        let expected = if ending == Outcome::Terminal { (ended, 0) } else { (0, ended) };
        assert_eq!((report.terminal, report.diverged), expected);
        assert_eq!(report.transitions, 2 * 2000 - ended);
    }
}

#[test]
fn an_ending_inside_a_rollout_is_counted() {
    // Every world ends at its third step; the tree of one simulation is one step deep.
    for (ending, expected) in [(Outcome::Terminal, (1, 0)), (Outcome::Diverged, (0, 1))] {
        let model = OneAction(ending);
        let mut planner = Pomcp::new(config(Budget::Simulations(1), 9)).unwrap();
        let report = planner.search(&model, &START, &UniformPolicy, 9, &mut rng(0));
        assert_eq!(((report.terminal, report.diverged), report.transitions, report.depth), (expected, 3, 1));
    }
}

/// Illegal action 0, action 2 with prior visits, and a leaf value.
struct Advisor;

impl Policy<Noise> for Advisor {
    fn action(&self, model: &Noise, state: &Counted, rng: &mut Rng) -> usize {
        UniformPolicy.action(model, state, rng)
    }

    fn priors(&self, _model: &Noise, _state: &Counted, priors: &mut [ActionPrior]) {
        assert!(priors.iter().all(|p| *p == ActionPrior::default()));
        priors[0].legal = false;
        priors[2] = ActionPrior { legal: true, visits: 1000, value: 7.0 };
    }

    fn leaf_value(&self, _model: &Noise, _state: &Counted, actions_left: usize) -> f64 {
        100.0 * actions_left as f64
    }
}

#[test]
fn priors_count_as_visits_and_illegal_actions_are_never_taken() {
    let model = Noise::new([9.0, 1.0, 1.0]);
    let search = |action_priors, simulations| {
        let config = Config { action_priors, ..config(Budget::Simulations(simulations), 1) };
        Pomcp::new(config).unwrap().search(&model, &START, &Advisor, 1, &mut rng(0))
    };
    let visits = |r: &planner::SearchReport<usize>| r.actions.iter().map(|a| a.visits).collect::<Vec<_>>();
    assert_eq!(search(ActionPriors::Off, 300).action, 0);
    let legal = search(ActionPriors::Legal, 300);
    assert_eq!((visits(&legal)[0], visits(&legal).iter().sum::<u64>()), (0, 300));
    // 1000 visits of value 7 and n of reward 1; action 1 is tried first, for it is unvisited.
    let full = search(ActionPriors::Full, 300);
    assert_eq!((visits(&full)[0], visits(&full).iter().sum::<u64>()), (0, 1300));
    let taken = full.actions[2].visits - 1000;
    assert!((full.actions[2].value - (7000.0 + taken as f64) / (1000.0 + taken as f64)).abs() < 1e-9);
    assert_eq!((full.action, search(ActionPriors::Full, 1).actions[1].visits), (2, 1));
}

#[test]
fn priors_are_asked_for_at_every_new_node() {
    let mut planner =
        Pomcp::new(Config { action_priors: ActionPriors::Full, ..config(Budget::Simulations(2000), 4) }).unwrap();
    planner.search(&Noise::new([9.0, 1.0, 1.0]), &START, &Advisor, 4, &mut rng(0));
    let mut open = vec![planner.tree(0, ExportLimit { depth: 9, visits: 0 }).unwrap()];
    let mut nodes = 0;
    while let Some(node) = open.pop() {
        nodes += 1;
        assert!(node.visits >= 1000, "{} visits", node.visits);
        for action in node.actions {
            assert_ne!(action.action, "0");
            open.extend(action.branches.into_iter().map(|b| b.node));
        }
    }
    assert!(nodes > 10, "{nodes}");
}

#[test]
#[should_panic(expected = "illegal")]
fn a_state_without_a_legal_action_is_a_bug() {
    struct Nothing;
    impl Policy<Noise> for Nothing {
        fn action(&self, _model: &Noise, _state: &Counted, _rng: &mut Rng) -> usize {
            0
        }
        fn priors(&self, _model: &Noise, _state: &Counted, priors: &mut [ActionPrior]) {
            priors.iter_mut().for_each(|p| p.legal = false);
        }
    }
    let config = Config { action_priors: ActionPriors::Legal, ..config(Budget::Simulations(1), 1) };
    Pomcp::new(config).unwrap().search(&Noise::new([0.0; 3]), &START, &Nothing, 1, &mut rng(0));
}

#[test]
fn a_leaf_value_stands_for_what_a_cut_rollout_leaves_out() {
    let model = Noise::new([1.0; 3]);
    let config = Config { rollout_depth: RolloutDepth::Actions(2), ..config(Budget::Simulations(1), 9) };
    let report = Pomcp::new(config).unwrap().search(&model, &START, &Advisor, 9, &mut rng(0));
    // One action in the tree, two in the rollout, six left of nine.
    let value = report.actions.iter().find(|a| a.visits == 1).unwrap().value;
    assert!((value - (1.0 + 0.9 + 0.81 + 0.729 * 600.0)).abs() < 1e-9, "{value}");
}

#[test]
fn a_full_tree_stops_growing_and_goes_on_searching() {
    let search = |nodes| {
        let model = Noise::new([1.0, 1.0, 1.0]);
        let mut planner = Pomcp::new(Config { nodes, ..config(Budget::Simulations(3000), 5) }).unwrap();
        let report = planner.search(&model, &START, &UniformPolicy, 5, &mut rng(0));
        planner.prune(&report.action, &2);
        (report, planner.search(&model, &START, &UniformPolicy, 5, &mut rng(0)).nodes)
    };
    let (free, _) = search(1 << 24);
    assert_eq!(free.unexpanded, 0);
    assert!(free.nodes > 1000);
    let (bounded, after_pruning) = search(100);
    assert_eq!((bounded.nodes, bounded.simulations, bounded.transitions), (100, 3000, 15_000));
    assert!(bounded.unexpanded > 1000, "{}", bounded.unexpanded);
    assert_eq!(after_pruning, 100, "pruning makes place for new nodes");
    // Reward 1 a step whatever is done: rollouts go on as deep as the tree would.
    assert!(bounded.actions.iter().all(|a| (a.value - 4.0951).abs() < 1e-9), "{:?}", bounded.actions);
    let (one, _) = search(1);
    assert_eq!((one.nodes, one.depth), (1, 1));
}

#[test]
fn a_budget_of_time_makes_at_least_one_simulation_a_tree() {
    let model = Noise::new([1.0, 1.0, 1.0]);
    let config = Config { trees: 3, ..config(Budget::Milliseconds(1), 5) };
    let report = Pomcp::new(config).unwrap().search(&model, &START, &UniformPolicy, 5, &mut rng(0));
    assert!(report.simulations >= 3);
    assert_eq!(report.stop, Stop::Time);
}

#[test]
fn trees_share_the_budget_and_their_number_of_threads_changes_nothing() {
    let run = |budget, trees, threads| {
        let model = Noise::new([1.0, 1.1, 0.9]);
        let mut planner = Pomcp::new(Config { trees, threads, ..config(budget, 6) }).unwrap();
        let mut rng = rng(0);
        let first = planner.search(&model, &START, &UniformPolicy, 6, &mut rng);
        planner.prune(&first.action, &2);
        let second = planner.search(&model, &START, &UniformPolicy, 5, &mut rng);
        (first, second)
    };
    for budget in [Budget::Simulations(1000), Budget::Transitions(5000)] {
        let one = run(budget, 3, 1);
        for threads in [2, 3, 8] {
            assert_eq!(run(budget, 3, threads), one);
        }
        assert_ne!(run(budget, 2, 1), one);
        assert!(one.1.reused > 0);
    }
    let (first, second) = run(Budget::Simulations(1000), 3, 2);
    assert_eq!((first.simulations, first.stop), (1000, Stop::Simulations));
    assert_eq!(first.actions.iter().map(|a| a.visits).sum::<u64>(), 1000);
    assert_eq!(second.actions.iter().map(|a| a.visits).sum::<u64>(), 1000 + second.reused);
    // A share of 1666 or 1667 transitions: at most 5 of each stay unused.
    let (first, _) = run(Budget::Transitions(5000), 3, 2);
    assert!((5000 - 3 * 5..=5000).contains(&first.transitions), "{}", first.transitions);
    assert_eq!(first.stop, Stop::Transitions);
}

#[test]
fn merged_values_are_the_means_of_all_returns() {
    // Rewards of an action do not vary at depth 1, so merging must give them exactly, whatever the visits of each tree.
    let config = Config { trees: 4, threads: 2, ..config(Budget::Simulations(401), 1) };
    let model = Noise::new([1.0, 3.0, 2.0]);
    let report = Pomcp::new(config).unwrap().search(&model, &START, &UniformPolicy, 1, &mut rng(0));
    for (action, reward) in report.actions.iter().zip([1.0, 3.0, 2.0]) {
        assert!((action.value - reward).abs() < 1e-12 && action.visits > 0);
    }
}

#[test]
fn an_export_shows_the_tree_within_its_limits() {
    let mut planner = Pomcp::new(Config { trees: 2, ..config(Budget::Simulations(2000), 3) }).unwrap();
    let everything = ExportLimit { depth: 9, visits: 0 };
    assert_eq!(planner.tree(0, everything), None);
    let report = planner.search(&Noise::new([1.0, 1.1, 0.9]), &START, &UniformPolicy, 3, &mut rng(0));
    let trees: Vec<TreeNode> = (0..2).map(|tree| planner.tree(tree, everything).unwrap()).collect();
    assert_eq!(planner.tree(2, everything), None);
    fn count(node: &TreeNode) -> usize {
        let branches = node.actions.iter().flat_map(|a| &a.branches);
        1 + branches.map(|b| count(&b.node)).sum::<usize>()
    }
    assert_eq!(trees.iter().map(count).sum::<usize>(), report.nodes);
    assert_eq!(trees.iter().map(|t| t.visits).sum::<u64>(), 2000);
    assert_eq!(trees[0].actions[1].action, "1");
    let observations: Vec<&str> = trees[0].actions[1].branches.iter().map(|b| b.observation.as_str()).collect();
    assert_eq!(observations, ["0", "1", "2", "3"]);
    let text = serde_json::to_string(&trees[0]).unwrap();
    assert_eq!(serde_json::from_str::<TreeNode>(&text).unwrap(), trees[0]);
    let shallow = planner.tree(0, ExportLimit { depth: 1, visits: 0 }).unwrap();
    assert!(shallow.actions.iter().all(|a| a.branches.is_empty()));
    let busy = planner.tree(0, ExportLimit { depth: 9, visits: 50 }).unwrap();
    assert!(count(&busy) < count(&trees[0]) && count(&busy) > 1);
    let dot = shallow.to_dot();
    assert_eq!(dot.matches("shape=box").count(), 3, "{dot}");
    assert_eq!(trees[0].to_dot().matches("shape=point").count(), count(&trees[0]));
}

#[test]
fn the_range_of_returns_starts_from_the_kept_means() {
    let mut planner = Pomcp::new(config(Budget::Simulations(1), 1)).unwrap();
    let mut search =
        || planner.search(&Noise::new([1.0, 3.0, 2.0]), &START, &UniformPolicy, 1, &mut rng(0)).exploration;
    assert_eq!(search(), 0.0);
    search();
    search();
    // All three were tried once: before its first return the next search knows means from 1 to 3.
    assert_eq!(search(), 2.0);
}

#[test]
fn a_kept_tree_searched_on_equals_one_longer_search() {
    // With a fixed constant, two searches of one tree draw and count exactly like one search of both budgets.
    let model = Noise::new([1.0, 1.1, 0.9]);
    let search = |budgets: &[usize]| {
        let mut rng = rng(0);
        let mut planner = None;
        let mut last = None;
        for &n in budgets {
            let config = Config { exploration: Exploration::Fixed(2.0), ..config(Budget::Simulations(n), 5) };
            let planner = planner.get_or_insert_with(|| Pomcp::new(config).unwrap());
            last = Some(planner.search(&model, &START, &UniformPolicy, 5, &mut rng));
        }
        last.unwrap()
    };
    let (once, twice) = (search(&[1000]), search(&[500, 500]));
    assert_eq!(once.actions, twice.actions);
    assert_eq!((once.nodes, twice.reused), (twice.nodes, 500));
}

proptest! {
    #[test]
    fn a_budget_of_transitions_is_never_overrun_and_nearly_used(
        budget in 10_usize..2000,
        depth in 1_usize..10,
        horizon in 1_usize..12,
        short in prop::option::of(0_usize..4),
    ) {
        let model = Noise { ending: Some((2, 0, Outcome::Terminal)), ..Noise::new([0.0, 1.0, 0.5]) };
        let rollout_depth = short.map_or(RolloutDepth::Full, RolloutDepth::Actions);
        let config = Config { rollout_depth, ..config(Budget::Transitions(budget), depth) };
        let mut planner = Pomcp::new(config).unwrap();
        for item in 0..2 {
            let before = model.steps.load(Ordering::Relaxed);
            let report = planner.search(&model, &START, &UniformPolicy, horizon, &mut rng(item));
            prop_assert_eq!(report.transitions, model.steps.load(Ordering::Relaxed) - before);
            prop_assert!(report.transitions <= budget);
            prop_assert!(report.transitions + depth.min(horizon) > budget);
        }
    }

    #[test]
    fn values_respect_the_discounted_bound(
        rewards in prop::array::uniform3(-10.0..10.0_f64),
        discount in 0.0..1.0_f64,
        depth in 1_usize..8,
        item in 0_u64..1000,
    ) {
        let model = Noise { discount, ..Noise::new(rewards) };
        let mut planner = Pomcp::new(config(Budget::Simulations(200), depth)).unwrap();
        let report = planner.search(&model, &START, &UniformPolicy, depth, &mut rng(item));
        let weight: f64 = (0..depth).map(|t| discount.powi(t as i32)).sum();
        let low = rewards.iter().fold(f64::INFINITY, |a, &b| a.min(b)) * weight;
        let high = rewards.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b)) * weight;
        for action in &report.actions {
            prop_assert!(action.value > low - 1e-9 && action.value < high + 1e-9, "{} outside [{low}, {high}]", action.value);
        }
        let visits: u64 = report.actions.iter().map(|a| a.visits).sum();
        prop_assert_eq!(visits, 200);
    }
}
