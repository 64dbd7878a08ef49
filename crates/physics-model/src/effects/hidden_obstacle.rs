//! A body on the table that Θ knows nothing of.
//!
//! No equation: one more rigid body, which the object, and the tool, can touch.
//!
//! | symbol | key | unit | plausible | source |
//! |---|---|---|---|---|
//! | – | `shape` | – | box, cylinder, sphere | – |
//! | – | `movable` | – | fixed to the table, or sliding on it like the object | – |
//! | centre | `x_m`, `y_m` | m | where things can be in reach of an arm | – |
//! | yaw | `yaw_rad` | rad | −π to π | – |
//! | sizes | `size_m` | m | 0.01 to 0.3 each | engineering judgement; as for the object, places that a shape has no use for are not read |
//! | mass | `mass_kg` | kg | 0.05 to 5 | engineering judgement; of a movable one |
//!
//! Shows in path and force at one place: the object stops or turns there, and the push takes more force.
//!
//! Acts as a further body of the world (N), upright on the table, with the friction of obstacles. The first size below 2 mm: no body. Where a
//! movable one has got to outlives the action ([`crate::effect::Memory::hidden`]).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::parameter::{Neutral, Parameter};
use crate::effect::{Effect, HiddenBody, Hooks, Nominal, Parametric};
use crate::theta::ObjectShape;

/// First size, m, from which on there is a body.
const SMALLEST_M: f64 = 0.002;

/// A body that Θ knows nothing of; see the module of the same name for ranges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HiddenObstacle {
    /// Shape.
    pub shape: ObjectShape,
    /// Whether it can move.
    pub movable: bool,
    /// Centre x, m, base frame.
    pub x_m: f64,
    /// Centre y, m, base frame.
    pub y_m: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// Sizes, m: box full lengths; cylinder radius and height; sphere radius.
    pub size_m: [f64; 3],
    /// Mass, kg.
    pub mass_kg: f64,
}

const PLACE: Parameter = Parameter::new("m", [-1.0, 1.0], [-10.0, 10.0], Neutral::Free(0.0));
const SIZE: Parameter = Parameter::new("m", [0.01, 0.3], [0.0, 1.0], Neutral::Free(0.1));

impl HiddenObstacle {
    /// Every shape, fixed and movable, with the values to start from.
    pub(crate) fn choices() -> Vec<Self> {
        let start = Self::start();
        let shapes = ObjectShape::ALL.into_iter().flat_map(|shape| [(shape, false), (shape, true)]);
        shapes.map(|(shape, movable)| Self { shape, movable, ..start.clone() }).collect()
    }

    fn exists(&self) -> bool {
        self.size_m[0] >= SMALLEST_M
    }
}

impl Parametric for HiddenObstacle {
    const NAME: &'static str = "hidden_obstacle";
    const PARAMETERS: &'static [Parameter] = &[
        PLACE.named("x_m"),
        PLACE.named("y_m"),
        Parameter::new("rad", [-3.15, 3.15], [-10.0, 10.0], Neutral::Free(0.0)).named("yaw_rad"),
        Parameter::new("m", [0.01, 0.3], [0.0, 1.0], Neutral::Value(0.0)).named("size_0_m"),
        SIZE.named("size_1_m"),
        SIZE.named("size_2_m"),
        Parameter::new("kg", [0.05, 5.0], [0.005, 1000.0], Neutral::Free(1.0)).named("mass_kg"),
    ];

    fn start() -> Self {
        Self {
            shape: ObjectShape::Box,
            movable: false,
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
            size_m: [0.0, 0.1, 0.1],
            mass_kg: 1.0,
        }
    }

    fn values(&self) -> Vec<f64> {
        let [a, b, c] = self.size_m;
        vec![self.x_m, self.y_m, self.yaw_rad, a, b, c, self.mass_kg]
    }

    fn set_values(&mut self, values: &[f64]) {
        let [a, b, c] = &mut self.size_m;
        let fields = [&mut self.x_m, &mut self.y_m, &mut self.yaw_rad, a, b, c, &mut self.mass_kg];
        for (field, value) in fields.into_iter().zip(values) {
            *field = *value;
        }
    }
}

impl Effect for HiddenObstacle {
    fn hooks(&self) -> Hooks {
        let present = self.exists();
        Hooks::NOMINAL
            .and(Hooks::UNREST)
            .and(Hooks::ASTRAY)
            .when(present)
            .and(Hooks::MEMORY.when(present && self.movable))
    }

    fn nominal(&self, nominal: &mut Nominal) {
        if self.exists() {
            nominal.hidden.push(HiddenBody {
                shape: self.shape,
                size_m: self.size_m,
                mass_kg: self.mass_kg,
                place_m: [self.x_m, self.y_m],
                yaw_rad: self.yaw_rad,
                movable: self.movable,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::nominal;

    #[test]
    fn a_body_of_some_size_is_there_and_one_without_is_not() {
        let mut world = nominal();
        let mut effect = HiddenObstacle::start();
        assert_eq!(effect.hooks(), Hooks::NONE);
        effect.nominal(&mut world);
        assert!(world.hidden.is_empty());
        effect.set_values(&[0.4, 0.1, 0.2, 0.05, 0.06, 0.07, 0.8]);
        effect.nominal(&mut world);
        assert_eq!(world.hidden.len(), 1);
        assert_eq!((world.hidden[0].place_m, world.hidden[0].size_m), ([0.4, 0.1], [0.05, 0.06, 0.07]));
        assert_eq!(effect.values(), [0.4, 0.1, 0.2, 0.05, 0.06, 0.07, 0.8]);
        assert_eq!(HiddenObstacle::choices().len(), 6);
    }
}
