//! Whole episodes with the belief update of POMCP 1.0, so that returns can be compared with published ones.

use pomdp::{Belief, Discretise, GenerativeModel, ObservationModel, Outcome, Perturb, Policy, Rng, discounted_return};
use rand::RngExt as _;

/// A problem with a distribution of initial states.
pub trait InitialState: GenerativeModel {
    /// Draws an initial state.
    fn initial(&self, rng: &mut Rng) -> Self::State;
}

/// Equally weighted states.
#[derive(Clone, Debug, PartialEq)]
pub struct Particles<S>(Vec<S>);

impl<S> Particles<S> {
    /// A belief of these states.
    ///
    /// # Panics
    ///
    /// Without a state.
    #[must_use]
    pub fn new(states: Vec<S>) -> Self {
        assert!(!states.is_empty(), "a belief holds at least one particle");
        Self(states)
    }

    /// The states.
    #[must_use]
    pub fn states(&self) -> &[S] {
        &self.0
    }
}

impl<S> Belief for Particles<S> {
    type State = S;

    fn sample(&self, rng: &mut Rng) -> &S {
        &self.0[rng.random_range(0..self.0.len())]
    }
}

impl<S: Clone> Particles<S> {
    /// `count` draws of the initial distribution.
    ///
    /// # Panics
    ///
    /// Where `count` is zero.
    pub fn initial<M: InitialState<State = S>>(model: &M, count: usize, rng: &mut Rng) -> Self {
        assert!(count > 0, "a belief holds at least one particle");
        Self((0..count).map(|_| model.initial(rng)).collect())
    }

    /// The belief of `count` particles after `action` and `observation`, as in POMCP 1.0: states drawn from this belief and stepped are
    /// kept where their observation is of the same class, the last sixteenth of them with a local move before the step against
    /// depletion. `None` where 1000 attempts a particle kept nothing.
    ///
    /// POMCP 1.0 keeps as many particles as its search left in the tree, and makes its local moves after the step; here
    /// their number is stated and every particle passes the same test.
    #[must_use]
    pub fn update<M>(
        &self,
        model: &M,
        count: usize,
        action: &M::Action,
        observation: &M::Observation,
        rng: &mut Rng,
    ) -> Option<Self>
    where
        M: Discretise<State = S> + Perturb,
    {
        let key = model.key(observation);
        let mut kept = Vec::with_capacity(count);
        for (target, moves) in [(count - count / 16, false), (count, true)] {
            for _ in 0..1000 * (target - kept.len()) {
                if kept.len() == target {
                    break;
                }
                let mut state = self.sample(rng).clone();
                if moves {
                    model.perturb(&mut state, rng);
                }
                let step = model.step(&mut state, action, rng);
                if step.outcome == Outcome::Continue && model.key(&step.observation) == key {
                    kept.push(state);
                }
            }
        }
        (!kept.is_empty()).then_some(Self(kept))
    }

    /// The belief of as many particles after `action` and `observation`: every particle is stepped and weighted by the likelihood, then as many are
    /// drawn, one from each of as many equal parts of the total weight (stratified resampling). `None` where nothing explains the observation.
    ///
    /// The filter of Sunberg and Kochenderfer (ICAPS 2018) for VDP Tag, which resamples with one offset for all parts.
    #[must_use]
    pub fn resample<M>(
        &self,
        model: &M,
        action: &M::Action,
        observation: &M::Observation,
        rng: &mut Rng,
    ) -> Option<Self>
    where
        M: ObservationModel<State = S>,
    {
        let mut next = Vec::with_capacity(self.0.len());
        let mut logs = Vec::with_capacity(self.0.len());
        for start in &self.0 {
            let mut state = start.clone();
            if model.step(&mut state, action, rng).outcome == Outcome::Continue {
                logs.push(model.log_likelihood(action, &state, observation));
                next.push(state);
            }
        }
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if most == f64::NEG_INFINITY {
            return None;
        }
        let weights: Vec<f64> = logs.iter().map(|log| (log - most).exp()).collect();
        let part = weights.iter().sum::<f64>() / self.0.len() as f64;
        let (mut drawn, mut at, mut sum) = (Vec::with_capacity(self.0.len()), 0, weights[0]);
        for index in 0..self.0.len() {
            let mark = (index as f64 + rng.random::<f64>()) * part;
            while sum <= mark && at + 1 < next.len() {
                at += 1;
                sum += weights[at];
            }
            drawn.push(next[at].clone());
        }
        Some(Self(drawn))
    }
}

/// How an episode went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Episode {
    /// Σ γ^t r_t.
    pub discounted_return: f64,
    /// Actions taken.
    pub actions: usize,
    /// Whether the belief ran out of particles, after which the fallback acted.
    pub depleted: bool,
}

/// Plays one episode of at most `horizon` actions with a belief of `particles`.
///
/// `decide` names the action for a belief, given the action and the observation before it. Where the belief runs out of particles,
/// `fallback` acts on the true state, as in POMCP 1.0: it must look at nothing that the agent cannot see.
pub fn play<M>(
    model: &M,
    particles: usize,
    horizon: usize,
    fallback: &impl Policy<M>,
    rng: &mut Rng,
    mut decide: impl FnMut(&Particles<M::State>, Option<(&M::Action, &M::Observation)>) -> M::Action,
) -> Episode
where
    M: InitialState + Discretise + Perturb,
{
    let mut state = model.initial(rng);
    let mut belief = Some(Particles::initial(model, particles, rng));
    let mut last: Option<(M::Action, M::Observation)> = None;
    let mut rewards = Vec::new();
    while rewards.len() < horizon {
        let action = match &belief {
            Some(belief) => decide(belief, last.as_ref().map(|(action, observation)| (action, observation))),
            None => fallback.action(model, &state, rng),
        };
        let step = model.step(&mut state, &action, rng);
        rewards.push(step.reward);
        if step.outcome != Outcome::Continue {
            break;
        }
        belief = belief.and_then(|b| b.update(model, particles, &action, &step.observation, rng));
        last = Some((action, step.observation));
    }
    let (actions, depleted) = (rewards.len(), belief.is_none());
    Episode { discounted_return: discounted_return(rewards, model.discount()), actions, depleted }
}

/// Plays one episode of at most `horizon` actions from `state` with any kind of belief.
///
/// `decide` names the action for a belief and the number of actions left; `learn` gives the belief after an action and its observation.
pub fn play_with<M: GenerativeModel, B>(
    model: &M,
    mut state: M::State,
    mut belief: B,
    horizon: usize,
    rng: &mut Rng,
    mut decide: impl FnMut(&B, usize) -> M::Action,
    mut learn: impl FnMut(B, &M::Action, &M::Observation, &mut Rng) -> B,
) -> Episode {
    let mut rewards = Vec::new();
    while rewards.len() < horizon {
        let action = decide(&belief, horizon - rewards.len());
        let step = model.step(&mut state, &action, rng);
        rewards.push(step.reward);
        if step.outcome != Outcome::Continue {
            break;
        }
        belief = learn(belief, &action, &step.observation, rng);
    }
    let actions = rewards.len();
    Episode { discounted_return: discounted_return(rewards, model.discount()), actions, depleted: false }
}

/// Mean of at least two values, and its standard error.
#[must_use]
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt())
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed, UniformPolicy};

    use super::*;
    use crate::RockSample;
    use crate::rock_sample::{Action, Observation};

    fn rng() -> Rng {
        Seed(1).stream(Purpose::Test, 0)
    }

    #[test]
    fn an_update_is_the_posterior() {
        // One check of rock 0 from (0, 3), √13 cells off: P(good | seen good) is the accuracy p. Every 16th particle had one of 8 rocks
        // turned before the check, which leaves an even belief even. Null: binomial of n = 8192 and p; tolerance 4 standard deviations.
        let model = RockSample::standard_7_8();
        let mut rng = rng();
        let belief = Particles::initial(&model, 8192, &mut rng);
        let after = belief.update(&model, 8192, &Action::Check(0), &Observation::Good, &mut rng).unwrap();
        let accuracy = (1.0 + 2_f64.powf(-13_f64.sqrt() / 20.0)) / 2.0;
        assert_eq!(after.states().len(), 8192);
        let good = after.states().iter().filter(|s| model.step(&mut { **s }, &Action::East, &mut rng).reward == 0.0);
        assert_eq!(good.count(), 8192, "every particle is at the start");
        // Its kind is seen by walking there: (2, 0) is two east and three south.
        let path = [Action::East, Action::East, Action::South, Action::South, Action::South];
        let good = after.states().iter().filter(|state| {
            let mut state = **state;
            for action in path {
                model.step(&mut state, &action, &mut rng);
            }
            model.step(&mut state, &Action::Sample, &mut rng).reward > 0.0
        });
        let tolerance = 4.0 * (8192.0 * accuracy * (1.0 - accuracy)).sqrt();
        assert!((good.count() as f64 - 8192.0 * accuracy).abs() < tolerance);
    }

    #[test]
    fn resampling_gives_the_posterior() {
        // As above, without turned rocks: every particle is weighted by p or 1 − p. Strata vary less than independent draws would: n = 8192,
        // tolerance 4 binomial standard deviations of the prior and of the draws.
        let model = RockSample::standard_7_8();
        let mut rng = rng();
        let belief = Particles::initial(&model, 8192, &mut rng);
        let after = belief.resample(&model, &Action::Check(0), &Observation::Good, &mut rng).unwrap();
        let accuracy = (1.0 + 2_f64.powf(-13_f64.sqrt() / 20.0)) / 2.0;
        let seen = |state: &crate::rock_sample::State| {
            model.log_likelihood(&Action::Check(0), state, &Observation::Good) > accuracy.ln() - 1e-9
        };
        let good = after.states().iter().filter(|state| seen(state)).count() as f64;
        assert_eq!(after.states().len(), 8192);
        assert!((good / 8192.0 - accuracy).abs() < 4.0 * (2.0 * accuracy * (1.0 - accuracy) / 8192.0).sqrt(), "{good}");
        assert_eq!(belief.resample(&model, &Action::East, &Observation::Good, &mut rng), None);
    }

    #[test]
    fn an_episode_with_any_belief_ends_by_itself_or_at_its_horizon() {
        let model = RockSample::standard_7_8();
        let mut left = Vec::new();
        let mut play = |horizon, action| {
            let start = model.initial(&mut rng());
            let decide = |belief: &u32, actions: usize| {
                left.push((*belief, actions));
                action
            };
            play_with(&model, start, 0_u32, horizon, &mut rng(), decide, |belief, _, _, _| belief + 1)
        };
        let east = play(90, Action::East);
        assert_eq!((east.actions, east.depleted), (7, false));
        assert!((east.discounted_return - 10.0 * 0.95_f64.powi(6)).abs() < 1e-12);
        assert_eq!(play(2, Action::West).discounted_return, -100.0 * 1.95);
        assert_eq!(left[6..], [(6, 84), (0, 2), (1, 1)]);
    }

    #[test]
    fn an_impossible_observation_depletes() {
        let model = RockSample::standard_7_8();
        let belief = Particles::initial(&model, 20, &mut rng());
        assert_eq!(belief.update(&model, 20, &Action::East, &Observation::Good, &mut rng()), None);
    }

    #[test]
    fn an_episode_ends_at_its_horizon_or_by_itself() {
        let model = RockSample::standard_7_8();
        let east = play(&model, 10, 90, &UniformPolicy, &mut rng(), |_, _| Action::East);
        assert_eq!((east.actions, east.depleted), (7, false));
        assert!((east.discounted_return - 10.0 * 0.95_f64.powi(6)).abs() < 1e-12);
        let fined = play(&model, 10, 3, &UniformPolicy, &mut rng(), |_, _| Action::West);
        assert_eq!((fined.actions, fined.discounted_return), (3, -100.0 * (1.0 + 0.95 + 0.95 * 0.95)));
    }
}
