//! {s, Θ} ~ RNN(o): how what the network suggests becomes particles.

use belief::Particles;
use pomdp::{Prior as _, Rng};
use prior::Suggester;
use push_task::sampling::effects::sample as sample_effects;
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

    /// The network's suggestions after `action`; `belief` is that before it.
    pub(crate) fn propose(
        &mut self,
        belief: &Particles<Particle>,
        action: Action,
        context: &Context<'_>,
        rng: &mut Rng,
    ) -> Vec<Particle> {
        let count = self.problem.scenario.agent.proposals;
        self.prior.suggest(Some(&action), context.observation);
        let mut proposals = suggest(self.prior, self.method, context, count, rng);
        complete_effects(self.problem, belief, &mut proposals, rng);
        proposals
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
