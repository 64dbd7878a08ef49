//! What a decision could still gain from more simulations.

use crate::config::require;
use crate::{ActionStats, Config, Error};

/// Ends a search that more simulations would not pay.
///
/// The budget is spent in `rounds` equal parts. After each, the search asks for every number of parts that are left what they could be expected to add to the
/// decision, and ends where none adds more than it costs. `price` is that of the whole budget, a part costs its share.
///
/// What m more simulations add is the largest expected improvement E[max(0, V(a) − V(best))] of another legal action, for the difference of the means that
/// they would show. That is taken for normal about the difference of today. Its variance is the squared standard error of today less that of after m more. If
/// those go to the actions as the N of this search so far, this is the share m / (N + m) of today's: an error of variance σ² / n becomes one of σ² / (n (1 + m / N)).
/// The standard error of a mean is the standard deviation of an action's returns at the root in this search over √N(ha). Actions with few returns borrow from
/// the spread of all. N(ha) counts what was kept from earlier searches and initial visits, as the mean does; N does not. What was kept is of an earlier belief, and
/// goes on to move as the tree learns: as if it were new, it would end a search that has hardly begun.
///
/// So a search ends where one action is clearly the best, where several are equally good, and where all that is left of the budget would not tell which is
/// better. To stop where no number of further samples pays its cost is the rule of Chick and Frazier, "Sequential sampling with economics of selection
/// procedures" (Management Science 58, 2012), and for searches that of Hay, Russell, Tolpin and Shimony, "Selecting computations: theory and applications"
/// (UAI 2012). Theirs know the spread or allow for its error; here it is put in as it is. Returns of one tree are not independent, as the tree learns: the figure
/// is an estimate, not a bound. While all returns are equal nothing is known, and the search goes on. With a budget of time each round may end one simulation
/// late.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schemars", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct EarlyStop {
    /// Equal parts of the budget. At least 2.
    pub rounds: usize,
    /// Price of the whole budget: what it has to be expected to add to a decision, in units of reward. Positive.
    pub price: f64,
}

impl EarlyStop {
    /// Checks both values against their limits.
    pub(crate) fn validate(self) -> Result<(), Error> {
        let Self { rounds, price } = self;
        require((2..=1000).contains(&rounds), "early_stop.rounds", &rounds, "between 2 and 1000")?;
        require(price.is_finite() && price > 0.0, "early_stop.price", &price, "finite and positive")
    }

    /// Whether to end after so many of the rounds.
    pub(crate) fn is_enough(self, contest: &Contest, rounds_done: usize) -> bool {
        (1..=self.rounds.saturating_sub(rounds_done)).all(|more| {
            let cost = self.price * more as f64 / self.rounds as f64;
            // Of as many simulations a round as so far.
            contest.gain(more as f64 / (rounds_done + more) as f64) <= cost
        })
    }
}

impl Config {
    /// Ends a search before its budget is spent where no more of it could be expected to add to the decision what it costs, at a price of the whole budget
    /// (positive, in units of reward). This is asked after each of `rounds` parts of the budget (at least 2). Start with 12 rounds and a hundredth of a
    /// typical return.
    #[must_use]
    pub fn with_early_stop(self, rounds: usize, price: f64) -> Self {
        Self { early_stop: Some(EarlyStop { rounds, price }), ..self }
    }
}

/// Count, mean and spread of returns (Welford 1962).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moments {
    count: u64,
    mean: f64,
    /// Sum of squared deviations from the mean.
    squares: f64,
}

impl Moments {
    pub(crate) fn record(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
    }

    /// Takes in the returns of another tree (Chan, Golub and LeVeque 1979).
    pub(crate) fn merge(&mut self, other: Self) {
        if other.count == 0 {
            return;
        }
        let (ours, theirs) = (self.count as f64, other.count as f64);
        let apart = other.mean - self.mean;
        self.count += other.count;
        self.mean += apart * theirs / self.count as f64;
        self.squares += other.squares + apart * apart * ours * theirs / self.count as f64;
    }

    fn freedom(self) -> f64 {
        self.count.saturating_sub(1) as f64
    }
}

/// Degrees of freedom that an action borrows from the spread of all actions: a handful of equal returns is no proof of a spread of zero.
const BORROWED: f64 = 4.0;

/// What is known of the best action beside the others: by how much it leads each other legal one, and the squared standard error of that. `None` where an
/// action is untried or nothing is known of the spread.
pub(crate) struct Contest(Option<Vec<(f64, f64)>>);

impl Contest {
    /// `legal` says which actions are.
    pub(crate) fn new(stats: &[ActionStats], returns: &[Moments], legal: &[bool], best: usize) -> Self {
        Self(leads(stats, returns, legal, best))
    }

    /// What more simulations, that take this share off the squared errors, could be expected to add to the decision for the best action, by the other action
    /// that promises most, in units of reward. Infinite where nothing is known.
    fn gain(&self, share: f64) -> f64 {
        let Some(leads) = &self.0 else { return f64::INFINITY };
        let gains = leads.iter().map(|(lead, variance)| expected_improvement(*lead, (variance * share).sqrt()));
        gains.fold(0.0, |most: f64, gain| if gain.is_nan() { f64::INFINITY } else { most.max(gain) })
    }
}

fn leads(stats: &[ActionStats], returns: &[Moments], legal: &[bool], best: usize) -> Option<Vec<(f64, f64)>> {
    let others: Vec<usize> = (0..stats.len()).filter(|&action| action != best && legal[action]).collect();
    if others.is_empty() {
        return Some(Vec::new());
    }
    let freedom: f64 = returns.iter().map(|r| r.freedom()).sum();
    if freedom == 0.0 {
        return None;
    }
    let pooled = returns.iter().map(|r| r.squares).sum::<f64>() / freedom;
    let tried = || stats.iter().filter(|action| action.visits > 0);
    if pooled == 0.0 && tried().all(|action| action.value == stats[best].value) {
        // Returns that have all been equal so far are no proof that others are: a goal may not have been found yet.
        return None;
    }
    // Of a mean, squared.
    let error = |action: usize| {
        let own = returns[action];
        let variance = (own.squares + BORROWED * pooled) / (own.freedom() + BORROWED);
        variance / stats[action].visits as f64
    };
    let lead = |action: usize| {
        let tried = stats[action].visits > 0;
        tried.then(|| (stats[best].value - stats[action].value, error(best) + error(action)))
    };
    others.into_iter().map(lead).collect()
}

/// E[max(0, X)] of a normal X with mean −`lead` and the standard deviation `error`.
fn expected_improvement(lead: f64, error: f64) -> f64 {
    if error == 0.0 {
        return (-lead).max(0.0);
    }
    let z = lead / error;
    let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
    // Φ(−z), with libm's erfc.
    error * density - lead * 0.5 * libm::erfc(z / std::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of(values: &[f64]) -> Moments {
        let mut moments = Moments::default();
        values.iter().for_each(|&value| moments.record(value));
        moments
    }

    fn stats(returns: &[Moments]) -> Vec<ActionStats> {
        returns.iter().map(|r| ActionStats { visits: r.count, value: r.mean }).collect()
    }

    proptest! {
        #[test]
        fn moments_are_those_of_the_values_in_one_part_or_two(
            values in prop::collection::vec(-100.0_f64..100.0, 2..40), cut in 0_usize..40,
        ) {
            let (n, cut) = (values.len() as f64, cut.min(values.len()));
            let mean = values.iter().sum::<f64>() / n;
            let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
            let mut merged = of(&values[..cut]);
            merged.merge(of(&values[cut..]));
            for moments in [of(&values), merged] {
                prop_assert_eq!(moments.count, values.len() as u64);
                prop_assert!((moments.mean - mean).abs() < 1e-9);
                prop_assert!((moments.squares - squares).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn values_outside_their_limits_are_refused() {
        let message =
            |rounds, price| Config::default().with_early_stop(rounds, price).validate().unwrap_err().to_string();
        assert_eq!(message(1, 3.0), "planner: `early_stop.rounds` is 1, but must be between 2 and 1000");
        assert_eq!(message(4, 0.0), "planner: `early_stop.price` is 0, but must be finite and positive");
        assert_eq!(Config::default().with_early_stop(4, 0.1).validate(), Ok(()));
    }

    #[test]
    fn the_expected_improvement_is_that_of_a_normal_difference() {
        // E[max(0, X)] by the midpoint rule, X normal with mean −lead.
        let numeric = |lead: f64, error: f64| {
            let step = 1e-3;
            let density =
                |x: f64| (-0.5 * ((x + lead) / error).powi(2)).exp() / (error * (2.0 * std::f64::consts::PI).sqrt());
            (0..60_000).map(|i| (f64::from(i) + 0.5) * step).map(|x| x * density(x) * step).sum::<f64>()
        };
        for (lead, error) in [(0.0, 1.0), (2.0, 1.0), (1.0, 3.0), (-1.5, 2.0)] {
            let (found, expected) = (expected_improvement(lead, error), numeric(lead, error));
            assert!((found - expected).abs() < 1e-6, "{lead} ± {error}: {found}, expected {expected}");
        }
        assert_eq!((expected_improvement(1.0, 0.0), expected_improvement(-1.0, 0.0)), (0.0, 1.0));
    }

    /// What exact values could be expected to add.
    fn open(returns: &[Moments], legal: &[bool]) -> f64 {
        Contest::new(&stats(returns), returns, legal, 0).gain(1.0)
    }

    #[test]
    fn the_gain_is_that_of_the_closest_action() {
        // Eight returns each, with a spread of 1: a variance of 8/7 each, so a standard error of 0.535 of the difference.
        let spread = |mean: f64| of(&[mean - 1.0, mean + 1.0].repeat(4));
        let returns = [spread(10.0), spread(9.0), spread(5.0)];
        let gain = open(&returns, &[true; 3]);
        assert!((gain - expected_improvement(1.0, (2.0_f64 / 7.0).sqrt())).abs() < 1e-12, "{gain}");
    }

    /// Two means whose true difference is drawn from what is known of it, and as many more returns as there are.
    #[test]
    fn more_simulations_add_what_choosing_by_all_returns_adds() {
        use pomdp::{Purpose, Seed};
        use rand_distr::{Distribution as _, StandardNormal};
        let lead = 0.1;
        let returns = [lead, 0.0].map(|mean| of(&[mean - 1.0, mean + 1.0].repeat(13)));
        let contest = Contest::new(&stats(&returns), &returns, &[true; 2], 0);
        let variance = contest.0.as_ref().unwrap()[0].1;
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let draws = 40_000;
        let added: f64 = (0..draws)
            .map(|_| {
                let truth = lead + variance.sqrt() * normal();
                // The mean of so many more returns of each has the same error; both together have the mean of the two means.
                let all = 0.5 * (lead + truth + variance.sqrt() * normal());
                if all < 0.0 { -truth } else { 0.0 }
            })
            .sum::<f64>()
            / f64::from(draws);
        let expected = contest.gain(0.5);
        assert!((added - expected).abs() < 0.002 && expected > 0.03, "{added}, expected {expected}");
    }

    #[test]
    fn a_search_ends_where_nothing_of_what_is_left_pays() {
        let spread = |mean: f64| of(&[mean - 1.0, mean + 1.0].repeat(50));
        let returns = [spread(1.0), spread(0.95)];
        let contest = Contest::new(&stats(&returns), &returns, &[true; 2], 0);
        let enough = |price: f64, done: usize| EarlyStop { rounds: 10, price }.is_enough(&contest, done);
        // Eight more rounds after two take 0.8 of the error of 0.14 squared.
        let all = expected_improvement(0.05, (contest.0.as_ref().unwrap()[0].1 * 0.8).sqrt());
        assert!(!enough(0.99 * all / 0.8, 2), "all that is left pays");
        assert!(enough(10.0 * all, 2), "no round pays");
        // Of few rounds that are left none does, where many would.
        assert!(enough(0.99 * all / 0.8, 9));
    }

    #[test]
    fn an_untried_legal_action_leaves_a_decision_open_and_an_illegal_one_does_not() {
        let returns = [of(&[10.0, 10.1]), of(&[]), of(&[1.0, 1.1])];
        assert_eq!(open(&returns, &[true; 3]), f64::INFINITY);
        assert!(open(&returns, &[true, false, true]) < 1e-9);
    }

    #[test]
    fn equal_returns_of_one_action_do_not_hide_the_spread_of_the_others() {
        let wide: Vec<f64> = (0..20).map(|i| if i % 2 == 0 { 60.0 } else { -60.0 }).collect();
        let returns = [of(&[12.0, 12.0, 12.0]), of(&wide)];
        assert!(open(&returns, &[true; 2]) > 1.0);
        let kept = [of(&[1.0; 3]), of(&[2.0; 3])];
        let unknown = |legal| Contest::new(&stats(&kept), &[Moments::default(); 2], legal, 0).gain(1.0);
        assert_eq!(unknown(&[true; 2]), f64::INFINITY, "nothing was simulated");
        assert_eq!(unknown(&[true, false]), 0.0, "there is nothing to decide");
        let same = [of(&[-2.85; 8]), of(&[-2.85; 8])];
        assert_eq!(open(&same, &[true; 2]), f64::INFINITY, "no return has differed so far");
        let apart = [of(&[5.0; 8]), of(&[-2.85; 8])];
        assert_eq!(open(&apart, &[true; 2]), 0.0, "each action has one return, and one is better");
    }
}
