//! The seam for physical effects that a rigid-body world lacks: the true world and the model each have their own list.
//!
//! An effect acts at one or more of five places, and a scenario may list any combination. Lists apply in their order.
//!
//! | place | hook | called |
//! |---|---|---|
//! | N, what the engine has of its own | [`Effect::gravity`], [`Effect::nominal`], [`Effect::mass_share`] | when a world is built (mass: each step) |
//! | K, friction of a contact with the table | [`Effect::friction`] | each contact, each step |
//! | F, force on a body | [`Effect::load`], [`Effect::attraction`] | each step |
//! | A, command of the tool | [`Effect::command`], [`Effect::joint_friction`] | each step |
//! | O, what the sensors say | [`Effect::force`], [`Effect::read`], [`Effect::pose_delay_secs`] | each step |
//!
//! [`Effect::hooks`] says which of these do anything, so that a world asks for nothing that nobody answers.
//!
//! # What carries over from one action to the next
//!
//! Worlds and signal chains live for one action. Between actions the arm stands still and signals settle: a low-pass filter starts at
//! its first reading, a delay line at its first value, a compliant arm unloaded where it stands. [`Memory`] keeps the rest: the time since
//! the episode began, how far the play of each joint is taken up, by how much the pose that was read lags behind, and the hidden bodies. A
//! run of a [`crate::rig`], tick by tick, keeps its chains for a whole episode instead.

pub mod catalogue;
pub mod memory;
pub mod parameter;
pub mod sheet;
pub mod signal;
pub mod unknown;

use crate::config::WorldConfig;
use crate::robot::JointVector;
use crate::state::BodyState;
use crate::theta::{ObjectShape, Theta};

pub use catalogue::{EffectConfig, EffectKind};
pub use memory::Memory;
pub use parameter::{Neutral, Parameter, Parametric, Scale};
pub use sheet::{Sheet, SheetRow};
pub use signal::{CommandFilter, CommandSpace, CommandStart, ForceFilter, ToolMoment};
pub use unknown::{EffectParameter, EffectValue};

/// Which free body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyRole {
    /// The target object.
    Object,
    /// The obstacle of Θ, if it can move.
    Obstacle,
    /// An obstacle that only an effect knows of.
    Hidden,
}

/// A free body as an effect sees it, before each control step. SI units, base axes.
#[derive(Clone, Copy, Debug)]
pub struct BodyView {
    /// Which body.
    pub role: BodyRole,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Friction coefficient with the table.
    pub friction: f64,
    /// Radius, m, of a body that rolls (sphere); `None` for others.
    pub rolling_radius_m: Option<f64>,
    /// Whether the body rests on or touches the table.
    pub on_table: bool,
    /// Centre of the shape, m.
    pub position_m: [f64; 3],
    /// Velocity of the centre of mass, m/s.
    pub linear_mps: [f64; 3],
    /// Angular velocity, rad/s.
    pub angular_rps: [f64; 3],
}

/// Force and torque that an effect exerts on a body at its centre of mass, base axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Torque, N·m.
    pub torque_nm: [f64; 3],
}

/// What an effect may know of the world.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Magnitude of gravity, m/s².
    pub gravity_mps2: f64,
    /// Duration of a control step, s.
    pub period_secs: f64,
}

/// A point at which a free body touches the table.
#[derive(Clone, Copy, Debug)]
pub struct TableContact {
    /// Where, m, base frame.
    pub position_m: [f64; 3],
    /// Velocity of the body's point over the table, m/s, base axes.
    pub slip_mps: [f64; 3],
}

impl TableContact {
    /// Speed of the slip, m/s.
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.slip_mps.iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

/// A body that only an effect knows of. It stands upright on the table.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenBody {
    /// Shape.
    pub shape: ObjectShape,
    /// Sizes, m, as for the object.
    pub size_m: [f64; 3],
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre x and y, m, base frame.
    pub place_m: [f64; 2],
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// Whether it can move.
    pub movable: bool,
}

/// What a world is built from, for an effect to change.
#[derive(Clone, Debug)]
pub struct Nominal {
    /// World.
    pub world: WorldConfig,
    /// Θ.
    pub theta: Theta,
    /// Where the object bears on the table, as a share of the way from its centre to the corners or the rim; `None`: as the engine finds contacts.
    pub support_share: Option<f64>,
    /// Radius, m, of the object's edges and corners; 0: sharp.
    pub edge_radius_m: f64,
    /// Stiffness, N/m, of the spring that holds the tool; infinite for a tool that is where it is commanded to be.
    pub tool_stiffness_npm: f64,
    /// Bodies that Θ knows nothing of.
    pub hidden: Vec<HiddenBody>,
}

impl Nominal {
    /// Of a world without effects.
    #[must_use]
    pub fn new(world: &WorldConfig, theta: &Theta) -> Self {
        Self {
            world: world.clone(),
            theta: theta.clone(),
            support_share: None,
            edge_radius_m: 0.0,
            tool_stiffness_npm: f64::INFINITY,
            hidden: Vec::new(),
        }
    }

    /// What `effects` make of it; `None` where none changes anything.
    #[must_use]
    pub fn with_effects(world: &WorldConfig, theta: &Theta, effects: &[Box<dyn Effect>]) -> Option<Self> {
        Hooks::of(effects).contains(Hooks::NOMINAL).then(|| {
            let mut nominal = Self::new(world, theta);
            for effect in effects {
                effect.nominal(&mut nominal);
            }
            nominal
        })
    }
}

/// A set of hooks: what an effect, or a list of them, changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hooks(u16);

impl Hooks {
    /// None.
    pub const NONE: Self = Self(0);
    /// [`Effect::gravity`].
    pub const GRAVITY: Self = Self(1);
    /// [`Effect::nominal`].
    pub const NOMINAL: Self = Self(1 << 1);
    /// [`Effect::mass_share`].
    pub const MASS: Self = Self(1 << 2);
    /// [`Effect::friction`].
    pub const FRICTION: Self = Self(1 << 3);
    /// [`Effect::load`].
    pub const LOAD: Self = Self(1 << 4);
    /// [`Effect::attraction`].
    pub const ATTRACTION: Self = Self(1 << 5);
    /// [`Effect::command`], or a tool that does not follow its command exactly.
    pub const COMMAND: Self = Self(1 << 6);
    /// [`Effect::joint_friction`].
    pub const JOINT_FRICTION: Self = Self(1 << 7);
    /// [`Effect::force`].
    pub const FORCE: Self = Self(1 << 8);
    /// [`Effect::read`] and its inverse.
    pub const POSE: Self = Self(1 << 9);
    /// [`Effect::pose_delay_secs`].
    pub const POSE_DELAY: Self = Self(1 << 10);
    /// A body at rest may start to move by itself.
    pub const UNREST: Self = Self(1 << 11);
    /// Tool or bodies may touch where the state and the course of the tool do not let it expect: all of the tool is simulated.
    pub const ASTRAY: Self = Self(1 << 14);
    /// Needs [`Memory`].
    pub const MEMORY: Self = Self(1 << 12);
    /// [`Effect::command`] of joints alone: a kinematic arm is then commanded by its joints.
    pub const JOINT_COMMAND: Self = Self(1 << 13);

    /// All of both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// These if `condition`, else none.
    #[must_use]
    pub const fn when(self, condition: bool) -> Self {
        if condition { self } else { Self::NONE }
    }

    /// Whether any of `other` is among these.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// All hooks of a list.
    #[must_use]
    pub fn of(effects: &[Box<dyn Effect>]) -> Self {
        effects.iter().fold(Self::NONE, |all, effect| all.and(effect.hooks()))
    }
}

/// A list of effects, and what they change together.
#[derive(Clone, Copy, Debug)]
pub struct Effects<'a> {
    /// The effects, in the order in which they apply.
    pub list: &'a [Box<dyn Effect>],
    /// All hooks of the list.
    pub hooks: Hooks,
}

impl<'a> Effects<'a> {
    /// Of a list.
    #[must_use]
    pub fn new(list: &'a [Box<dyn Effect>]) -> Self {
        Self { list, hooks: Hooks::of(list) }
    }
}

/// One named effect. Every method but [`Self::hooks`] does nothing unless it is overridden; an effect that overrides one names it there.
pub trait Effect: Send + Sync + std::fmt::Debug {
    /// Which of the methods below do something with the parameters as they are.
    fn hooks(&self) -> Hooks;

    /// Gravity vector, m/s², base axes: changed in place.
    fn gravity(&self, _gravity_mps2: &mut [f64; 3]) {}

    /// What the world is built from: changed in place.
    fn nominal(&self, _nominal: &mut Nominal) {}

    /// Share of its mass that the object has left `time_secs` after the episode began.
    fn mass_share(&self, _time_secs: f64) -> f64 {
        1.0
    }

    /// Factor on the friction coefficient of a free body at a contact with the table.
    fn friction(&self, _contact: &TableContact) -> f64 {
        1.0
    }

    /// Load on a free body during the next control step; added to `load`.
    fn load(&self, _surroundings: &Surroundings, _body: &BodyView, _load: &mut Load) {}

    /// Attraction, N, between tool and object whose surfaces are `gap_m` apart (negative: overlap).
    fn attraction(&self, _gap_m: f64) -> f64 {
        0.0
    }

    /// What becomes of the commanded positions, from `start` on.
    fn command(&self, _start: &CommandStart) -> Option<Box<dyn CommandFilter>> {
        None
    }

    /// Friction torques of the joints, N·m, at `rate_rps`: against the motion; added to `torque_nm`.
    fn joint_friction(&self, _rate_rps: &[f64], _torque_nm: &mut JointVector) {}

    /// What becomes of the force that the sensors read, every `period_secs`.
    fn force(&self, _period_secs: f64) -> Option<Box<dyn ForceFilter>> {
        None
    }

    /// What the pose sensor says of a body: changed in place.
    fn read(&self, _body: &mut BodyState) {}

    /// Inverse of [`Self::read`]: the state behind a reading.
    fn unread(&self, _body: &mut BodyState) {}

    /// How old a pose is when it is read, s.
    fn pose_delay_secs(&self) -> f64 {
        0.0
    }
}

#[cfg(test)]
impl BodyView {
    /// A free body of `mass_kg` on the table, for closed forms.
    pub(crate) fn on_table(mass_kg: f64) -> Self {
        Self {
            role: BodyRole::Object,
            mass_kg,
            friction: 0.4,
            rolling_radius_m: None,
            on_table: true,
            position_m: [0.0; 3],
            linear_mps: [0.0; 3],
            angular_rps: [0.0; 3],
        }
    }
}
