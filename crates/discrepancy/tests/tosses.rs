//! Simulated tosses of a cube: what a free body hides is named.

use discrepancy::{Nominal, Report, Settings, Verdict, diagnose};
use measured_log::{
    Axis, Channel, Component, Episode, Header, Log, Noise, Number, Object, Robot, Shape, SplitConfig, Table,
};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::{Effect, EffectKind};
use physics_model::rig::{Rig, RigObject, RigShape, RigStart, RigTool};
use physics_model::{BodyState, ObjectShape};
use pomdp::{Purpose, Rng, Seed};
use rand_distr::{Distribution as _, Normal, Uniform};

const PERIOD_SECS: f64 = 1.0 / 150.0;
const SIDE_M: f64 = 0.1;
const FRICTION: f64 = 0.2;
const ROWS: usize = 75;
const TOSSES: u64 = 16;
const POSITION_M: f64 = 0.000_05;
const ORIENTATION_RAD: f64 = 0.000_5;

/// Steps half as long as the model's, solved with more iterations and stiffer contacts.
fn rig() -> Rig {
    let steps = 16;
    let world = WorldConfig {
        control_period_secs: PERIOD_SECS / f64::from(steps),
        control_steps: 1,
        solver_iterations: 6,
        contact_frequency_hz: 240.0,
        contact_damping_ratio: 1.2,
        table_height_m: 0.0,
        gravity_mps2: 9.81,
        tool_friction: 0.2,
        obstacle_friction: 0.5,
        arm_stiffness_npm: 50_000.0,
        restitution: 0.0,
        obstacle_mobility: ObstacleMobility::Fixed,
    };
    Rig { world, tick_steps: steps, tool: RigTool::None, tool_slip_mps: 0.0, cone_exponent: 1.0 }
}

fn header() -> Header {
    Header {
        robot: Robot::None,
        period_secs: PERIOD_SECS,
        tool_radius_m: None,
        tool_friction: None,
        gravity_mps2: 9.81,
        table: Table { height_m: 0.0.into(), friction: Number::Uncertain { mean: 1.1 * FRICTION, stddev: 0.03 } },
        object: Object {
            shape: Shape::Box { size_m: [Number::Fixed(SIDE_M); 3] },
            mass_kg: 0.4.into(),
            com_m: [Number::Fixed(0.0); 3],
            inertia_kgm2: None,
            restitution: None,
        },
        noise: Noise {
            object_position_m: Some(POSITION_M),
            object_orientation_rad: Some(ORIENTATION_RAD),
            ..Noise::default()
        },
        split: SplitConfig { holdout_fraction: 0.3 },
    }
}

/// A cube thrown from 15 cm that turns.
fn start(rng: &mut Rng) -> BodyState {
    let mut draw = |size: f64| Uniform::new_inclusive(-size, size).unwrap().sample(rng);
    let mut body = BodyState::at_rest([0.0, 0.0, 0.15], 0.0);
    let q: [f64; 4] = std::array::from_fn(|_| draw(1.0));
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    body.orientation = q.map(|v| v / norm);
    body.linear_mps = [draw(0.6), draw(0.6), draw(0.4)];
    body.angular_rps = std::array::from_fn(|_| draw(4.0));
    body
}

/// The pose that a noisy sensor reads.
fn append(episode: &mut Episode, body: &BodyState, rng: &mut Rng) {
    let mut noise = |stddev: f64| Normal::new(0.0, stddev).unwrap().sample(rng);
    let place: [f64; 3] = std::array::from_fn(|i| body.position_m[i] + noise(POSITION_M));
    // Half a small turn about each axis, to first order: (1, t / 2) q.
    let [tx, ty, tz]: [f64; 3] = std::array::from_fn(|_| 0.5 * noise(ORIENTATION_RAD));
    let [x, y, z, w] = body.orientation;
    let q = [
        x + tx * w + ty * z - tz * y,
        y + ty * w + tz * x - tx * z,
        z + tz * w + tx * y - ty * x,
        w - tx * x - ty * y - tz * z,
    ];
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    episode.time_secs.push(episode.time_secs.len() as f64 * PERIOD_SECS);
    let mut push = |channel, value: f64| episode.channels.entry(channel).or_default().push(Some(value));
    for (axis, value) in Axis::ALL.into_iter().zip(place) {
        push(Channel::ObjectPosition(axis), value);
    }
    for (component, value) in Component::ALL.into_iter().zip(q) {
        push(Channel::ObjectOrientation(component), value / norm);
    }
}

fn tosses(hidden: &[(EffectKind, &[f64])]) -> Log {
    let effects: Vec<Box<dyn Effect>> =
        hidden.iter().map(|(kind, values)| kind.from_parameters(values).unwrap().build()).collect();
    let shape = RigShape::Solid { shape: ObjectShape::Box, size_m: [SIDE_M; 3] };
    let cube = RigObject::new(shape, 0.4, FRICTION);
    let episodes = (0..TOSSES).map(|id| {
        let mut rng = Seed(id).stream(Purpose::World, 0);
        let body = start(&mut rng);
        let readings = rig().run(&cube, &effects, &RigStart::of_episode(body, None), &[[0.0; 3]; ROWS]).unwrap();
        let mut episode = Episode { id, ..Episode::default() };
        append(&mut episode, &body, &mut rng);
        readings.iter().for_each(|reading| append(&mut episode, &reading.object, &mut rng));
        episode
    });
    Log { header: header(), episodes: episodes.collect() }
}

fn report(log: &Log) -> Report {
    let nominal = Nominal::new(&log.header, RigTool::None).unwrap();
    let settings = Settings::default();
    let diagnosis = diagnose(log, "tosses", &nominal, &settings).unwrap();
    Report::new(&diagnosis, &settings, 0.0)
}

/// Value and interval of an effect's parameter.
fn found(report: &Report, effect: &str, key: &str) -> (f64, [f64; 2]) {
    let effect = report.effects.iter().find(|named| named.name == effect);
    let effect = effect.unwrap_or_else(|| panic!("{}", report.summary));
    let value = effect.parameters.iter().find(|value| value.key == key).unwrap();
    (value.value, value.interval90)
}

#[test]
fn round_edges_are_named_with_their_radius() {
    let report = report(&tosses(&[(EffectKind::EdgeRounding, &[0.006])]));
    assert_eq!(report.effects[0].name, "edge_rounding", "{}", report.summary);
    let (radius_m, [low, high]) = found(&report, "edge_rounding", "radius_m");
    assert!((radius_m - 0.006).abs() < 0.0005 && low < high, "{radius_m} [{low}, {high}]");
    assert!(report.heldout.after < 0.5 * report.heldout.before, "{:?}", report.heldout);
    assert!(report.rollouts <= 5000, "{}", report.rollouts);
    // It acts where the cube touches the table, not in its flight.
    assert_ne!(report.located[0].phase.name(), "free motion");
}

#[test]
fn a_centre_of_mass_above_the_middle_is_named_with_its_height() {
    let report = report(&tosses(&[(EffectKind::ComOffset, &[0.0, 0.0, 0.08])]));
    assert_eq!(report.effects[0].name, "com_offset", "{}", report.summary);
    let (share, _) = found(&report, "com_offset", "share_z");
    assert!((share - 0.08).abs() < 0.01, "{share}");
}

#[test]
fn tosses_of_what_the_model_says_lack_nothing() {
    let report = report(&tosses(&[]));
    assert_eq!(report.verdict, Verdict::None, "{}", report.summary);
    // Noise alone, and what it makes of the start.
    let [position, orientation] = report.evidence.errors.as_slice() else { panic!("{:?}", report.evidence.errors) };
    for (error, noise) in [(position, POSITION_M), (orientation, ORIENTATION_RAD)] {
        assert!(error.before == error.after && error.median_before > 0.6 * noise, "{error:?}");
        assert!(error.median_before < 2.0 * noise, "{error:?}");
    }
}

#[test]
fn four_effects_that_hide_each_other_are_named_together() {
    let hidden: [(EffectKind, &[f64], &str); 4] = [
        (EffectKind::PoseScale, &[0.98], "scale"),
        (EffectKind::EdgeRounding, &[0.005], "radius_m"),
        (EffectKind::Restitution, &[0.3], "coefficient"),
        (EffectKind::ComOffset, &[0.0, 0.0, 0.05], "share_z"),
    ];
    let report = report(&tosses(&hidden.map(|(kind, values, _)| (kind, values))));
    assert_eq!(report.effects.len(), hidden.len(), "{}", report.summary);
    for (kind, values, key) in hidden {
        let (value, [low, high]) = found(&report, kind.name(), key);
        let truth = values[values.len() - 1];
        assert!(low < value && value < high, "{value} [{low}, {high}]");
        assert!((value - truth).abs() < 0.1 * truth.abs().min(0.2), "{key}: {value}, {truth}");
    }
    assert!(report.heldout.after < 0.5 * report.heldout.before, "{:?}", report.heldout);
    assert!(report.rollouts <= 5000, "{}", report.rollouts);
}

/// Throws of a ball of 2 cm and 2.7 g through the air, of which only the place is read.
fn flights(drag_pm: f64) -> Log {
    const MASS_KG: f64 = 0.002_7;
    let effects = [EffectKind::QuadraticDrag.from_parameters(&[drag_pm * MASS_KG]).unwrap().build()];
    let shape = RigShape::Solid { shape: ObjectShape::Sphere, size_m: [0.02, 0.0, 0.0] };
    let ball = RigObject::new(shape, MASS_KG, FRICTION);
    let mut header = header();
    header.object.shape = Shape::Sphere { radius_m: 0.02.into() };
    header.object.mass_kg = MASS_KG.into();
    header.noise = Noise { object_position_m: Some(POSITION_M), ..Noise::default() };
    let episodes = (0..TOSSES).map(|id| {
        let mut rng = Seed(id).stream(Purpose::World, 0);
        let mut body = start(&mut rng);
        body.position_m[2] = 1.5;
        body.linear_mps = body.linear_mps.map(|speed| 5.0 * speed);
        let readings = rig().run(&ball, &effects, &RigStart::of_episode(body, None), &[[0.0; 3]; ROWS / 2]).unwrap();
        let mut episode = Episode { id, ..Episode::default() };
        append(&mut episode, &body, &mut rng);
        readings.iter().for_each(|reading| append(&mut episode, &reading.object, &mut rng));
        episode.channels.retain(|channel, _| matches!(channel, Channel::ObjectPosition(_)));
        episode
    });
    Log { header, episodes: episodes.collect() }
}

#[test]
fn the_drag_of_a_ball_of_grams_is_named() {
    let report = report(&flights(0.16));
    assert_eq!(report.effects[0].name, "quadratic_drag", "{}", report.summary);
    let (coefficient, [low, high]) = found(&report, "quadratic_drag", "coefficient_ns2pm2");
    assert!((coefficient / 0.002_7 - 0.16).abs() < 0.02 && low < high, "{coefficient} [{low}, {high}]");
}
