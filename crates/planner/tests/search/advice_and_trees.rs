//! What a policy tells a search, the node limit, several trees, exports.

use super::*;

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
    // A first round that affords no simulation leaves the root as it is: the second asks.
    let config = Config { action_priors: ActionPriors::Full, ..config(Budget::Simulations(3), 1) };
    let mut late = Pomcp::new(config.with_early_stop(9, 1e-9)).unwrap();
    let late = late.search(&model, &START, &Advisor, 1, &mut rng(0));
    assert_eq!((visits(&late)[0], visits(&late).iter().sum::<u64>()), (0, 1003));
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
fn a_search_ends_early_where_more_would_not_pay_and_spends_its_budget_where_actions_tie() {
    let at = |price, rewards, budget, threads| {
        let config = Config { trees: 3, threads, ..config(budget, 3) }.with_early_stop(5, price);
        let mut planner = Pomcp::new(config).unwrap();
        planner.search(&Noise::new(rewards), &START, &UniformPolicy, 3, &mut rng(0))
    };
    let run = |rewards, budget, threads| at(1e-9, rewards, budget, threads);
    for (budget, all) in
        [(Budget::Simulations(1000), Stop::Simulations), (Budget::Transitions(3000), Stop::Transitions)]
    {
        let clear = run([1.0, 9.0, 1.0], budget, 1);
        assert_eq!((clear.action, clear.stop), (1, Stop::LittleToGain));
        assert!((150..=200).contains(&clear.simulations), "the first of five rounds: {}", clear.simulations);
        assert_eq!(run([1.0, 9.0, 1.0], budget, 2), clear);
        let open = run([1.1, 1.1, 0.9], budget, 1);
        assert_eq!(open.stop, all);
        assert!(open.transitions >= 3000 - 3 * 3, "all rounds: {}", open.transitions);
        // Where telling them apart would bring little, a high price is not paid.
        assert_eq!(at(10.0, [1.1, 1.1, 0.9], budget, 1).stop, Stop::LittleToGain);
    }
    // A round that affords no simulation settles nothing.
    assert_eq!(run([1.0, 9.0, 1.0], Budget::Simulations(3), 1).simulations, 3);
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
