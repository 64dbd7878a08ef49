//! What an arm did and saw in an episode, for inference over all of it.

use std::ops::Range;

use physics_model::theta::ObjectShape;
use pomdp::{Factor, Replay};

use crate::action::Action;
use crate::coordinates::{Coordinates, OBJECT, OBSTACLE};
use crate::model::{Answer, Particle};
use crate::sensor::Observation;
use crate::transition_noise::STEP_COORDINATES;

/// Coordinates that only the object's shape gives a meaning: centre of mass and sizes.
const SHAPE: Range<usize> = 2..8;

/// An episode so far, from the arm's side. Classes are the object's shape and the obstacle's ([`physics_model::theta::obstacle_class`]).
#[derive(Clone, Debug)]
pub struct History<'a> {
    coordinates: Coordinates<'a>,
    factors: Vec<Factor>,
    blocks: Vec<Range<usize>>,
    steps: Vec<Done>,
    most: f64,
}

/// An action with its answer.
#[derive(Clone, Debug)]
struct Done {
    action: Action,
    observation: Observation,
    joints_rad: Vec<f64>,
}

impl<'a> History<'a> {
    /// An episode that has just begun.
    #[must_use]
    pub fn new(coordinates: Coordinates<'a>) -> Self {
        let (shape, obstacle) = coordinates.class_probabilities();
        let factors = vec![
            Factor { probabilities: shape.to_vec(), coordinates: SHAPE },
            Factor { probabilities: obstacle.to_vec(), coordinates: OBSTACLE },
        ];
        // Mass and friction; centre of mass; sizes; pose; obstacle; all.
        let blocks = vec![0..2, 2..5, 5..8, 8..11, OBJECT, OBSTACLE, 0..coordinates.count()];
        let most = coordinates.model().most_log_likelihood();
        Self { coordinates, factors, blocks, steps: Vec::new(), most }
    }

    /// The prior.
    #[must_use]
    pub fn start_coordinates(&self) -> &Coordinates<'a> {
        &self.coordinates
    }

    /// Adds an action, what was observed after it and where the joints are then, rad.
    pub fn push(&mut self, action: Action, observation: &Observation, joints_rad: &[f64]) {
        self.steps.push(Done { action, observation: observation.clone(), joints_rad: joints_rad.to_vec() });
    }
}

impl Replay for History<'_> {
    type State = Particle;

    fn factors(&self) -> &[Factor] {
        &self.factors
    }

    fn coordinates(&self) -> usize {
        self.coordinates.count()
    }

    fn blocks(&self) -> &[Range<usize>] {
        &self.blocks
    }

    fn step_coordinates(&self) -> usize {
        STEP_COORDINATES
    }

    fn steps(&self) -> usize {
        self.steps.len()
    }

    fn start(&self, classes: &[usize], coordinates: &[f64]) -> Option<(Particle, f64)> {
        let shapes = (ObjectShape::ALL[classes[0]], ObjectShape::ALL.get(classes[1]).copied());
        self.coordinates.start(shapes, coordinates)
    }

    fn advance(&self, step: usize, state: &mut Particle, coordinates: &[f64]) -> f64 {
        let Done { action, observation, joints_rad } = &self.steps[step];
        self.coordinates.model().replay(state, *action, Answer { observation, joints_rad }, coordinates)
    }

    fn most(&self, _step: usize) -> f64 {
        self.most
    }
}
