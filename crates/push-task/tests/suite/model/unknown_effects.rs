//! Effects as a part of a hypothesis: values of Θ do what the same values in the list do.

use physics_model::config::ObstacleMobility;
use physics_model::effect::{EffectKind, EffectParameter, EffectValue};
use physics_model::{EffectConfig, ObjectShape};
use pomdp::{Purpose, Seed};
use push_task::{Action, Particle, PushConfig, PushModel};

use super::{PLUS_Y, particle};
use crate::support::model;

#[test]
fn every_parameter_of_every_effect_acts_as_a_part_of_a_hypothesis() {
    let mut acting = std::collections::BTreeSet::new();
    // One feels at its wrist, the other in its joints.
    for arm in ["sawyer", "jaco"] {
        let (plain, joints) = model(arm, ObstacleMobility::Fixed);
        for kind in EffectKind::ALL.iter().copied() {
            if acts_as_a_part_of_a_hypothesis(kind, &plain, &joints) {
                acting.insert(kind.name());
            }
        }
    }
    let names = EffectKind::ALL.iter().map(|kind| kind.name());
    let silent: Vec<&str> = names.filter(|name| !acting.contains(name)).collect();
    assert_eq!(silent, Vec::<&str>::new(), "no push is another one with these");
}

/// Whether a push is another one; that it is the same with a value of Θ as with the value in the list is asserted.
fn acts_as_a_part_of_a_hypothesis(kind: EffectKind, plain: &PushModel, joints: &[f64]) -> bool {
    let with = |effect: EffectConfig| {
        let config = PushConfig { effects: vec![effect], ..plain.config().clone() };
        PushModel::new(config, std::sync::Arc::new(plain.robot().clone()))
    };
    // Pushes, and what the sensors say after each.
    let pushed = |model: &PushModel, particle: &Particle| {
        let (mut particle, mut rng) = (particle.clone(), Seed(1).stream(Purpose::Test, 0));
        let observations = [PLUS_Y; 5].map(|action| {
            model.act(&mut particle, Action::ALL[action], &mut rng);
            (particle.force, model.readings(&particle).object)
        });
        (observations, particle.state)
    };
    let listed = kind.start();
    let unmoved = with(listed.clone());
    let mut start = particle(&unmoved, joints, -0.1);
    if kind == EffectKind::RollingResistance {
        start.theta.object.shape = ObjectShape::Sphere;
        start.theta.object.size_m = [0.05, 0.0, 0.0];
    }
    let mut acts = false;
    for (index, parameter) in kind.parameters().iter().enumerate() {
        // To the middle between where it is and the farther end of what is plausible; a limit without end to where every push reaches it.
        let [low, high] = parameter.plausible;
        let now = Some(listed.values()[index]).filter(|now| now.is_finite());
        let end = if now.is_none_or(|now| (high - now).abs() > (now - low).abs()) { high } else { low };
        let mut values = listed.values();
        values[index] = if kind == EffectKind::ForceSaturation { 0.1 } else { 0.5 * (now.unwrap_or(low) + end) };
        let Ok(moved) = listed.with_parameters(&values) else { panic!("{}: {values:?}", kind.name()) };
        let mut hypothesis = start.clone();
        let parameter = EffectParameter::new(kind, parameter.name).unwrap();
        hypothesis.theta.effects = vec![EffectValue { parameter, value: values[index] }];
        let found = pushed(&unmoved, &hypothesis);
        assert_eq!(found, pushed(&with(moved), &start), "{}: {values:?}", kind.name());
        acts |= found != pushed(&unmoved, &start);
    }
    acts
}

#[test]
fn an_unknown_offset_puts_each_hypothesis_behind_the_same_reading() {
    let (plain, joints) = model("sawyer", ObstacleMobility::Fixed);
    let effects = vec![EffectKind::PoseOffset.neutral(&plain.config().world, &particle(&plain, &joints, 0.0).theta)];
    let config = PushConfig { effects, ..plain.config().clone() };
    let model = PushModel::new(config, std::sync::Arc::new(plain.robot().clone()));
    let before = particle(&model, &joints, -0.1);
    let mut shifted = before.clone();
    let parameter = EffectParameter::new(EffectKind::PoseOffset, "offset_y_m").unwrap();
    shifted.theta.effects = vec![EffectValue { parameter, value: 0.01 }];
    model.displace(&mut shifted);
    assert!((shifted.state.object.position_m[1] - (before.state.object.position_m[1] - 0.01)).abs() < 1e-12);
    let [a, b] = [&before, &shifted].map(|particle| model.readings(particle).object.position_m);
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
}
