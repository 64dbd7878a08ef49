//! Θ: the physical parameters, fixed in an episode and unknown to the robot.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::effect::EffectValue;

/// Shape of the target object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectShape {
    /// Cuboid; sizes are its full lengths along x, y, z.
    Box,
    /// Upright cylinder, axis z; sizes are radius and height.
    Cylinder,
    /// Sphere; its size is the radius.
    Sphere,
}

impl ObjectShape {
    /// All shapes, in the order of their class index.
    pub const ALL: [Self; 3] = [Self::Box, Self::Cylinder, Self::Sphere];

    /// Class index in categorical distributions.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// How many of the three size values mean something for this shape; the others are 0.
    #[must_use]
    pub const fn size_count(self) -> usize {
        match self {
            Self::Box => 3,
            Self::Cylinder => 2,
            Self::Sphere => 1,
        }
    }

    /// Half of the vertical extent, m, of a shape of `size_m` that stands upright.
    #[must_use]
    pub fn half_height_m(self, size_m: [f64; 3]) -> f64 {
        match self {
            Self::Box => size_m[2] / 2.0,
            Self::Cylinder => size_m[1] / 2.0,
            Self::Sphere => size_m[0],
        }
    }

    /// Half extents, m, along the axes of the shape's frame.
    #[must_use]
    pub fn half_extents_m(self, size_m: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Box => size_m.map(|size| size / 2.0),
            Self::Cylinder => [size_m[0], size_m[0], size_m[1] / 2.0],
            Self::Sphere => [size_m[0]; 3],
        }
    }

    /// Radius, m, of the circle around the footprint of a shape of `size_m`.
    #[must_use]
    pub fn footprint_radius_m(self, size_m: [f64; 3]) -> f64 {
        match self {
            Self::Box => size_m[0].hypot(size_m[1]) / 2.0,
            Self::Cylinder | Self::Sphere => size_m[0],
        }
    }

    /// Name as in scenario files and tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Cylinder => "cylinder",
            Self::Sphere => "sphere",
        }
    }
}

/// Shape class of the obstacle: one of the object's shapes, or no obstacle.
///
/// Class indices: box 0, cylinder 1, sphere 2, none 3.
#[must_use]
pub const fn obstacle_class(shape: Option<ObjectShape>) -> usize {
    match shape {
        Some(shape) => shape.index(),
        None => NO_OBSTACLE,
    }
}

/// Class index of "no obstacle".
pub const NO_OBSTACLE: usize = 3;

/// The centre of mass `com_m` in the frame of its shape. A sphere looks the same in every frame; the one is taken in which the centre of mass
/// lies below the centre, so that a sphere in its frame is at rest and does not start to roll by its own weight.
#[must_use]
pub fn standard_com_m(shape: ObjectShape, com_m: [f64; 3]) -> [f64; 3] {
    match shape {
        ObjectShape::Box | ObjectShape::Cylinder => com_m,
        ObjectShape::Sphere => [0.0, 0.0, -com_m[2].abs()],
    }
}

/// Parameters of the target object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectTheta {
    /// Shape.
    pub shape: ObjectShape,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass relative to the centre of the shape, m, in the object's frame. That of a sphere is turned so that the centre of mass
    /// lies on its −z axis (see [`standard_com_m`]).
    pub com_m: [f64; 3],
    /// Coulomb friction coefficient with the table, in [0, 1].
    pub friction: f64,
    /// Sizes, m: box full lengths; cylinder (radius, height, 0); sphere (radius, 0, 0).
    pub size_m: [f64; 3],
}

/// Parameters of the obstacle. Whether it can move belongs to the domain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleTheta {
    /// Shape.
    pub shape: ObjectShape,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Sizes, m, as for the object.
    pub size_m: [f64; 3],
}

/// Θ: 12 continuous and 2 discrete values, and the parameters of effects that a scenario makes unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Theta {
    /// The target object.
    pub object: ObjectTheta,
    /// The obstacle; `None` where there is none.
    pub obstacle: Option<ObstacleTheta>,
    /// Unknown parameters of effects, none in most scenarios. Neither datasets nor the network's layout hold them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<EffectValue>,
}

/// The discrete values of Θ: names, and labels by class index.
pub const CLASS_TARGETS: [(&str, &[&str]); 2] =
    [("object_shape", &["box", "cylinder", "sphere"]), ("obstacle_shape", &["box", "cylinder", "sphere", "none"])];

/// Number of continuous values of Θ.
pub const THETA_LEN: usize = 12;

/// Names of the continuous values of Θ, in the order of [`Theta::continuous`].
pub const THETA_NAMES: [&str; THETA_LEN] = [
    "object_mass_kg",
    "object_com_x_m",
    "object_com_y_m",
    "object_com_z_m",
    "object_friction",
    "object_size_0_m",
    "object_size_1_m",
    "object_size_2_m",
    "obstacle_mass_kg",
    "obstacle_size_0_m",
    "obstacle_size_1_m",
    "obstacle_size_2_m",
];

impl Theta {
    /// The continuous values, in the order of [`THETA_NAMES`]; those that do not apply are 0.
    #[must_use]
    pub fn continuous(&self) -> [f64; THETA_LEN] {
        let o = &self.object;
        let mut values = [0.0; THETA_LEN];
        values[0] = o.mass_kg;
        values[1..4].copy_from_slice(&o.com_m);
        values[4] = o.friction;
        values[5..8].copy_from_slice(&o.size_m);
        if let Some(obstacle) = &self.obstacle {
            values[8] = obstacle.mass_kg;
            values[9..12].copy_from_slice(&obstacle.size_m);
        }
        values
    }

    /// Class indices of the object's and the obstacle's shape.
    #[must_use]
    pub fn classes(&self) -> [usize; 2] {
        [self.object.shape.index(), obstacle_class(self.obstacle.as_ref().map(|o| o.shape))]
    }

    /// Which continuous values mean something for these shapes, in the order of [`THETA_NAMES`].
    #[must_use]
    pub fn applies(&self) -> [bool; THETA_LEN] {
        let mut applies = [true; THETA_LEN];
        applies[1..3].fill(self.object.shape != ObjectShape::Sphere);
        for (i, flag) in applies[5..8].iter_mut().enumerate() {
            *flag = i < self.object.shape.size_count();
        }
        let obstacle_sizes = self.obstacle.as_ref().map_or(0, |o| o.shape.size_count());
        applies[8] = self.obstacle.is_some();
        for (i, flag) in applies[9..12].iter_mut().enumerate() {
            *flag = i < obstacle_sizes;
        }
        applies
    }

    /// Θ from continuous values (order of [`THETA_NAMES`]) and class indices. Values that do not apply to the classes are
    /// set to 0; no range is checked here: see [`crate::feasible::check_theta`].
    ///
    /// # Panics
    ///
    /// If a class index is out of range.
    #[must_use]
    pub fn from_parts(values: &[f64; THETA_LEN], classes: [usize; 2]) -> Self {
        let sizes = |shape: ObjectShape, v: &[f64]| {
            let mut size = [0.0; 3];
            size[..shape.size_count()].copy_from_slice(&v[..shape.size_count()]);
            size
        };
        let shape = ObjectShape::ALL[classes[0]];
        let obstacle = (classes[1] != NO_OBSTACLE).then(|| {
            let shape = ObjectShape::ALL[classes[1]];
            ObstacleTheta { shape, mass_kg: values[8], size_m: sizes(shape, &values[9..12]) }
        });
        Self {
            object: ObjectTheta {
                shape,
                mass_kg: values[0],
                com_m: standard_com_m(shape, [values[1], values[2], values[3]]),
                friction: values[4],
                size_m: sizes(shape, &values[5..8]),
            },
            obstacle,
            effects: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn theta_survives_the_way_to_vectors_and_back() {
        let theta = Theta {
            object: ObjectTheta {
                shape: ObjectShape::Cylinder,
                mass_kg: 0.5,
                com_m: [0.01, -0.02, 0.003],
                friction: 0.4,
                size_m: [0.03, 0.1, 0.0],
            },
            obstacle: Some(ObstacleTheta { shape: ObjectShape::Sphere, mass_kg: 2.0, size_m: [0.05, 0.0, 0.0] }),
            effects: Vec::new(),
        };
        assert_eq!(Theta::from_parts(&theta.continuous(), theta.classes()), theta);
        assert_eq!(theta.applies().iter().filter(|a| **a).count(), 5 + 2 + 1 + 1);
        let bare = Theta { obstacle: None, ..theta };
        assert_eq!(Theta::from_parts(&bare.continuous(), bare.classes()), bare);
        assert_eq!(bare.classes(), [1, NO_OBSTACLE]);
    }
}
