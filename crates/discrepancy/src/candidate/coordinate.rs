//! What a fit moves of an effect, in units within which it is plausible.

use physics_model::ObjectShape;
use physics_model::effect::parameter::{Parameter, Scale};
use physics_model::effect::{EffectConfig, EffectKind};

use super::{Context, Coordinate, STRENGTH_SHARE};

/// Standard deviation of where something is, m, around the place that a fit begins from.
const PLACE_M: f64 = 0.05;

pub(super) fn coordinates(base: &EffectConfig, context: &Context) -> Vec<Coordinate> {
    let kind = base.kind();
    let values = base.values();
    kind.parameters()
        .iter()
        .enumerate()
        .filter(|(index, _)| !left_alone(kind, *index, context))
        .map(|(index, parameter)| coordinate(kind, index, parameter, values[index], context))
        .collect()
}

/// What no log of this kind can say.
fn left_alone(kind: EffectKind, index: usize, context: &Context) -> bool {
    match kind {
        // Where a payload's centre is shows in torques alone.
        EffectKind::WristPayload => index > 0 && !(context.wrist_torques || context.joint_torques),
        // What is pushed stays upright, where the height of its centre hardly shows; of a sphere it does, which stays where it is in the table's frame.
        EffectKind::ComOffset => index == 2 && context.tool && context.theta.object.shape != ObjectShape::Sphere,
        _ => false,
    }
}

fn coordinate(kind: EffectKind, index: usize, parameter: &Parameter, value: f64, context: &Context) -> Coordinate {
    let scale = parameter.scale;
    let origin = scale.coordinate(value);
    if !parameter.is_strength() {
        let unit = match (kind, parameter.unit) {
            (EffectKind::Tether, _) => 0.1,
            (EffectKind::WristPayload, _) => 0.04,
            (_, "m") if parameter.name.ends_with("radius_m") => 0.02,
            (_, "m") => PLACE_M,
            (_, "rad") => 0.4,
            (_, "m/s") => 0.02,
            _ => 0.5 * (parameter.plausible[1] - parameter.plausible[0]).abs(),
        };
        let ends = parameter.limits.map(|limit| (limit - origin) / unit);
        return Coordinate { index, origin, unit, range: [ends[0].max(-5.0), ends[1].min(5.0)], strength: false };
    }
    let [low, high] = if kind == EffectKind::ForceSaturation {
        // What was never reached clips nothing.
        [0.3 * context.largest_force_n.max(0.1), f64::INFINITY]
    } else {
        parameter.plausible
    };
    let [a, b] = [scale.coordinate(low), scale.coordinate(high)];
    let farthest = if (a - origin).abs() > (b - origin).abs() { a } else { b };
    let unit = STRENGTH_SHARE * (farthest - origin).abs().max(1e-9) * beyond_usual(kind, context);
    // One that is plausible on one side alone is looked for there.
    let (least, most) = (a.min(b), a.max(b));
    let tolerance = 1e-9 * unit;
    let below = if least < origin - tolerance { -FARTHEST } else { 0.0 };
    let above = if most > origin + tolerance { FARTHEST } else { 0.0 };
    let [from, to] = match scale {
        Scale::Linear => parameter.limits,
        Scale::Reciprocal => [0.0, scale.coordinate(parameter.limits[0])],
    };
    let range = [((from - origin) / unit).max(below), ((to - origin) / unit).min(above)];
    Coordinate { index, origin, unit, range, strength: true }
}

/// How far a strength is looked for, in standard deviations of its prior: eight times as strong as plausible. What is stronger than plausible is named
/// all the same; the prior says what that costs.
const FARTHEST: f64 = 12.0;

/// The force, N, and the speed, m/s, up to which the catalogue's ranges are those of a push. Beyond, a sensor may be off by as much more, and a drag be as
/// much weaker and still make the same force.
const PUSH_N: f64 = 20.0;
const PUSH_MPS: f64 = 0.5;

/// How many times as large a strength is as in a push.
fn beyond_usual(kind: EffectKind, context: &Context) -> f64 {
    let (force, speed) = ((context.usual_force_n / PUSH_N).max(1.0), (PUSH_MPS / context.usual_speed_mps).min(1.0));
    match kind {
        EffectKind::ForceBias | EffectKind::ForceDrift | EffectKind::WristPayload => force,
        EffectKind::ViscousDamping => speed,
        EffectKind::QuadraticDrag => speed * speed,
        _ => 1.0,
    }
}
