//! One episode of each problem of [`super::contest`].

use planner::{Observations, Pomcp, Pomcpow, SearchReport};
use pomdp::{Belief as _, Policy, Purpose, Rng, Seed, UniformPolicy};
use problems::bits::Advice;
use problems::finite::{ExactBelief, Finite, FullInformation, Lookahead, PricedUncertainty};
use problems::rock_sample::{Posterior, Steps, Tour};
use problems::vdp_tag::{self, Chase, Wander};
use problems::{InitialState, LaserTag, LightDark, Particles, RockSample, SubHunt, VdpTag, episode};

use super::options::{Decide, Leaf, Options};
use crate::physics::thread_secs;

/// How an episode went, and what its searches cost.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Played {
    pub(super) discounted_return: f64,
    pub(super) decisions: usize,
    pub(super) simulations: usize,
    /// Thread CPU time of the searches.
    pub(super) search_secs: f64,
    /// Thread CPU time of everything else: the belief, values of states.
    pub(super) other_secs: f64,
}

/// Random streams of an episode.
struct Streams {
    world: Rng,
    search: Rng,
    belief: Rng,
}

impl Streams {
    fn of(seed: Seed, item: u64) -> Self {
        let [world, search, belief] =
            [Purpose::Truth, Purpose::Search, Purpose::Filter].map(|purpose| seed.stream(purpose, item));
        Self { world, search, belief }
    }
}

/// Searches, counted.
#[derive(Default)]
struct Searches {
    simulations: usize,
    secs: f64,
}

impl Searches {
    fn count<A>(&mut self, search: impl FnOnce() -> SearchReport<A>) -> A {
        let report = self.time(search);
        self.simulations += report.simulations;
        report.action
    }

    fn time<A>(&mut self, search: impl FnOnce() -> A) -> A {
        let start = thread_secs();
        let found = search();
        self.secs += thread_secs() - start;
        found
    }

    fn played(&self, episode: episode::Episode, whole_secs: f64) -> Played {
        Played {
            discounted_return: episode.discounted_return,
            decisions: episode.actions,
            simulations: self.simulations,
            search_secs: self.secs,
            other_secs: whole_secs - self.secs,
        }
    }
}

const VALID: &str = "options were validated";
const EXPLAINS: &str = "the true state explains what it shows";

/// A finite problem with an exact belief; `known` is the value of full information.
fn finite<M>(model: &M, known: &FullInformation, options: &Options, (seed, item): (Seed, u64)) -> Played
where
    M: Finite + InitialState + Sync + pomdp::Discretise,
    M::State: Send + Sync,
    M::Observation: Send,
    M::Key: Send,
{
    let priced = PricedUncertainty::new(known, options.price_of_uncertainty);
    let policy: &(dyn Policy<M> + Sync) = match options.leaf {
        Leaf::FullInformation | Leaf::Heuristic | Leaf::Plan => &priced,
        Leaf::Random => &UniformPolicy,
    };
    let start_secs = thread_secs();
    let Streams { mut world, mut search, .. } = Streams::of(seed, item);
    let mut searches = Searches::default();
    let (start, belief) = (model.initial(&mut world), ExactBelief::initial(model));
    let learn = |belief: ExactBelief<M::State>, action: &M::Action, seen: &M::Observation, _: &mut Rng| {
        belief.update(model, action, seen).expect(EXPLAINS)
    };
    let episode = if let Some(decide) = options.decide {
        let decide = |belief: &ExactBelief<M::State>, _| {
            searches.time(|| match decide {
                Decide::ExactStep(draws) => Lookahead::new(priced, draws).action(model, belief, &mut search),
                Decide::Qmdp | Decide::Plan | Decide::PlanAfter(_) => known.qmdp(model, belief),
            })
        };
        episode::play_with(model, start, belief, options.horizon, &mut world, decide, learn)
    } else if options.planner.observations == Observations::Classes {
        let mut planner = Pomcp::new(options.planner.clone()).expect(VALID);
        let decide = |belief: &ExactBelief<M::State>, left| {
            planner.reset();
            searches.count(|| planner.search(model, belief, policy, left, &mut search))
        };
        episode::play_with(model, start, belief, options.horizon, &mut world, decide, learn)
    } else {
        let mut planner = Pomcpow::new(options.planner.clone()).expect(VALID);
        let decide = |belief: &ExactBelief<M::State>, left| {
            planner.reset();
            searches.count(|| planner.search(model, belief, policy, left, &mut search))
        };
        episode::play_with(model, start, belief, options.horizon, &mut world, decide, learn)
    };
    searches.played(episode, thread_secs() - start_secs)
}

/// Values of a finite problem that is the same in every episode.
pub(super) fn light_dark(options: &Options) -> impl Fn(Seed, u64) -> Played {
    let known = FullInformation::solve(&LightDark, 1e-9);
    move |seed, item| finite(&LightDark, &known, options, (seed, item))
}

/// As [`light_dark`].
pub(super) fn sub_hunt(options: &Options) -> impl Fn(Seed, u64) -> Played {
    let known = FullInformation::solve(&SubHunt, 1e-6);
    move |seed, item| finite(&SubHunt, &known, options, (seed, item))
}

/// A new floor in each episode.
pub(super) fn laser_tag(options: &Options) -> impl Fn(Seed, u64) -> Played {
    move |seed, item| {
        let start = thread_secs();
        let model = LaserTag::random(&mut seed.stream(Purpose::World, item));
        let known = FullInformation::solve(&model, 1e-3);
        let solved = thread_secs() - start;
        let played = finite(&model, &known, options, (seed, item));
        Played { other_secs: played.other_secs + solved, ..played }
    }
}

/// A new layout in each episode; particles are independent draws of the exact belief.
pub(super) fn rock_sample(options: &Options) -> impl Fn(Seed, u64) -> Played {
    move |seed, item| {
        let start_secs = thread_secs();
        let Streams { mut world, mut search, mut belief } = Streams::of(seed, item);
        let model = RockSample::random(15, 15, &mut seed.stream(Purpose::World, item));
        let advice = Advice::default();
        let policy: &(dyn Policy<RockSample> + Sync) = if options.leaf == Leaf::Plan { &Tour } else { &advice };
        let mut searches = Searches::default();
        let mut planner = Pomcp::new(options.planner.clone()).expect(VALID);
        let start = model.initial(&mut world);
        let first = (Posterior::initial(&model), None);
        let decide = |(posterior, last): &(Posterior, Option<_>), left| {
            if let Some((action, observation)) = last {
                planner.prune(action, observation);
            }
            let particles = posterior.particles(&model, options.particles, &mut belief);
            if let Some(decide) = options.decide {
                let steps = if let Decide::PlanAfter(steps) = decide { steps } else { 0 };
                // What is known is the same in all of them.
                return searches.time(|| Steps(steps).action(&model, &particles.states()[0], &mut search));
            }
            searches.count(|| planner.search(&model, &particles, policy, left, &mut search))
        };
        let learn = |(posterior, _): (Posterior, _), action: &_, seen: &_, _: &mut Rng| {
            (posterior.update(&model, action, seen), Some((*action, *seen)))
        };
        let episode = episode::play_with(&model, start, first, options.horizon, &mut world, decide, learn);
        searches.played(episode, thread_secs() - start_secs)
    }
}

/// Actions for one search: for the mean and for some particles of the belief, where they will be; directions around the circle; each with and without a
/// look.
fn candidates(belief: &Particles<vdp_tag::State>, options: &Options, rng: &mut Rng) -> Vec<vdp_tag::Action> {
    let states = belief.states();
    let agent = states[0].agent;
    let mean = [0, 1].map(|axis| states.iter().map(|s| s.target[axis]).sum::<f64>() / states.len() as f64);
    let mut angles = vec![vdp_tag::towards(agent, mean).angle];
    angles.extend((0..options.aims).map(|_| vdp_tag::towards(agent, belief.sample(rng).target).angle));
    let turn = std::f64::consts::TAU / options.directions.max(1) as f64;
    let first = angles[0];
    angles.extend((0..options.directions).map(|index| first + turn * (index as f64 + 0.5)));
    [false, true]
        .into_iter()
        .flat_map(|look| angles.iter().map(move |&angle| vdp_tag::Action { look, angle }))
        .collect()
}

/// The actions to choose from are drawn anew for each search.
pub(super) fn vdp_tag(options: &Options) -> impl Fn(Seed, u64) -> Played {
    move |seed, item| {
        let start_secs = thread_secs();
        let Streams { mut world, mut search, mut belief } = Streams::of(seed, item);
        let policy: &(dyn Policy<VdpTag> + Sync) = if options.leaf == Leaf::Random { &Wander } else { &Chase };
        let model = VdpTag::with_actions(vec![vdp_tag::Action { look: false, angle: 0.0 }]);
        let (start, first) = (model.initial(&mut world), Particles::initial(&model, options.particles, &mut belief));
        let mut searches = Searches::default();
        let mut planner = Pomcpow::new(options.planner.clone()).expect(VALID);
        let decide = |belief: &Particles<vdp_tag::State>, left| {
            planner.reset();
            let model = VdpTag::with_actions(candidates(belief, options, &mut search));
            searches.count(|| planner.search(&model, belief, policy, left, &mut search))
        };
        let learn = |particles: Particles<vdp_tag::State>, action: &_, seen: &_, _: &mut Rng| {
            particles.resample(&model, action, seen, &mut belief).expect(EXPLAINS)
        };
        let episode = episode::play_with(&model, start, first, options.horizon, &mut world, decide, learn);
        searches.played(episode, thread_secs() - start_secs)
    }
}
