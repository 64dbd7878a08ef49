//! Strong effects, of which a slight one says little, and a weak one beside a strong one: of a few simulated pushes they are named.

use diagnose_benchmark::generate::{Actions, RobotName, SetSpec, generate_part};
use discrepancy::{Nominal, Report, Settings, Verdict, diagnose, rig_tool};
use physics_model::{EffectConfig, EffectKind, ObjectShape};

/// Episodes of a log, about.
const EPISODES: usize = 16;

fn spec(shape: ObjectShape, actions: Actions, hidden: &[(EffectKind, &[f64])]) -> SetSpec {
    let effect = |(kind, values): &(EffectKind, &[f64])| -> EffectConfig { kind.from_parameters(values).unwrap() };
    SetSpec {
        seed: 4,
        robot: RobotName::None,
        shape,
        effects: hidden.iter().map(effect).collect(),
        unknown: None,
        nominal_errors: [0.9, 1.1],
        fixed_friction: false,
        noise: 1.0,
        actions,
        engine: (2, 8, 100.0),
    }
}

fn report(spec: &SetSpec, episodes: usize) -> Report {
    let log = generate_part(spec, None, episodes).unwrap();
    let nominal = Nominal::new(&log.header, rig_tool(&log, None).unwrap()).unwrap();
    let settings = Settings::default();
    Report::new(&diagnose(&log, "strong", &nominal, &settings).unwrap(), &settings, 0.0)
}

/// Checks that the effect alone is named, with its first value to within `tolerance`, and that nothing is left.
fn named(spec: &SetSpec, episodes: usize, tolerance: f64) {
    let report = report(spec, episodes);
    let [hidden] = spec.effects.as_slice() else { panic!("one effect") };
    let [effect] = report.effects.as_slice() else { panic!("{}", report.summary) };
    assert_eq!((report.verdict, effect.name), (Verdict::Effect, hidden.kind().name()), "{}", report.summary);
    let (value, truth) = (effect.parameters[0].value, hidden.values()[0]);
    assert!((value - truth).abs() < tolerance, "{value}, in truth {truth}");
    assert!(report.heldout.after < 1.2 && report.rollouts <= 5000, "{:?}", report.heldout);
}

#[test]
fn a_frame_that_is_turned_by_degrees() {
    // Of other seeds a slight turn shows the way to a strong one; of this one it did not.
    let turned =
        spec(ObjectShape::Box, Actions::Designed, &[(EffectKind::PoseRotation, &[-0.058_567_790_834_046_576])]);
    let turned = SetSpec { seed: 14_350_960_743_186_455_203, nominal_errors: [0.9, 1.2], ..turned };
    named(&turned, usize::MAX, 0.002);
}

#[test]
fn bodies_that_bounce_halfway_back() {
    named(&spec(ObjectShape::Cylinder, Actions::Passive, &[(EffectKind::Restitution, &[0.5])]), EPISODES, 0.05);
}

#[test]
fn less_than_half_the_friction_where_the_log_takes_it_for_known() {
    let slippery = spec(ObjectShape::Cylinder, Actions::Passive, &[(EffectKind::FrictionLevel, &[0.15])]);
    named(&SetSpec { fixed_friction: true, nominal_errors: [0.9, 1.0], ..slippery }, EPISODES, 0.005);
}

#[test]
fn a_weak_damping_beside_a_tool_that_sticks() {
    let hidden: [(EffectKind, &[f64]); 2] = [(EffectKind::Adhesion, &[1.9]), (EffectKind::ViscousDamping, &[1.4])];
    let report = report(&spec(ObjectShape::Cylinder, Actions::Passive, &hidden), EPISODES);
    let names: Vec<&str> = report.effects.iter().map(|effect| effect.name).collect();
    assert_eq!((report.verdict, names.as_slice()), (Verdict::Effect, &["adhesion", "viscous_damping"][..]));
}
