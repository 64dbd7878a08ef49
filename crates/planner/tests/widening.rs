//! Progressive widening against a problem with continuous observations whose values are known by quadrature.

use planner::{ActionPriors, Backup, Budget, Config, Error, Exploration, Observations, Pomcp, Pomcpow, RolloutDepth};
use pomdp::{Belief, GenerativeModel, ObservationModel, Outcome, Policy, Purpose, Rng, Seed, Step};
use problems::LightDark;
use problems::light_dark::Walk;
use problems::tiger::Action;
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

const DISCOUNT: f64 = 0.95;

/// Tiger that ends when a door is opened, with ears that hear how far left or right the growl is: normal around ±1 with standard deviation 1.
struct Ears;

impl GenerativeModel for Ears {
    type State = bool;
    type Action = Action;
    type Observation = f64;

    fn actions(&self) -> &[Action] {
        &[Action::Listen, Action::OpenLeft, Action::OpenRight]
    }

    fn step(&self, left: &mut bool, action: &Action, rng: &mut Rng) -> Step<f64> {
        let noise: f64 = StandardNormal.sample(rng);
        let eaten = match action {
            Action::Listen => {
                let observation = noise + if *left { 1.0 } else { -1.0 };
                return Step { observation, reward: -1.0, outcome: Outcome::Continue };
            }
            Action::OpenLeft => *left,
            Action::OpenRight => !*left,
        };
        Step { observation: noise, reward: if eaten { -100.0 } else { 10.0 }, outcome: Outcome::Terminal }
    }

    fn discount(&self) -> f64 {
        DISCOUNT
    }
}

impl ObservationModel for Ears {
    fn log_likelihood(&self, _action: &Action, left: &bool, observation: &f64) -> f64 {
        // Without the constant of the density: weights are relative.
        -0.5 * (observation - if *left { 1.0 } else { -1.0 }).powi(2)
    }
}

/// Optimal value of `horizon` actions where the tiger is on the left with probability `left`, by the trapezoidal rule.
fn optimal(left: f64, horizon: usize) -> f64 {
    if horizon == 0 {
        return 0.0;
    }
    let open = 10.0 - 110.0 * left.min(1.0 - left);
    let (step, steps) = (0.1, 60);
    let listen = (-steps..=steps).map(|i| {
        let y = f64::from(i) * step;
        let density = |mean: f64| (-0.5 * (y - mean).powi(2)).exp() / std::f64::consts::TAU.sqrt();
        let (with, without) = (left * density(1.0), (1.0 - left) * density(-1.0));
        let next = if horizon == 1 { 0.0 } else { optimal(with / (with + without), horizon - 1) };
        (with + without) * next * step
    });
    open.max(-1.0 + DISCOUNT * listen.sum::<f64>())
}

/// A rollout that learns nothing: the values below come from the tree alone.
struct Listens;

impl<M: GenerativeModel<Action = Action>> Policy<M> for Listens {
    fn action(&self, _model: &M, _state: &M::State, _rng: &mut Rng) -> Action {
        Action::Listen
    }
}

struct Even;

impl Belief for Even {
    type State = bool;

    fn sample(&self, rng: &mut Rng) -> &bool {
        if rng.random() { &true } else { &false }
    }
}

fn config(simulations: usize, depth: usize, factor: f64, exponent: f64) -> Config {
    Config {
        budget: Budget::Simulations(simulations),
        exploration: Exploration::Fixed(40.0),
        depth,
        rollout_depth: RolloutDepth::Full,
        action_priors: ActionPriors::Off,
        observations: Observations::Widening { factor, exponent },
        backup: Backup::Mean,
        nodes: 1 << 24,
        ..Config::default()
    }
}

/// Mean and standard error over eight seeds of the value of listening at the root.
fn listening<M>(model: &M, config: &Config) -> (f64, f64)
where
    M: ObservationModel<State = bool, Action = Action> + Sync,
    M::Observation: Send,
{
    let value = |seed| {
        let mut planner = Pomcpow::new(config.clone()).unwrap();
        let mut rng = Seed(seed).stream(Purpose::Search, 0);
        planner.search(model, &Even, &Listens, config.depth, &mut rng).actions[0].value
    };
    let values: Vec<f64> = (1..=8).map(value).collect();
    let mean = values.iter().sum::<f64>() / 8.0;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 56.0).sqrt())
}

#[test]
fn values_of_continuous_observations_are_the_exact_ones() {
    // Null: the mean over eight seeds lies within three standard errors of the exact value. Most of a seed's error comes from the some
    // eighty observations that stand for all. Without weights no branch would tell anything, and listening would be worth −1.95 and
    // −2.85. Exploration lowers the values (by 0.4 at 2^17 simulations for horizon 3), less than the three standard errors.
    // Branches that start with states of their parent: at horizon 2 alone, with twice as many observations for a smaller error. At horizon 3 so many
    // branches leave each too few visits, and exploration lowers the values by 2, with such states and without.
    let cases = [(2, 1.1723, 0, 4.0), (3, 3.4182, 0, 4.0), (2, 1.1723, 20, 8.0)];
    for (horizon, exact, branch_states, factor) in cases {
        assert!((optimal(0.5, horizon) - exact).abs() < 5e-5);
        let config = Config { branch_states, ..config(1 << 17, horizon, factor, 0.25) };
        let (mean, error) = listening(&Ears, &config);
        assert!(
            (mean - exact).abs() < 3.0 * error && error < 0.6,
            "horizon {horizon}, {branch_states} states: {mean} ± {error}, exact {exact}"
        );
    }
}

#[test]
fn a_likelihood_that_knows_more_than_the_observations_say_changes_the_values() {
    /// The same ears with densities ten times too sharp.
    struct Sharp;

    impl GenerativeModel for Sharp {
        type State = bool;
        type Action = Action;
        type Observation = f64;

        fn actions(&self) -> &[Action] {
            Ears.actions()
        }

        fn step(&self, left: &mut bool, action: &Action, rng: &mut Rng) -> Step<f64> {
            let mut step = Ears.step(left, action, rng);
            step.observation *= 1e3;
            step
        }

        fn discount(&self) -> f64 {
            DISCOUNT
        }
    }

    impl ObservationModel for Sharp {
        fn log_likelihood(&self, _action: &Action, left: &bool, observation: &f64) -> f64 {
            // Differences of the logarithms of thousands: their exponentials leave the range of numbers.
            -0.5 * (observation - if *left { 1e3 } else { -1e3 }).powi(2)
        }
    }

    // In effect every observation names the side of zero it lies on, right with probability 0.84, as certain: after one growl a door is
    // opened, and 0.16 · 110 is lost on it; what the tree believes is worth more than that. Nothing overflows.
    let (mean, _) = listening(&Sharp, &config(1 << 12, 2, 4.0, 0.25));
    assert!(mean.is_finite() && mean > 4.0, "{mean}");
}

#[test]
fn a_branch_per_visit_at_most_and_few_where_configured_so() {
    let branches = |factor, exponent| {
        let mut planner: Pomcpow<Ears> = Pomcpow::new(config(1000, 2, factor, exponent)).unwrap();
        let mut rng = Seed(1).stream(Purpose::Search, 0);
        let report = planner.search(&Ears, &Even, &Listens, 2, &mut rng);
        let root = planner.tree(0, planner::ExportLimit { depth: 2, visits: 0 }).unwrap();
        (root.actions[0].branches.len() as f64, report.actions[0].visits as f64)
    };
    // A branch is added while there are at most k_o N^α_o of them, N before the visit: ⌊k (N − 1)^α⌋ + 1 at the end.
    for (factor, exponent) in [(1.0, 0.5), (3.0, 0.25), (2.5, 0.0)] {
        let (count, visits) = branches(factor, exponent);
        let expected = (factor * (visits - 1.0_f64).powf(exponent)).floor() + 1.0;
        assert_eq!(count, expected, "{factor} · {visits}^{exponent}");
    }
    let (count, visits) = branches(1e6, 1.0);
    assert_eq!(count, visits, "every observation is new");
}

#[test]
fn a_full_tree_stops_growing_and_goes_on_searching() {
    let search = |nodes| {
        let mut planner = Pomcpow::new(Config { nodes, ..config(5000, 3, 4.0, 0.3) }).unwrap();
        let mut rng = Seed(1).stream(Purpose::Search, 0);
        planner.search(&Ears, &Even, &Listens, 3, &mut rng)
    };
    let free = search(1 << 24);
    assert_eq!(free.unexpanded, 0);
    // States held by branches count too: every simulation that listens leaves one.
    assert!(free.nodes > 5000, "{}", free.nodes);
    let bounded = search(500);
    assert!(bounded.nodes <= 500 && bounded.simulations == 5000 && bounded.transitions <= 15_000, "{bounded:?}");
}

#[test]
fn each_planner_takes_its_own_kind_of_observations() {
    let classes = Config { observations: Observations::Classes, ..config(10, 2, 1.0, 0.5) };
    assert!(matches!(Pomcpow::<LightDark>::new(classes), Err(Error::Config { key: "observations", .. })));
    let widening = Pomcp::<LightDark>::new(config(10, 2, 1.0, 0.5));
    assert!(matches!(widening, Err(Error::Config { key: "observations", .. })));
}

#[test]
fn the_origin_is_not_declared_blindly() {
    // From places spread around 2, one in nine at the origin: declaring it is worth 100 · (1 − 8) / 9 = −77.8, measuring first is worth
    // more to both planners.
    struct Start;
    impl Belief for Start {
        type State = i32;
        fn sample(&self, rng: &mut Rng) -> &i32 {
            const PLACES: [i32; 9] = [-3, -1, 0, 1, 2, 3, 4, 5, 7];
            &PLACES[rng.random_range(0..9)]
        }
    }
    let widening = Config { exploration: Exploration::Fixed(100.0), ..config(20_000, 20, 4.0, 0.2) };
    let classes = Config { observations: Observations::Classes, ..widening.clone() };
    let mut rng = Seed(1).stream(Purpose::Search, 0);
    let rng = &mut rng;
    let mut widened = Pomcpow::new(widening).unwrap();
    let mut classed = Pomcp::new(classes).unwrap();
    for report in
        [widened.search(&LightDark, &Start, &Walk, 20, rng), classed.search(&LightDark, &Start, &Walk, 20, rng)]
    {
        let declare = report.actions[2];
        // Null: 9 outcomes of ±100 with mean −77.8, standard deviation 63; tolerance 4 standard errors of its visits.
        assert!((declare.value + 77.8).abs() < 4.0 * 63.0 / (declare.visits as f64).sqrt(), "{declare:?}");
        assert!(report.action != 0 && report.actions.iter().all(|a| a.value > declare.value - 1e-9), "{report:?}");
    }
}
