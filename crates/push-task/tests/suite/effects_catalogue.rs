//! The catalogue as a whole: names, neutral values, what shows of each effect, combinations, determinism.

use std::sync::Arc;

use physics_model::config::{ArmConfig, ObstacleMobility, ServoConfig};
use physics_model::effect::{EffectKind, Parameter};
use physics_model::{BodyState, EffectConfig, EffectError, ObjectShape, ObjectTheta, Theta};
use pomdp::{Outcome, Purpose, Seed};
use push_task::{Action, Observation, Particle, PushConfig, PushModel, State};

const PLUS_Y: Action = Action::ALL[2];
const MINUS_Y: Action = Action::ALL[6];

fn model(arm: &str, effects: Vec<EffectConfig>) -> (PushModel, Vec<f64>) {
    with_arm(arm, ArmConfig::Kinematic, effects)
}

fn with_arm(name: &str, arm: ArmConfig, effects: Vec<EffectConfig>) -> (PushModel, Vec<f64>) {
    let (plain, joints) = crate::support::model(name, ObstacleMobility::Fixed);
    let config = PushConfig { arm, effects, ..plain.config().clone() };
    (PushModel::new(config, Arc::new(plain.robot().clone())), joints)
}

/// An object 3 mm ahead of the tool along +y.
fn particle(model: &PushModel, joints: &[f64], shape: ObjectShape) -> Particle {
    let size_m = match shape {
        ObjectShape::Box => [0.08, 0.08, 0.1],
        ObjectShape::Cylinder => [0.04, 0.1, 0.0],
        ObjectShape::Sphere => [0.045, 0.0, 0.0],
    };
    let config = model.config();
    let [x, y, _] = config.task.tool_start_m;
    let object = ObjectTheta { shape, mass_kg: 0.5, com_m: [0.0; 3], friction: 0.4, size_m };
    let z = config.world.table_height_m + shape.half_height_m(size_m);
    // The first place ahead where nothing overlaps, less what a touch allows.
    (0..200)
        .map(|millimetres| {
            let body = BodyState::at_rest([x, y + 0.001 * f64::from(millimetres), z], 0.0);
            let state = State { joints_rad: joints.to_vec(), object: body, obstacle: None };
            Particle::new(state, Theta { object: object.clone(), obstacle: None, effects: vec![] })
        })
        .find(|particle| model.check(particle).is_ok())
        .map(|mut particle| {
            particle.state.object.position_m[1] += 0.009;
            particle
        })
        .expect("a place ahead of the tool")
}

/// Pushes, a retreat and a second push; the observations, and the last hypothesis.
fn play(model: &PushModel, joints: &[f64], shape: ObjectShape) -> (Vec<Observation>, Particle, bool) {
    let mut particle = particle(model, joints, shape);
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let mut seen = vec![model.initial_observation(&mut particle, &mut rng)];
    for action in [PLUS_Y, PLUS_Y, MINUS_Y, MINUS_Y, PLUS_Y] {
        let (step, _) = model.act(&mut particle, action, &mut rng);
        seen.push(step.observation);
        if step.outcome == Outcome::Diverged {
            return (seen, particle, true);
        }
    }
    (seen, particle, false)
}

/// The effect in the middle of what is plausible, at a place where the push meets it.
fn typical(kind: EffectKind, model: &PushModel) -> EffectConfig {
    let [x, y, _] = model.config().task.tool_start_m;
    let values: Vec<f64> = kind
        .parameters()
        .iter()
        .map(|parameter| match (kind.name(), parameter.name) {
            // The middle of the range is what the world has anyway.
            ("friction_level", _) => 0.6,
            ("force_saturation", _) => 1.0,
            ("hidden_obstacle", "x_m") => x + 0.05,
            ("hidden_obstacle", "y_m") => y + 0.1,
            ("hidden_obstacle", "size_0_m" | "size_1_m") => 0.06,
            ("friction_patch", "x_m") | ("tether", "anchor_x_m") => x,
            ("friction_patch" | "tether", "y_m" | "anchor_y_m") => y + 0.1,
            _ => parameter.typical(),
        })
        .collect();
    kind.from_parameters(&values).expect("typical values are within the limits")
}

fn largest_difference(a: &[Observation], b: &[Observation]) -> f64 {
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a.0.iter().zip(&b.0));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_catalogue_has_36_names_that_scenario_files_know() {
    assert_eq!(EffectKind::ALL.len(), 36, "33 rows, one of which names two, round edges and late forces");
    for kind in EffectKind::ALL {
        assert_eq!(kind.name().parse::<EffectKind>(), Ok(*kind));
        for effect in kind.variants() {
            assert_eq!(effect.kind(), *kind);
            assert_eq!(effect.check(), Ok(()));
            assert_eq!(effect.with_parameters(&effect.values()), Ok(effect.clone()));
            #[derive(serde::Serialize, serde::Deserialize)]
            struct File {
                effects: Vec<EffectConfig>,
            }
            let text = toml::to_string(&File { effects: vec![effect.clone()] }).expect("TOML");
            assert!(text.contains(kind.name()), "{text}");
            let read: File = toml::from_str(&text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(read.effects, [effect]);
            let misspelt = text.replacen(kind.parameters()[0].name, "nonsense", 1);
            if kind.name() != "hidden_obstacle" || misspelt != text {
                assert!(toml::from_str::<File>(&misspelt).is_err(), "{misspelt}");
            }
        }
        for parameter in kind.parameters() {
            let ([low, high], [least, most]) = (parameter.plausible, parameter.limits);
            assert!(least <= low && low < high && high <= most, "{} {parameter:?}", kind.name());
            let x = parameter.scale.coordinate(parameter.typical());
            assert!((parameter.scale.value(x) / parameter.typical() - 1.0).abs() < 1e-12 || x == 0.0);
        }
        assert!(kind.parameters().iter().any(Parameter::is_strength), "{}", kind.name());
    }
}

#[test]
fn errors_name_effect_key_limits_and_unit() {
    let error = EffectKind::WristPayload.from_parameters(&[1000.0, 0.0, 0.0, 0.0]).unwrap_err();
    assert_eq!(error.to_string(), "wrist_payload.mass_kg: expected -5 to 50 kg, found 1000");
    let error = EffectKind::PoseScale.from_parameters(&[f64::NAN]).unwrap_err();
    assert_eq!(error.to_string(), "pose_scale.scale: expected 0.1 to 10, found NaN");
    assert_eq!(
        EffectKind::Tether.from_parameters(&[1.0]),
        Err(EffectError::Count { effect: "tether", expected: 3, found: 1 })
    );
    assert!("gravity".parse::<EffectKind>().unwrap_err().to_string().contains("viscous_damping, quadratic_drag"));
}

#[test]
fn an_effect_at_its_neutral_value_changes_nothing() {
    let arms = [ArmConfig::Kinematic, ArmConfig::Dynamic(ServoConfig { stiffness_nmprad: 5000.0, damping_ratio: 1.0 })];
    for (name, arm) in ["sawyer", "jaco"].into_iter().flat_map(|name| arms.iter().map(move |arm| (name, arm))) {
        let (plain, joints) = with_arm(name, arm.clone(), vec![]);
        for shape in ObjectShape::ALL {
            let expected = play(&plain, &joints, shape);
            let theta = particle(&plain, &joints, shape).theta;
            for kind in EffectKind::ALL {
                for variant in kind.variants() {
                    let neutral = kind.neutral(&plain.config().world, &theta);
                    let neutral =
                        variant.with_parameters(&neutral.values()).expect("neutral values are within the limits");
                    let (model, _) = with_arm(name, arm.clone(), vec![neutral]);
                    let found = play(&model, &joints, shape);
                    assert_eq!(found, expected, "{name} {shape:?} {}: bit for bit", kind.name());
                }
            }
        }
    }
}

#[test]
fn every_effect_shows_in_a_push() {
    // What a wrist sensor cannot feel is looked for with joint torques; what rolls, with a sphere.
    let shows = |kind: EffectKind| {
        ["sawyer", "jaco"].iter().any(|arm| {
            ObjectShape::ALL.iter().any(|shape| {
                let (plain, joints) = model(arm, vec![]);
                let (changed, _) = model(arm, vec![typical(kind, &plain)]);
                let (expected, found) = (play(&plain, &joints, *shape), play(&changed, &joints, *shape));
                // A millimetre, milliradian, millinewton or millinewton metre.
                found.2 || largest_difference(&found.0, &expected.0) > 1e-3
            })
        })
    };
    let hidden: Vec<&str> = EffectKind::ALL.iter().filter(|kind| !shows(**kind)).map(|kind| kind.name()).collect();
    assert!(hidden.is_empty(), "no sign of {hidden:?}");
}

#[test]
fn the_ends_of_all_ranges_are_worlds_or_are_reported() {
    for arm in ["sawyer", "jaco"] {
        let (_, joints) = model(arm, vec![]);
        for variant in EffectKind::ALL.iter().flat_map(|kind| kind.variants()) {
            let parameters = variant.kind().parameters();
            for end in 0..2 {
                for range in [|p: &Parameter| p.plausible, |p: &Parameter| p.limits] {
                    let values: Vec<f64> = parameters.iter().map(|parameter| range(parameter)[end]).collect();
                    let effect = variant.with_parameters(&values).expect("the ends belong to the range");
                    let (model, _) = model(arm, vec![effect.clone()]);
                    for shape in ObjectShape::ALL {
                        // Far beyond what is plausible a world may diverge; it must say so and stay finite.
                        let (seen, particle, _) = play(&model, &joints, shape);
                        let finite = seen.iter().all(|observation| observation.0.iter().all(|v| v.is_finite()));
                        assert!(finite && particle.state.to_vec().iter().all(|v| v.is_finite()), "{arm} {effect:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn all_pairs_of_effects_combine() {
    for arm in ["sawyer", "jaco"] {
        let (plain, joints) = model(arm, vec![]);
        let all: Vec<EffectConfig> = EffectKind::ALL.iter().map(|kind| typical(*kind, &plain)).collect();
        let mut diverged = 0;
        for (i, first) in all.iter().enumerate() {
            for second in &all[i..] {
                let shape = ObjectShape::ALL[i % 3];
                let (both, _) = model(arm, vec![first.clone(), second.clone()]);
                let (seen, particle, lost) = play(&both, &joints, shape);
                diverged += u32::from(lost);
                let finite = seen.iter().all(|observation| observation.0.iter().all(|v| v.is_finite()));
                let names = (first.kind().name(), second.kind().name());
                assert!(finite && particle.state.to_vec().iter().all(|v| v.is_finite()), "{arm} {names:?}: {seen:?}");
            }
        }
        assert!(diverged == 0, "{arm}: {diverged} of 630 pairs diverged");
    }
}

#[test]
fn all_effects_at_once_are_a_world_and_a_function_of_its_state() {
    for arm in ["sawyer", "jaco"] {
        let (plain, joints) = model(arm, vec![]);
        let all: Vec<EffectConfig> = EffectKind::ALL.iter().map(|kind| typical(*kind, &plain)).collect();
        let (model, _) = model(arm, all);
        let first = play(&model, &joints, ObjectShape::Box);
        play(&model, &joints, ObjectShape::Sphere);
        assert_eq!(play(&model, &joints, ObjectShape::Box), first);
        // A hypothesis that was written and read goes on as if it had not been.
        let mut particle = first.1;
        assert!(particle.memory.is_some());
        let text = serde_json::to_string(&particle).expect("JSON");
        let mut read: Particle = serde_json::from_str(&text).expect("a particle");
        let mut rng = Seed(2).stream(Purpose::Test, 0);
        assert_eq!(model.act(&mut particle, PLUS_Y, &mut rng.clone()), model.act(&mut read, PLUS_Y, &mut rng));
        assert_eq!(read, particle);
    }
}
