//! The object of a rig.

use std::sync::Arc;

use super::{Rig, RigError};
use crate::bodies::Beyond;
use crate::config::WorldConfig;
use crate::prism::Prism;
use crate::theta::{ObjectShape, ObjectTheta, Theta};

/// Shape and size of an object.
#[derive(Clone, Debug)]
pub enum RigShape {
    /// Box, cylinder or sphere.
    Solid {
        /// Shape.
        shape: ObjectShape,
        /// Sizes, m, as in [`ObjectTheta::size_m`].
        size_m: [f64; 3],
    },
    /// An extruded outline.
    Prism(Arc<Prism>),
}

/// The object of a hypothesis. Its frame has its origin in the centre of the shape.
#[derive(Clone, Debug)]
pub struct RigObject {
    /// Shape.
    pub shape: RigShape,
    /// Mass, kg, without what is added.
    pub mass_kg: f64,
    /// Its centre of mass, m, object frame; that of a sphere likewise.
    pub com_m: [f64; 3],
    /// Coulomb friction coefficient of the pair object–table.
    pub friction: f64,
    /// Inertia about that centre of mass along the object's axes, kg m²; `None`: that of a uniform solid of the shape.
    pub inertia_kgm2: Option<[f64; 3]>,
    /// Coefficient of restitution of contacts; `None`: that of the rig's world.
    pub restitution: Option<f64>,
    /// Known weight, kg: a point mass at the centre of the shape.
    pub added_mass_kg: f64,
    /// Whether a box or cylinder bears on its lower corners or on four points of its lower rim, always the same, and not on the points that the
    /// engine's search for contacts picks. Those of a rim jump about, so that a run depends on the last digits of its arguments: the yaw
    /// of a pushed cylinder by some hundredths. For objects that stay upright.
    pub on_points: bool,
}

impl RigObject {
    /// A uniform solid without added mass.
    #[must_use]
    pub fn new(shape: RigShape, mass_kg: f64, friction: f64) -> Self {
        Self {
            shape,
            mass_kg,
            com_m: [0.0; 3],
            friction,
            inertia_kgm2: None,
            restitution: None,
            added_mass_kg: 0.0,
            on_points: false,
        }
    }

    fn theta(&self) -> Theta {
        let (shape, size_m) = match &self.shape {
            RigShape::Solid { shape, size_m } => (*shape, *size_m),
            // For what asks for a size: the box around it.
            RigShape::Prism(prism) => (ObjectShape::Box, prism.size_m()),
        };
        let (mass_kg, com_m, friction) = (self.mass_kg, self.com_m, self.friction);
        let object = ObjectTheta { shape, mass_kg, com_m, friction, size_m };
        Theta { object, obstacle: None, effects: Vec::new() }
    }

    pub(super) fn beyond(&self) -> Beyond {
        Beyond {
            prism: match &self.shape {
                RigShape::Solid { .. } => None,
                RigShape::Prism(prism) => Some(prism.clone()),
            },
            inertia_kgm2: self.inertia_kgm2,
            added_mass_kg: self.added_mass_kg,
            on_points: self.on_points,
        }
    }

    /// Refuses what the engine could panic at.
    pub(super) fn check(&self) -> Result<(), RigError> {
        let refuse = |what, expected| Err(RigError::Object { what, expected });
        let positive = |v: f64| v > 0.0 && v <= 1e6;
        if let RigShape::Solid { shape, size_m } = &self.shape
            && !size_m[..shape.size_count()].iter().all(|v| *v >= 1e-4 && *v <= 10.0)
        {
            return refuse("size", "0.1 mm to 10 m");
        }
        if !positive(self.mass_kg) {
            return refuse("mass", "more than 0, up to 1e6 kg");
        }
        if !self.com_m.iter().all(|v| v.abs() <= 10.0) {
            return refuse("centre of mass", "within 10 m");
        }
        if !(0.0..=100.0).contains(&self.friction) {
            return refuse("friction", "0 to 100");
        }
        if !self.inertia_kgm2.iter().flatten().all(|v| positive(*v)) {
            return refuse("inertia", "more than 0, up to 1e6 kg m²");
        }
        if !self.restitution.is_none_or(|e| (0.0..=1.0).contains(&e)) {
            return refuse("restitution", "0 to 1");
        }
        if !(0.0..=1e6).contains(&self.added_mass_kg) {
            return refuse("added mass", "0 to 1e6 kg");
        }
        Ok(())
    }
}

impl Rig {
    /// World and Θ of a hypothesis before effects: what [`crate::EffectKind::neutral`] asks for. A prism appears as the box around it.
    #[must_use]
    pub fn nominal(&self, object: &RigObject) -> (WorldConfig, Theta) {
        let restitution = object.restitution.unwrap_or(self.world.restitution);
        (WorldConfig { restitution, ..self.world.clone() }, object.theta())
    }
}
