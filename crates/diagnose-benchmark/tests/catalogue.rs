//! Every effect of the catalogue in worlds that differ by their units and their frame alone: what is simulated there differs by units and frame, too.
//!
//! A diagnosis carries logs and effects from unit to unit. It is right if the unit of each parameter is, and nothing in an effect is absolute that should not be.

use diagnose_benchmark::actions::Script;
use diagnose_benchmark::draw;
use diagnose_benchmark::generate::{Actions, RobotName, SetSpec};
use nalgebra::{UnitQuaternion, Vector3};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effect::Effect;
use physics_model::rig::{Rig, RigObject, RigReading, RigShape, RigStart, RigTool};
use physics_model::{BodyState, EffectConfig, EffectKind, ObjectShape};
use pomdp::{Purpose, Seed};

const MASS_KG: f64 = 0.5;
const FRICTION: f64 = 0.35;
const TOOL_M: f64 = 0.02;
const G: f64 = 9.81;

/// Unit of mass and of length, and by how much the frame is turned, rad.
#[derive(Clone, Copy)]
struct World {
    mass: f64,
    length: f64,
    yaw_rad: f64,
    /// Whether effects are turned with it, as they should be.
    turns_effects: bool,
}

const PLAIN: World = World { mass: 1.0, length: 1.0, yaw_rad: 0.0, turns_effects: true };

impl World {
    /// What a unit is multiplied by.
    fn factor(&self, unit: &str) -> f64 {
        match unit {
            "N" | "N/s" => self.mass * self.length,
            "N/m" | "N·s/m" | "kg" => self.mass,
            "N·s²/m²" => self.mass / self.length,
            "m" | "m/s" => self.length,
            "" | "s" | "1/s" | "Hz" | "rad" => 1.0,
            unit => panic!("{unit}"),
        }
    }

    fn turn(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.yaw_rad)
    }

    fn place(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        (self.turn() * (self.length * Vector3::new(x, y, z))).into()
    }

    /// An effect as it is here.
    fn effect(&self, effect: &EffectConfig) -> EffectConfig {
        let scaled = effect.scaled(|parameter| self.factor(parameter.unit));
        let kind = scaled.kind();
        let mut values = scaled.values();
        let along = |axis: char| {
            kind.parameters().iter().position(|one| one.name.split('_').any(|part| part == axis.to_string()))
        };
        // The centre of mass is told along the axes of the object.
        let turns = kind != EffectKind::ComOffset && self.turns_effects;
        if let (Some(x), Some(y), true) = (along('x'), along('y'), turns) {
            let turned = self.turn() * Vector3::new(values[x], values[y], 0.0);
            (values[x], values[y]) = (turned.x, turned.y);
        }
        match kind {
            EffectKind::AnisotropicFriction => values[1] = (values[1] + self.yaw_rad).rem_euclid(std::f64::consts::PI),
            EffectKind::HiddenObstacle => values[2] += self.yaw_rad,
            _ => {}
        }
        scaled.with_parameters(&values).unwrap()
    }

    fn play(
        &self,
        shape: ObjectShape,
        size_m: [f64; 3],
        script: &Script,
        effect: Option<&EffectConfig>,
    ) -> Vec<RigReading> {
        let size_m = size_m.map(|size| self.length * size);
        let world = WorldConfig {
            control_period_secs: 0.005,
            control_steps: 1,
            solver_iterations: 4,
            contact_frequency_hz: 60.0,
            contact_damping_ratio: 5.0,
            table_height_m: 0.0,
            gravity_mps2: self.length * G,
            tool_friction: 0.1,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0 * self.mass,
            restitution: 0.0,
            obstacle_mobility: ObstacleMobility::Movable,
        };
        let rig = Rig {
            world,
            tick_steps: 2,
            tool: RigTool::Ball { radius_m: self.length * TOOL_M },
            tool_slip_mps: 0.0,
            cone_exponent: 1.0,
        };
        let object = RigObject {
            added_mass_kg: self.mass * script.added_mass_kg,
            ..RigObject::new(RigShape::Solid { shape, size_m }, self.mass * MASS_KG, FRICTION)
        };
        let [x, y] = script.place_m;
        let place = self.place([x, y, 0.0]);
        let height_m = shape.half_height_m(size_m) + self.length * script.lift_m;
        let body = BodyState::at_rest([place[0], place[1], height_m], script.yaw_rad + self.yaw_rad);
        let effects: Vec<Box<dyn Effect>> = effect.map(|effect| self.effect(effect).build()).into_iter().collect();
        let seen = physics_model::effect::signal::read(&effects, &body);
        let commands: Vec<[f64; 3]> = script.commands.iter().map(|command| self.place(*command)).collect();
        rig.run(&object, &effects, &RigStart::of_episode(seen, Some(commands[0])), &commands[1..]).unwrap()
    }

    /// What sensors read, in the units and the frame of the plain world: place, force and torque, in 0.5 mm, 50 mN and 2 mN·m.
    fn numbers(&self, readings: &[RigReading]) -> Vec<f64> {
        let back = self.turn().inverse();
        let of = |vector: [f64; 3], unit: f64| -> [f64; 3] { (back * (Vector3::from(vector) / unit)).into() };
        let [m, l] = [self.mass, self.length];
        let row = |reading: &RigReading| {
            [
                of(reading.object.position_m, 5e-4 * l),
                of(reading.wrench.force_n, 0.05 * m * l),
                of(reading.wrench.torque_nm, 2e-3 * m * l * l),
            ]
        };
        readings.iter().flat_map(row).flatten().collect()
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / n as f64).sqrt()
}

/// How far readings with an effect in `world` are from those in the plain one, in the median push and the worst one, and how much the effect changes; in noise.
struct Off {
    median: f64,
    worst: f64,
    does: f64,
}

fn off(kind: EffectKind, world: World) -> Off {
    let mut rng = Seed(3).stream(Purpose::World, kind as u64);
    let shape = if kind == EffectKind::RollingResistance { ObjectShape::Sphere } else { ObjectShape::Box };
    let spec = SetSpec {
        seed: 3,
        robot: RobotName::None,
        shape,
        effects: Vec::new(),
        unknown: None,
        nominal_errors: [1.0; 2],
        fixed_friction: false,
        noise: 1.0,
        actions: Actions::Designed,
        engine: (2, 4, 60.0),
    };
    let effect = draw::effect(kind, 2, Actions::Designed, [1.0; 2], [0.1, 0.03], &mut rng);
    let (mut wrong, mut does) = (Vec::new(), 0.0_f64);
    for script in spec.scripts().iter().step_by(5) {
        let of = |world: World, effect: Option<&EffectConfig>| {
            world.numbers(&world.play(shape, spec.size_m(), script, effect))
        };
        let plain = of(PLAIN, Some(&effect));
        wrong.push(apart(&plain, &of(world, Some(&effect))));
        does = does.max(apart(&plain, &of(PLAIN, None)));
    }
    wrong.sort_by(f64::total_cmp);
    Off { median: wrong[wrong.len() / 2], worst: wrong[wrong.len() - 1], does }
}

/// An arm keeps its lengths and masses, and what is in its joints needs one.
fn of_no_arm() -> impl Iterator<Item = EffectKind> {
    let of_arm = |kind: &EffectKind| matches!(kind, EffectKind::Backlash | EffectKind::JointFriction);
    EffectKind::ALL.iter().copied().filter(move |kind| !of_arm(kind))
}

#[test]
fn with_other_masses_forces_differ_and_nothing_else() {
    for kind in of_no_arm() {
        let Off { worst, does, .. } = off(kind, World { mass: 4.0, ..PLAIN });
        // A drift of the force shows after minutes.
        assert!(does > if kind == EffectKind::ForceDrift { 0.05 } else { 0.9 }, "{}: {does}", kind.name());
        // A hand that gives way has a mass of its own.
        let most = if kind == EffectKind::ArmCompliance { 0.3 * does } else { 1e-3 * does };
        assert!(worst <= most, "{}: {worst} of {does}", kind.name());
    }
}

#[test]
fn with_other_lengths_and_gravity_ways_and_forces_differ_and_nothing_else() {
    for kind in of_no_arm() {
        // The engine looks for contacts from a fixed distance: what is hit at speed, a push in four, is hit in another step.
        let Off { median, does, .. } = off(kind, World { length: 2.0, ..PLAIN });
        // A small sole stands on balls of 2 mm, and a film lets go at 1 mm.
        let fixed = matches!(kind, EffectKind::PressureDistribution | EffectKind::Adhesion);
        let share = if fixed { 0.2 } else { 0.02 };
        assert!(median <= share * does.max(1.0), "{}: {median} of {does}", kind.name());
    }
}

#[test]
fn in_a_frame_that_is_turned_readings_are_turned() {
    // A sensor's range ends along its own axes.
    for kind in of_no_arm().filter(|kind| *kind != EffectKind::ForceSaturation) {
        // The engine's contacts are not the same in all directions: half of the noise without any effect, more if they are soft.
        let Off { median, does, .. } = off(kind, World { yaw_rad: 2.0, ..PLAIN });
        assert!(median <= 1.0, "{}: {median} of {does}", kind.name());
    }
}

#[test]
fn an_effect_that_is_not_turned_with_its_frame_shows() {
    for kind in [EffectKind::ConstantForce, EffectKind::ForceBias, EffectKind::PoseOffset, EffectKind::Tether] {
        let Off { median, .. } = off(kind, World { yaw_rad: 2.0, turns_effects: false, ..PLAIN });
        assert!(median > 1.0, "{}: {median}", kind.name());
    }
}
