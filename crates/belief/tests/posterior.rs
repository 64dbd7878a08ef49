//! The rejection filter against the exact posterior of a hidden Markov model.

use belief::{Particles, RejectionConfig, RejectionFilter};
use pomdp::{Discretise, GenerativeModel, Outcome, Perturb, Proposals, Purpose, Rng, Seed, Step, Updater, conformance};
use rand::RngExt as _;

const STATES: usize = 3;
/// P(s' | s) for each action.
const TRANSITION: [[[f64; STATES]; STATES]; 2] =
    [[[0.7, 0.2, 0.1], [0.1, 0.6, 0.3], [0.25, 0.25, 0.5]], [[0.1, 0.8, 0.1], [0.3, 0.1, 0.6], [0.9, 0.05, 0.05]]];
/// P(o | s').
const EMISSION: [[f64; 2]; STATES] = [[0.9, 0.1], [0.5, 0.5], [0.2, 0.8]];
const PRIOR: [f64; STATES] = [0.5, 0.3, 0.2];
/// Actions and observations of the episode.
const HISTORY: [(usize, usize); 5] = [(0, 1), (1, 0), (0, 0), (1, 1), (0, 1)];

struct Markov;

fn draw(probabilities: &[f64], rng: &mut Rng) -> usize {
    let mut rest: f64 = rng.random();
    for (index, p) in probabilities.iter().enumerate() {
        rest -= p;
        if rest < 0.0 {
            return index;
        }
    }
    probabilities.len() - 1
}

impl GenerativeModel for Markov {
    type State = usize;
    type Action = usize;
    type Observation = usize;

    fn actions(&self) -> &[usize] {
        &[0, 1]
    }

    fn step(&self, state: &mut usize, action: &usize, rng: &mut Rng) -> Step<usize> {
        *state = draw(&TRANSITION[*action][*state], rng);
        Step { observation: draw(&EMISSION[*state], rng), reward: 0.0, outcome: Outcome::Continue }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl Discretise for Markov {
    type Key = usize;

    fn key(&self, observation: &usize) -> usize {
        *observation
    }
}

impl Perturb for Markov {
    fn perturb(&self, _state: &mut usize, _rng: &mut Rng) {
        panic!("nothing was depleted, so no noise is due");
    }
}

/// Posterior and evidence by Bayes' rule.
fn bayes(prior: [f64; STATES], action: usize, observation: usize) -> ([f64; STATES], f64) {
    let joint: [f64; STATES] = std::array::from_fn(|next| {
        let predicted: f64 = (0..STATES).map(|s| prior[s] * TRANSITION[action][s][next]).sum();
        predicted * EMISSION[next][observation]
    });
    let evidence = joint.iter().sum();
    (joint.map(|p| p / evidence), evidence)
}

fn counts(belief: &Particles<usize>) -> [f64; STATES] {
    let mut counts = [0.0; STATES];
    belief.states().iter().for_each(|&s| counts[s] += 1.0);
    counts
}

fn filter(particles: usize) -> RejectionFilter {
    RejectionFilter::new(RejectionConfig {
        particles,
        max_attempts: 100 * particles,
        noise_share: 0.5,
        proposal_share: 0.5,
    })
    .unwrap()
}

#[test]
fn the_test_model_conforms() {
    conformance::check_generative_model(&Markov, &[0, 1, 2], 50);
}

#[test]
fn one_update_draws_from_the_exact_posterior() {
    // Null: from the exact prior, given as three weighted particles, the new particles are independent draws from the exact
    // posterior. n = 20,000 a step; the sum of five χ² with 2 degrees of freedom exceeds 29.59 with probability 0.001. A posterior
    // off by 0.02 in two states adds about 50 a step.
    let n = 20_000;
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let mut exact = PRIOR;
    let mut chi_squared = 0.0;
    for (action, observation) in HISTORY {
        let belief = Particles::weighted(vec![0, 1, 2], exact.to_vec()).unwrap();
        let (belief, report) =
            filter(n).update(&Markov, belief, &action, &observation, Proposals::none(), &mut rng).unwrap();
        let evidence;
        (exact, evidence) = bayes(exact, action, observation);
        for (count, p) in counts(&belief).into_iter().zip(exact) {
            let expected = p * n as f64;
            chi_squared += (count - expected).powi(2) / expected;
        }
        // Null: acceptance is binomial with the exact evidence; tolerance 4 standard deviations of its mean.
        let deviation = (evidence * (1.0 - evidence) / report.transitions as f64).sqrt();
        assert!((report.acceptance - evidence).abs() < 4.0 * deviation, "{} instead of {evidence}", report.acceptance);
        assert_eq!(report.log_evidence, report.acceptance.ln());
        assert_eq!((report.reinvigorated, report.proposed, report.diverged), (0, 0, 0));
        assert_eq!(report.effective_sample_size, n as f64);
    }
    assert!(chi_squared < 29.59, "{chi_squared}");
}

#[test]
fn a_chain_of_updates_follows_the_exact_posterior() {
    // Each of five updates resamples n = 20,000 particles, so the error of a frequency has a variance of at most 5 · 0.25 / n;
    // tolerance 4 standard deviations = 0.032. (The true errors are smaller: the chain forgets.)
    let n = 20_000;
    let mut rng = Seed(2).stream(Purpose::Test, 0);
    let mut belief = Particles::weighted(vec![0, 1, 2], PRIOR.to_vec()).unwrap();
    let mut exact = PRIOR;
    for (action, observation) in HISTORY {
        (belief, _) = filter(n).update(&Markov, belief, &action, &observation, Proposals::none(), &mut rng).unwrap();
        (exact, _) = bayes(exact, action, observation);
    }
    let errors: Vec<f64> = counts(&belief).iter().zip(exact).map(|(c, p)| c / n as f64 - p).collect();
    assert!(errors.iter().all(|e| e.abs() < 0.032), "{errors:?}");
}

#[test]
fn equal_seeds_give_equal_beliefs_and_other_seeds_others() {
    let run = |item| {
        let mut rng = Seed(1).stream(Purpose::Test, item);
        let belief = Particles::uniform(vec![0, 1, 2]).unwrap();
        filter(100).update(&Markov, belief, &0, &1, Proposals::new(&[0, 1]), &mut rng).unwrap()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}
