//! What the files say, and that they say what they leave out. `tests/peers/mjcf_gain.py` loads them in MuJoCo.

use std::sync::Arc;

use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::effects::{
    ComOffset, ConstantForce, FrictionLevel, HiddenObstacle, RollingResistance, Tether, ViscousDamping,
};
use physics_model::{EffectConfig, EffectKind, ObjectShape, Prism, Rig, RigObject, RigShape, RigTool};
use simulator_files::{Scene, mjcf, urdf};

fn solid(shape: ObjectShape, size_m: [f64; 3]) -> RigObject {
    RigObject::new(RigShape::Solid { shape, size_m }, 0.5, 0.3)
}

fn brick() -> RigObject {
    solid(ObjectShape::Box, [0.08, 0.06, 0.05])
}

fn scene(object: RigObject, effects: Vec<EffectConfig>) -> Scene<'static> {
    let world = WorldConfig {
        control_period_secs: 0.01,
        control_steps: 1,
        solver_iterations: 4,
        contact_frequency_hz: 60.0,
        contact_damping_ratio: 5.0,
        table_height_m: 0.75,
        gravity_mps2: 9.81,
        tool_friction: 0.2,
        obstacle_friction: 0.5,
        arm_stiffness_npm: 50_000.0,
        restitution: 0.0,
        obstacle_mobility: ObstacleMobility::Movable,
    };
    let rig =
        Rig { world, tick_steps: 1, tool: RigTool::Ball { radius_m: 0.02 }, tool_slip_mps: 0.0, cone_exponent: 1.0 };
    Scene { name: "a log -- of --- mine", rig, object, effects }
}

/// Values of an attribute of the first element that `part` stands in.
fn values(text: &str, part: &str, attribute: &str) -> Vec<f64> {
    let element = text.split('<').find(|element| element.contains(part)).unwrap_or_else(|| panic!("{part}: {text}"));
    let (_, rest) = element.split_once(&format!("{attribute}=\"")).unwrap_or_else(|| panic!("{attribute}: {element}"));
    rest.split_once('"').unwrap().0.split(' ').map(|word| word.parse().unwrap()).collect()
}

fn close(ours: &[f64], expected: &[f64]) {
    assert_eq!(ours.len(), expected.len(), "{ours:?} {expected:?}");
    for (ours, expected) in ours.iter().zip(expected) {
        assert!((ours - expected).abs() < 1e-12, "{ours} {expected}");
    }
}

#[test]
fn a_box_has_its_mass_its_size_and_its_corners() {
    let text = mjcf(&scene(brick(), Vec::new()));
    close(&values(&text, "name=\"object\" type", "size"), &[0.04, 0.03, 0.025]);
    close(&values(&text, "inertial", "mass"), &[0.5]);
    let [a, b, c] = [0.08_f64, 0.06, 0.05].map(|v| v * v);
    let moments = [b + c, a + c, a + b].map(|v| 0.5 * v / 12.0);
    close(&values(&text, "inertial", "fullinertia"), &[moments[0], moments[1], moments[2], 0.0, 0.0, 0.0]);
    close(&values(&text, "name=\"table\"", "pos"), &[0.0, 0.0, 0.75]);
    close(&values(&text, "geom1=\"table\"", "friction"), &[0.3, 0.3, 0.0, 0.0, 0.0]);
    close(&values(&text, "geom1=\"tool\"", "friction"), &[0.2, 0.2, 0.0, 0.0, 0.0]);
    assert_eq!(text.matches("geom1=\"table\"").count(), 8, "eight corners");
    assert!(text.contains("Every effect of the model is in this file."));
}

#[test]
fn a_comment_ends_where_it_should_whatever_a_log_is_called() {
    for text in [mjcf(&scene(brick(), Vec::new())), urdf(&scene(brick(), Vec::new()))] {
        let (_, rest) = text.split_once("<!--").unwrap();
        let (inside, _) = rest.split_once("-->").unwrap();
        assert!(!inside.contains("--"), "{inside}");
    }
}

#[test]
fn effects_become_what_the_format_has_words_for() {
    let effects = vec![
        EffectConfig::ViscousDamping(ViscousDamping { coefficient_nspm: 0.8 }),
        EffectConfig::ConstantForce(ConstantForce { force_x_n: 0.1, force_y_n: -0.2 }),
        EffectConfig::Tether(Tether { stiffness_npm: 4.0, anchor_x_m: 0.05, anchor_y_m: -0.03 }),
        EffectConfig::ComOffset(ComOffset { share_x: 0.1, share_y: 0.0, share_z: 0.0 }),
        EffectConfig::FrictionLevel(FrictionLevel { coefficient: 0.55 }),
    ];
    let text = mjcf(&scene(brick(), effects));
    close(&values(&text, "joint name=\"object_x\"", "damping"), &[0.8]);
    close(&values(&text, "joint name=\"object_x\"", "stiffness"), &[4.0]);
    close(&values(&text, "joint name=\"object_y\"", "springref"), &[-0.03]);
    assert!(!text.split('<').any(|element| element.contains("object_z") && element.contains("stiffness")));
    close(&values(&text, "general joint=\"object_y\"", "biasprm"), &[-0.2, 0.0, 0.0]);
    // The body's frame is at its centre of mass.
    close(&values(&text, "inertial", "pos"), &[0.0; 3]);
    close(&values(&text, "site name=\"object\"", "pos"), &[-0.008, 0.0, 0.0]);
    close(&values(&text, "geom name=\"point0\"", "pos"), &[0.0399 - 0.008, 0.0299, -0.0249]);
    close(&values(&text, "key name", "qpos"), &[0.008, 0.0, 0.775, 1.0, 0.0, 0.0, 0.0, -0.3, 0.0, 0.775]);
    close(&values(&text, "geom1=\"table\"", "friction"), &[0.55, 0.55, 0.0, 0.0, 0.0]);
    assert!(text.contains("Every effect of the model is in this file."));
}

#[test]
fn a_ball_rolls_with_a_lever_and_a_box_does_not() {
    let effect = || vec![EffectConfig::RollingResistance(RollingResistance { lever_m: 0.002 })];
    let ball = mjcf(&scene(solid(ObjectShape::Sphere, [0.03, 0.0, 0.0]), effect()));
    close(&values(&ball, "geom1=\"table\"", "friction"), &[0.3, 0.3, 0.0, 0.002, 0.002]);
    close(&values(&ball, "geom1=\"table\"", "condim"), &[6.0]);
    let brick = mjcf(&scene(brick(), effect()));
    close(&values(&brick, "geom1=\"table\"", "condim"), &[3.0]);
}

#[test]
fn a_body_in_the_way_stands_on_the_table() {
    let body = HiddenObstacle {
        shape: ObjectShape::Cylinder,
        movable: false,
        x_m: 0.1,
        y_m: 0.2,
        yaw_rad: 0.0,
        size_m: [0.03, 0.08, 0.0],
        mass_kg: 1.0,
    };
    let movable = HiddenObstacle { movable: true, ..body.clone() };
    let text = mjcf(&scene(brick(), vec![EffectConfig::HiddenObstacle(movable)]));
    close(&values(&text, "diaginertia=\"0", "mass"), &[1.0]);
    close(&values(&text, "key name", "qpos")[10..], &[0.1, 0.2, 0.79, 1.0, 0.0, 0.0, 0.0]);
    let text = mjcf(&scene(brick(), vec![EffectConfig::HiddenObstacle(body)]));
    close(&values(&text, "body name=\"obstacle0\"", "pos"), &[0.1, 0.2, 0.79]);
    close(&values(&text, "geom1=\"object\" geom2=\"obstacle0\"", "friction"), &[0.3, 0.3, 0.0, 0.0, 0.0]);
    assert!(!text.contains("freejoint"));
}

#[test]
fn every_effect_is_in_the_scene_or_named_as_left_out() {
    for kind in EffectKind::ALL {
        for object in [brick(), solid(ObjectShape::Sphere, [0.03, 0.0, 0.0])] {
            let mut effect = kind.start();
            // Away from where it does nothing.
            let changed: Vec<f64> =
                kind.parameters().iter().map(|p| 0.5 * (p.plausible[0] + p.plausible[1]) + 0.013).collect();
            effect = effect.with_parameters(&changed).unwrap_or(effect);
            let (with, without) = (scene(object.clone(), vec![effect]), scene(object, Vec::new()));
            for (format, write) in [("mjcf", mjcf as fn(&Scene) -> String), ("urdf", urdf)] {
                let (text, plain) = (write(&with), write(&without));
                let body = |text: &str| text.split_once("-->").unwrap().1.to_owned();
                let says = body(&text) != body(&plain);
                let named = text.contains(&format!("- {} (", kind.name()));
                // Boxes do not roll, and balls have no sole.
                let is_box = text.contains("<box size") || text.contains("type=\"box\"");
                let idle = kind.name() == if is_box { "rolling_resistance" } else { "pressure_distribution" };
                assert!(says != named || idle, "{format}, {}: said {says}, named {named}\n{text}", kind.name());
            }
        }
    }
}

#[test]
fn a_prism_is_a_mesh_with_its_inertia_and_a_hollow_one_is_said_to_be_filled() {
    let outline = vec![[0.0, 0.0], [0.06, 0.0], [0.06, 0.02], [0.02, 0.02], [0.02, 0.06], [0.0, 0.06]];
    let outline: Vec<[f64; 2]> = outline.into_iter().map(|[x, y]| [x - 0.022, y - 0.022]).collect();
    let prism = Arc::new(Prism::new(outline, 0.03, Vec::new()).unwrap());
    let object = RigObject::new(RigShape::Prism(prism.clone()), 0.5, 0.3);
    let text = mjcf(&scene(object.clone(), Vec::new()));
    assert_eq!(values(&text, "mesh name=\"object\"", "vertex").len(), 36);
    let inertia = prism.inertia_kgm2(0.5);
    close(&values(&text, "inertial", "fullinertia")[..3], &[inertia[(0, 0)], inertia[(1, 1)], inertia[(2, 2)]]);
    assert!(text.contains("convex hull of the outline"));
    assert!(urdf(&scene(object, Vec::new())).contains("box around the outline"));
}

#[test]
fn a_flat_disc_and_a_prism_of_many_corners_have_softer_contacts() {
    let rate = |object: RigObject| -values(&mjcf(&scene(object, Vec::new())), "geom1=\"table\"", "solref")[0];
    let usual = rate(brick());
    close(&[usual], &[300.0 * 300.0]);
    // Eight points on the rim of a thin disc are 2 · 8 times as stiff about a diameter as one alone for the mass.
    let disc = rate(solid(ObjectShape::Cylinder, [0.1, 0.002, 0.0]));
    assert!(((disc / usual).sqrt() - 10.0 / 16.0).abs() < 0.01, "{}", (disc / usual).sqrt());
    let corner = |i: u32| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 60.0).sin_cos();
        [0.04 * cos, 0.04 * sin]
    };
    let prism = Prism::new((0..60).map(corner).collect(), 0.05, Vec::new()).unwrap();
    let object = RigObject::new(RigShape::Prism(Arc::new(prism)), 0.5, 0.3);
    let text = mjcf(&scene(object.clone(), Vec::new()));
    assert_eq!(text.matches("geom1=\"table\"").count(), 16, "as many as the engine has, on both faces");
    assert!(rate(object) <= usual);
}

#[test]
fn what_bounces_is_said_not_to() {
    let object = RigObject { restitution: Some(0.4), ..brick() };
    assert!(mjcf(&scene(object, Vec::new())).contains("the coefficient of restitution, 0.4, is not in this file"));
}

#[test]
fn a_urdf_has_the_values_of_the_model_in_the_places_of_the_format() {
    let effects = vec![EffectConfig::ComOffset(ComOffset { share_x: 0.0, share_y: 0.1, share_z: 0.0 })];
    let text = urdf(&scene(solid(ObjectShape::Cylinder, [0.04, 0.1, 0.0]), effects));
    let document = roxmltree::Document::parse(&text).unwrap();
    let value = |path: &[&str], key: &str| -> Vec<f64> {
        let root = document.root_element();
        let found =
            path.iter().fold(root, |node, name| node.children().find(|child| child.has_tag_name(*name)).expect(name));
        found.attribute(key).expect(key).split_whitespace().map(|number| number.parse().unwrap()).collect()
    };
    assert_eq!(value(&["link", "inertial", "mass"], "value"), [0.5]);
    close(&value(&["link", "inertial", "origin"], "xyz"), &[0.0, 0.008, 0.0]);
    close(&value(&["link", "inertial", "inertia"], "izz"), &[0.5 * 0.04 * 0.04 / 2.0]);
    let cylinder = ["link", "collision", "geometry", "cylinder"];
    assert_eq!((value(&cylinder, "radius"), value(&cylinder, "length")), (vec![0.04], vec![0.1]));
}
