//! What the goal policy does and expects, alone with an object and beside an obstacle.

use physics_model::config::ObstacleMobility;
use physics_model::{BodyState, ObjectShape, ObstacleTheta};
use pomdp::{Outcome, Policy as _, Purpose, Seed};
use push_task::{Action, GoalPolicy, Particle, PushModel};

use super::{PLUS_Y, particle, with_obstacle};
use crate::support::model;

/// Actions that an episode may take.
const LONGEST: usize = 45;

/// Follows the policy. Returns its discounted return and the number of its actions, where it reaches the goal.
fn follow(model: &PushModel, mut particle: Particle) -> Option<(f64, usize)> {
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let (mut sum, mut weight) = (0.0, 1.0);
    for count in 1..=LONGEST {
        let action = GoalPolicy.action(model, &particle, &mut rng);
        let step = model.act(&mut particle, action, &mut rng).0;
        sum += weight * step.reward;
        weight *= model.config().task.discount;
        if step.outcome == Outcome::Terminal {
            return Some((sum, count));
        }
    }
    None
}

/// A cylinder, which the tool cannot turn, at a place beyond the goal.
fn beyond(model: &PushModel, joints: &[f64], (x_m, y_m): (f64, f64)) -> Particle {
    let mut particle = particle(model, joints, y_m);
    particle.theta.object.shape = ObjectShape::Cylinder;
    particle.theta.object.size_m = [0.04, 0.04, 0.1];
    particle.state.object.position_m[0] = x_m;
    particle
}

#[test]
fn it_goes_round_the_object_where_it_starts_on_the_wrong_side_and_expects_what_that_earns() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    for place in [(0.53, 0.2), (0.47, 0.18)] {
        let start = beyond(&model, &joints, place);
        let expected = GoalPolicy.leaf_value(&model, &start, LONGEST);
        let (earned, count) = follow(&model, start).unwrap_or_else(|| panic!("{place:?} is not solved"));
        // The first movement of the object pays 10 more, which the policy does not count on.
        assert!((earned - expected).abs() < 8.0, "{place:?}: {earned} in {count} actions for {expected}");
    }
}

#[test]
fn what_is_in_the_way_of_the_tool_lowers_what_it_expects() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let free = beyond(&model, &joints, (0.53, 0.2));
    let value = |particle: &Particle| GoalPolicy.leaf_value(&model, particle, 30);
    let beside = |x_m: f64| {
        let mut particle = free.clone();
        particle.theta.obstacle =
            Some(ObstacleTheta { shape: ObjectShape::Cylinder, mass_kg: 1.0, size_m: [0.03, 0.03, 0.1] });
        particle.state.obstacle = Some(BodyState::at_rest([x_m, 0.2, -0.05], 0.0));
        particle
    };
    // On one side of the object nothing is lost: the tool passes on the other.
    assert_eq!(value(&beside(0.595)), value(&free));
    // From the front to behind the object it is a quarter of a circle farther than straight through it.
    let nearer = beyond(&model, &joints, (0.53, 0.0));
    assert!(value(&nearer) > value(&free) + 20.0, "{} and {}", value(&nearer), value(&free));
}

#[test]
fn it_pushes_past_an_obstacle_that_it_sees() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let mut start = with_obstacle(beyond(&model, &joints, (0.53, -0.15)), -0.02);
    start.theta.obstacle =
        Some(ObstacleTheta { shape: ObjectShape::Cylinder, mass_kg: 1.0, size_m: [0.03, 0.03, 0.1] });
    // On the other side it would have to push from out of reach.
    start.state.obstacle.as_mut().expect("an obstacle").position_m[0] = 0.56;
    let (_, count) = follow(&model, start).expect("solved");
    assert!(count < 30, "{count} actions");
}

#[test]
fn a_tool_that_presses_the_object_against_an_obstacle_backs_off_before_it_goes_round() {
    let (model, joints) = model("sawyer", ObstacleMobility::Fixed);
    let mut start = with_obstacle(particle(&model, &joints, -0.12), 0.02);
    start.theta.obstacle =
        Some(ObstacleTheta { shape: ObjectShape::Cylinder, mass_kg: 1.0, size_m: [0.03, 0.03, 0.1] });
    start.state.obstacle.as_mut().expect("an obstacle").position_m[0] = 0.56;
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    // Straight on, until it is stuck.
    for _ in 0..8 {
        model.act(&mut start, Action::ALL[PLUS_Y], &mut rng);
    }
    let stuck = start.state.object.position_m[1];
    model.act(&mut start, Action::ALL[PLUS_Y], &mut rng);
    assert!((start.state.object.position_m[1] - stuck).abs() < 0.004, "{:?} does not stick", start.state.object);
    let (_, count) = follow(&model, start).expect("solved");
    assert!(count < 35, "{count} actions");
}
