//! RockSample against its definition.

use pomdp::{Purpose, Seed, conformance};

use super::*;

fn rng() -> Rng {
    Seed(1).stream(Purpose::Test, 0)
}

fn run(problem: &RockSample, state: &mut State, actions: &[Action]) -> Vec<f64> {
    let mut rng = rng();
    actions.iter().map(|action| problem.step(state, action, &mut rng).reward).collect()
}

#[test]
fn both_layouts_conform() {
    for problem in [RockSample::standard_7_8(), RockSample::standard_11_11()] {
        let states: Vec<State> = (0..20).map(|i| problem.initial(&mut Seed(1).stream(Purpose::Test, i))).collect();
        conformance::check_generative_model(&problem, &states, 60);
    }
}

#[test]
fn the_start_is_as_published_and_every_rock_is_good_half_the_time() {
    let (small, large) = (RockSample::standard_7_8(), RockSample::standard_11_11());
    assert_eq!((small.actions().len(), large.actions().len()), (13, 16));
    assert_eq!(small.place(&small.initial(&mut rng())), [0, 3]);
    assert_eq!(large.place(&large.initial(&mut rng())), [0, 5]);
    let mut rng = rng();
    let mut counts = [0_i32; 8];
    for _ in 0..2000 {
        let state = small.initial(&mut rng);
        (0..8).for_each(|rock| counts[rock] += i32::from(state.good >> rock & 1));
    }
    // n = 2000, standard deviation 22.4; tolerance 4 of them.
    assert!(counts.iter().all(|c| (c - 1000).abs() < 90), "{counts:?}");
}

#[test]
fn moves_stay_on_the_grid_and_the_east_edge_pays() {
    use Action::{East, North, South, West};
    let problem = RockSample::standard_7_8();
    let mut state = problem.state(|_| true);
    assert_eq!(
        run(&problem, &mut state, &[West, North, North, North, North, East, South]),
        [-100.0, 0.0, 0.0, 0.0, -100.0, 0.0, 0.0]
    );
    assert_eq!(problem.place(&state), [1, 5]);
    assert_eq!(run(&problem, &mut state, &[South; 6]), [0.0, 0.0, 0.0, 0.0, 0.0, -100.0]);
    assert_eq!(run(&problem, &mut state, &[East; 5]), [0.0; 5]);
    let step = problem.step(&mut state, &East, &mut rng());
    assert_eq!((step.reward, step.outcome), (10.0, Outcome::Terminal));
}

#[test]
fn a_sampled_rock_becomes_bad_and_bare_ground_costs() {
    use Action::{East, Sample, South};
    let problem = RockSample::standard_7_8();
    // Rock 1 at (0, 1), two cells south of the start.
    let path = [South, South, Sample, Sample, East, Sample];
    let rewards = |good: bool| run(&problem, &mut problem.state(|rock| good && rock == 1), &path);
    assert_eq!(rewards(true), [0.0, 0.0, 10.0, -10.0, 0.0, -100.0]);
    assert_eq!(rewards(false), [0.0, 0.0, -10.0, -10.0, 0.0, -100.0]);
}

#[test]
fn checks_are_right_as_often_as_the_distance_allows() {
    // From (0, 3): rock 3 at (6, 3) is 6 cells off, rock 5 at (3, 4) √10.
    let problem = RockSample::standard_7_8();
    let mut rng = rng();
    for (rock, distance) in [(3_u8, 6.0_f64), (5, 10_f64.sqrt())] {
        let accuracy = (1.0 + 2_f64.powf(-distance / 20.0)) / 2.0;
        for good in [true, false] {
            let state = problem.state(|_| good);
            let look = |seen| problem.log_likelihood(&Action::Check(rock), &state, &seen).exp();
            let (right, wrong) =
                if good { (Observation::Good, Observation::Bad) } else { (Observation::Bad, Observation::Good) };
            assert!((look(right) - accuracy).abs() < 1e-12 && (look(right) + look(wrong) - 1.0).abs() < 1e-12);
            let seen = (0..10_000)
                .filter(|_| problem.step(&mut { state }, &Action::Check(rock), &mut rng).observation == right);
            // Standard deviation √(n p (1 − p)); tolerance 4 of them.
            let tolerance = 4.0 * (10_000.0 * accuracy * (1.0 - accuracy)).sqrt();
            assert!((seen.count() as f64 - 10_000.0 * accuracy).abs() < tolerance);
        }
    }
    let nothing = problem.log_likelihood(&Action::North, &problem.state(|_| true), &Observation::Nothing);
    assert_eq!(nothing, 0.0);
}

fn named(problem: &RockSample, set: Actions) -> Vec<Action> {
    problem.actions().iter().enumerate().filter(|(i, _)| set.contains(*i)).map(|(_, a)| *a).collect()
}

#[test]
fn preferences_follow_what_was_seen() {
    use Action::{Check, East, North, Sample, South, West};
    let problem = RockSample::standard_7_8();
    let mut state = problem.state(|_| true);
    let all_checks = (0..8).map(Check);
    let moves = [North, East, South];
    let expected: Vec<Action> = moves.into_iter().chain(all_checks).collect();
    assert_eq!(named(&problem, problem.preferred(&state)), expected);
    assert_eq!(problem.legal(&state), problem.preferred(&state), "no rock here and the west edge at hand");
    // Rock 1, two cells south: seen good from its own cell, which settles it; then only sampling is preferred.
    run(&problem, &mut state, &[South, South, Check(1)]);
    assert_eq!(named(&problem, problem.preferred(&state)), [Sample]);
    run(&problem, &mut state, &[Sample]);
    assert!(!problem.legal(&state).contains(4) && !problem.legal(&state).contains(CHECK + 1));
    // All looked bad: east.
    state.seen.disliked = u16::MAX;
    assert_eq!(named(&problem, problem.preferred(&state)), [East]);
    // One open rock to the west that is settled: only the way there.
    state.seen.disliked = !1;
    (state.seen.settled, state.cell) = (u16::MAX, 3);
    assert_eq!(named(&problem, problem.preferred(&state)), [West]);
}

#[test]
fn five_checks_or_a_balance_of_two_settle_a_rock() {
    let problem = RockSample::standard_7_8();
    let mut state = problem.state(|_| true);
    let mut rng = rng();
    let mut balance: i32 = 0;
    for count in 1..=5 {
        balance += match problem.step(&mut state, &Action::Check(3), &mut rng).observation {
            Observation::Good => 1,
            _ => -1,
        };
        assert_eq!(problem.preferred(&state).contains(CHECK + 3), count < 5 && balance.abs() < 2, "{count} checks");
    }
}

#[test]
fn a_local_move_turns_one_open_rock() {
    let problem = RockSample::standard_7_8();
    let mut rng = rng();
    for _ in 0..100 {
        let before = State { sampled: 0b11, ..problem.initial(&mut rng) };
        let mut after = before;
        problem.perturb(&mut after, &mut rng);
        let turned = before.good ^ after.good;
        assert!(turned.count_ones() == 1 && turned & 0b11 == 0 && turned < 256);
    }
}

#[test]
fn rollouts_never_pay_a_fine() {
    let problem = RockSample::standard_11_11();
    let mut rng = rng();
    for rollout in [Knowledge::Legal, Knowledge::Preferred] {
        let advice = Advice { rollout, ..Advice::default() };
        for _ in 0..200 {
            let mut state = problem.initial(&mut rng);
            for _ in 0..90 {
                let action = advice.action(&problem, &state, &mut rng);
                let step = problem.step(&mut state, &action, &mut rng);
                assert!(step.reward > -100.0, "{action:?}");
                if step.outcome == Outcome::Terminal {
                    break;
                }
            }
        }
    }
}
