//! The weighted filter against Bayes' rule on a hidden Markov model and against Kalman's filter.

mod common;

use belief::{WeightedConfig, WeightedFilter};
use common::{assert_mean, config, moments, track};
use pomdp::{Belief as _, Purpose, Rng, Seed, conformance};
use problems::hmm::{Hmm, STATES};
use problems::linear_gaussian::{Gaussian, LinearGaussian};
use rand::RngExt as _;

/// Actions and observations of the episode.
const HISTORY: [(usize, usize); 5] = [(0, 1), (1, 0), (0, 0), (1, 1), (0, 1)];
const PRIOR: [f64; STATES] = [0.5, 0.3, 0.2];

fn tempered(particles: usize) -> WeightedConfig {
    WeightedConfig { tempering_share: 0.5, max_bridges: 30, ..config(particles) }
}

fn prior_draws(count: usize, rng: &mut Rng) -> Vec<usize> {
    let draw = |u: f64| usize::from(u >= PRIOR[0]) + usize::from(u >= PRIOR[0] + PRIOR[1]);
    (0..count).map(|_| draw(rng.random())).collect()
}

#[test]
fn the_test_models_conform() {
    conformance::check_generative_model(&Hmm::vague(), &[0, 1, 2], 50);
    let line = LinearGaussian { gain: 0.9, process_stddev: 0.3, observation_stddev: 0.5 };
    conformance::check_generative_model(&line, &[0.0, 1.0], 20);
    conformance::check_observation_model(&line, &[0.0, 3.0], 100);
    for model in [Hmm::vague(), Hmm::sharp()] {
        conformance::check_observation_model(&model, &[0, 1, 2], 500);
        conformance::check_discrete_likelihoods(&model, &[0, 1, 2], 5, &[0, 1]);
        conformance::check_discretise(&model, &[0, 1, 2], 20);
    }
}

/// A draw from the belief after every step of `episodes` independent filters, against the exact posterior; and the mean of the ratio of
/// estimated to exact evidence.
fn against_bayes(model: &Hmm, config: &WeightedConfig, episodes: usize, bridged: bool) {
    // Null: a draw from each of n independent beliefs follows the exact posterior (the filter's own bias is of the order of 1/particles
    // and far below 1/√n). χ² with 2 degrees of freedom exceeds 17.0 with probability 0.0002, for each of 5 steps.
    // Null: the mean of exp(ln evidence − exact) over the n episodes is 1; tolerance 4 of its standard errors.
    let mut filter = WeightedFilter::new(config.clone()).unwrap();
    let mut counts = [[0.0; STATES]; 5];
    let mut ratios = Vec::new();
    let (mut resamplings, mut bridges) = (0, 0);
    let mut exact = PRIOR;
    let mut exact_log_evidence = 0.0;
    let mut posteriors = Vec::new();
    for (action, observation) in HISTORY {
        let evidence;
        (exact, evidence) = model.bayes(exact, action, observation);
        exact_log_evidence += evidence.ln();
        posteriors.push(exact);
    }
    for episode in 0..episodes {
        let mut rng = Seed(1).stream(Purpose::Test, episode as u64);
        let start = prior_draws(config.particles_min, &mut rng);
        let mut log_evidence = 0.0;
        for (time, counts) in counts.iter_mut().enumerate() {
            // The filter has no memory without restarts: a prefix of the history gives the belief at that time.
            if time == HISTORY.len() - 1 || episode % 5 == time {
                let (belief, reports) = track(&mut filter, model, start.clone(), &HISTORY[..=time], &mut rng);
                counts[*belief.sample(&mut rng)] += 1.0;
                if time == HISTORY.len() - 1 {
                    log_evidence = reports.iter().map(|r| r.log_evidence).sum();
                    resamplings += reports.iter().filter(|r| r.resampled).count();
                    bridges += reports.iter().map(|r| r.bridges).sum::<usize>();
                    assert!(reports.iter().all(|r| r.temperature == 1.0));
                }
            }
        }
        ratios.push((log_evidence - exact_log_evidence).exp());
    }
    assert!(resamplings > 0, "nothing was resampled: the test shows nothing");
    assert_eq!(bridges > 0, bridged, "{bridges} bridges");
    for (time, (counts, posterior)) in counts.iter().zip(&posteriors).enumerate() {
        let n: f64 = counts.iter().sum();
        let chi_squared: f64 = counts.iter().zip(posterior).map(|(c, p)| (c - n * p).powi(2) / (n * p)).sum();
        println!("step {time}: χ² {chi_squared:.2}, n = {n}");
        assert!(chi_squared < 17.0, "step {time}: {chi_squared} for {counts:?} and {posterior:?}");
    }
    assert_mean(&ratios, 1.0, 4.0, "evidence ratio");
}

#[test]
fn draws_follow_the_exact_posterior_and_evidence_is_unbiased() {
    against_bayes(&Hmm::vague(), &config(50), 8000, false);
    against_bayes(&Hmm::vague(), &WeightedConfig { resample_share: 1.0, ..config(50) }, 4000, false);
}

#[test]
fn sharp_observations_change_neither() {
    against_bayes(&Hmm::sharp(), &config(100), 3000, false);
}

#[test]
fn tempering_changes_neither() {
    against_bayes(&Hmm::sharp(), &tempered(100), 3000, true);
}

/// Errors of mean and variance, in units of the exact ones, and ratios of evidence, of filters on episodes of a linear-Gaussian system.
fn against_kalman(model: &LinearGaussian, config: &WeightedConfig, episodes: u64, steps: usize, bridged: bool) {
    // Null: the mean over n episodes of (filtered mean − exact) / exact standard deviation is 0, of the ratio of the variances 1, and of
    // that of the evidence 1; tolerance 4 standard errors. The self-normalised weights bias the variance by about −1 / effective size,
    // here a quarter of a standard error.
    let mut filter = WeightedFilter::new(config.clone()).unwrap();
    let (mut means, mut variances, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let mut bridges = 0;
    for episode in 0..episodes {
        let mut rng = Seed(2).stream(Purpose::Test, episode);
        let prior = Gaussian { mean: 0.0, variance: 1.0 };
        let mut truth = prior.sample(&mut rng);
        let history: Vec<(f64, f64)> = (0..steps)
            .map(|t| {
                use pomdp::GenerativeModel as _;
                let action = model.actions()[t % 3];
                (action, model.step(&mut truth, &action, &mut rng).observation)
            })
            .collect();
        let (mut exact, mut exact_log_evidence) = (prior, 0.0);
        for (action, observation) in &history {
            let log;
            (exact, log) = model.kalman(exact, *action, *observation);
            exact_log_evidence += log;
        }
        let start = (0..config.particles_min).map(|_| prior.sample(&mut rng)).collect();
        let (belief, reports) = track(&mut filter, model, start, &history, &mut rng);
        let (mean, variance) = moments(&belief, |x| Some(*x));
        means.push((mean - exact.mean) / exact.variance.sqrt());
        variances.push(variance / exact.variance);
        ratios.push((reports.iter().map(|r| r.log_evidence).sum::<f64>() - exact_log_evidence).exp());
        bridges += reports.iter().map(|r| r.bridges).sum::<usize>();
    }
    assert_eq!(bridges > 0, bridged, "{bridges} bridges");
    assert_mean(&means, 0.0, 4.0, "error of the mean");
    assert_mean(&variances, 1.0, 4.0, "ratio of variances");
    assert_mean(&ratios, 1.0, 4.0, "evidence ratio");
}

#[test]
fn kalman_is_met() {
    let model = LinearGaussian { gain: 0.9, process_stddev: 0.5, observation_stddev: 0.5 };
    against_kalman(&model, &config(300), 400, 8, false);
}

#[test]
fn kalman_is_met_with_tempering_where_the_sensor_is_sharp() {
    // The observation is 25 times sharper than the prediction: 300 particles leave an effective size of some 15.
    let model = LinearGaussian { gain: 0.9, process_stddev: 0.5, observation_stddev: 0.02 };
    against_kalman(&model, &WeightedConfig { max_transitions: 100_000, ..tempered(300) }, 200, 4, true);
}
