//! A number that re-tuning may change: its prior, and what it is of a rig.

use crate::clock::Clock;

/// The logarithm of the exponent of the cone of friction reaches as far either way: beyond, all pyramids are alike.
const CONE_RANGE: f64 = 3.0;

/// A number that re-tuning may change.
#[derive(Clone, Debug)]
pub struct Tunable {
    /// Key in `log.toml`.
    pub key: String,
    /// Prior mean.
    pub mean: f64,
    /// Prior standard deviation.
    pub stddev: f64,
    pub(crate) positive: bool,
    pub(crate) place: Place,
}

impl Tunable {
    /// Value at a coordinate.
    #[must_use]
    pub fn value(&self, z: f64) -> f64 {
        if !self.positive {
            return self.mean + z * self.stddev;
        }
        let value = self.mean * (z * self.stddev / self.mean).exp();
        if self.place == Place::Cone { value.clamp(CONE_RANGE.exp().recip(), CONE_RANGE.exp()) } else { value }
    }

    /// Makes `value` the mean. What no log says stays known to the same factor; the spread of what one says is its own.
    pub(crate) fn set(&mut self, value: f64) {
        if self.place.is_contact() {
            self.stddev *= value / self.mean;
        }
        self.mean = value;
    }

    /// What a value of it has to be.
    pub(crate) fn expected(&self) -> String {
        match self.place {
            Place::Cone => format!("{:.2} to {:.0}", CONE_RANGE.exp().recip(), CONE_RANGE.exp()),
            _ if self.positive => "more than 0".into(),
            _ => "a number".into(),
        }
    }

    /// Whether it can have a value: what is scaled is above 0.
    pub(crate) fn takes(&self, value: f64) -> bool {
        // As many digits as the limits are told with.
        let is_cone = |value: f64| value.ln().abs() < CONE_RANGE + 0.01;
        value.is_finite() && (!self.positive || value > 0.0) && (self.place != Place::Cone || is_cone(value))
    }

    /// The coordinate z of a value.
    #[must_use]
    pub fn coordinate(&self, value: f64) -> f64 {
        if self.positive {
            (value / self.mean).ln() * self.mean / self.stddev
        } else {
            (value - self.mean) / self.stddev
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    TableHeight,
    TableFriction,
    ToolFriction,
    Mass,
    Com(usize),
    Size(usize),
    Inertia(usize),
    Restitution,
    Clock(Clock),
    ContactFrequency,
    Cone,
    ContactDamping,
}

impl Place {
    /// What no log says: see [`crate::nominal`].
    pub(crate) fn is_contact(self) -> bool {
        matches!(self, Self::ContactFrequency | Self::ContactDamping | Self::Cone)
    }

    pub(crate) fn unit(self) -> &'static str {
        match self {
            Self::TableFriction | Self::ToolFriction | Self::Restitution | Self::ContactDamping | Self::Cone => "",
            Self::ContactFrequency => "Hz",
            Self::Clock(_) => "s",
            Self::TableHeight | Self::Com(_) | Self::Size(_) => "m",
            Self::Mass => "kg",
            Self::Inertia(_) => "kg·m²",
        }
    }
}
