//! A number of the nominal model: fixed, or known with an uncertainty.

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};

/// A number of the nominal model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// Known: re-tuning leaves it alone.
    Fixed(f64),
    /// The re-tuning prior, a Gaussian.
    Uncertain {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        stddev: f64,
    },
}

impl Number {
    /// The value or the mean.
    #[must_use]
    pub fn mean(self) -> f64 {
        match self {
            Self::Fixed(value) => value,
            Self::Uncertain { mean, .. } => mean,
        }
    }

    /// The standard deviation, 0 where it is fixed.
    #[must_use]
    pub fn stddev(self) -> f64 {
        match self {
            Self::Fixed(_) => 0.0,
            Self::Uncertain { stddev, .. } => stddev,
        }
    }

    /// As TOML.
    pub(crate) fn to_toml(self) -> String {
        match self {
            Self::Fixed(value) => format!("{value:?}"),
            Self::Uncertain { mean, stddev } => format!("{{ mean = {mean:?}, stddev = {stddev:?} }}"),
        }
    }
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        Self::Fixed(value)
    }
}

// By hand, because serde's untagged enums answer a misspelt key with "no variant matches".
impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Number;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number or { mean = …, stddev = … }")
            }

            fn visit_f64<E>(self, value: f64) -> Result<Number, E> {
                Ok(Number::Fixed(value))
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Number, E> {
                exact(value).map(Number::Fixed).ok_or_else(|| E::custom("an integer beyond 2^53"))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Number, A::Error> {
                #[derive(serde::Deserialize)]
                #[serde(deny_unknown_fields)]
                struct Gaussian {
                    mean: f64,
                    stddev: f64,
                }
                let both = Gaussian::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
                Ok(Number::Uncertain { mean: both.mean, stddev: both.stddev })
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// `value` as a float, if that loses nothing.
#[expect(clippy::cast_precision_loss, reason = "bounded first")]
fn exact(value: i64) -> Option<f64> {
    (value.unsigned_abs() <= 1 << 53).then_some(value as f64)
}
