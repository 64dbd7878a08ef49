//! One world: an episode, and what each source says of it at each step.

use agent::{
    Agent, Episode, Estimate, ExternalEpisode, Method, Network, Reason, SimulatedWorld, StepView, Watcher,
    World as Acted, WorldStep,
};
use anyhow::{Result, bail};
use belief::Particles;
use physics_model::config::ObstacleMobility;
use pomdp::{Purpose, Replay as _, Rng, Seed, Teacher as _};
use prior_training::starts;
use push_task::{Action, Coordinates, Observation, Particle};
use rand::RngExt as _;
use scenario::Problem;
use serde::{Deserialize, Serialize};

use super::reference::{Ruler, ruler};
use super::{External, NO_DRAWN};

/// Effective draws of a belief that is well.
pub(super) const USUAL_DRAWS: f64 = 50.0;

/// Numbers whose ranks are taken: names, and whether only hypotheses of the true shape have them.
pub(super) const NUMBERS: [(&str, bool); 8] = [
    ("mass", false),
    ("friction", false),
    ("size_0", true),
    ("size_1", true),
    ("size_2", true),
    ("com_x", true),
    ("com_y", true),
    ("com_z", true),
];

/// What one belief says of the true world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Effective number of draws: a belief that is down to a few cannot be told from a calibrated one by its ranks.
    pub effective: f64,
    /// Probability of an obstacle.
    pub obstacle: f64,
    /// Probability of the object's true shape, and of the obstacle's true class, or none.
    pub shape: f64,
    /// See `shape`.
    pub obstacle_class: f64,
    /// Rank of the true value among n draws and itself, (n P(number < true one) + u (n P(equal) + 1)) / (n + 1) with u uniform and n the effective size, for
    /// each of [`NUMBERS`]: uniform for a calibrated belief, however few the draws (Talts et al. 2018), nearly so where they have weights. Null where the shape has no such number.
    pub ranks: Vec<Option<f64>>,
    /// Mean of ln mass minus the true one.
    pub log_mass_error: f64,
    /// Mean of friction minus the true one.
    pub friction_error: f64,
    /// ln of the probability of shape and obstacle's class, and of Gaussians of ln mass and friction, at the truth.
    pub log_score: f64,
    /// P(nearer to a random point than the truth is): uniform for a calibrated joint belief (TARP; Lemos et al. 2023).
    pub tarp: f64,
    /// Distance of the obstacle's mean place from the true one, m, where both have one.
    pub obstacle_m: Option<f64>,
}

/// A world.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct World {
    /// Why the episode ended.
    pub reason: String,
    /// What an external world did wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Σ γ^t r_t.
    pub discounted_return: f64,
    /// Whether there is an obstacle.
    pub has_obstacle: bool,
    /// Step of the first contact of the tool with the object, from 1; null where there was none.
    pub first_contact: Option<usize>,
    /// What the filter says: before the first action and after each one but the last.
    pub filter: Vec<Row>,
    /// What the prior says.
    pub prior: Vec<Row>,
    /// What the network says.
    pub network: Vec<Row>,
    /// Transitions of each update.
    pub transitions: Vec<usize>,
    /// Exponent that each update has reached.
    pub exponents: Vec<f64>,
    /// Wall-clock time of search and update, mean over the actions, s.
    pub seconds: f64,
    /// What the ruler says after the last action, where it was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruler: Option<Ruler>,
    /// Why there is no ruler although it was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruler_failure: Option<String>,
    /// Classes and coordinates of the start in the network's distribution, and the values of each step ([`starts`]).
    pub values: Vec<f32>,
}

/// Looks on and keeps what later replays need.
struct Onlooker {
    truth: Option<Particle>,
    rows: Vec<Row>,
    steps: Vec<(Action, Observation, Vec<f64>)>,
    transitions: Vec<usize>,
    exponents: Vec<f64>,
    rng: Rng,
}

impl Onlooker {
    fn new(rng: Rng) -> Self {
        let (rows, steps, transitions, exponents) = Default::default();
        Self { truth: None, rows, steps, transitions, exponents, rng }
    }

    /// The episode as [`starts`] have it; empty where the start is outside the distribution of `coordinates`. `first`: observation, and joints, rad.
    fn values(
        &self,
        problem: &Problem,
        coordinates: &Coordinates<'_>,
        start: &Particle,
        first: (&Observation, &[f64]),
        seed: Seed,
    ) -> Vec<f32> {
        let steps = std::iter::once((None, first.0.clone(), first.1));
        let later = self.steps.iter().map(|(action, seen, joints)| (Some(*action), seen.clone(), &joints[..]));
        let mut rng = seed.stream(Purpose::Statistics, 2);
        starts::values(problem, coordinates, start, &mut rng, steps.chain(later)).unwrap_or_default()
    }
}

impl Watcher for Onlooker {
    fn see(&mut self, view: &StepView<'_>) {
        let Some(truth) = view.truth else { return };
        self.truth.get_or_insert_with(|| truth.clone());
        let Some(belief) = view.belief else { return };
        self.rows.push(row(belief, truth, &mut self.rng));
        if let Some(step) = view.step {
            self.steps.push((step.action, step.observation.clone(), view.joints_rad.to_vec()));
            if let Some(update) = &step.update {
                self.transitions.push(update.transitions);
                self.exponents.push(update.temperature);
            }
        }
    }
}

/// A world of which the first answer is kept. One that says what it has drawn knows the truth, as far as that does not change.
struct Opened<W> {
    world: W,
    first: Option<(Observation, Vec<f64>)>,
    truth: fn(&W) -> Option<&Particle>,
}

impl<W> Opened<W> {
    fn new(world: W, truth: fn(&W) -> Option<&Particle>) -> Self {
        Self { world, first: None, truth }
    }
}

impl<W: Acted> Acted for Opened<W> {
    fn reset(&mut self) -> Result<(Observation, Vec<f64>), agent::Error> {
        let first = self.world.reset()?;
        self.first = Some(first.clone());
        Ok(first)
    }

    fn act(&mut self, action: Action) -> Result<WorldStep, agent::Error> {
        self.world.act(action)
    }

    fn truth(&self) -> Option<&Particle> {
        (self.truth)(&self.world)
    }
}

/// Seed of world `number`: that of a trial of `eval`.
pub(super) fn seed(root: u64, number: u32) -> Seed {
    Seed(root).child(Purpose::World, u64::from(number))
}

/// Plays world `number`.
pub(super) fn play(
    problem: &Problem,
    network: &Network,
    root: u64,
    number: u32,
    external: Option<&External>,
    reference: Option<usize>,
) -> Result<World> {
    let seed = seed(root, number);
    let Some(external) = external else {
        let start = problem.sample_world(&mut seed.stream(Purpose::World, 0))?;
        let world = SimulatedWorld::new(&problem.truth, start, seed.stream(Purpose::Truth, 0));
        return played(problem, network, seed, Opened::new(world, Acted::truth), true, reference);
    };
    let mut world = external.start(problem)?;
    let episode = world.episode(problem, number, seed.0);
    let stays = problem.scenario.world.obstacle_mobility == ObstacleMobility::Fixed;
    played(problem, network, seed, Opened::new(episode, ExternalEpisode::drawn), stays, reference)
}

fn failed(failure: String) -> World {
    World { reason: Reason::WorldFailed.name().into(), failure: Some(failure), ..World::default() }
}

/// `follows`: the truth says where the obstacle is, not only where it was at first. `reference`: particles of the ruler.
fn played<W: Acted>(
    problem: &Problem,
    network: &Network,
    seed: Seed,
    mut world: Opened<W>,
    follows: bool,
    reference: Option<usize>,
) -> Result<World> {
    let mut onlooker = Onlooker::new(seed.stream(Purpose::Statistics, 0));
    #[expect(clippy::disallowed_methods, reason = "a benchmark measures time")]
    let started = std::time::Instant::now();
    let mut agent = Agent::new(problem, Method::Mixture, Some(network))?;
    let episode = match agent.run_watched(&mut world, seed, &mut onlooker) {
        // What it first measured cannot be: an object inside the tool, for example.
        Err(agent::Error::Scenario(error)) => Episode::failed(format!("the first observation and the task: {error}")),
        played => played?,
    };
    let seconds = started.elapsed().as_secs_f64() / episode.steps.len().max(1) as f64;
    let (Some((observation, joints_rad)), Some(start), None) = (world.first, onlooker.truth.take(), &episode.failure)
    else {
        return Ok(failed(episode.failure.unwrap_or_else(|| NO_DRAWN.into())));
    };
    if !follows {
        onlooker.rows.iter_mut().skip(1).for_each(|row| row.obstacle_m = None);
    }

    let mut rng = seed.stream(Purpose::Statistics, 1);
    let Network::Posterior(network) = network else { bail!("expected the network of a bridge filter") };
    let mut network = network.clone();
    network.reset();
    network.observe(&problem.model, None, &observation, &joints_rad);
    let mut history = agent::history(problem, Some(&network), &observation);
    let coordinates = history.start_coordinates().with_distribution(network.distribution());
    let values = onlooker.values(problem, &coordinates, &start, (&observation, &joints_rad), seed);
    let prior = Estimate::prior(&history);
    // As many as the filter aims at.
    let count = problem.scenario.belief.bridge.effective.round() as usize;
    let mut draws = |estimate: &Estimate<'_>| -> Result<Row> {
        let drawn = (0..10 * count).filter_map(|_| {
            let (classes, z) = estimate.draw(&mut rng)?;
            Some(history.start(&classes, &z)?.0)
        });
        let belief = Particles::uniform(drawn.take(count).collect())?;
        Ok(row(&belief, &start, &mut rng))
    };
    if onlooker.rows.is_empty() {
        return Ok(failed("no world of the distribution agrees with the first observation".into()));
    }
    let (mut of_prior, mut of_network) = (vec![draws(&prior)?], vec![draws(&Estimate::network(&history, &network))?]);
    for (action, observation, joints_rad) in &onlooker.steps {
        network.observe(&problem.model, Some(*action), observation, joints_rad);
        of_prior.push(draws(&prior)?);
        of_network.push(draws(&Estimate::network(&history, &network))?);
    }
    onlooker.steps.iter().for_each(|(action, observation, joints)| history.push(*action, observation, joints));
    let estimate = Estimate::network(&history, &network);
    let asked = reference.map(|particles| ruler(particles, &history, &estimate, &start, &mut rng));
    let (ruler, ruler_failure) = ruled(asked, problem.scenario.world.obstacle_mobility);
    Ok(World {
        reason: episode.reason.name().into(),
        failure: None,
        discounted_return: episode.discounted_return,
        has_obstacle: start.theta.obstacle.is_some(),
        first_contact: first_contact(&episode, &observation),
        filter: onlooker.rows,
        prior: of_prior,
        network: of_network,
        transitions: onlooker.transitions,
        exponents: onlooker.exponents,
        seconds,
        ruler,
        ruler_failure,
        values,
    })
}

/// A ruler, or why there is none.
fn ruled(asked: Option<Result<Ruler>>, mobility: ObstacleMobility) -> (Option<Ruler>, Option<String>) {
    match asked {
        Some(Ok(mut ruler)) => {
            // Where an obstacle can move, the chains say where it is in the end, and the truth where it was at first.
            if mobility != ObstacleMobility::Fixed {
                ruler.row.obstacle_m = None;
            }
            (Some(ruler), None)
        }
        Some(Err(error)) => (None, Some(format!("{error:#}"))),
        None => (None, None),
    }
}

/// Step of the first contact of the tool with the object, from 1.
fn first_contact(episode: &Episode, first: &Observation) -> Option<usize> {
    let touched = |row: &agent::StepRecord| row.large_force || row.obstacle_touched || moved(&row.observation, first);
    episode.steps.iter().position(touched).map(|index| index + 1)
}

/// Whether the object is seen 1 cm or more from where it was first seen: five standard deviations.
fn moved(now: &Observation, first: &Observation) -> bool {
    let (a, b) = (now.object_pose().0, first.object_pose().0);
    (a[0] - b[0]).hypot(a[1] - b[1]) > 0.01
}

/// The numbers of [`NUMBERS`].
fn numbers(particle: &Particle) -> [f64; 8] {
    let o = &particle.theta.object;
    let ([a, b, c], [x, y, z]) = (o.size_m, o.com_m);
    [o.mass_kg, o.friction, a, b, c, x, y, z]
}

/// Whether the true object has a number.
fn has(truth: &Particle, index: usize) -> bool {
    let shape = truth.theta.object.shape;
    match index {
        0 | 1 | 7 => true,
        2..=4 => index - 2 < shape.size_count(),
        _ => shape.size_count() > 1,
    }
}

pub(super) fn row(belief: &Particles<Particle>, truth: &Particle, rng: &mut Rng) -> Row {
    let weighted = distinct(belief);
    let effective = effective_size(weighted.iter().map(|(_, weight)| *weight));
    let mean = |value: &dyn Fn(&Particle) -> f64| weighted.iter().map(|(p, w)| w * value(p)).sum::<f64>();
    let share = |holds: &dyn Fn(&Particle) -> bool| mean(&|p| f64::from(u8::from(holds(p))));
    let [true_shape, true_obstacle] = truth.theta.classes();
    let shape = share(&|p| p.theta.classes()[0] == true_shape);
    let obstacle_class = share(&|p| p.theta.classes()[1] == true_obstacle);
    let both = share(&|p| p.theta.classes() == [true_shape, true_obstacle]);
    let true_numbers = numbers(truth);
    let ranks = (0..NUMBERS.len()).map(|index| {
        let of_shape = |p: &Particle| !NUMBERS[index].1 || p.theta.classes()[0] == true_shape;
        let mass = share(&of_shape);
        let u: f64 = rng.random();
        (has(truth, index) && mass > 0.0).then(|| {
            let count = effective_size(weighted.iter().filter(|(p, _)| of_shape(p)).map(|(_, w)| *w));
            let below = share(&|p| of_shape(p) && numbers(p)[index] < true_numbers[index]) / mass;
            let equal = share(&|p| of_shape(p) && numbers(p)[index] == true_numbers[index]) / mass;
            (count * below + u * (count * equal + 1.0)) / (count + 1.0)
        })
    });
    let ranks = ranks.collect();
    let gaussian = |value: &dyn Fn(&Particle) -> f64| {
        let m = mean(value);
        let variance = mean(&|p| (value(p) - m).powi(2)).max(1e-6);
        let error = m - value(truth);
        (error, -0.5 * error * error / variance - 0.5 * (2.0 * std::f64::consts::PI * variance).ln())
    };
    let (log_mass_error, mass_score) = gaussian(&|p| p.theta.object.mass_kg.ln());
    let (friction_error, friction_score) = gaussian(&|p| p.theta.object.friction);
    // The mass of a class that no draw has is at most a draw's. A belief that is down to few draws is not forgiven for it.
    let floor = 0.5 / effective.max(USUAL_DRAWS);
    let obstacle_m = truth.state.obstacle.as_ref().and_then(|body| {
        let with = share(&|p| p.state.obstacle.is_some());
        let off = |axis: usize| {
            let sum = mean(&|p| p.state.obstacle.as_ref().map_or(0.0, |o| o.position_m[axis]));
            sum / with - body.position_m[axis]
        };
        (with > 0.0).then(|| off(0).hypot(off(1)))
    });
    Row {
        effective,
        obstacle: share(&|p| p.theta.obstacle.is_some()),
        shape,
        obstacle_class,
        ranks,
        log_mass_error,
        friction_error,
        log_score: both.max(floor).ln() + mass_score + friction_score,
        tarp: tarp(&weighted, truth, rng),
        obstacle_m,
    }
}

/// ln mass, friction and half extents, m, in units of about their prior spreads, and the classes.
fn joint(particle: &Particle) -> [f64; 7] {
    let o = &particle.theta.object;
    let [x, y, z] = o.shape.half_extents_m(o.size_m);
    let [shape, obstacle] = particle.theta.classes();
    [
        o.mass_kg.ln() / 0.4,
        o.friction / 0.13,
        x / 0.006,
        y / 0.006,
        z / 0.005,
        2.0 * shape as f64,
        2.0 * obstacle as f64,
    ]
}

/// Where the truth stands among the draws by its distance from a point that knows nothing of it: one of the draws, blurred, which is then left out.
fn tarp(weighted: &[(&Particle, f64)], truth: &Particle, rng: &mut Rng) -> f64 {
    let mut rest: f64 = rng.random();
    let drawn = weighted.iter().position(|(_, weight)| {
        rest -= weight;
        rest < 0.0
    });
    let drawn = drawn.unwrap_or(weighted.len() - 1);
    let centre = joint(weighted[drawn].0).map(|value| value + 2.0 * (rng.random::<f64>() - 0.5));
    let distance = |particle: &Particle| joint(particle).iter().zip(centre).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    let of_truth = distance(truth);
    let others = || weighted.iter().enumerate().filter(|(index, _)| *index != drawn).map(|(_, other)| other);
    let mass: f64 = others().map(|(_, weight)| weight).sum();
    let u: f64 = rng.random();
    if mass <= 0.0 {
        return u;
    }
    let count = effective_size(others().map(|(_, weight)| *weight));
    let nearer: f64 = others().filter(|(particle, _)| distance(particle) < of_truth).map(|(_, weight)| weight).sum();
    (count * nearer / mass + u) / (count + 1.0)
}

/// Particles with weights above 0; those that say the same are one.
fn distinct(belief: &Particles<Particle>) -> Vec<(&Particle, f64)> {
    let mut weighted: Vec<(&Particle, f64)> = Vec::new();
    let mut places = std::collections::BTreeMap::new();
    for (particle, weight) in belief.iter().filter(|(_, weight)| *weight > 0.0) {
        let same = (particle.theta.classes(), numbers(particle).map(f64::to_bits));
        let place = *places.entry(same).or_insert(weighted.len());
        match weighted.get_mut(place) {
            Some((_, sum)) => *sum += weight,
            None => weighted.push((particle, weight)),
        }
    }
    weighted
}

/// (Σ w)² / Σ w² (Kish 1965).
fn effective_size(weights: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = weights.fold((0.0, 0.0), |(sum, squares), w| (sum + w, squares + w * w));
    sum * sum / squares
}
