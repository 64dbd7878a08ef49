//! Round edges of what is thrown, against closed forms.

#[path = "support/rigs.rs"]
mod rigs;

use physics_model::effect::{Effect, EffectKind};
use physics_model::rig::{RigObject, RigShape, RigStart, RigTool};
use physics_model::{BodyState, ObjectShape};
use rigs::{G, rig};

const TICK_SECS: f64 = 0.01;

#[test]
fn round_edges_and_corners_meet_the_table_lower() {
    let (side_m, radius_m) = (0.1_f64, 0.006);
    let cube = RigObject::new(RigShape::Solid { shape: ObjectShape::Box, size_m: [side_m; 3] }, 0.5, 0.3);
    // On a face, an edge and a corner: turned about x and then y. Lowest points of the sharp cube are at half a side times √1, √2, √3.
    let corner = (1.0 / 3.0_f64.sqrt()).acos();
    let turns = [(0.0, 1.0_f64), (std::f64::consts::FRAC_PI_4, 2.0), (corner, 3.0)];
    for (index, (turn, square)) in turns.into_iter().enumerate() {
        // About an edge's axis, or about a diagonal of the sole.
        let (sin, cos) = (0.5 * turn).sin_cos();
        let axis =
            if index == 2 { [-std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2] } else { [1.0, 0.0] };
        let height = |radius: f64| (0.5 * side_m - radius) * square.sqrt() + radius;
        for radius in [0.0, radius_m] {
            let rounding = EffectKind::EdgeRounding.from_parameters(&[radius]).unwrap();
            let effects: [Box<dyn Effect>; 1] = [rounding.build()];
            let fall = |above_m: f64| {
                let mut from = BodyState::at_rest([0.0; 3], 0.0);
                from.orientation = [axis[0] * sin, axis[1] * sin, 0.0, cos];
                from.position_m[2] = height(radius) + above_m;
                let readings =
                    rig(RigTool::None).run(&cube, &effects, &RigStart::of_episode(from, None), &[[0.0; 3]]).unwrap();
                readings[0].object.linear_mps[2]
            };
            // Free 1 mm above where it touches, held 0.1 mm below.
            assert!((fall(0.001) + G * TICK_SECS).abs() < 1e-4, "{square}, {radius}: {}", fall(0.001));
            assert!(fall(-0.0001) > -0.5 * G * TICK_SECS, "{square}, {radius}: {}", fall(-0.0001));
        }
    }
}
