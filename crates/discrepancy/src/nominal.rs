//! The nominal model of a log: what re-tuning may change, and within which prior.
//!
//! Every number of `log.toml` that is given as `{ mean, stddev }` becomes a coordinate z with prior N(0, 1): value = mean · exp(z · stddev / mean)
//! for what is positive (mass, friction, lengths, inertia, restitution), mean + z · stddev for what has a sign (centre of mass, height).

use std::sync::Arc;

use measured_log::{Header, Number, Shape};
use physics_model::config::{ObstacleMobility, WorldConfig};
use physics_model::rig::{Prism, Rig, RigObject, RigShape, RigTool};
use physics_model::{EffectConfig, EffectKind, ObjectShape};
use simulator_files::Scene;

use crate::clock::Clock;
use crate::error::Error;
use crate::tunable::Place;
use crate::units::Units;

pub use crate::tunable::Tunable;

/// Engine step, s, at most. Longer ones, or fewer iterations, save half of the time. With 1/50 the mean ln probability of what 28 logs at 50 and 60 Hz hide fell
/// from −0.84 to −0.93, and with two iterations instead of four that of 20 at 100 and 125 Hz from −1.17 to −1.48 (usual logs of seed 16, of which single
/// ones went up and down by much more); two tests of `tests/metamorphic.rs` fail with 1/50.
const LONGEST_STEP_SECS: f64 = 1.0 / 60.0;
/// Friction of tool and object where the log does not say, and its standard deviation as a share of it.
const TOOL_FRICTION: f64 = 0.2;
const TOOL_FRICTION_UNKNOWN: f64 = 0.5;
/// The same of one that it says exactly: engines with cones, pyramids and patches slide at forces that differ by as much.
const TOOL_FRICTION_SHARE: f64 = 0.15;

/// Engine step, s, of what is thrown, at most: an eighth of a tick at 148 Hz.
const THROWN_STEP_SECS: f64 = 0.000_85;
/// Its contacts are rigid as far as a camera sees: hard things part within milliseconds, 0.8 ms being 1 / (2π · 200 Hz). The planner's softer ones would
/// hide much of what an impact shows.
const THROWN_FREQUENCY_HZ: f64 = 200.0;
/// Critically damped: what bounces back is said by the restitution.
const THROWN_DAMPING_RATIO: f64 = 1.0;

/// Standard deviation of the logarithm of a contact's natural frequency and damping ratio: a factor of two. MuJoCo's default contacts are softer than
/// ours by about as much, those of Bullet and of real tables stiffer.
const CONTACT_SPREAD: f64 = 0.7;

/// The same of the exponent of the cone of friction: real friction is Coulomb's, and pyramids of engines were found at 4 to 8 and at 0.06 to 0.2.
const CONE_SPREAD: f64 = 1.0;

/// How far contacts reach, in these: beyond a factor of eight no contact is one.
const CONTACT_RANGE: f64 = 3.0;

/// How exactly the engine solves. Variants of it show how far its answers can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Engine {
    /// Engine steps a tick, times this.
    pub refinement: u32,
    /// Solver iterations of an engine step.
    pub solver_iterations: u32,
    /// Natural frequency of contacts, Hz.
    pub contact_frequency_hz: f64,
    /// Damping ratio of contacts.
    pub contact_damping_ratio: f64,
    /// Whether what is pushed bears on four fixed points (see [`RigObject::on_points`]): without them the yaw of a cylinder is a gamble.
    pub on_points: bool,
    /// Slip, m/s, below which the friction of tool and object is in proportion to it; 0: it sticks (see [`Rig::tool_slip_mps`]).
    pub tool_slip_mps: f64,
}

impl Default for Engine {
    fn default() -> Self {
        // The planner's contacts (scenarios/base.toml), solved with four iterations where the planner can afford two.
        Self {
            refinement: 1,
            solver_iterations: 4,
            contact_frequency_hz: 60.0,
            contact_damping_ratio: 5.0,
            on_points: true,
            tool_slip_mps: 0.0,
        }
    }
}

/// The nominal model.
#[derive(Clone, Debug)]
pub struct Nominal {
    header: Header,
    tool: RigTool,
    prism: Option<Arc<Prism>>,
    /// What re-tuning may change, in the order of the coordinates.
    pub tunables: Vec<Tunable>,
    /// Effects that the model already has.
    pub effects: Vec<EffectConfig>,
}

impl Nominal {
    /// Of a log's header. `tool`: what moves by command.
    ///
    /// # Errors
    ///
    /// [`Error::Model`] for an outline that is no prism.
    pub fn new(header: &Header, tool: RigTool) -> Result<Self, Error> {
        let prism = match &header.object.shape {
            Shape::Prism { outline_m, height_m, feet_m } => {
                let prism = Prism::new(outline_m.clone(), height_m.mean(), feet_m.clone());
                Some(Arc::new(prism.map_err(|error| Error::Model { reason: error.to_string() })?))
            }
            _ => None,
        };
        let mut nominal = Self { header: header.clone(), tool, prism, tunables: Vec::new(), effects: Vec::new() };
        nominal.tunables = nominal.uncertain();
        Ok(nominal)
    }

    /// The same of ticks of another duration, s.
    pub(crate) fn with_period_secs(mut self, period_secs: f64) -> Self {
        self.header.period_secs = period_secs;
        self
    }

    /// The same in other units, of which `units` says how much one of today's is.
    pub(crate) fn in_units(&self, units: &Units) -> Result<Self, Error> {
        let tool = match &self.tool {
            RigTool::Ball { radius_m } => RigTool::Ball { radius_m: units.factor("m") * radius_m },
            tool => tool.clone(),
        };
        let mut nominal = Self::new(&units.header(&self.header), tool)?;
        for (scaled, tunable) in nominal.tunables.iter_mut().zip(&self.tunables) {
            scaled.set(units.factor(tunable.place.unit()) * tunable.mean);
        }
        nominal.effects = self.effects.iter().map(|effect| units.effect(effect)).collect();
        Ok(nominal)
    }

    fn uncertain(&self) -> Vec<Tunable> {
        let header = &self.header;
        // First, where [`crate::model`] looks for them.
        let clocks = Clock::ALL.into_iter().filter(|_| self.has_tool());
        let clock = |clock: Clock| Tunable {
            key: clock.key().into(),
            mean: 0.0,
            stddev: clock.stddev_secs(),
            positive: false,
            place: Place::Clock(clock),
        };
        let mut all: Vec<Tunable> = clocks.map(clock).collect();
        let mut add = |key: String, number: Number, positive: bool, place: Place| {
            if let Number::Uncertain { mean, stddev } = number {
                all.push(Tunable { key, mean, stddev, positive, place });
            }
        };
        add("table.height_m".into(), header.table.height_m, false, Place::TableHeight);
        add("table.friction".into(), header.table.friction, true, Place::TableFriction);
        if self.has_tool() {
            add("tool_friction".into(), self.tool_friction(), true, Place::ToolFriction);
        }
        let object = &header.object;
        add("object.mass_kg".into(), object.mass_kg, true, Place::Mass);
        for (i, com) in object.com_m.iter().enumerate() {
            add(format!("object.com_m[{i}]"), *com, false, Place::Com(i));
        }
        for (i, size) in sizes(&object.shape).into_iter().enumerate() {
            add(format!("object.size_m[{i}]"), size, true, Place::Size(i));
        }
        for (i, inertia) in object.inertia_kgm2.iter().flatten().enumerate() {
            add(format!("object.inertia_kgm2[{i}]"), *inertia, true, Place::Inertia(i));
        }
        if let Some(restitution) = object.restitution {
            add("object.restitution".into(), restitution, true, Place::Restitution);
        }
        all.extend(self.contact());
        all
    }

    /// Friction of tool and object. One that is given exactly is exact in another law of friction than the engine's.
    fn tool_friction(&self) -> Number {
        let about = |mean: f64, share: f64| Number::Uncertain { mean, stddev: share * mean };
        match self.header.tool_friction {
            Some(Number::Fixed(mean)) if mean > 0.0 => about(mean, TOOL_FRICTION_SHARE),
            Some(number) => number,
            None => about(TOOL_FRICTION, TOOL_FRICTION_UNKNOWN),
        }
    }

    /// How stiff contacts are, and how much they damp: no log says it, and engines differ by factors.
    fn contact(&self) -> Vec<Tunable> {
        let engine = self.engine();
        let tunable = |key: &str, mean: f64, spread: f64, place| Tunable {
            key: key.into(),
            mean,
            stddev: spread * mean,
            positive: true,
            place,
        };
        let mut all = vec![
            tunable("contact.frequency_hz", engine.contact_frequency_hz, CONTACT_SPREAD, Place::ContactFrequency),
            tunable("contact.damping_ratio", engine.contact_damping_ratio, CONTACT_SPREAD, Place::ContactDamping),
        ];
        if self.has_tool() && !self.rolls() {
            all.push(tunable("contact.cone_exponent", 1.0, CONE_SPREAD, Place::Cone));
        }
        all
    }

    /// The log's header.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What moves by command.
    #[must_use]
    pub fn tool(&self) -> &RigTool {
        &self.tool
    }

    /// Whether something moves by command.
    #[must_use]
    pub fn has_tool(&self) -> bool {
        !matches!(self.tool, RigTool::None)
    }

    /// How exactly the engine solves what is compared with a log.
    #[must_use]
    pub fn engine(&self) -> Engine {
        // A push is slow and lasts; what is thrown hits the table within a few milliseconds.
        if self.has_tool() {
            return Engine::default();
        }
        Engine {
            refinement: (self.step_secs() / THROWN_STEP_SECS - 1e-9).ceil().max(1.0) as u32,
            contact_frequency_hz: THROWN_FREQUENCY_HZ,
            contact_damping_ratio: THROWN_DAMPING_RATIO,
            ..Engine::default()
        }
    }

    /// Engine steps a tick, before refinement.
    fn steps(&self) -> u32 {
        (self.header.period_secs / LONGEST_STEP_SECS - 1e-9).ceil().max(1.0) as u32
    }

    fn step_secs(&self) -> f64 {
        self.header.period_secs / f64::from(self.steps())
    }

    /// Whether re-tuning may change a number of the log.
    pub(crate) fn tunes(&self, key: &str) -> bool {
        self.tunables.iter().any(|tunable| tunable.key == key)
    }

    /// Number of clocks that may be skewed: the first of what re-tuning may change.
    #[must_use]
    pub fn clocks(&self) -> usize {
        self.tunables.iter().filter(|tunable| matches!(tunable.place, Place::Clock(_))).count()
    }

    /// By how much clocks at coordinates `z` are late, s, in the order of [`Clock::ALL`], beside these effects.
    pub(crate) fn skews_secs<'a>(&self, z: &[f64], effects: impl Iterator<Item = &'a EffectConfig>) -> [f64; 2] {
        let kinds: Vec<EffectKind> = effects.map(EffectConfig::kind).collect();
        Clock::ALL.map(|clock| {
            let place = self.tunables.iter().position(|tunable| tunable.place == Place::Clock(clock));
            let replaced = kinds.iter().any(|kind| clock.gives_way_to(*kind));
            place.filter(|_| !replaced).map_or(0.0, |place| self.tunables[place].value(z[place]))
        })
    }

    /// Coordinates of clocks that give way to an effect.
    pub(crate) fn replaced_by(&self, kind: EffectKind) -> impl Iterator<Item = usize> + '_ {
        let gives_way =
            move |tunable: &Tunable| matches!(tunable.place, Place::Clock(clock) if clock.gives_way_to(kind));
        self.tunables.iter().enumerate().filter(move |(_, tunable)| gives_way(tunable)).map(|(index, _)| index)
    }

    /// Whether the object rolls.
    #[must_use]
    pub fn rolls(&self) -> bool {
        matches!(self.header.object.shape, Shape::Sphere { .. })
    }

    /// The arm's joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        usize::from(self.header.robot.joints())
    }

    fn value(&self, z: &[f64], place: Place, number: Number) -> f64 {
        match self.tunables.iter().position(|tunable| tunable.place == place) {
            Some(index) => self.tunables[index].value(z[index]),
            None => number.mean(),
        }
    }

    /// Coordinates with contacts as the model has them.
    pub(crate) fn with_own_contacts(&self, z: &[f64]) -> Vec<f64> {
        let contact = |place: Place| matches!(place, Place::ContactFrequency | Place::ContactDamping);
        (self.tunables.iter().zip(z)).map(|(tunable, z)| if contact(tunable.place) { 0.0 } else { *z }).collect()
    }

    /// A contact's value in that of the plain engine, of which an engine may be a variant; 1 where re-tuning may not change it. The mean is another one where
    /// a model file has set it.
    fn factor(&self, z: &[f64], place: Place, plain: f64) -> f64 {
        let index = self.tunables.iter().position(|tunable| tunable.place == place);
        let value = |index: usize| self.tunables[index].value(z[index].clamp(-CONTACT_RANGE, CONTACT_RANGE));
        index.map_or(1.0, |index| value(index) / plain)
    }

    /// The rig with coordinates `z`.
    #[must_use]
    pub fn rig(&self, z: &[f64], engine: &Engine) -> Rig {
        let header = &self.header;
        let steps = self.steps() * engine.refinement;
        let tool_friction = self.value(z, Place::ToolFriction, self.tool_friction());
        let plain = self.engine();
        let frequency = self.factor(z, Place::ContactFrequency, plain.contact_frequency_hz);
        let damping = self.factor(z, Place::ContactDamping, plain.contact_damping_ratio);
        let cone_exponent = self.factor(z, Place::Cone, 1.0);
        let world = WorldConfig {
            control_period_secs: header.period_secs / f64::from(steps),
            control_steps: 1,
            solver_iterations: engine.solver_iterations,
            contact_frequency_hz: frequency * engine.contact_frequency_hz,
            contact_damping_ratio: damping * engine.contact_damping_ratio,
            table_height_m: self.value(z, Place::TableHeight, header.table.height_m),
            gravity_mps2: header.gravity_mps2,
            tool_friction,
            obstacle_friction: 0.5,
            arm_stiffness_npm: 50_000.0,
            restitution: 0.0,
            obstacle_mobility: ObstacleMobility::Movable,
        };
        Rig { world, tick_steps: steps, tool: self.tool.clone(), tool_slip_mps: engine.tool_slip_mps, cone_exponent }
    }

    /// The rig at its means, as files of other simulators take it.
    #[must_use]
    pub fn scene<'a>(&self, name: &'a str) -> Scene<'a> {
        let (z, engine) = (vec![0.0; self.tunables.len()], self.engine());
        let (rig, object) = (self.rig(&z, &engine), self.object(&z, 0.0, &engine));
        Scene { name, rig, object, effects: self.effects.clone() }
    }

    /// The object with coordinates `z` and a known weight.
    ///
    /// # Panics
    ///
    /// Never: a nominal of a prism has one.
    #[must_use]
    pub fn object(&self, z: &[f64], added_mass_kg: f64, engine: &Engine) -> RigObject {
        let object = &self.header.object;
        let size = |i: usize, number: Number| self.value(z, Place::Size(i), number);
        let solid = |shape, size_m| RigShape::Solid { shape, size_m };
        let shape = match (&object.shape, &self.prism) {
            (Shape::Prism { .. }, Some(prism)) => RigShape::Prism(prism.clone()),
            (Shape::Box { size_m }, _) => solid(ObjectShape::Box, std::array::from_fn(|i| size(i, size_m[i]))),
            (Shape::Cylinder { radius_m, height_m }, _) => {
                solid(ObjectShape::Cylinder, [size(0, *radius_m), size(1, *height_m), 0.0])
            }
            (Shape::Sphere { radius_m }, _) => solid(ObjectShape::Sphere, [size(0, *radius_m), 0.0, 0.0]),
            (Shape::Prism { .. }, None) => unreachable!("a nominal with a prism has one"),
        };
        RigObject {
            shape,
            mass_kg: self.value(z, Place::Mass, object.mass_kg),
            com_m: std::array::from_fn(|i| self.value(z, Place::Com(i), object.com_m[i])),
            friction: self.value(z, Place::TableFriction, self.header.table.friction),
            inertia_kgm2: object
                .inertia_kgm2
                .map(|inertia| std::array::from_fn(|i| self.value(z, Place::Inertia(i), inertia[i]))),
            restitution: object.restitution.map(|number| self.value(z, Place::Restitution, number)),
            added_mass_kg,
            // What is thrown tumbles.
            on_points: engine.on_points && self.has_tool(),
        }
    }
}

/// The lengths of a shape that may be uncertain, in the order of `size_m`.
fn sizes(shape: &Shape) -> Vec<Number> {
    match shape {
        Shape::Box { size_m } => size_m.to_vec(),
        Shape::Cylinder { radius_m, height_m } => vec![*radius_m, *height_m],
        Shape::Sphere { radius_m } => vec![*radius_m],
        // Its outline is fixed.
        Shape::Prism { .. } => Vec::new(),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use measured_log::{Noise, Object, Robot, SplitConfig, Table};

    use super::*;

    /// A ball of which only the mass may be re-tuned.
    pub(crate) fn uncertain_mass() -> Nominal {
        let header = Header {
            robot: Robot::None,
            period_secs: 0.01,
            tool_radius_m: None,
            tool_friction: None,
            gravity_mps2: 9.81,
            table: Table { height_m: 0.0.into(), friction: 0.4.into() },
            object: Object {
                shape: Shape::Sphere { radius_m: 0.03.into() },
                mass_kg: Number::Uncertain { mean: 0.2, stddev: 0.02 },
                com_m: [0.0.into(); 3],
                inertia_kgm2: None,
                restitution: None,
            },
            noise: Noise::default(),
            split: SplitConfig { holdout_fraction: 0.5 },
        };
        Nominal::new(&header, RigTool::None).unwrap()
    }

    #[test]
    fn a_model_file_moves_means_and_not_what_is_known_of_them() {
        let mut header = uncertain_mass().header;
        header.object.shape = Shape::Box { size_m: [0.05.into(), 0.04.into(), 0.03.into()] };
        (header.tool_radius_m, header.robot) = (Some(0.01), Robot::None);
        let mut nominal = Nominal::new(&header, RigTool::Ball { radius_m: 0.01 }).unwrap();
        let keys = [("contact.cone_exponent", 0.12), ("contact.frequency_hz", 190.0), ("contact.damping_ratio", 2.0)];
        let find = |nominal: &Nominal, key: &str| -> Tunable {
            nominal.tunables.iter().find(|tunable| tunable.key == key).unwrap().clone()
        };
        let before = keys.map(|(key, _)| find(&nominal, key));
        for (key, value) in keys {
            nominal.tunables.iter_mut().find(|tunable| tunable.key == key).unwrap().set(value);
        }
        // What is simulated is in the units of the object.
        let simulated = nominal.in_units(&Units::default()).unwrap();
        for ((key, value), before) in keys.iter().zip(before) {
            for nominal in [&nominal, &simulated] {
                let factor = find(nominal, key).value(1.0) / value;
                assert!((factor / (before.value(1.0) / before.mean) - 1.0).abs() < 1e-9, "{key}: {factor}");
            }
        }
        // A cone is one of friction, whatever a fit or a file says.
        let cone = find(&nominal, "contact.cone_exponent");
        assert!(cone.value(-8.0) > 0.04 && cone.value(8.0) < 21.0);
        assert!(
            cone.takes(0.05)
                && cone.takes(20.0)
                && ![0.01, 500.0, -1.0, f64::NAN].map(|value| cone.takes(value)).contains(&true)
        );
    }

    #[test]
    fn contacts_that_a_model_file_has_set_are_those_that_are_simulated() {
        let mut nominal = uncertain_mass();
        let z = vec![0.0; nominal.tunables.len()];
        let engine = nominal.engine();
        assert_eq!(nominal.rig(&z, &engine).world.contact_frequency_hz, engine.contact_frequency_hz);
        let contact = nominal.tunables.iter_mut().find(|tunable| tunable.key == "contact.frequency_hz").unwrap();
        contact.set(120.0);
        assert!((contact.value(1.0) / 120.0 - CONTACT_SPREAD.exp()).abs() < 1e-9);
        assert!((nominal.rig(&z, &engine).world.contact_frequency_hz - 120.0).abs() < 1e-9);
        let stiffer = Engine { contact_frequency_hz: 2.0 * engine.contact_frequency_hz, ..engine };
        assert!((nominal.rig(&z, &stiffer).world.contact_frequency_hz - 240.0).abs() < 1e-9);
    }
}
