//! Parameters of effects that the robot does not know: a part of Θ.

use serde::{Deserialize, Serialize};

use super::{Effect, EffectConfig, EffectKind, Parameter};
use crate::error::EffectError;

/// One continuous parameter of one effect; written as `effect.parameter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct EffectParameter {
    kind: EffectKind,
    index: u8,
}

impl EffectParameter {
    /// The parameter `name` of an effect.
    ///
    /// # Errors
    ///
    /// [`EffectError::UnknownParameter`] if the effect has none of this name.
    pub fn new(kind: EffectKind, name: &str) -> Result<Self, EffectError> {
        let known = kind.parameters();
        match known.iter().position(|parameter| parameter.name == name) {
            Some(index) => Ok(Self { kind, index: index as u8 }),
            None => Err(EffectError::UnknownParameter {
                effect: kind.name(),
                name: name.into(),
                known: known.iter().map(|parameter| parameter.name).collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// Of which effect.
    #[must_use]
    pub fn kind(self) -> EffectKind {
        self.kind
    }

    /// Its description.
    #[must_use]
    pub fn parameter(self) -> &'static Parameter {
        &self.kind.parameters()[usize::from(self.index)]
    }
}

impl TryFrom<String> for EffectParameter {
    type Error = EffectError;

    fn try_from(text: String) -> Result<Self, EffectError> {
        let (effect, name) = text.split_once('.').unwrap_or((&text, ""));
        Self::new(effect.parse()?, name)
    }
}

impl From<EffectParameter> for String {
    fn from(parameter: EffectParameter) -> Self {
        format!("{}.{}", parameter.kind.name(), parameter.parameter().name)
    }
}

/// The value that a hypothesis has of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectValue {
    /// Parameter.
    pub parameter: EffectParameter,
    /// Value, in the parameter's unit.
    pub value: f64,
}

/// The effects of a list with the values of a hypothesis in their place: of every kind the first one takes them. Values of kinds that
/// are not in the list are not used: the true world and the model have lists of their own.
#[must_use]
pub fn build(list: &[EffectConfig], values: &[EffectValue]) -> Vec<Box<dyn Effect>> {
    let mut effects = list.to_vec();
    for value in values {
        if let Some(effect) = effects.iter_mut().find(|effect| effect.kind() == value.parameter.kind) {
            effect.set_value(usize::from(value.parameter.index), value.value);
        }
    }
    effects.iter().map(EffectConfig::build).collect()
}
