//! Hypotheses of the network that a belief has no ancestors for.

use belief::Particles;
use physics_model::BodyState;
use pomdp::{Belief as _, Rng};
use prior::Suggester;
use push_task::{Particle, PushModel};

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
