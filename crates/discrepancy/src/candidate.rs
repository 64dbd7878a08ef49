//! Every effect of the catalogue as coordinates that a fit can go along, and the places to begin from.
//!
//! A coordinate a moves a parameter from its neutral or starting value by a · unit, in the parameter's own scale (its reciprocal for
//! stiffnesses and limits). Units are such that N(0, 1) covers what is plausible: the prior of a fit.

use physics_model::config::WorldConfig;
use physics_model::effect::{EffectConfig, EffectKind};
use physics_model::{ObjectShape, Theta};

use crate::obstacle::Place;

mod coordinate;

use coordinate::coordinates;

/// Of the distance from the neutral to the farthest plausible value: one standard deviation of the prior of a strength.
const STRENGTH_SHARE: f64 = 1.0 / 1.5;
/// A coefficient of restitution, where the model has none, below which contacts of another engine part as fast. Of 20 logs of arms (seed 30 of the benchmark) one
/// without an effect was told 0.05.
const LEAST_BOUNCE: f64 = 0.1;
/// Anisotropies that are tried along every axis.
const AMPLITUDES: [f64; 2] = [0.04, 0.1];
/// Limits of a force sensor, as shares of the largest force that was read, from one that acts along an axis to one along a space diagonal.
const CLIPS: [f64; 4] = [1.0, 0.85, 0.7, 0.58];
/// Coefficients of restitution that are tried.
const BOUNCES: [f64; 7] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7];
/// Places of a patch that are tried.
const PATCHES: usize = 6;
/// Standard deviation of where a body in the way is, m, around the place that a fit begins from: it is seen to within a few millimetres. Its radius is known
/// twice as well.
const OBSTACLE_M: f64 = 0.01;

/// What is known of the log before any effect is tried.
#[derive(Clone, Debug)]
pub struct Context {
    /// The nominal world.
    pub world: WorldConfig,
    /// The nominal object.
    pub theta: Theta,
    /// Places over which the object moves, m, base frame: centres of clusters.
    pub places_m: Vec<[f64; 2]>,
    /// Where something may stand in the way.
    pub obstacles_m: Vec<Place>,
    /// Where the table may be rougher or smoother, as forces say; none without them.
    pub patches_m: Vec<Place>,
    /// Largest force that was read, N; 0 without a sensor.
    pub largest_force_n: f64,
    /// The same of all but one in a hundred readings.
    pub usual_force_n: f64,
    /// Speed of the object, m/s, of all but one in twenty tenths of a second.
    pub usual_speed_mps: f64,
    /// Whether there is a tool that is commanded.
    pub tool: bool,
    /// Whether the object is an outline that was extruded.
    pub outline: bool,
    /// Whether the log has forces at the wrist or torques of joints.
    pub forces: bool,
    /// Whether there is an arm with joints.
    pub joints: bool,
    /// Whether torques at the wrist were measured.
    pub wrist_torques: bool,
    /// Whether torques of joints were measured.
    pub joint_torques: bool,
}

/// One coordinate of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinate {
    /// Index of the parameter in the effect.
    pub index: usize,
    /// Value where a = 0, in the parameter's scale.
    pub origin: f64,
    /// Change of the scaled value for a = 1.
    pub unit: f64,
    /// Range of a.
    pub range: [f64; 2],
    /// Whether the effect is absent at a = 0 of this and its like.
    pub strength: bool,
}

/// An effect from a place to begin from.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The effect with neutral strengths and the starting values of the rest.
    pub base: EffectConfig,
    /// Continuous coordinates that a fit moves.
    pub coordinates: Vec<Coordinate>,
    /// Coordinates that a fit starts from for what has no small version of itself (a body in the way); `None`: from 0.
    pub begin: Option<Vec<f64>>,
}

impl Candidate {
    /// Kind of the effect.
    #[must_use]
    pub fn kind(&self) -> EffectKind {
        self.base.kind()
    }

    /// Kind of the effect, and whether it moves: a body in the way that does is another model than one that does not.
    #[must_use]
    pub fn variant(&self) -> (EffectKind, bool) {
        let moves = matches!(&self.base, EffectConfig::HiddenObstacle(obstacle) if obstacle.movable);
        (self.kind(), moves)
    }

    /// Whether a log may have several of its kind, each at a place of its own.
    #[must_use]
    pub fn tied_to_a_place(&self) -> bool {
        matches!(self.kind(), EffectKind::FrictionPatch | EffectKind::HiddenObstacle)
    }

    /// The effect at coordinates `a`, one for each of [`Self::coordinates`]; they are held within their ranges.
    #[must_use]
    pub fn effect(&self, a: &[f64]) -> EffectConfig {
        let mut values = self.base.values();
        let parameters = self.kind().parameters();
        for (coordinate, a) in self.coordinates.iter().zip(a) {
            let a = a.clamp(coordinate.range[0], coordinate.range[1]);
            let parameter = &parameters[coordinate.index];
            let value = parameter.scale.value(coordinate.origin + a * coordinate.unit);
            let [low, high] = parameter.limits;
            values[coordinate.index] = value.clamp(low, high);
        }
        self.base.with_parameters(&values).unwrap_or_else(|_| self.base.clone())
    }

    /// Coordinates of parameters of the effect, one for each of them, held within their ranges.
    #[must_use]
    pub fn coordinates_of(&self, values: &[f64]) -> Vec<f64> {
        let parameters = self.kind().parameters();
        let coordinate = |c: &Coordinate| {
            let a = (parameters[c.index].scale.coordinate(values[c.index]) - c.origin) / c.unit;
            a.clamp(c.range[0], c.range[1])
        };
        self.coordinates.iter().map(coordinate).collect()
    }

    /// Coordinates to begin from where a linear step leads nowhere.
    #[must_use]
    pub fn elsewhere(&self) -> Vec<Vec<f64>> {
        match self.kind() {
            // Every bounce more or less is a ridge; for the kind the stronger step alone asks.
            EffectKind::Restitution => BOUNCES.iter().map(|e| self.coordinates_of(&[*e])).collect(),
            // What a round object, which slips off its tool, does is no multiple of what a slight anisotropy does, and every axis has its own valley.
            EffectKind::AnisotropicFriction => {
                let axes = |a| (0..8).map(move |eighth| [a, f64::from(eighth) * std::f64::consts::FRAC_PI_8]);
                AMPLITUDES.into_iter().flat_map(axes).map(|values| self.coordinates_of(&values)).collect()
            }
            // One that clips most of what is read leaves no slope that says so. In their unit, which is that of a limit of three tenths of the largest force, limits are
            // where they are whatever that is.
            EffectKind::ForceSaturation => CLIPS.iter().map(|share| vec![0.3 / (STRENGTH_SHARE * share)]).collect(),
            _ => Vec::new(),
        }
    }

    /// Whether at coordinates `a` the effect is one of the engine's own errors (see [`crate::study`]): contacts of another engine part a little faster where
    /// the model's do not bounce. That is no discovery; what bounces is.
    pub(crate) fn is_engine_error(&self, a: &[f64]) -> bool {
        let Some(coordinate) = self.coordinates.first() else { return false };
        let origin = self.kind().parameters()[coordinate.index].scale.value(coordinate.origin);
        let value = self.effect(a).values()[coordinate.index];
        match self.kind() {
            EffectKind::Restitution => origin == 0.0 && value < LEAST_BOUNCE,
            _ => false,
        }
    }

    /// Coordinates of the strengths.
    pub fn strengths(&self) -> impl Iterator<Item = usize> + '_ {
        self.coordinates.iter().enumerate().filter(|(_, c)| c.strength).map(|(index, _)| index)
    }
}

/// All candidates that could show in such a log.
#[must_use]
pub fn candidates(context: &Context) -> Vec<Candidate> {
    EffectKind::ALL
        .iter()
        .filter(|kind| is_named(**kind) && applies(**kind, context))
        .flat_map(|kind| of_kind(*kind, context))
        .collect()
}

/// Whether a diagnosis names it. How stiff contacts are is re-tuned like a mass: engines differ by factors, and no log says what its contacts should be.
#[must_use]
pub(crate) fn is_named(kind: EffectKind) -> bool {
    kind != EffectKind::ContactCompliance
}

/// Whether an effect could show at all.
fn applies(kind: EffectKind, context: &Context) -> bool {
    use EffectKind as K;
    let sphere = context.theta.object.shape == ObjectShape::Sphere;
    match kind {
        K::ForceBias
        | K::ForceDrift
        | K::ForceGain
        | K::ForceLowPass
        | K::ForceSaturation
        | K::ForceDelay
        | K::WristPayload => context.forces,
        K::JointFriction => context.joint_torques,
        K::Backlash => context.joints,
        K::ArmCompliance | K::ActuatorGain | K::ActuationDelay | K::Adhesion => context.tool,
        // What is thrown leaves its path wherever it meets the table: that says nothing of bodies.
        K::HiddenObstacle => context.tool,
        K::RollingResistance => sphere,
        K::PressureDistribution => !sphere,
        // What is pushed stays on its sole, whose size `pressure_distribution` has; of an outline the edges are its own.
        K::EdgeRounding => !sphere && !context.tool && !context.outline,
        _ => true,
    }
}

fn of_kind(kind: EffectKind, context: &Context) -> Vec<Candidate> {
    let neutral = kind.neutral(&context.world, &context.theta);
    let with = |changes: &[(usize, f64)]| {
        let mut values = neutral.values();
        for (index, value) in changes {
            values[*index] = *value;
        }
        let base = neutral.with_parameters(&values).unwrap_or_else(|_| neutral.clone());
        Candidate { coordinates: coordinates(&base, context), base, begin: None }
    };
    match kind {
        // Both harmonics of the direction, either sign: the amplitude has none.
        EffectKind::AnisotropicFriction => {
            (0..4).map(|eighth| with(&[(1, f64::from(eighth) * std::f64::consts::FRAC_PI_4)])).collect()
        }
        EffectKind::FrictionPatch => {
            let anywhere = context.places_m.iter().map(|place| (*place, 0.05));
            (context.patches_m.iter().copied().chain(anywhere))
                .take(PATCHES)
                .map(|([x, y], radius_m)| with(&[(1, x), (2, y), (3, radius_m)]))
                .collect()
        }
        // In the middle and to all sides of it: where an object is pulled to from everywhere, or pushed along by.
        EffectKind::Tether => {
            let n = context.places_m.len().max(1) as f64;
            let mean = |axis: usize| context.places_m.iter().map(|place| place[axis]).sum::<f64>() / n;
            let sides = [[0.0, 0.0], [0.12, 0.0], [-0.12, 0.0], [0.0, 0.12], [0.0, -0.12]];
            sides.iter().map(|[dx, dy]| with(&[(1, mean(0) + dx), (2, mean(1) + dy)])).collect()
        }
        EffectKind::StribeckFriction => [0.02, 0.06].iter().map(|v| with(&[(1, *v)])).collect(),
        EffectKind::HiddenObstacle => obstacles(context),
        _ => vec![with(&[])],
    }
}

/// A slim upright body, fixed and movable.
pub(crate) fn bodies((place, radius_m): &Place) -> impl Iterator<Item = EffectConfig> {
    let start = [place[0], place[1], 0.0, *radius_m, 0.08, 0.0, 1.0];
    let slim =
        |base: &EffectConfig| matches!(base, EffectConfig::HiddenObstacle(body) if body.shape == ObjectShape::Cylinder);
    let choices = EffectKind::HiddenObstacle.variants().into_iter().filter(slim);
    choices.filter_map(move |base| base.with_parameters(&start).ok())
}

/// The same where something seems to stand in the way.
fn obstacles(context: &Context) -> Vec<Candidate> {
    let candidate = |base: EffectConfig| {
        let start = base.values();
        let unit = |index: usize, unit: f64, range: [f64; 2]| Coordinate {
            index,
            origin: start[index],
            unit,
            range,
            strength: index == 3,
        };
        let mut coordinates = vec![
            unit(0, OBSTACLE_M, [-5.0, 5.0]),
            unit(1, OBSTACLE_M, [-5.0, 5.0]),
            unit(3, 0.5 * OBSTACLE_M, [(0.01 - start[3]) / (0.5 * OBSTACLE_M), 5.0]),
        ];
        if matches!(&base, EffectConfig::HiddenObstacle(body) if body.movable) {
            coordinates.push(unit(6, 0.6, [-1.5, 6.0]));
        }
        let begin = Some(vec![0.0; coordinates.len()]);
        Candidate { base, coordinates, begin }
    };
    context.obstacles_m.iter().flat_map(bodies).map(candidate).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use physics_model::ObjectTheta;

    pub(crate) fn context() -> Context {
        let nominal = crate::nominal::Engine::default();
        let world = WorldConfig {
            control_period_secs: 0.01,
            control_steps: 1,
            solver_iterations: nominal.solver_iterations,
            contact_frequency_hz: nominal.contact_frequency_hz,
            contact_damping_ratio: nominal.contact_damping_ratio,
            table_height_m: 0.0,
            gravity_mps2: 9.81,
            tool_friction: 0.2,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0,
            restitution: 0.0,
            obstacle_mobility: physics_model::config::ObstacleMobility::Movable,
        };
        let object =
            ObjectTheta { shape: ObjectShape::Box, mass_kg: 0.5, com_m: [0.0; 3], friction: 0.4, size_m: [0.08; 3] };
        Context {
            world,
            theta: Theta { object, obstacle: None, effects: Vec::new() },
            places_m: vec![[0.4, 0.0]],
            obstacles_m: vec![([0.5, 0.1], 0.03)],
            patches_m: vec![([0.4, 0.1], 0.09)],
            largest_force_n: 10.0,
            usual_force_n: 10.0,
            usual_speed_mps: 0.2,
            tool: true,
            outline: false,
            forces: true,
            joints: true,
            wrist_torques: true,
            joint_torques: true,
        }
    }

    #[test]
    fn contacts_that_hardly_bounce_are_another_engines_and_stiffness_is_no_effect() {
        let all = candidates(&context());
        assert!(all.iter().all(|candidate| candidate.kind() != EffectKind::ContactCompliance));
        let bounce = all.iter().find(|candidate| candidate.kind() == EffectKind::Restitution).unwrap();
        let engine = |coefficient: f64| bounce.is_engine_error(&bounce.coordinates_of(&[coefficient]));
        assert!(engine(0.05) && !engine(0.15) && !engine(0.5));
        let tilt = all.iter().find(|candidate| candidate.kind() == EffectKind::TableTilt).unwrap();
        assert!(!tilt.is_engine_error(&[0.0, 0.0]));
    }

    #[test]
    fn a_body_is_tried_fixed_and_then_movable() {
        let moves = |body: EffectConfig| matches!(body, EffectConfig::HiddenObstacle(body) if body.movable);
        assert_eq!(bodies(&([0.1, -0.2], 0.03)).map(moves).collect::<Vec<_>>(), [false, true]);
        let [x, y, _, radius, ..] = bodies(&([0.1, -0.2], 0.03)).next().unwrap().values()[..] else { panic!() };
        assert_eq!([x, y, radius], [0.1, -0.2, 0.03]);
    }

    #[test]
    fn bounces_are_tried_once() {
        let all = candidates(&context());
        let bounces: Vec<_> = all.iter().filter(|c| c.kind() == EffectKind::Restitution).collect();
        let tried: Vec<_> = bounces.iter().flat_map(|c| c.elsewhere().into_iter().map(|a| c.effect(&a))).collect();
        let coefficients: Vec<f64> = tried.iter().map(|effect| effect.values()[0]).collect();
        assert!(coefficients.iter().zip(BOUNCES).all(|(a, b)| (a - b).abs() < 1e-9) && tried.len() == BOUNCES.len());
    }

    #[test]
    fn nothing_that_the_catalogue_calls_plausible_is_negligible() {
        for candidate in candidates(&context()) {
            let parameters = candidate.kind().parameters();
            for index in candidate.strengths() {
                let coordinate = &candidate.coordinates[index];
                let parameter = &parameters[coordinate.index];
                let least = parameter
                    .plausible
                    .map(|end| ((parameter.scale.coordinate(end) - coordinate.origin) / coordinate.unit).abs());
                let ends = least.into_iter().filter(|a| *a > 1e-9).fold(f64::INFINITY, f64::min);
                assert!(ends > crate::accept::NEGLIGIBLE, "{}: {ends}", parameter.name);
            }
        }
    }

    #[test]
    fn candidates_are_neutral_where_they_begin_and_plausible_one_unit_away() {
        use EffectKind as K;
        let thrown = Context { tool: false, ..context() };
        let [pushed, thrown] = [context(), thrown].map(|context| candidates(&context));
        for kind in EffectKind::ALL {
            let expected = !matches!(kind, K::RollingResistance | K::EdgeRounding | K::ContactCompliance);
            assert_eq!(pushed.iter().any(|c| c.kind() == *kind), expected, "{}", kind.name());
            let tools = matches!(kind, K::ArmCompliance | K::ActuatorGain | K::ActuationDelay | K::Adhesion);
            let expected = !tools && !matches!(kind, K::RollingResistance | K::HiddenObstacle | K::ContactCompliance);
            assert_eq!(thrown.iter().any(|c| c.kind() == *kind), expected, "{}, thrown", kind.name());
        }
        for candidate in pushed.iter().chain(&thrown) {
            let zero = vec![0.0; candidate.coordinates.len()];
            assert_eq!(candidate.effect(&zero), candidate.base);
            for index in candidate.strengths() {
                let coordinate = &candidate.coordinates[index];
                assert!(coordinate.range[0] <= 0.0 && coordinate.range[1] >= 0.0, "{coordinate:?}");
                let sign = if coordinate.range[1] >= 1.0 { 1.0 } else { -1.0 };
                let mut a = zero.clone();
                a[index] = sign;
                let effect = candidate.effect(&a);
                assert_ne!(effect, candidate.base);
                assert!(effect.check().is_ok(), "{effect:?}");
                let again = candidate.coordinates_of(&effect.values());
                assert!(again.iter().zip(&a).all(|(x, y)| (x - y).abs() < 1e-9), "{effect:?}: {again:?}");
            }
        }
    }
}
