//! All effects, as scenarios name them and as a fitter goes through them.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Effect, Parameter, Parametric};
use crate::config::WorldConfig;
use crate::effects::*;
use crate::error::EffectError;
use crate::theta::Theta;

macro_rules! catalogue {
    ($($effect:ident: $description:literal),+ $(,)?) => {
        /// An effect as a scenario names it.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum EffectConfig {
            $(#[doc = $description] $effect($effect),)+
        }

        /// Name of an effect without its values.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum EffectKind {
            $(#[doc = $description] $effect,)+
        }

        impl EffectKind {
            /// All effects, in the order of the catalogue.
            pub const ALL: &'static [Self] = &[$(Self::$effect),+];

            /// Name in scenario files and reports.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$effect => <$effect as Parametric>::NAME,)+ }
            }

            /// One line on what it does.
            #[must_use]
            pub const fn description(self) -> &'static str {
                match self { $(Self::$effect => $description,)+ }
            }

            /// Continuous parameters, in the order of [`EffectConfig::values`].
            #[must_use]
            pub const fn parameters(self) -> &'static [Parameter] {
                match self { $(Self::$effect => <$effect as Parametric>::PARAMETERS,)+ }
            }

            /// The effect with neutral or start values, those of the world taken from the scenarios' base.
            #[must_use]
            pub fn start(self) -> EffectConfig {
                match self { $(Self::$effect => EffectConfig::$effect($effect::start()),)+ }
            }
        }

        impl EffectConfig {
            /// Which effect.
            #[must_use]
            pub const fn kind(&self) -> EffectKind {
                match self { $(Self::$effect(_) => EffectKind::$effect,)+ }
            }

            /// Values of the continuous parameters, in the order of [`EffectKind::parameters`].
            #[must_use]
            pub fn values(&self) -> Vec<f64> {
                match self { $(Self::$effect(effect) => effect.values(),)+ }
            }

            fn set_values(&mut self, values: &[f64]) {
                match self { $(Self::$effect(effect) => effect.set_values(values),)+ }
            }

            /// The effect, ready to use.
            #[must_use]
            pub fn build(&self) -> Box<dyn Effect> {
                match self { $(Self::$effect(effect) => Box::new(effect.clone()),)+ }
            }
        }
    };
}

// The order is that of the catalogue; along one signal (command, force, pose) it is also that of the physical parts.
catalogue! {
    ViscousDamping: "F = −c v.",
    QuadraticDrag: "F = −k |v| v.",
    FrictionLevel: "Another friction coefficient of object and table.",
    StribeckFriction: "More friction in slow slip.",
    StaticFriction: "More friction before the slip.",
    AnisotropicFriction: "Friction that depends on the direction of the slip.",
    FrictionPatch: "Other friction at a place of the table.",
    PressureDistribution: "The object bears on points nearer to its centre.",
    RollingResistance: "Torque c_rr N against rolling.",
    TableTilt: "The table is not level.",
    ConstantForce: "A force on the object.",
    Tether: "A spring from the object to a point.",
    ComOffset: "The centre of mass is elsewhere.",
    EdgeRounding: "Edges and corners are round.",
    MassLeak: "The object loses mass.",
    Restitution: "Bodies bounce.",
    ContactCompliance: "Another stiffness and damping of contacts.",
    ArmCompliance: "The tool gives way to forces.",
    ActuatorGain: "Moves are longer or shorter than commanded.",
    Backlash: "Joints have play.",
    ActuationDelay: "Commands take time.",
    JointFriction: "Joints have friction.",
    WristPayload: "The hand carries an unknown mass.",
    ForceBias: "The force sensor has an offset.",
    ForceDrift: "The force sensor's offset grows.",
    ForceGain: "The force sensor has another gain.",
    ForceLowPass: "The force sensor is slow.",
    ForceSaturation: "The force sensor has an end of its range.",
    ForceDelay: "Forces are read late.",
    PoseOffset: "Poses are read beside where they are.",
    PoseDelay: "Poses are read late.",
    PoseScale: "Distances are read longer or shorter.",
    TimeBase: "The clock of the readings is fast or slow.",
    PoseRotation: "The pose sensor's frame is turned about the vertical.",
    HiddenObstacle: "A body that Θ knows nothing of.",
    Adhesion: "Tool and object stick together.",
}

impl EffectKind {
    /// The effect of these values, in the order of [`Self::parameters`]; what is not continuous is as in [`Self::start`].
    ///
    /// # Errors
    ///
    /// [`EffectError`] for another number of values, or one outside its limits.
    pub fn from_parameters(self, values: &[f64]) -> Result<EffectConfig, EffectError> {
        self.start().with_parameters(values)
    }

    /// The effect that changes nothing in a world.
    #[must_use]
    pub fn neutral(self, world: &WorldConfig, theta: &Theta) -> EffectConfig {
        let mut effect = self.start();
        let values: Vec<f64> = self.parameters().iter().map(|parameter| parameter.neutral_in(world, theta)).collect();
        effect.set_values(&values);
        effect
    }

    /// The effect once for every choice of what is not continuous, each with the values of [`Self::start`].
    #[must_use]
    pub fn variants(self) -> Vec<EffectConfig> {
        match self {
            Self::HiddenObstacle => HiddenObstacle::choices().into_iter().map(EffectConfig::HiddenObstacle).collect(),
            kind => vec![kind.start()],
        }
    }
}

impl FromStr for EffectKind {
    type Err = EffectError;

    fn from_str(name: &str) -> Result<Self, EffectError> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name).ok_or_else(|| EffectError::Unknown {
            name: name.into(),
            known: Self::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", "),
        })
    }
}

impl EffectConfig {
    /// The same with other values, in the order of [`EffectKind::parameters`].
    ///
    /// # Errors
    ///
    /// [`EffectError`] for another number of values, or one outside its limits.
    pub fn with_parameters(&self, values: &[f64]) -> Result<Self, EffectError> {
        let kind = self.kind();
        let expected = kind.parameters().len();
        if values.len() != expected {
            return Err(EffectError::Count { effect: kind.name(), expected, found: values.len() });
        }
        let mut effect = self.clone();
        effect.set_values(values);
        effect.check()?;
        Ok(effect)
    }

    /// The same in other units: each continuous value times the factor of its parameter, unchecked.
    #[must_use]
    pub fn scaled(&self, factor: impl Fn(&Parameter) -> f64) -> Self {
        let scaled =
            self.kind().parameters().iter().zip(self.values()).map(|(parameter, value)| factor(parameter) * value);
        let mut effect = self.clone();
        effect.set_values(&scaled.collect::<Vec<f64>>());
        effect
    }

    /// Sets one continuous value, unchecked.
    pub(crate) fn set_value(&mut self, index: usize, value: f64) {
        let mut values = self.values();
        values[index] = value;
        self.set_values(&values);
    }

    /// Whether all parameters are within their limits.
    ///
    /// # Errors
    ///
    /// [`EffectError::OutOfRange`] for the first that is not.
    pub fn check(&self) -> Result<(), EffectError> {
        let kind = self.kind();
        kind.parameters()
            .iter()
            .zip(self.values())
            .try_for_each(|(parameter, value)| parameter.check(kind.name(), value))
    }

    /// What is wrong with the parameters, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        self.check().err().map(|error| error.to_string())
    }
}
