//! Budgets, horizons, statistics and what pruning keeps.

use super::*;

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
fn a_return_is_cut_where_its_simulation_explored() {
    // Two actions: 1 point for the first, then 0, or −100 for the actions 1 and 2. Each is tried after the rollout, so as long as only −100
    // is known below, it passes; from the first 0 on nothing else does, however often the others are explored.
    struct Costly;

    impl GenerativeModel for Costly {
        type State = usize;
        type Action = usize;
        type Observation = ();

        fn actions(&self) -> &[usize] {
            &[0, 1, 2]
        }

        fn step(&self, taken: &mut usize, action: &usize, _rng: &mut Rng) -> Step<()> {
            *taken += 1;
            let reward = if *taken == 1 { 1.0 } else { [0.0, -100.0, -100.0][*action] };
            Step { observation: (), reward, outcome: Outcome::Continue }
        }

        fn discount(&self) -> f64 {
            0.5
        }
    }
    impl Discretise for Costly {
        type Key = ();

        fn key(&self, (): &()) {}
    }
    /// Rollouts that pay nothing.
    struct First;
    impl Policy<Costly> for First {
        fn action(&self, _model: &Costly, _taken: &usize, _rng: &mut Rng) -> usize {
            0
        }
    }
    struct Start;
    impl Belief for Start {
        type State = usize;

        fn sample(&self, _rng: &mut Rng) -> &usize {
            &0
        }
    }
    let losses = |backup| {
        let exploration = Exploration::Fixed(100.0);
        let config = Config { backup, exploration, ..config(Budget::Simulations(3000), 2) };
        let report = Pomcp::new(config).unwrap().search(&Costly, &Start, &First, 2, &mut rng(0));
        report.actions.iter().map(|a| (1.0 - a.value) * a.visits as f64 / 50.0).collect::<Vec<_>>()
    };
    // In returns of −100, discounted once: at most the two that came before the first 0.
    let cut = losses(Backup::Watkins);
    assert!(cut.iter().all(|&n| [0.0, 1.0, 2.0].iter().any(|m| (n - m).abs() < 1e-6)), "{cut:?}");
    assert!(losses(Backup::Mean).iter().all(|&n| n > 10.0));
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
