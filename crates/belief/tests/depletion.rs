//! What the rejection filter does when particles run out: noise, copies, proposals, and the typed error.

use std::cell::Cell;

use belief::{Error, Particles, RejectionConfig, RejectionFilter};
use pomdp::{
    Discretise, GenerativeModel, Outcome, Perturb, Proposals, Purpose, Rng, Seed, Step, UpdateReport, Updater,
    conformance,
};
use proptest::prelude::*;
use rand_distr::{Distribution as _, Normal};

/// A position on a line, moved by the action and seen to the next whole number. Positions above 100 are the goal, below −100 the
/// world diverges.
struct Line {
    noise_stddev: f64,
    steps: Cell<usize>,
}

fn line() -> Line {
    Line { noise_stddev: 0.5, steps: Cell::new(0) }
}

impl GenerativeModel for Line {
    type State = f64;
    type Action = f64;
    type Observation = f64;

    fn actions(&self) -> &[f64] {
        &[-1.0, 1.0]
    }

    fn step(&self, position: &mut f64, action: &f64, _rng: &mut Rng) -> Step<f64> {
        self.steps.set(self.steps.get() + 1);
        *position += action;
        let outcome = match *position {
            p if p > 100.0 => Outcome::Terminal,
            p if p < -100.0 => Outcome::Diverged,
            _ => Outcome::Continue,
        };
        Step { observation: *position, reward: 0.0, outcome }
    }

    fn discount(&self) -> f64 {
        1.0
    }
}

impl Discretise for Line {
    type Key = i64;

    fn key(&self, observation: &f64) -> i64 {
        observation.round() as i64
    }
}

impl Perturb for Line {
    fn perturb(&self, position: &mut f64, rng: &mut Rng) {
        *position += Normal::new(0.0, self.noise_stddev).unwrap().sample(rng);
    }
}

fn update(
    config: RejectionConfig,
    model: &Line,
    belief: Vec<f64>,
    (action, observation): (f64, f64),
    proposals: &[f64],
) -> Result<(Vec<f64>, UpdateReport), Error> {
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let belief = Particles::uniform(belief).unwrap();
    let (belief, report) = RejectionFilter::new(config).unwrap().update(
        model,
        belief,
        &action,
        &observation,
        Proposals::new(proposals),
        &mut rng,
    )?;
    Ok((belief.into_states(), report))
}

fn config(noise_share: f64, proposal_share: f64) -> RejectionConfig {
    RejectionConfig { particles: 100, max_attempts: 5000, noise_share, proposal_share }
}

#[test]
fn the_test_model_conforms() {
    conformance::check_generative_model(&line(), &[0.0, 3.5, 99.5, -99.5], 20);
}

#[test]
fn an_invalid_config_makes_no_filter() {
    let error = RejectionFilter::new(config(0.5, 1.5)).unwrap_err();
    assert_eq!(error, Error::Config { key: "proposal_share", value: "1.5".into(), limit: "in [0, 1)".into() });
}

#[test]
fn depleted_belief_is_an_error() {
    // Noise of 0.5 cannot bridge 50.
    let error = update(config(0.5, 0.5), &line(), vec![0.0], (1.0, 50.0), &[]).unwrap_err();
    assert_eq!(error, Error::Depleted { attempts: 5000, diverged: 0, terminal: 0 });
    assert!(error.to_string().contains("none of 5000 simulated particles agrees"), "{error}");
}

#[test]
fn noise_recovers_from_a_wrong_belief() {
    // The action brings the particles to 0.7 and 1; class 2 begins at 1.5, one standard deviation of the noise further.
    let belief = vec![-0.3, 0.0];
    let without = update(config(0.0, 0.0), &line(), belief.clone(), (1.0, 2.0), &[]);
    assert_eq!(without.unwrap_err(), Error::Depleted { attempts: 5000, diverged: 0, terminal: 0 });
    let (states, report) = update(config(0.5, 0.0), &line(), belief, (1.0, 2.0), &[]).unwrap();
    assert_eq!(states.len(), 100);
    assert!(states.iter().all(|&s| line().key(&s) == 2), "{states:?}");
    assert_eq!(report.reinvigorated, 100);
    assert_eq!(report.log_evidence, f64::NEG_INFINITY, "the belief itself explained nothing");
    assert!(report.acceptance > 0.0);
    assert!(report.transitions > 2500, "noise came before the plain attempts were used");
}

#[test]
fn what_is_left_is_duplicated_to_the_full_count() {
    // One particle in a thousand agrees, at one of two places; without noise about 5 of 5000 attempts are kept.
    let mut belief = vec![50.0; 1998];
    belief.extend([0.1, -0.1]);
    let (states, report) = update(config(0.0, 0.0), &line(), belief, (1.0, 1.0), &[]).unwrap();
    assert_eq!(states.len(), 100);
    assert!(states.iter().all(|&s| line().key(&s) == 1));
    let kept = (report.acceptance * 5000.0).round();
    assert!((1.0..15.0).contains(&kept), "{kept}");
    assert_eq!(report.transitions, 5000);
    assert_eq!(report.log_evidence, (kept / 5000.0).ln());
    assert_eq!(report.reinvigorated, 0, "copies are not noise");
}

#[test]
fn terminal_particles_disagree_while_the_episode_goes_on() {
    // The class of 100.4 is 100, that of the terminal 100.3 too: only the outcome tells them apart.
    let terminal = update(config(0.0, 0.0), &line(), vec![99.3], (1.0, 100.4), &[]).unwrap_err();
    assert_eq!(terminal, Error::Depleted { attempts: 5000, diverged: 0, terminal: 5000 });
    let (states, report) = update(config(0.0, 0.0), &line(), vec![99.3, 98.8], (1.0, 99.9), &[]).unwrap();
    assert!(states.iter().all(|&s| s == 99.8), "{states:?}");
    // Null: each attempt is terminal with probability 1/2 until 100 are kept: mean 0.5, tolerance 4 · √(0.25 / 200) = 0.14.
    assert!((report.acceptance - 0.5).abs() < 0.14, "{}", report.acceptance);
}

#[test]
fn diverged_particles_are_dropped_and_counted() {
    let (states, report) = update(config(0.0, 0.0), &line(), vec![-99.3, -98.8], (-1.0, -99.8), &[]).unwrap();
    assert!(states.iter().all(|&s| s == -99.8), "{states:?}");
    assert_eq!(report.diverged, report.transitions - 100);
    assert!(report.diverged > 50);
}

#[test]
fn proposals_take_their_share_and_no_more() {
    let proposals: Vec<f64> = (0..60).map(|i| 1.0 + f64::from(i) / 1000.0).collect();
    let (states, report) = update(config(0.0, 0.25), &line(), vec![0.2], (1.0, 1.0), &proposals).unwrap();
    assert_eq!(&states[75..], &proposals[..25]);
    assert!(states[..75].iter().all(|&s| s == 1.2));
    assert_eq!((report.proposed, report.transitions), (25, 75));
    let (states, report) = update(config(0.0, 0.25), &line(), vec![0.2], (1.0, 1.0), &proposals[..3]).unwrap();
    assert_eq!((states.len(), report.proposed), (100, 3));
}

#[test]
fn proposals_alone_make_the_belief_where_simulation_explains_nothing() {
    let (states, report) = update(config(0.5, 0.25), &line(), vec![0.0], (1.0, 50.0), &[49.9, 50.1]).unwrap();
    assert_eq!(states.iter().filter(|&&s| s == 49.9).count(), 50);
    assert_eq!(states.iter().filter(|&&s| s == 50.1).count(), 50);
    assert_eq!((report.proposed, report.reinvigorated), (100, 0));
    assert_eq!((report.acceptance, report.log_evidence), (0.0, f64::NEG_INFINITY));
}

#[test]
fn a_share_of_zero_ignores_proposals_even_in_depletion() {
    let error = update(config(0.5, 0.0), &line(), vec![0.0], (1.0, 50.0), &[50.0]).unwrap_err();
    assert!(matches!(error, Error::Depleted { .. }));
}

proptest! {
    #[test]
    fn the_count_the_class_and_the_attempts_hold_for_every_setting(
        particles in 1_usize..40,
        more in 0_usize..200,
        noise_share in 0.0..1.0_f64,
        proposal_share in 0.0..1.0_f64,
        belief in prop::collection::vec(-3.0..3.0_f64, 1..20),
        observation in -4.0..4.0_f64,
        proposed in 0_usize..50,
    ) {
        let model = line();
        let config = RejectionConfig { particles, max_attempts: particles + more, noise_share, proposal_share };
        let proposals = vec![observation; proposed];
        match update(config, &model, belief, (1.0, observation), &proposals) {
            Ok((states, report)) => {
                prop_assert_eq!(states.len(), particles);
                prop_assert!(states.iter().all(|s| model.key(s) == model.key(&observation)));
                prop_assert_eq!(report.transitions, model.steps.get());
                prop_assert!(report.transitions <= particles + more);
                prop_assert!(report.reinvigorated + report.proposed <= particles);
                prop_assert!((0.0..=1.0).contains(&report.acceptance));
            }
            Err(error) => {
                prop_assert_eq!(error, Error::Depleted { attempts: particles + more, diverged: 0, terminal: 0 });
            }
        }
    }
}
