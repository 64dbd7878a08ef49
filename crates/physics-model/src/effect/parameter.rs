//! Continuous parameters of effects, described alike, so that a fitter can go through all of them.

use crate::config::WorldConfig;
use crate::error::EffectError;
use crate::theta::Theta;

/// The value at which a parameter has no effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Neutral {
    /// This value.
    Value(f64),
    /// None: the parameter says how or where the effect acts, while another one is neutral. A value to start from.
    Free(f64),
    /// The friction coefficient of the object.
    Friction,
    /// The natural frequency of the world's contacts.
    ContactFrequency,
    /// The damping ratio of the world's contacts.
    ContactDamping,
    /// The world's coefficient of restitution.
    Restitution,
}

/// Along which coordinate a parameter's effect is closest to linear: what a fitter should step in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// The value itself.
    Linear,
    /// Its reciprocal: a stiffness or limit whose neutral value is infinite.
    Reciprocal,
}

impl Scale {
    /// Coordinate of a value.
    #[must_use]
    pub fn coordinate(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Reciprocal => value.recip(),
        }
    }

    /// Value at a coordinate. A coordinate of 0 or below is that of an infinite value.
    #[must_use]
    pub fn value(self, coordinate: f64) -> f64 {
        match self {
            Self::Linear => coordinate,
            Self::Reciprocal if coordinate <= 0.0 => f64::INFINITY,
            Self::Reciprocal => coordinate.recip(),
        }
    }
}

/// A continuous parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Key in scenario files; it ends in the unit.
    pub name: &'static str,
    /// Unit, empty for a ratio.
    pub unit: &'static str,
    /// Range that real set-ups have.
    pub plausible: [f64; 2],
    /// Range outside which a scenario is refused.
    pub limits: [f64; 2],
    /// Where it has no effect.
    pub neutral: Neutral,
    /// Coordinate for fitting.
    pub scale: Scale,
}

impl Parameter {
    /// A parameter; the macro that lists it gives it its name.
    pub(crate) const fn new(unit: &'static str, plausible: [f64; 2], limits: [f64; 2], neutral: Neutral) -> Self {
        Self { name: "", unit, plausible, limits, neutral, scale: Scale::Linear }
    }

    /// The same, to be fitted as its reciprocal.
    pub(crate) const fn reciprocal(self) -> Self {
        Self { scale: Scale::Reciprocal, ..self }
    }

    /// The same under a name.
    pub(crate) const fn named(self, name: &'static str) -> Self {
        Self { name, ..self }
    }

    /// The value without effect in a world; for a [`Neutral::Free`] one the value to start from.
    #[must_use]
    pub fn neutral_in(&self, world: &WorldConfig, theta: &Theta) -> f64 {
        match self.neutral {
            Neutral::Value(value) | Neutral::Free(value) => value,
            Neutral::Friction => theta.object.friction,
            Neutral::ContactFrequency => world.contact_frequency_hz,
            Neutral::ContactDamping => world.contact_damping_ratio,
            Neutral::Restitution => world.restitution,
        }
    }

    /// Whether the effect is absent where this and its like are neutral, unlike a place or a direction.
    #[must_use]
    pub fn is_strength(&self) -> bool {
        !matches!(self.neutral, Neutral::Free(_))
    }

    /// A value in the middle of what is plausible: of the upper half where the neutral value lies inside.
    #[must_use]
    pub fn typical(&self) -> f64 {
        let [low, high] = self.plausible;
        match self.neutral {
            Neutral::Value(value) if low < value && value < high => 0.5 * (value + high),
            _ => 0.5 * (low + high),
        }
    }

    /// Whether `value` lies within the limits.
    pub(crate) fn check(&self, effect: &'static str, value: f64) -> Result<(), EffectError> {
        let [low, high] = self.limits;
        // Also false for NaN.
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(EffectError::OutOfRange { effect, key: self.name, value, low, high, unit: self.unit })
    }
}

/// An effect's values as a vector, in the order of [`Self::PARAMETERS`].
pub trait Parametric: Sized {
    /// Name in scenario files.
    const NAME: &'static str;
    /// Parameters.
    const PARAMETERS: &'static [Parameter];

    /// With the neutral or start values of all parameters; those of the world taken from the scenarios' base.
    fn start() -> Self;

    /// Values.
    fn values(&self) -> Vec<f64>;

    /// Sets as many values as there are parameters.
    fn set_values(&mut self, values: &[f64]);
}

/// The neutral value where no world is at hand: that of the scenarios' base.
pub(crate) const fn start_value(parameter: &Parameter) -> f64 {
    match parameter.neutral {
        Neutral::Value(value) | Neutral::Free(value) => value,
        Neutral::Friction => 0.4,
        Neutral::ContactFrequency => 60.0,
        Neutral::ContactDamping => 5.0,
        Neutral::Restitution => 0.0,
    }
}

/// Implements [`Parametric`] for a struct of `f64` fields: the fields are the keys.
macro_rules! parametric {
    ($effect:ident, $name:literal, { $($field:ident: $parameter:expr),+ $(,)? }) => {
        impl $crate::effect::Parametric for $effect {
            const NAME: &'static str = $name;
            const PARAMETERS: &'static [$crate::effect::Parameter] = &[$($parameter.named(stringify!($field))),+];

            fn start() -> Self {
                Self { $($field: $crate::effect::parameter::start_value(&$parameter)),+ }
            }

            fn values(&self) -> Vec<f64> {
                vec![$(self.$field),+]
            }

            fn set_values(&mut self, values: &[f64]) {
                let fields = [$(&mut self.$field),+];
                for (field, value) in fields.into_iter().zip(values) {
                    *field = *value;
                }
            }
        }
    };
}
pub(crate) use parametric;
