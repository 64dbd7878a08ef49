//! {s, Θ} ~ RNN(o): how what the network suggests becomes particles.

use belief::Particles;
use physics_model::BodyState;
use pomdp::{Belief as _, Prior as _, Rng};
use prior::Suggester;
use push_task::sampling::effects::{log_density as log_density_of_effects, sample as sample_effects};
use push_task::{Action, Observation, Particle, PushModel};
use scenario::Problem;

use crate::Method;

/// Attempts at drawing one possible suggestion.
const DRAWS_PER_PROPOSAL: usize = 10;

/// The network during an episode, and what its suggestions lack.
pub(crate) struct Proposer<'a> {
    problem: &'a Problem,
    method: Method,
    prior: &'a mut Suggester,
}

/// What is known after an action.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub model: &'a PushModel,
    pub observation: &'a Observation,
    /// Joint positions, rad.
    pub joints_rad: &'a [f64],
    /// Whether the object has ever been moved.
    pub object_moved: bool,
}

impl<'a> Proposer<'a> {
    /// A new episode that begins with `first`.
    pub(crate) fn new(problem: &'a Problem, method: Method, prior: &'a mut Suggester, first: &Observation) -> Self {
        prior.reset();
        prior.suggest(None, first);
        Self { problem, method, prior }
    }

    /// The belief before `action` with the network's births, and the network's suggestions after it.
    ///
    /// # Errors
    ///
    /// Never for weights that are a distribution.
    pub(crate) fn propose(
        &mut self,
        belief: Particles<Particle>,
        action: Action,
        context: &Context<'_>,
        rng: &mut Rng,
    ) -> Result<(Particles<Particle>, Vec<Particle>), belief::Error> {
        let config = &self.problem.scenario.agent;
        let belief = with_births(context.model, self.prior, belief, config.birth_share, rng)?;
        self.prior.suggest(Some(&action), context.observation);
        let mut proposals = suggest(self.prior, self.method, context, config.proposals, rng);
        complete_effects(self.problem, &belief, &mut proposals, rng);
        Ok((belief, proposals))
    }

    /// Whether proposals are all of the draws, so that their density is known.
    pub(crate) fn knows_density(&self) -> bool {
        self.method == Method::Mixture
    }

    /// ln of the density that proposals are drawn from, at a particle.
    pub(crate) fn log_density(&self, particle: &Particle) -> f64 {
        let mobility = self.problem.model.config().world.obstacle_mobility;
        let log_density = self.prior.log_density(mobility, particle);
        log_density + log_density_of_effects(&self.problem.beliefs.effects, &particle.theta.effects)
    }
}

/// Suggested particles after the latest observation: possible worlds that agree with it as far as can be told without
/// simulating the action again.
pub(crate) fn suggest(
    prior: &Suggester,
    method: Method,
    context: &Context<'_>,
    count: usize,
    rng: &mut Rng,
) -> Vec<Particle> {
    let complete = |mut particle: Particle| {
        particle.state.joints_rad = context.joints_rad.to_vec();
        particle.object_moved = context.object_moved;
        particle.force = context.model.measured_force(context.observation);
        let fits = context.model.check(&particle).is_ok() && context.model.agrees(&particle, context.observation);
        fits.then_some(particle)
    };
    let table_height_m = context.model.config().world.table_height_m;
    if method == Method::Mixture {
        // All of them: leaving out what does not fit would change the density that they are drawn from.
        return (0..count).filter_map(|_| prior.sample_raw(table_height_m, rng)).collect();
    }
    if method == Method::RnnMax {
        let strongest = prior.strongest(table_height_m).and_then(complete);
        return strongest.into_iter().flat_map(|particle| std::iter::repeat_n(particle, count)).collect();
    }
    let mut particles = Vec::with_capacity(count);
    for _ in 0..count * DRAWS_PER_PROPOSAL {
        if particles.len() == count {
            break;
        }
        particles.extend(prior.sample(table_height_m, rng).and_then(complete));
    }
    particles
}

/// What the network knows nothing of: unknown parameters of effects, from their first distribution, and what effects remember, from the
/// belief before the action.
fn complete_effects(problem: &Problem, belief: &Particles<Particle>, proposals: &mut [Particle], rng: &mut Rng) {
    let memory = belief.iter().next().and_then(|(particle, _)| problem.model.memory_after_action(particle));
    for particle in proposals {
        particle.theta.effects = sample_effects(&problem.beliefs.effects, rng);
        particle.memory.clone_from(&memory);
    }
}

/// Draws from the network's latest suggestion, each with the measured part of a state of the belief, take `share` of its probability:
/// b ← (1 − ε) b + ε q.
///
/// Importance weights alone move a filter among the structures that it has; one that it gave up, or that its first belief did not know of
/// (an obstacle), has no state to start from. The network was trained on complete episodes, so q is a posterior given the same history: the belief
/// forgets a little of what it computed, and can be brought back by what the network makes of the same sensors. Must be called before the
/// suggestion takes in the next observation, as the belief does not know it yet either.
///
/// The particle count rises by `share` of it. Draws that are no possible world are left out, and the share with them.
pub(crate) fn with_births(
    model: &PushModel,
    prior: &Suggester,
    belief: Particles<Particle>,
    share: f64,
    rng: &mut Rng,
) -> Result<Particles<Particle>, belief::Error> {
    let wanted = (share * belief.count() as f64).ceil() as usize;
    let table_height_m = model.config().world.table_height_m;
    let births: Vec<Particle> = (0..wanted)
        .filter_map(|_| {
            let base = belief.sample(rng).clone();
            let draw = prior.sample(table_height_m, rng)?;
            let born = born(model, base, draw);
            model.check(&born).is_ok().then_some(born)
        })
        .collect();
    if births.is_empty() {
        return Ok(belief);
    }
    let share = share * births.len() as f64 / wanted as f64;
    let mut weights: Vec<f64> = belief.iter().map(|(_, weight)| (1.0 - share) * weight).collect();
    weights.extend(std::iter::repeat_n(share / births.len() as f64, births.len()));
    let mut states = belief.into_states();
    states.extend(births);
    Particles::weighted(states, weights)
}

/// Θ and obstacle of `draw`, the rest of `base`: its object stands where it was, at the height of its new shape.
fn born(model: &PushModel, base: Particle, draw: Particle) -> Particle {
    let object = &draw.theta.object;
    let [x, y, _] = base.state.object.position_m;
    let z = model.config().world.table_height_m + object.shape.half_height_m(object.size_m);
    let mut born = base;
    born.state.object = BodyState::at_rest([x, y, z], born.state.object.yaw_rad());
    born.state.obstacle = draw.state.obstacle;
    // Effects are none of the network's.
    let effects = std::mem::take(&mut born.theta.effects);
    born.theta = draw.theta;
    born.theta.effects = effects;
    born
}
