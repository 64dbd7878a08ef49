//! What the weighted filter does when it is lost, and what it never does: empty beliefs, more transitions than allowed, results that depend
//! on threads.

mod common;

use std::sync::atomic::{AtomicUsize, Ordering};

use belief::{Error, Particles, WeightedConfig, WeightedFilter};
use common::{config, moments, track};
use pomdp::{
    GenerativeModel, ObservationModel, Outcome, Partition, Proposals, Purpose, Rng, Seed, StaticParameters, Step,
    UpdateReport, Updater as _,
};
use problems::static_parameter::{Kind, StaticParameter, Thing};
use proptest::prelude::*;

fn problem() -> StaticParameter {
    StaticParameter { noise_stddev: 0.1, stiff: 0.4, bound: f64::INFINITY }
}

fn stiff(theta: f64) -> Thing {
    Thing { kind: Kind::Stiff, theta: vec![theta], displacement: 0.0 }
}

fn restarting() -> WeightedConfig {
    WeightedConfig {
        tempering_share: 0.3,
        max_bridges: 10,
        history_limit: 10,
        restart_transitions: 20_000,
        restart_surprise: 20.0,
        structure_quota: 20,
        ..config(300)
    }
}

/// Observations of a stiff thing that answers with 1.3 times the action, which nobody expects but the prior.
const HISTORY: [(f64, f64); 3] = [(1.0, 1.35), (-1.0, -1.22), (2.0, 2.65)];

#[test]
fn a_kidnapped_belief_is_drawn_anew_and_explains_the_whole_history() {
    // The belief is certain of θ = −3. Null: the restarted belief is the exact posterior; over n = 60 filters the mean error of the response
    // (in exact standard deviations) is 0 and P(stiff) is exact, tolerance 4 standard errors.
    let model = problem();
    let (share, _) = model.stiff_posterior(&HISTORY);
    let exact = model.exact(Kind::Stiff, &HISTORY);
    let (mut errors, mut shares) = (Vec::new(), Vec::new());
    for index in 0..60 {
        let mut rng = Seed(1).stream(Purpose::Test, index);
        let mut filter = WeightedFilter::new(restarting()).unwrap().with_restart(|rng| Some(problem().sample(rng)));
        // The first two steps are explained: they are those of a belief that knew too little. Then it is kidnapped.
        let start = (0..300).map(|_| model.sample(&mut rng)).collect();
        track(&mut filter, &model, start, &HISTORY[..2], &mut rng);
        let kidnapped = Particles::uniform(vec![stiff(-3.0); 300]).unwrap();
        let (action, observation) = HISTORY[2];
        let (belief, report) =
            filter.update(&model, kidnapped, &action, &observation, Proposals::none(), &mut rng).unwrap();
        assert_eq!((report.recoveries, report.structures.len()), (1, 2), "{report:?}");
        assert!(report.surprise < 5.0, "{report:?}");
        assert!(report.log_evidence < -1000.0, "the evidence is that of the belief that failed");
        assert!(report.transitions <= 30_000 + 20_000);
        let (mean, _) = moments(&belief, |t| (t.kind == Kind::Stiff).then(|| t.theta[0]));
        errors.push((mean - exact.mean[0]) / exact.covariance[0][0].sqrt());
        shares.push(belief.iter().filter(|(t, _)| t.kind == Kind::Stiff).map(|(_, w)| w).sum());
    }
    common::assert_mean(&errors, 0.0, 4.0, "error of the mean");
    common::assert_mean(&shares, share, 4.0, "P(stiff)");
}

fn kidnapped(config: WeightedConfig, restart: bool) -> UpdateReport {
    let mut rng = Seed(2).stream(Purpose::Test, 0);
    let mut filter = WeightedFilter::new(config).unwrap();
    if restart {
        filter = filter.with_restart(|rng| Some(problem().sample(rng)));
    }
    let start = vec![stiff(-3.0), stiff(-3.1)];
    track(&mut filter, &problem(), start, &HISTORY, &mut rng).1.pop().unwrap()
}

#[test]
fn without_sampler_budget_or_memory_nothing_is_drawn_anew_and_the_surprise_says_so() {
    assert_eq!(kidnapped(restarting(), true).recoveries, 0, "the first update recovered, the last had no need to");
    for (config, restart) in [
        (restarting(), false),
        (WeightedConfig { restart_transitions: 0, ..restarting() }, true),
        (WeightedConfig { restart_transitions: 299, ..restarting() }, true),
        (WeightedConfig { history_limit: 0, ..restarting() }, true),
    ] {
        let report = kidnapped(config, restart);
        assert_eq!(report.recoveries, 0);
        assert!(report.surprise > 20.0, "{report:?}");
    }
}

#[test]
fn depleted_belief_is_an_error_and_a_restart_heals_it() {
    // An infinite response diverges: no particle has any likelihood.
    let broken = || Particles::uniform(vec![stiff(f64::INFINITY); 50]).unwrap();
    let mut rng = Seed(3).stream(Purpose::Test, 0);
    let mut filter = WeightedFilter::new(WeightedConfig { max_bridges: 0, ..restarting() }).unwrap();
    let error = filter.update(&problem(), broken(), &1.0, &1.3, Proposals::none(), &mut rng).unwrap_err();
    assert_eq!(error, Error::Depleted { attempts: 50, diverged: 50, terminal: 0 });
    let mut filter = filter.with_restart(|rng| Some(problem().sample(rng)));
    filter.reset();
    let (belief, report) = filter.update(&problem(), broken(), &1.0, &1.3, Proposals::none(), &mut rng).unwrap();
    assert_eq!((report.recoveries, report.acceptance, report.log_evidence), (1, 0.0, f64::NEG_INFINITY));
    assert!(belief.count() > 100 && report.diverged == 50);
    // A sampler that draws nothing possible is no way out.
    let mut filter = WeightedFilter::new(restarting()).unwrap().with_restart(|_| None);
    assert!(filter.update(&problem(), broken(), &1.0, &1.3, Proposals::none(), &mut rng).is_err());
}

#[test]
fn proposals_without_density_are_refused_and_a_share_of_zero_ignores_them() {
    let draws = [stiff(1.0)];
    let run = |proposal_share| {
        let mut rng = Seed(4).stream(Purpose::Test, 0);
        let mut filter = WeightedFilter::new(WeightedConfig { proposal_share, ..config(20) }).unwrap();
        let belief = Particles::uniform(vec![stiff(1.1); 20]).unwrap();
        filter.update(&problem(), belief, &1.0, &1.0, Proposals::unweighted(&draws), &mut rng)
    };
    assert_eq!(run(0.5).unwrap_err(), Error::ProposalDensity);
    assert_eq!(run(0.0).unwrap().1.proposed, 0);
}

#[test]
fn terminal_particles_explain_nothing_while_the_episode_goes_on() {
    /// A line whose positions above 10 end the episode.
    struct Line;
    impl GenerativeModel for Line {
        type State = f64;
        type Action = f64;
        type Observation = f64;
        fn actions(&self) -> &[f64] {
            &[1.0]
        }
        fn step(&self, x: &mut f64, action: &f64, _rng: &mut Rng) -> Step<f64> {
            *x += action;
            let outcome = if *x > 10.0 { Outcome::Terminal } else { Outcome::Continue };
            Step { observation: *x, reward: 0.0, outcome }
        }
        fn discount(&self) -> f64 {
            1.0
        }
    }
    impl ObservationModel for Line {
        fn log_likelihood(&self, _action: &f64, next: &f64, observation: &f64) -> f64 {
            -(next - observation).powi(2)
        }
    }
    impl StaticParameters for Line {
        type Structure = ();
        fn structure(&self, _x: &f64) {}
        fn parameters(&self, _x: &f64) -> Vec<f64> {
            vec![]
        }
        fn with_parameters(&self, x: &f64, _parameters: &[f64]) -> Option<f64> {
            Some(*x)
        }
    }
    impl Partition for Line {
        type Cell = i64;
        fn cell(&self, x: &f64) -> i64 {
            *x as i64
        }
    }
    let mut rng = Seed(5).stream(Purpose::Test, 0);
    let mut filter = WeightedFilter::new(config(2)).unwrap();
    let belief = Particles::uniform(vec![9.5, 8.5]).unwrap();
    let (belief, report) = filter.update(&Line, belief, &1.0, &10.4, Proposals::none(), &mut rng).unwrap();
    assert!(belief.states().iter().all(|&x| x == 9.5));
    assert_eq!((report.acceptance, report.diverged), (0.5, 0));
    assert!((report.log_evidence - (0.5_f64.ln() - 0.81)).abs() < 1e-12, "{}", report.log_evidence);
    let belief = Particles::uniform(vec![9.5]).unwrap();
    let error = filter.update(&Line, belief, &1.0, &10.4, Proposals::none(), &mut rng).unwrap_err();
    assert_eq!(error, Error::Depleted { attempts: 1, diverged: 0, terminal: 1 });
}

fn spread_out(count: usize, stddev: f64, rng: &mut Rng) -> Vec<Thing> {
    let around =
        |thing: Thing| Thing { theta: thing.theta.iter().map(|x| 0.5 + stddev * (x - 0.5)).collect(), ..thing };
    (0..count).map(|_| around(problem().sample(rng))).collect()
}

#[test]
fn the_same_seed_gives_the_same_belief_on_any_number_of_threads() {
    let run = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut rng = Seed(seed).stream(Purpose::Test, 0);
            let mut filter = WeightedFilter::new(restarting()).unwrap();
            let start = spread_out(300, 1.0, &mut rng);
            let sharp = StaticParameter { noise_stddev: 0.02, ..problem() };
            let (belief, reports) = track(&mut filter, &sharp, start, &HISTORY, &mut rng);
            assert!(reports.iter().any(|r| r.bridges > 0));
            (format!("{belief:?}"), reports)
        })
    };
    let one = run(1, 6);
    assert_eq!(one, run(1, 6));
    assert_eq!(one, run(2, 6));
    assert_eq!(one, run(5, 6));
    assert_ne!(one.0, run(1, 7).0);
}

#[test]
fn a_certain_belief_needs_fewer_particles_than_an_uncertain_one() {
    let adaptive = WeightedConfig { particles_min: 40, particles_max: 3000, kld_error: 0.1, ..config(3000) };
    let count = |stddev: f64| {
        let mut rng = Seed(7).stream(Purpose::Test, 0);
        let mut filter = WeightedFilter::new(adaptive.clone()).unwrap();
        let start = spread_out(3000, stddev, &mut rng);
        let reports = track(&mut filter, &problem(), start, &[(0.0, 0.0)], &mut rng).1;
        assert_eq!(reports[0].transitions, 3000);
        reports[0].particles
    };
    let (certain, uncertain) = (count(0.02), count(1.0));
    assert!((40..100).contains(&certain), "{certain}");
    assert!((300..3000).contains(&uncertain), "{uncertain}");
}

#[test]
fn the_order_of_the_particles_does_not_matter_to_the_distribution() {
    // 200 particles, every other one of response 1.2, or sorted. Null: the number of particles near 1.2 after resampling has the same mean
    // in both orders; n = 2000, tolerance 4 standard errors of the difference.
    let config = WeightedConfig { resample_share: 1.0, smoothing_discount: 1.0, ..config(200) };
    let mut differences = Vec::new();
    for index in 0..2000 {
        let mut rng = Seed(8).stream(Purpose::Test, index);
        let alternating: Vec<Thing> = (0..200).map(|i| stiff(if i % 2 == 0 { 1.2 } else { 1.3 })).collect();
        let mut sorted = alternating.clone();
        sorted.sort_by(|a, b| a.theta[0].total_cmp(&b.theta[0]));
        let mut count = |start| {
            let mut filter = WeightedFilter::new(config.clone()).unwrap();
            let (belief, _) = track(&mut filter, &problem(), start, &[(1.0, 1.22)], &mut rng);
            belief.states().iter().filter(|t| t.theta[0] < 1.25).count() as f64
        };
        differences.push(count(alternating) - count(sorted));
    }
    common::assert_mean(&differences, 0.0, 4.0, "difference between the orders");
}

/// Counts what is really simulated.
struct Counted(StaticParameter, AtomicUsize);

impl GenerativeModel for Counted {
    type State = Thing;
    type Action = f64;
    type Observation = f64;
    fn actions(&self) -> &[f64] {
        self.0.actions()
    }
    fn step(&self, thing: &mut Thing, action: &f64, rng: &mut Rng) -> Step<f64> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.step(thing, action, rng)
    }
    fn discount(&self) -> f64 {
        1.0
    }
}

impl ObservationModel for Counted {
    fn log_likelihood(&self, action: &f64, next: &Thing, observation: &f64) -> f64 {
        self.0.log_likelihood(action, next, observation)
    }
}

impl StaticParameters for Counted {
    type Structure = Kind;
    fn structure(&self, thing: &Thing) -> Kind {
        thing.kind
    }
    fn parameters(&self, thing: &Thing) -> Vec<f64> {
        self.0.parameters(thing)
    }
    fn with_parameters(&self, thing: &Thing, parameters: &[f64]) -> Option<Thing> {
        self.0.with_parameters(thing, parameters)
    }
}

impl Partition for Counted {
    type Cell = Vec<i64>;
    fn cell(&self, thing: &Thing) -> Vec<i64> {
        self.0.cell(thing)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]
    #[test]
    fn budget_counts_weights_and_books_hold_for_every_setting(
        particles_min in 1_usize..50,
        more in 0_usize..100,
        max_transitions in 150_usize..2000,
        tempering_share in 0.0..1.0_f64,
        max_bridges in 0_usize..6,
        smoothing_discount in 0.5..1.0_f64,
        structure_quota in 0_usize..40,
        proposal_share in 0.0..0.9_f64,
        restart_transitions in 0_usize..2000,
        given in 1_usize..300,
        observation in -30.0..30.0_f64,
        noise in 0.01..1.0_f64,
        item in 0_u64..1000,
    ) {
        let config = WeightedConfig {
            particles_min,
            particles_max: particles_min + more,
            max_transitions,
            resample_share: tempering_share.max(0.5),
            tempering_share,
            max_bridges,
            smoothing_discount,
            structure_quota,
            proposal_share,
            restart_transitions,
            history_limit: 2,
            restart_surprise: 20.0,
            ..config(1)
        };
        let model = Counted(StaticParameter { noise_stddev: noise, ..problem() }, AtomicUsize::new(0));
        let mut rng = Seed(9).stream(Purpose::Test, item);
        let mut filter = WeightedFilter::new(config).unwrap().with_restart(|rng| Some(problem().sample(rng)));
        let mut belief = Particles::uniform(spread_out(given, 1.0, &mut rng)).unwrap();
        let draws = spread_out(100, 1.0, &mut rng);
        let density = |thing: &Thing| problem().log_prior(thing);
        for (step, action) in [1.0, -1.0, 2.0].into_iter().enumerate() {
            let before = model.1.load(Ordering::Relaxed);
            let proposals = Proposals::weighted(&draws, &density);
            let (next, report) =
                filter.update(&model, belief, &action, &(action * observation), proposals, &mut rng).unwrap();
            belief = next;
            prop_assert_eq!(report.transitions, model.1.load(Ordering::Relaxed) - before);
            let restarts = if step < 2 { restart_transitions } else { 0 };
            prop_assert!(report.transitions <= max_transitions + restarts);
            prop_assert!(belief.count() == report.particles && belief.count() <= particles_min + more);
            prop_assert!((belief.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(belief.iter().all(|(_, w)| w > 0.0));
            prop_assert!(report.temperature > 0.0 && report.temperature <= 1.0);
            prop_assert!(report.bridges <= max_bridges);
            prop_assert!((0.0..=1.0).contains(&report.acceptance));
            prop_assert!(report.log_evidence < f64::INFINITY);
            let books = &report.structures;
            prop_assert!((books.iter().map(|s| s.posterior).sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!((books.iter().map(|s| s.prior).sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert_eq!(books.iter().map(|s| s.particles).sum::<usize>(), belief.count());
        }
    }
}
