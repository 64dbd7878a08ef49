//! Which sets a benchmark has: a function of its options alone.

use physics_model::{EffectConfig, EffectKind, ObjectShape};
use pomdp::{Purpose, Rng, Seed};
use rand::RngExt as _;
use rand::seq::SliceRandom as _;
use serde::{Deserialize, Serialize};

use crate::actions::place_obstacle;
use crate::draw;
use crate::generate::{Actions, ENGINES, RobotName, SetSpec};
use crate::unknown::Unknown;

/// Version of the sets: another one for every change that makes other logs of the same options.
pub const VERSION: u32 = 6;

/// What decides all logs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// [`VERSION`].
    pub version: u32,
    /// Root seed.
    pub seed: u64,
    /// Sets with an effect of the catalogue, of each kind of actions.
    pub sets: u32,
    /// Sets without an effect.
    pub none: u32,
    /// Sets with an effect of no catalogue.
    pub unknown: u32,
    /// Sets with two effects.
    pub pairs: u32,
    /// Sets of an arm, one in three without an effect; the others are pushed by a ball but for what only an arm has.
    pub arms: u32,
    /// Kinds of actions.
    pub actions: Vec<Actions>,
    /// Effects of the catalogue; all where empty.
    pub only: Vec<EffectKind>,
}

/// What kind of set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// One effect of the catalogue.
    Catalogue,
    /// No effect.
    None,
    /// One effect of no catalogue.
    Unknown,
    /// Two effects of the catalogue.
    Pair,
    /// One effect of the catalogue or none, in the log of an arm.
    Arm,
}

/// A truth file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// Kind of set.
    pub group: Group,
    /// 0, 1, 2.
    pub strength: usize,
    /// The set.
    pub spec: SetSpec,
}

impl Truth {
    /// Names of what is hidden; `none` where nothing is.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let known = self.spec.effects.iter().map(|effect| effect.kind().name().to_owned());
        let mut names: Vec<String> = known.chain(self.spec.unknown.iter().map(|u| u.name().to_owned())).collect();
        if names.is_empty() {
            names.push("none".into());
        }
        names
    }
}

/// What is to be drawn for a place in the plan.
#[derive(Clone, Copy, Debug)]
struct Cell {
    group: Group,
    actions: Actions,
    /// Counts within group and actions.
    index: usize,
}

/// The sets of a benchmark. Their order is shuffled, so that a number says nothing.
#[derive(Clone, Debug)]
pub struct Plan {
    options: Options,
    cells: Vec<Cell>,
}

impl Plan {
    /// Of these options.
    #[must_use]
    pub fn new(options: Options) -> Self {
        let mut cells = Vec::new();
        for actions in &options.actions {
            let groups = [
                (Group::Catalogue, options.sets),
                (Group::None, options.none),
                (Group::Unknown, options.unknown),
                (Group::Pair, options.pairs),
                (Group::Arm, options.arms),
            ];
            for (group, count) in groups {
                cells.extend((0..count as usize).map(|index| Cell { group, actions: *actions, index }));
            }
        }
        cells.shuffle(&mut Seed(options.seed).stream(Purpose::Shuffle, 0));
        Self { options, cells }
    }

    /// Number of sets.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Draws a set; another attempt where an earlier one's world could not be.
    #[must_use]
    pub fn draw(&self, place: usize, attempt: u64) -> Truth {
        let cell = self.cells[place];
        let seed = Seed(self.options.seed).child(Purpose::World, place as u64).child(Purpose::World, attempt);
        let mut rng = seed.stream(Purpose::Exploration, 0);
        match cell.group {
            Group::Catalogue => {
                let kinds = self.kinds(cell.actions);
                let (round, at) = (cell.index / kinds.len(), cell.index % kinds.len());
                // Neighbours in the catalogue begin with other strengths and noise; three and two rounds go through all.
                let strength = (round + at) % 3;
                let noise = if (at / 3 + round) % 2 == 0 { 1.0 } else { 3.0 };
                one(kinds[at], strength, noise, cell, seed.0, &mut rng)
            }
            Group::Arm => self.of_arm(cell, seed.0, &mut rng),
            Group::None => {
                let noise = if cell.index.is_multiple_of(2) { 1.0 } else { 3.0 };
                let shape = ObjectShape::ALL[cell.index % 3];
                Truth { group: cell.group, strength: 0, spec: base(shape, noise, cell, seed.0, &mut rng) }
            }
            Group::Unknown => {
                let (kind, round) = (cell.index % Unknown::KINDS, cell.index / Unknown::KINDS);
                let shape = ObjectShape::ALL[rng.random_range(0..2)];
                let noise = if (kind + round).is_multiple_of(2) { 1.0 } else { 3.0 };
                let mut spec = base(shape, noise, cell, seed.0, &mut rng);
                let strength = (kind + round) % 3;
                spec.unknown = Some(Unknown::draw(kind, strength, &mut rng));
                Truth { group: cell.group, strength, spec }
            }
            Group::Pair => {
                let pair = draw::pair(cell.actions, &mut rng);
                let noise = if cell.index.is_multiple_of(2) { 1.0 } else { 3.0 };
                let shape = draw::shape(pair[0], &mut rng);
                let mut spec = base(shape, noise, cell, seed.0, &mut rng);
                // A small effect beside a large one is another question.
                let strength = 1 + cell.index % 2;
                let errors = spec.nominal_errors;
                let mut draw = |kind| draw::effect(kind, strength, cell.actions, errors, [0.0; 2], &mut rng);
                spec.effects = pair.into_iter().map(&mut draw).collect();
                Truth { group: cell.group, strength, spec }
            }
        }
    }

    /// A set of an arm. Which effect is drawn, not gone through: there are fewer sets than effects.
    fn of_arm(&self, cell: Cell, seed: u64, rng: &mut Rng) -> Truth {
        let noise = if cell.index.is_multiple_of(2) { 1.0 } else { 3.0 };
        if cell.index % 3 == 2 {
            let shape = ObjectShape::ALL[rng.random_range(0..2)];
            let spec = SetSpec { robot: RobotName::Sawyer, ..base(shape, noise, cell, seed, rng) };
            return Truth { group: cell.group, strength: 0, spec };
        }
        // Bodies stand where a ball reaches; what only an arm has is among the sets of the catalogue.
        let elsewhere = [EffectKind::HiddenObstacle, EffectKind::Backlash, EffectKind::JointFriction];
        let mut kinds = self.kinds(cell.actions);
        if kinds.iter().any(|kind| !elsewhere.contains(kind)) {
            kinds.retain(|kind| !elsewhere.contains(kind));
        }
        let kind = kinds[rng.random_range(0..kinds.len())];
        one(kind, cell.index % 3, noise, cell, seed, rng)
    }

    /// What the catalogue sets go through.
    fn kinds(&self, actions: Actions) -> Vec<EffectKind> {
        let asked = |kind: &EffectKind| self.options.only.is_empty() || self.options.only.contains(kind);
        let all = EffectKind::ALL.iter().copied();
        let kinds: Vec<EffectKind> =
            all.clone().filter(|kind| asked(kind) && draw::identifiable(*kind, actions)).collect();
        // What was asked for by name is drawn, whatever can be said of it.
        if kinds.is_empty() { all.filter(asked).collect() } else { kinds }
    }
}

/// A set without an effect.
fn base(shape: ObjectShape, noise: f64, cell: Cell, seed: u64, rng: &mut Rng) -> SetSpec {
    let fixed_friction = rng.random_bool(0.2);
    let mut error = || {
        let size = if rng.random_bool(0.5) { 0.1 } else { 0.2 };
        if rng.random_bool(0.5) { 1.0 + size } else { 1.0 - size }
    };
    let [mass, friction] = [error(), error()];
    SetSpec {
        seed,
        robot: RobotName::None,
        shape,
        effects: Vec::new(),
        unknown: None,
        nominal_errors: [mass, if fixed_friction { 1.0 } else { friction }],
        fixed_friction,
        noise,
        actions: cell.actions,
        engine: ENGINES[rng.random_range(0..ENGINES.len())],
    }
}

/// A set with one effect.
fn one(kind: EffectKind, strength: usize, noise: f64, cell: Cell, seed: u64, rng: &mut Rng) -> Truth {
    let shape = draw::shape(kind, rng);
    let mut spec = base(shape, noise, cell, seed, rng);
    if cell.group == Group::Arm || matches!(kind, EffectKind::Backlash | EffectKind::JointFriction) {
        spec.robot = RobotName::Sawyer;
    }
    if kind == EffectKind::FrictionLevel {
        spec.fixed_friction = true;
        spec.nominal_errors[1] = 1.0;
    }
    let place_m = if kind == EffectKind::HiddenObstacle {
        place_obstacle(&spec.scripts(), &spec.scene(), 0.03, 0.02, rng)
    } else {
        [0.0; 2]
    };
    let effect: EffectConfig = draw::effect(kind, strength, cell.actions, spec.nominal_errors, place_m, rng);
    spec.effects.push(effect);
    Truth { group: cell.group, strength, spec }
}
