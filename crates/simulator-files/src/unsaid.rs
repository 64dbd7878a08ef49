//! What a format has no words for.

use physics_model::{EffectConfig, EffectKind};

/// A simulator's format.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Mjcf,
    Urdf,
}

/// How a format says an effect, or what to do instead.
pub(crate) fn instead(effect: &EffectConfig, format: Format, rolls: bool) -> Option<String> {
    use EffectKind as K;
    let kind = effect.kind();
    let in_urdf = matches!(kind, K::FrictionLevel | K::ComOffset);
    let in_mjcf = in_urdf
        || matches!(kind, K::TableTilt | K::ViscousDamping | K::ConstantForce | K::Tether | K::PressureDistribution)
        || matches!(kind, K::HiddenObstacle)
        || kind == K::RollingResistance && rolls;
    // A body that does not roll has no rolling resistance.
    let idle = kind == K::RollingResistance && !rolls;
    if idle || (format == Format::Mjcf && in_mjcf) || (format == Format::Urdf && in_urdf) {
        return None;
    }
    let advice = match kind {
        K::ActuationDelay => "delay the commands: in MuJoCo by `delay` and `nsample` of your actuators",
        K::ActuatorGain => "multiply the moves that are commanded",
        K::Backlash | K::ArmCompliance => "change the joints of your arm",
        K::JointFriction => "set friction and damping of your arm's joints",
        K::WristPayload => "add a body of this mass and centre to the hand",
        K::ForceBias
        | K::ForceDrift
        | K::ForceGain
        | K::ForceLowPass
        | K::ForceSaturation
        | K::ForceDelay
        | K::PoseOffset
        | K::PoseDelay
        | K::PoseScale
        | K::PoseRotation
        | K::TimeBase => "the sensor does this, not the scene: undo it in the readings, or do it to simulated ones",
        K::TableTilt => "turn gravity in the world's file",
        K::ConstantForce | K::Tether | K::ViscousDamping | K::QuadraticDrag | K::RollingResistance | K::Adhesion => {
            "apply this force in each step"
        }
        K::MassLeak => "change mass and inertia in each step",
        K::StribeckFriction | K::StaticFriction | K::AnisotropicFriction | K::FrictionPatch => {
            "change the friction of each contact in each step"
        }
        K::Restitution | K::ContactCompliance => "tune the contacts of your simulator: each has its own law",
        K::PressureDistribution | K::EdgeRounding => "change the geometry that touches the table",
        K::HiddenObstacle => "add this body to the world's file",
        K::FrictionLevel | K::ComOffset => "",
    };
    Some(format!("{}: {advice}", describe(effect)))
}

/// Name and values.
fn describe(effect: &EffectConfig) -> String {
    let values = effect.kind().parameters().iter().zip(effect.values());
    let values: Vec<String> = values.map(|(p, value)| format!("{} = {} {}", p.name, number(value), p.unit)).collect();
    let values: Vec<&str> = values.iter().map(|value| value.trim_end()).collect();
    format!("{} ({})", effect.kind().name(), values.join(", "))
}

/// Comment lines of what is not said.
pub(crate) fn notes(effects: &[EffectConfig], format: Format, rolls: bool) -> String {
    let unsaid: Vec<String> = effects.iter().filter_map(|effect| instead(effect, format, rolls)).collect();
    if unsaid.is_empty() {
        return "Every effect of the model is in this file.".into();
    }
    let lines: String = unsaid.iter().map(|line| format!("\n    - {line}")).collect();
    format!("NOT in this file, as the format has no words for it:{lines}")
}

/// Text as a comment of XML may have it.
pub(crate) fn comment(text: &str) -> String {
    let plain: String = text.chars().filter(|c| *c == '\n' || !c.is_control()).collect();
    // Twice, as three dashes leave two.
    plain.replace("--", "- -").replace("--", "- -")
}

/// A number as files take it: its shortest form that is read back to the same.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 { "0".into() } else { format!("{value:?}") }
}

/// Numbers with spaces between them.
pub(crate) fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(number).collect::<Vec<_>>().join(" ")
}
