//! Static parameters of two structures: calibration, evidence of each structure, quotas, outside proposals.

mod common;

use belief::{Particles, WeightedConfig, WeightedFilter};
use common::{assert_mean, config, moments, track};
use pomdp::{Belief as _, GenerativeModel as _, Proposals, Purpose, Rng, Seed, Updater as _, conformance};
use problems::static_parameter::{Kind, StaticParameter, Thing};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

fn problem(noise_stddev: f64) -> StaticParameter {
    StaticParameter { noise_stddev, stiff: 0.4, bound: f64::INFINITY }
}

fn episode(model: &StaticParameter, truth: &mut Thing, steps: usize, rng: &mut Rng) -> Vec<(f64, f64)> {
    let act = |t: usize| {
        let action = model.actions()[t % 4];
        (action, model.step(truth, &action, rng).observation)
    };
    (0..steps).map(act).collect()
}

/// Displacement under a unit action: a number that every structure has.
fn response(thing: &Thing) -> f64 {
    thing.theta.iter().sum()
}

fn stiff_share(belief: &Particles<Thing>) -> f64 {
    belief.iter().filter(|(t, _)| t.kind == Kind::Stiff).map(|(_, w)| w).sum()
}

#[test]
fn the_test_model_conforms() {
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let model = problem(0.1);
    let states: Vec<Thing> = (0..20).map(|_| model.sample(&mut rng)).collect();
    conformance::check_generative_model(&model, &states, 8);
    conformance::check_observation_model(&model, &states, 20);
    conformance::check_perturb(&model, &states, 20, |_| true);
    conformance::check_perturb_is_centred(&model, &states[0], 2000, |thing| thing.theta.clone());
    conformance::check_static_parameters(&model, &states, 1e-12);
    conformance::check_parameters_stay(&model, &states, 8, 0.0);
}

/// Simulation-based calibration (Talts et al. 2018) over `episodes` worlds drawn from the prior.
fn calibrate(model: &StaticParameter, config: &WeightedConfig, episodes: u64, bridged: bool) {
    // Null: among 9 draws from the belief, the rank of the true response is uniform on 0..=9; χ² with 9 degrees of freedom exceeds 29.7
    // with probability 0.0005. The same for θ₁ of the loose worlds.
    // Null: P(stiff) is that of Bayes' rule in the mean; tolerance 4 standard errors.
    // Null: ln evidence of the whole episode is unbiased in exp; tolerance 4 standard errors.
    let mut filter = WeightedFilter::new(config.clone()).unwrap();
    let (mut ranks, mut slopes) = ([0.0; 10], [0.0; 10]);
    let mut surplus = Vec::new();
    let mut ratios = Vec::new();
    let (mut bridges, mut resamplings) = (0, 0);
    for index in 0..episodes {
        let mut rng = Seed(3).stream(Purpose::Test, index);
        let mut truth = model.sample(&mut rng);
        let history = episode(model, &mut truth, 6, &mut rng);
        let start = (0..config.particles_min).map(|_| model.sample(&mut rng)).collect();
        let (belief, reports) = track(&mut filter, model, start, &history, &mut rng);
        let below = (0..9).filter(|_| response(belief.sample(&mut rng)) < response(&truth)).count();
        ranks[below] += 1.0;
        // Which episodes count is decided by the data alone, so the ranks stay uniform.
        if truth.kind == Kind::Loose && stiff_share(&belief) < 0.9 {
            let mut slope = || {
                loop {
                    let drawn = belief.sample(&mut rng);
                    if drawn.kind == Kind::Loose {
                        break drawn.theta[1];
                    }
                }
            };
            slopes[(0..9).filter(|_| slope() < truth.theta[1]).count()] += 1.0;
        }
        let share = stiff_share(&belief);
        surplus.push(share - model.stiff_posterior(&history).0);
        let log_evidence: f64 = reports.iter().map(|r| r.log_evidence).sum();
        ratios.push((log_evidence - model.stiff_posterior(&history).1).exp());
        bridges += reports.iter().map(|r| r.bridges).sum::<usize>();
        resamplings += reports.iter().filter(|r| r.resampled).count();
    }
    assert!(resamplings as u64 > episodes / 2);
    assert_eq!(bridges > 0, bridged, "{bridges} bridges");
    for (what, ranks) in [("response", ranks), ("slope", slopes)] {
        let expected = ranks.iter().sum::<f64>() / 10.0;
        let chi_squared: f64 = ranks.iter().map(|r| (r - expected).powi(2) / expected).sum();
        println!("ranks of the {what}: χ² {chi_squared:.1}, n = {}: {ranks:?}", 10.0 * expected);
        assert!(chi_squared < 29.7, "{what}: {chi_squared}: {ranks:?}");
    }
    assert_mean(&surplus, 0.0, 4.0, "error of P(stiff)");
    assert_mean(&ratios, 1.0, 4.0, "evidence ratio");
}

#[test]
fn static_parameters_are_calibrated() {
    calibrate(&problem(0.3), &WeightedConfig { structure_quota: 30, ..config(800) }, 1000, false);
}

#[test]
fn static_parameters_are_calibrated_with_tempering() {
    let config = WeightedConfig { structure_quota: 30, tempering_share: 0.3, max_bridges: 20, ..config(800) };
    calibrate(&problem(0.05), &config, 500, true);
}

#[test]
fn smoothing_keeps_moments_and_makes_no_copies() {
    // Six updates of which every one resamples (share 1). Null: over n = 100 episodes the mean of the filtered mean's error (in exact
    // standard deviations) is 0 and of the variance ratio 1, for both parameters of the loose structure; tolerance 4 standard errors.
    // Without shrinkage the kernels would add 2 % of the variance each time: more than ten standard errors.
    let model = StaticParameter { noise_stddev: 0.5, stiff: 1e-9, bound: f64::INFINITY };
    let config = WeightedConfig { resample_share: 1.0, smoothing_discount: 0.9, ..config(2000) };
    let mut filter = WeightedFilter::new(config).unwrap();
    let mut errors = [const { Vec::new() }; 2];
    let mut ratios = [const { Vec::new() }; 2];
    for index in 0..100 {
        let mut rng = Seed(4).stream(Purpose::Test, index);
        let mut truth = model.sample(&mut rng);
        let history = episode(&model, &mut truth, 6, &mut rng);
        let start = (0..2000).map(|_| model.sample(&mut rng)).collect();
        let (belief, reports) = track(&mut filter, &model, start, &history, &mut rng);
        assert!(reports.iter().all(|r| r.reinvigorated == 2000));
        let mut responses: Vec<f64> = belief.states().iter().map(response).collect();
        responses.sort_by(f64::total_cmp);
        assert!(responses.windows(2).all(|w| w[0] != w[1]), "two particles are the same");
        let exact = model.exact(Kind::Loose, &history);
        for axis in 0..2 {
            let (mean, variance) = moments(&belief, |t| Some(t.theta[axis]));
            errors[axis].push((mean - exact.mean[axis]) / exact.covariance[axis][axis].sqrt());
            ratios[axis].push(variance / exact.covariance[axis][axis]);
        }
    }
    for axis in 0..2 {
        assert_mean(&errors[axis], 0.0, 4.0, "error of the mean");
        assert_mean(&ratios[axis], 1.0, 4.0, "ratio of variances");
    }
}

#[test]
fn a_quota_keeps_a_rare_structure_alive_and_the_belief_unbiased() {
    // One world in 300 is stiff, and 60 particles are drawn: most start with none of them in the long run. The starts are drawn with 10 stiff
    // ones of correct weight. Null: the mean over n = 3000 filters of exp(ln evidence) P(stiff) is p(observations, stiff), of
    // exp(ln evidence) P(loose) likewise; tolerance 4 standard errors.
    let model = StaticParameter { noise_stddev: 0.5, stiff: 1.0 / 300.0, bound: f64::INFINITY };
    let history = [(1.0, 0.9), (-1.0, -0.8), (2.0, 1.9), (0.5, 0.4)];
    let quota = WeightedConfig {
        structure_quota: 10,
        structure_threshold: 1e-5,
        resample_share: 1.0,
        smoothing_discount: 1.0,
        ..config(60)
    };
    let run = |config: &WeightedConfig, index: u64| {
        let mut filter = WeightedFilter::new(config.clone()).unwrap();
        let mut rng = Seed(5).stream(Purpose::Test, index);
        let draw = |stiff: bool, rng: &mut Rng| loop {
            let thing = StaticParameter { stiff: 0.5, ..model }.sample(rng);
            if (thing.kind == Kind::Stiff) == stiff {
                break thing;
            }
        };
        let states: Vec<Thing> = (0..60).map(|i| draw(i < 10, &mut rng)).collect();
        let weight = |i: usize| if i < 10 { model.stiff / 10.0 } else { (1.0 - model.stiff) / 50.0 };
        let mut belief = Particles::weighted(states, (0..60).map(weight).collect()).unwrap();
        let mut log_evidence = 0.0;
        let mut latest = None;
        for (action, observation) in history {
            let (next, report) =
                filter.update(&model, belief, &action, &observation, Proposals::none(), &mut rng).unwrap();
            belief = next;
            log_evidence += report.log_evidence;
            assert_eq!(report.particles, 60);
            latest = Some(report);
        }
        (log_evidence.exp(), stiff_share(&belief), latest.unwrap())
    };
    let (share, exact) = model.stiff_posterior(&history);
    let (mut stiff, mut loose) = (Vec::new(), Vec::new());
    for index in 0..3000 {
        let (evidence, p, report) = run(&quota, index);
        stiff.push(evidence * p);
        loose.push(evidence * (1.0 - p));
        let books = &report.structures[0];
        assert_eq!((books.structure.as_str(), report.structures.len()), ("Stiff", 2));
        assert!(books.particles >= 10 && (books.posterior - p).abs() < 1e-9);
        // Bayes' rule within the report.
        let by_bayes = report.log_evidence + (books.posterior / books.prior).ln();
        assert!((books.log_evidence - by_bayes).abs() < 1e-9);
    }
    assert_mean(&stiff, share * exact.exp(), 4.0, "p(observations, stiff)");
    assert_mean(&loose, (1.0 - share) * exact.exp(), 4.0, "p(observations, loose)");
    // Without a quota the rare structure dies in most filters.
    let without = WeightedConfig { structure_quota: 0, structure_threshold: 1.0, ..quota };
    let dead = (0..200).filter(|&index| run(&without, index).1 == 0.0).count();
    assert!(dead > 50, "{dead} of 200");
}

/// A proposal density: structure by probability, each parameter Gaussian.
struct Suggestion {
    stiff: f64,
    mean: [f64; 2],
    stddev: f64,
}

impl Suggestion {
    fn draw(&self, rng: &mut Rng) -> Thing {
        let kind = if rng.random_bool(self.stiff) { Kind::Stiff } else { Kind::Loose };
        let count = if kind == Kind::Stiff { 1 } else { 2 };
        let theta = (0..count)
            .map(|i| {
                let z: f64 = StandardNormal.sample(rng);
                // The response of both structures is the sum of the means.
                let mean = if kind == Kind::Stiff { self.mean[0] + self.mean[1] } else { self.mean[i] };
                mean + self.stddev * z
            })
            .collect();
        Thing { kind, theta, displacement: 0.0 }
    }

    fn log_density(&self, thing: &Thing) -> f64 {
        let (log_kind, means) = match thing.kind {
            Kind::Stiff => (self.stiff.ln(), vec![self.mean[0] + self.mean[1]]),
            Kind::Loose => ((1.0 - self.stiff).ln(), self.mean.to_vec()),
        };
        let normal = |(x, mean): (&f64, f64)| {
            -0.5 * ((x - mean) / self.stddev).powi(2) - self.stddev.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln()
        };
        log_kind + thing.theta.iter().zip(means).map(normal).sum::<f64>()
    }
}

/// Filters on worlds from the prior with the proposals of `suggest(truth)`; mean effective size before resampling and mean share of proposals.
fn with_proposals(config: &WeightedConfig, episodes: u64, suggest: impl Fn(&Thing) -> Suggestion) -> (f64, f64) {
    // Null: as in `calibrate`, over n episodes of 3 steps: the response's ranks are uniform, the mean errors of P(stiff) and of the
    // evidence ratio vanish.
    let model = problem(0.2);
    let mut filter = WeightedFilter::new(config.clone()).unwrap();
    let mut ranks = [0.0; 10];
    let (mut surplus, mut size, mut taken) = (Vec::new(), 0.0, 0.0);
    let mut ratios = Vec::new();
    for index in 0..episodes {
        let mut rng = Seed(6).stream(Purpose::Test, index);
        let mut truth = model.sample(&mut rng);
        let suggestion = suggest(&truth);
        let history = episode(&model, &mut truth, 3, &mut rng);
        let start = (0..config.particles_min).map(|_| model.sample(&mut rng)).collect();
        let mut belief = Particles::uniform(start).unwrap();
        let mut log_evidence = 0.0;
        for (action, observation) in &history {
            let draws: Vec<Thing> = (0..config.particles_min).map(|_| suggestion.draw(&mut rng)).collect();
            let density = |thing: &Thing| suggestion.log_density(thing);
            let proposals = Proposals::weighted(&draws, &density);
            let (next, report) = filter.update(&model, belief, action, observation, proposals, &mut rng).unwrap();
            belief = next;
            log_evidence += report.log_evidence;
            size += report.effective_sample_size_before / (3 * episodes) as f64;
            taken += report.proposed as f64 / report.particles as f64 / (3 * episodes) as f64;
        }
        let below = (0..9).filter(|_| response(belief.sample(&mut rng)) < response(&truth)).count();
        ranks[below] += 1.0;
        let share = stiff_share(&belief);
        surplus.push(share - model.stiff_posterior(&history).0);
        ratios.push((log_evidence - model.stiff_posterior(&history).1).exp());
    }
    let expected = episodes as f64 / 10.0;
    let chi_squared: f64 = ranks.iter().map(|r| (r - expected).powi(2) / expected).sum();
    println!("χ² {chi_squared:.1}, size {size:.1}, taken {taken:.3}");
    assert!(chi_squared < 29.7, "{chi_squared}: {ranks:?}");
    assert_mean(&surplus, 0.0, 4.0, "error of P(stiff)");
    assert_mean(&ratios, 1.0, 4.0, "evidence ratio");
    (size, taken)
}

fn proposing() -> WeightedConfig {
    WeightedConfig { proposal_share: 0.3, structure_quota: 20, ..config(600) }
}

#[test]
fn good_proposals_leave_the_belief_calibrated_and_enlarge_the_effective_size() {
    // Good: near the truth, as a network that saw it might be; independent of the noise of the observations, like a prior.
    let good = |truth: &Thing| {
        let mean = match truth.kind {
            Kind::Stiff => [0.4 * truth.theta[0], 0.6 * truth.theta[0]],
            Kind::Loose => [truth.theta[0], truth.theta[1]],
        };
        Suggestion { stiff: 0.4, mean, stddev: 0.15 }
    };
    let (with, taken) = with_proposals(&proposing(), 600, good);
    let none = WeightedConfig { proposal_share: 0.0, ..proposing() };
    let (without, _) = with_proposals(&none, 200, good);
    assert!(with > 1.2 * without, "{with} {without}");
    assert!(taken > 0.2, "{taken}");
}

#[test]
fn wrong_proposals_leave_the_belief_calibrated() {
    let (_, taken) = with_proposals(&proposing(), 600, |_| Suggestion { stiff: 0.9, mean: [4.0, 4.0], stddev: 1.0 });
    assert!(taken < 0.05, "{taken}");
}

#[test]
fn confident_and_wrong_proposals_leave_the_belief_calibrated() {
    // Narrow and at a place that is possible but has nothing to do with the truth.
    let (_, taken) = with_proposals(&proposing(), 600, |_| Suggestion { stiff: 0.95, mean: [0.5, 0.9], stddev: 0.02 });
    assert!(taken < 0.2, "{taken}");
}

#[test]
fn proposals_stay_calibrated_with_tempering() {
    let config = WeightedConfig { tempering_share: 0.3, max_bridges: 20, ..proposing() };
    with_proposals(&config, 400, |_| Suggestion { stiff: 0.5, mean: [0.5, 0.5], stddev: 0.3 });
}

#[test]
fn impossible_values_are_drawn_again() {
    // Bound 1.2: a fifth of the prior's kernels reach over it. No particle may.
    let model = StaticParameter { noise_stddev: 0.5, stiff: 0.4, bound: 1.2 };
    let mut rng = Seed(7).stream(Purpose::Test, 0);
    let mut start = Vec::new();
    while start.len() < 500 {
        let thing = model.sample(&mut rng);
        if thing.theta.iter().all(|x| x.abs() <= 1.2) {
            start.push(thing);
        }
    }
    for tempering_share in [0.0, 0.9] {
        let config = WeightedConfig {
            resample_share: 1.0,
            smoothing_discount: 0.8,
            tempering_share,
            max_bridges: 10,
            ..config(500)
        };
        let mut filter = WeightedFilter::new(config).unwrap();
        let (belief, reports) =
            track(&mut filter, &model, start.clone(), &[(1.0, 1.1), (1.0, 1.2), (2.0, 2.2)], &mut rng);
        assert!(belief.states().iter().all(|t| t.theta.iter().all(|x| x.abs() <= 1.2)));
        assert!(reports.iter().all(|r| r.reinvigorated > 300), "{reports:?}");
    }
}
