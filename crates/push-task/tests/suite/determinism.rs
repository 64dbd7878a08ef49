//! A transition is a function of (s, Θ, action, stream), bit for bit: whatever ran before, on any thread, after a write and a read.

use physics_model::config::ObstacleMobility;
use physics_model::theta::standard_com_m;
use physics_model::{BodyState, ObjectShape, ObjectTheta, ObstacleTheta, Theta};
use pomdp::{Outcome, Policy as _, Purpose, Seed};
use push_task::{Action, HeuristicPolicy, Particle, PushModel, State};
use rand::RngExt as _;

/// A hypothesis on the way of a push: every third with an obstacle.
fn hypothesis(model: &PushModel, joints: &[f64], item: u64) -> Particle {
    let mut rng = Seed(3).stream(Purpose::World, item);
    let shape = ObjectShape::ALL[(item % 3) as usize];
    let size_m = match shape {
        ObjectShape::Box => [rng.random_range(0.05..0.1), rng.random_range(0.05..0.1), 0.09],
        ObjectShape::Cylinder => [rng.random_range(0.03..0.05), 0.09, 0.0],
        ObjectShape::Sphere => [rng.random_range(0.035..0.05), 0.0, 0.0],
    };
    let table = model.config().world.table_height_m;
    let x = model.config().task.tool_start_m[0];
    let object = ObjectTheta {
        shape,
        mass_kg: rng.random_range(0.2..1.0),
        com_m: standard_com_m(shape, [rng.random_range(-0.01..0.01), rng.random_range(-0.01..0.01), -0.005]),
        friction: rng.random_range(0.1..0.8),
        size_m,
    };
    let at = [x + rng.random_range(-0.01..0.01), -0.07, table + shape.half_height_m(size_m)];
    let mut particle = Particle::new(
        State {
            joints_rad: joints.to_vec(),
            object: BodyState::at_rest(at, rng.random_range(-0.5..0.5)),
            obstacle: None,
        },
        Theta { object, obstacle: None, effects: vec![] },
    );
    if item.is_multiple_of(3) {
        let size_m = [0.05, 0.05, 0.09];
        particle.theta.obstacle = Some(ObstacleTheta { shape: ObjectShape::Box, mass_kg: 0.8, size_m });
        particle.state.obstacle = Some(BodyState::at_rest([x + 0.02, 0.06, table + 0.045], 0.3));
    }
    particle
}

/// Twelve actions towards the object; the text of every state and observation on the way, which shows each bit.
fn play(model: &PushModel, joints: &[f64], item: u64) -> Vec<String> {
    let mut particle = hypothesis(model, joints, item);
    let mut rng = Seed(4).stream(Purpose::Truth, item);
    let mut lines = Vec::new();
    for _ in 0..12 {
        let action = HeuristicPolicy.action(model, &particle, &mut rng);
        let (step, report) = model.act(&mut particle, action, &mut rng);
        lines.push(format!("{particle:?} {step:?} {report:?}"));
        if step.outcome != Outcome::Continue {
            break;
        }
    }
    lines
}

#[test]
fn transitions_are_the_same_on_one_thread_and_on_many_in_any_order() {
    for (arm, mobility) in [("sawyer", ObstacleMobility::Movable), ("jaco", ObstacleMobility::Fixed)] {
        let (model, joints) = crate::support::model(arm, mobility);
        let items = 0..24_u64;
        let alone: Vec<Vec<String>> = items.clone().map(|item| play(&model, &joints, item)).collect();
        for lines in &alone {
            assert!(lines.len() > 3, "{arm}: ended early: {lines:?}");
        }
        for threads in [2, 5] {
            let mut together: Vec<(u64, Vec<String>)> = std::thread::scope(|scope| {
                let workers: Vec<_> = (0..threads)
                    .map(|worker| {
                        let (model, joints, items) = (&model, &joints, items.clone());
                        // Backwards, so that what runs before an item differs.
                        let mine = items.rev().filter(move |item| item % threads == worker);
                        scope.spawn(move || mine.map(|item| (item, play(model, joints, item))).collect::<Vec<_>>())
                    })
                    .collect();
                workers.into_iter().flat_map(|worker| worker.join().expect("worker")).collect()
            });
            together.sort();
            for (item, lines) in together {
                assert_eq!(lines, alone[item as usize], "{arm}, item {item}, {threads} threads");
            }
        }
    }
}

#[test]
fn a_state_that_was_written_and_read_goes_on_as_if_it_had_not_been() {
    let (model, joints) = crate::support::model("sawyer", ObstacleMobility::Movable);
    for item in 0..24 {
        let mut particle = hypothesis(&model, &joints, item);
        let mut rng = Seed(4).stream(Purpose::Truth, item);
        for step in 0..12_u64 {
            let text = serde_json::to_string(&particle).expect("JSON");
            let mut read: Particle = serde_json::from_str(&text).expect("a particle");
            assert_eq!(read, particle);
            let values = State::from_slice(&particle.state.to_vec(), joints.len(), particle.state.obstacle.is_some());
            assert_eq!(values, particle.state, "the row of numbers of a dataset");
            let action = Action::ALL[(item + step) as usize % 4];
            let expected = model.act(&mut particle, action, &mut rng.clone());
            let found = model.act(&mut read, action, &mut rng);
            assert_eq!(found, expected);
            assert_eq!(format!("{read:?}"), format!("{particle:?}"));
            if expected.0.outcome != Outcome::Continue {
                break;
            }
        }
    }
}
