//! Friction of engines that solve it by axes, against those engines (`tests/peers/friction_cones.py`).

#[path = "support/rigs.rs"]
mod rigs;

use physics_model::rig::{Rig, RigObject, RigShape, RigStart, RigTool};
use physics_model::{BodyState, ObjectShape};
use rigs::rig;

const SIZE_M: [f64; 3] = [0.1, 0.1, 0.02];
const MASS_KG: f64 = 0.5;
const MU: f64 = 0.4;
const SPEED_MPS: f64 = 1.5;
const STEP_SECS: f64 = 0.001;
const STEPS: usize = 200;

/// Where the box is after 0.2 s if its cone of friction has this exponent.
fn slid(cone_exponent: f64, direction_rad: f64) -> [f64; 2] {
    let mut rig = Rig { tick_steps: 1, cone_exponent, ..rig(RigTool::None) };
    rig.world.control_period_secs = STEP_SECS;
    let mut object = RigObject::new(RigShape::Solid { shape: ObjectShape::Box, size_m: SIZE_M }, MASS_KG, MU);
    object.on_points = true;
    let mut body = BodyState::at_rest([0.0, 0.0, SIZE_M[2] / 2.0], 0.0);
    let (sin, cos) = direction_rad.sin_cos();
    body.linear_mps = [SPEED_MPS * cos, SPEED_MPS * sin, 0.0];
    let readings = rig.run(&object, &[], &RigStart::of_episode(body, None), &[[0.0; 3]; STEPS]).unwrap();
    let [x, y, _] = readings[STEPS - 1].object.position_m;
    [x, y]
}

#[test]
fn cones_and_pyramids_carry_a_box_where_other_engines_do() {
    let rows = include_str!("data/friction_cones.csv").lines().skip(1);
    let mut seen = 0;
    for row in rows {
        let [engine, cone, direction, x, y] = row.split(',').collect::<Vec<_>>()[..] else { panic!("{row}") };
        let exponent = match (engine, cone) {
            (_, "elliptic" | "coulomb") => 1.0,
            ("mujoco", "pyramidal") => 100.0,
            ("dart" | "bullet", "pyramidal") => 0.01,
            _ => panic!("{row}"),
        };
        let number = |text: &str| text.parse::<f64>().unwrap();
        let found = slid(exponent, number(direction).to_radians());
        let off_m = (found[0] - number(x)).hypot(found[1] - number(y));
        // Of some 20 cm; another cone would be off by up to 4 cm.
        assert!(off_m < 0.003, "{row}: {found:?}");
        seen += 1;
    }
    assert_eq!(seen, 54);
}

#[test]
fn a_shape_that_is_none_is_refused() {
    for cone_exponent in [0.0, -1.0, 1e9, f64::NAN] {
        let rig = Rig { cone_exponent, ..rig(RigTool::None) };
        let object = RigObject::new(RigShape::Solid { shape: ObjectShape::Box, size_m: SIZE_M }, MASS_KG, MU);
        let body = BodyState::at_rest([0.0, 0.0, SIZE_M[2] / 2.0], 0.0);
        let refused = rig.run(&object, &[], &RigStart::of_episode(body, None), &[[0.0; 3]]);
        assert!(refused.unwrap_err().to_string().contains("cone_exponent"));
    }
}
