//! 100,000 random hypotheses: whatever is within the documented ranges steps without a panic, to a finite state or a counted divergence.

use std::sync::OnceLock;

use physics_model::config::ObstacleMobility;
use physics_model::feasible::check_theta;
use physics_model::{BodyState, Theta};
use pomdp::{Outcome, Purpose, Seed};
use proptest::prelude::*;
use push_task::{Action, Particle, PushModel, State};

const CASES: u32 = 25_000;

type Problem = OnceLock<(PushModel, Vec<f64>)>;

/// A body somewhere around the tool, in the table or in the air, in any orientation, at rest or fast.
fn body() -> impl Strategy<Value = BodyState> {
    (
        prop::array::uniform3(-0.15..0.15_f64),
        prop::array::uniform4(-1.0..1.0_f64),
        prop::array::uniform3(-2.0..2.0_f64),
        prop::array::uniform3(-20.0..20.0_f64),
        any::<bool>(),
        any::<bool>(),
    )
        .prop_map(|(position, quaternion, linear, angular, upright, rests)| {
            let mut values = [0.0; 13];
            values[..3].copy_from_slice(&position);
            values[3..7].copy_from_slice(&quaternion);
            if upright {
                values[3..5].fill(0.0);
            }
            if !rests {
                values[7..10].copy_from_slice(&linear);
                values[10..].copy_from_slice(&angular);
            }
            BodyState::from_array(&values)
        })
}

/// Values within the ranges of `check_theta`: magnitudes uniform in their logarithm, the centre of mass within half of the smallest size.
fn theta() -> impl Strategy<Value = Theta> {
    let magnitude = |low: f64, high: f64| (low.ln()..high.ln()).prop_map(f64::exp);
    // Half of the sizes are those of things that a hand could hold: most of the others overlap something from the start.
    let size = || prop_oneof![magnitude(0.005, 1.0), magnitude(0.02, 0.12)];
    (
        0..3_usize,
        0..4_usize,
        magnitude(0.005, 100.0),
        magnitude(0.005, 1000.0),
        0.0..=1.0_f64,
        prop::array::uniform3(size()),
        prop::array::uniform3(size()),
        prop::array::uniform3(-0.5..0.5_f64),
    )
        .prop_map(|(shape, obstacle, mass, obstacle_mass, friction, size, obstacle_size, com)| {
            let mut values = [0.0; 12];
            values[0] = mass;
            values[4] = friction;
            values[5..8].copy_from_slice(&size);
            values[8] = obstacle_mass;
            values[9..].copy_from_slice(&obstacle_size);
            // A radius reaches as far as half an edge: the smallest size keeps the centre of mass inside whatever the shape is.
            let smallest = size.iter().copied().fold(f64::MAX, f64::min);
            for (value, share) in values[1..4].iter_mut().zip(com) {
                *value = share * smallest;
            }
            Theta::from_parts(&values, [shape, obstacle])
        })
}

fn check(
    arm: &str,
    mobility: ObstacleMobility,
    problem: &Problem,
    case: (Theta, BodyState, BodyState, usize, bool),
) -> Outcome {
    let (model, joints) = problem.get_or_init(|| crate::support::model(arm, mobility));
    let (theta, object, obstacle, action, stand) = case;
    check_theta(&theta).expect("within the documented ranges");
    let tool = model.tool_position_m(joints);
    let table_m = model.config().world.table_height_m;
    let placed = |mut body: BodyState, half_height_m: f64| {
        for (coordinate, at) in body.position_m.iter_mut().zip(tool) {
            *coordinate += at;
        }
        if stand {
            body.position_m[2] = table_m + half_height_m;
            body.orientation = [0.0, 0.0, 0.0, 1.0];
        }
        body
    };
    let state = State {
        joints_rad: joints.clone(),
        object: placed(object, theta.object.shape.half_height_m(theta.object.size_m)),
        obstacle: theta.obstacle.as_ref().map(|o| placed(obstacle, o.shape.half_height_m(o.size_m))),
    };
    let before = Particle::new(state, theta);
    let mut after = before.clone();
    let (step, report) = model.act(&mut after, Action::ALL[action], &mut Seed(5).stream(Purpose::Test, action as u64));
    assert!(step.observation.0.iter().all(|v| v.is_finite()), "{:?}", step.observation);
    assert!(after.state.to_vec().iter().all(|v| v.is_finite()), "{:?}", after.state);
    assert!(step.reward.is_finite());
    assert_eq!(step.outcome == Outcome::Diverged, report.divergence.is_some());
    if step.outcome == Outcome::Diverged {
        assert_eq!(after.state, before.state, "an impossible hypothesis stays as it was");
    } else if model.check(&before).is_ok() {
        assert_eq!(model.check(&after), Ok(()), "a possible world steps to a possible one");
    }
    step.outcome
}

/// Runs the cases of one arm and mobility; most must be worlds, else nothing was tested.
macro_rules! hypotheses {
    ($name:ident, $arm:literal, $mobility:expr) => {
        #[test]
        fn $name() {
            let problem = Problem::new();
            let mut runner = proptest::test_runner::TestRunner::new_with_rng(
                ProptestConfig { cases: CASES, failure_persistence: None, ..ProptestConfig::default() },
                proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
            );
            let survived = std::cell::Cell::new(0_u32);
            let cases = (theta(), body(), body(), 0..10_usize, prop::bool::weighted(0.8));
            let result = runner.run(&cases, |case| {
                let outcome = check($arm, $mobility, &problem, case);
                survived.set(survived.get() + u32::from(outcome != Outcome::Diverged));
                Ok(())
            });
            if let Err(error) = result {
                panic!("{error}");
            }
            assert!(survived.get() > CASES / 10, "only {} of {CASES} hypotheses are worlds", survived.get());
            eprintln!("{} of {CASES} hypotheses are worlds", survived.get());
        }
    };
}

hypotheses!(sawyer_with_a_fixed_obstacle, "sawyer", ObstacleMobility::Fixed);
hypotheses!(sawyer_with_a_movable_obstacle, "sawyer", ObstacleMobility::Movable);
hypotheses!(jaco_with_a_fixed_obstacle, "jaco", ObstacleMobility::Fixed);
hypotheses!(jaco_with_a_movable_obstacle, "jaco", ObstacleMobility::Movable);
