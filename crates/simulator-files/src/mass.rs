//! Mass, its centre and its inertia.

use nalgebra::Matrix3;
use physics_model::{ObjectShape, ObjectTheta, RigObject, RigShape};

/// Mass properties of an object.
pub(crate) struct Mass {
    /// kg.
    pub(crate) mass_kg: f64,
    /// Centre of mass, m, object frame.
    pub(crate) com_m: [f64; 3],
    /// About the centre of mass, kg m², object axes.
    pub(crate) inertia_kgm2: Matrix3<f64>,
}

impl Mass {
    /// Of an object of which effects have made `theta`.
    pub(crate) fn new(object: &RigObject, theta: &ObjectTheta) -> Self {
        let mass_kg = theta.mass_kg;
        let diagonal = |moments: [f64; 3]| Matrix3::from_diagonal(&moments.into());
        let inertia_kgm2 = match (object.inertia_kgm2, &object.shape) {
            (Some(moments), _) => diagonal(moments),
            (None, RigShape::Prism(prism)) => prism.inertia_kgm2(mass_kg),
            (None, RigShape::Solid { shape, size_m }) => diagonal(uniform(*shape, *size_m).map(|m| m * mass_kg)),
        };
        Self { mass_kg, com_m: theta.com_m, inertia_kgm2 }
    }

    /// xx, yy, zz, xy, xz, yz.
    pub(crate) fn moments(&self) -> [f64; 6] {
        let m = &self.inertia_kgm2;
        [m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(0, 1)], m[(0, 2)], m[(1, 2)]]
    }
}

/// Moments of a uniform solid of 1 kg about its axes, m².
pub(crate) fn uniform(shape: ObjectShape, size_m: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = size_m;
    match shape {
        ObjectShape::Box => [(b * b + c * c) / 12.0, (a * a + c * c) / 12.0, (a * a + b * b) / 12.0],
        ObjectShape::Cylinder => {
            let across = (3.0 * a * a + b * b) / 12.0;
            [across, across, a * a / 2.0]
        }
        ObjectShape::Sphere => [0.4 * a * a; 3],
    }
}
