//! What is written.

use physics_model::effect::Nominal;
use physics_model::effects::{ConstantForce, RollingResistance, Tether, ViscousDamping};
use physics_model::{EffectConfig, ObjectShape, Rig, RigObject, RigShape};

use crate::mass::Mass;

/// A rig with its object and effects, in SI units and the base frame.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// What the files are called in their comments, as a rule the log.
    pub name: &'a str,
    /// Of its world gravity, table and friction of the tool; the rest is the engine's own business.
    pub rig: Rig,
    /// The object without added weights.
    pub object: RigObject,
    /// Effects, in order.
    pub effects: Vec<EffectConfig>,
}

/// A scene with everything that effects change before a simulation begins.
pub(crate) struct Built {
    pub(crate) nominal: Nominal,
    pub(crate) gravity_mps2: [f64; 3],
    pub(crate) mass: Mass,
    /// Viscous damping, N·s/m.
    pub(crate) damping_nspm: f64,
    /// Constant force, N.
    pub(crate) force_n: [f64; 2],
    /// Stiffness, N/m, and place, m, of springs to the ground; several add up to one.
    pub(crate) tether: (f64, [f64; 2]),
    /// Lever of rolling, m.
    pub(crate) rolling_m: f64,
}

impl Scene<'_> {
    pub(crate) fn build(&self) -> Built {
        let (world, theta) = self.rig.nominal(&self.object);
        let mut nominal = Nominal::new(&world, &theta);
        let mut gravity_mps2 = [0.0, 0.0, -world.gravity_mps2];
        let (mut damping_nspm, mut force_n, mut rolling_m) = (0.0, [0.0; 2], 0.0);
        let (mut stiffness, mut moment) = (0.0, [0.0; 2]);
        for effect in &self.effects {
            let built = effect.build();
            built.gravity(&mut gravity_mps2);
            built.nominal(&mut nominal);
            match effect {
                EffectConfig::ViscousDamping(ViscousDamping { coefficient_nspm }) => damping_nspm += coefficient_nspm,
                EffectConfig::ConstantForce(ConstantForce { force_x_n, force_y_n }) => {
                    force_n = [force_n[0] + force_x_n, force_n[1] + force_y_n];
                }
                EffectConfig::Tether(Tether { stiffness_npm, anchor_x_m, anchor_y_m }) => {
                    stiffness += stiffness_npm;
                    moment = [moment[0] + stiffness_npm * anchor_x_m, moment[1] + stiffness_npm * anchor_y_m];
                }
                EffectConfig::RollingResistance(RollingResistance { lever_m }) => rolling_m += lever_m,
                _ => {}
            }
        }
        let anchor = if stiffness > 0.0 { moment.map(|m| m / stiffness) } else { [0.0; 2] };
        let mass = Mass::new(&self.object, &nominal.theta.object);
        Built { nominal, gravity_mps2, mass, damping_nspm, force_n, tether: (stiffness, anchor), rolling_m }
    }

    /// Whether the object rolls.
    pub(crate) fn rolls(&self) -> bool {
        matches!(self.object.shape, RigShape::Solid { shape: ObjectShape::Sphere, .. })
    }
}
