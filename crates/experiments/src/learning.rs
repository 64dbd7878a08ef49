//! What beliefs learn over an episode: errors by step, over the trials of an arm.

use agent::BeliefErrors;

use crate::combined::{Arm, Part};
use crate::{TrialRecord, spreadsheet};

/// An error of the belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Friction,
    LogMass,
    Com,
    Size,
    Shape,
    Obstacle,
    ObstaclePlace,
}

impl Quantity {
    pub(crate) const ALL: [Self; 7] =
        [Self::Friction, Self::LogMass, Self::Com, Self::Size, Self::Shape, Self::Obstacle, Self::ObstaclePlace];

    /// Name in files: the key of the record.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::LogMass => "log_mass",
            Self::Com => "com_m",
            Self::Size => "size_m",
            Self::Shape => "shape_probability",
            Self::Obstacle => "obstacle_probability",
            Self::ObstaclePlace => "obstacle_m",
        }
    }

    /// Values after each number of actions, while the trial lasts.
    fn of(self, errors: &BeliefErrors) -> Vec<Option<f64>> {
        let numbers = match self {
            Self::Friction => &errors.friction,
            Self::LogMass => &errors.log_mass,
            Self::Com => &errors.com_m,
            Self::Size => &errors.size_m,
            Self::Shape => &errors.shape_probability,
            Self::Obstacle => &errors.obstacle_probability,
            Self::ObstaclePlace => return errors.obstacle_m.clone(),
        };
        numbers.iter().copied().map(Some).collect()
    }
}

/// Median and quartiles of values over trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spread {
    pub(crate) count: usize,
    pub(crate) low: f64,
    pub(crate) median: f64,
    pub(crate) high: f64,
}

impl Spread {
    /// By linear interpolation between order statistics; `None` without values.
    pub(crate) fn of(mut values: Vec<f64>) -> Option<Self> {
        let mut quantile = |level| statistics::quantile(&mut values, level);
        let (low, median, high) = (quantile(0.25)?, quantile(0.5)?, quantile(0.75)?);
        Some(Self { count: values.len(), low, median, high })
    }
}

/// Errors of an arm on a domain.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    pub(crate) arm: Arm,
    pub(crate) domain: String,
    pub(crate) quantity: Quantity,
    /// After 0, 1, … actions; `None` where no trial has a value.
    pub(crate) steps: Vec<Option<Spread>>,
}

/// Curves of every arm that has a belief in a world that knows its truth.
///
/// A trial that has ended keeps its last belief, so that each step counts the same trials. Otherwise late steps would
/// show only the trials that have not solved the task.
pub(crate) fn curves(parts: &[Part]) -> Vec<Curve> {
    let mut curves = Vec::new();
    for part in parts {
        let Some(domain) = part.table.rows.first().map(|row| row.domain.clone()) else { continue };
        for &method in &part.methods {
            let of_method = part.trials.values().filter(|trial| trial.method == method);
            let errors: Vec<&BeliefErrors> =
                of_method.filter_map(|trial: &TrialRecord| trial.belief_errors.as_ref()).collect();
            let length = errors.iter().map(|errors| errors.len()).max().unwrap_or(0);
            for quantity in Quantity::ALL.into_iter().filter(|_| length > 0) {
                let values: Vec<Vec<Option<f64>>> = errors.iter().map(|errors| quantity.of(errors)).collect();
                let at = |step: usize| {
                    let now = values.iter().filter_map(|trial| *trial.get(step).or(trial.last())?);
                    Spread::of(now.collect())
                };
                let arm = Arm { run: part.run.clone(), method };
                curves.push(Curve { arm, domain: domain.clone(), quantity, steps: (0..length).map(at).collect() });
            }
        }
    }
    curves
}

/// Curves for spreadsheets: a line a step and arm, three columns a quantity.
pub(crate) fn to_csv(curves: &[Curve]) -> String {
    let mut header = ["domain", "run", "method", "actions", "trials"].map(String::from).to_vec();
    for quantity in Quantity::ALL {
        header.extend(["quartile1", "median", "quartile3"].map(|part| format!("{}_{part}", quantity.name())));
    }
    let of_arms = curves.chunk_by(|a, b| a.arm == b.arm && a.domain == b.domain);
    let rows = of_arms.flat_map(|of_arm| (0..of_arm[0].steps.len()).map(move |step| row(of_arm, step)));
    spreadsheet::to_csv(&header, rows)
}

/// What all curves of an arm say of a step.
fn row(of_arm: &[Curve], step: usize) -> Vec<String> {
    let first = &of_arm[0];
    let trials = first.steps[step].map_or(0, |spread| spread.count);
    let Arm { run, method } = &first.arm;
    let mut row = vec![first.domain.clone(), run.clone(), method.name().into(), step.to_string(), trials.to_string()];
    for curve in of_arm {
        let cells =
            curve.steps[step].map(|Spread { low, median, high, .. }| [low, median, high].map(|v| format!("{v:.4}")));
        row.extend(cells.unwrap_or_default());
    }
    row
}

#[cfg(test)]
mod tests {
    use agent::Method;

    use super::*;
    use crate::combined::tests::part;

    #[test]
    fn quartiles_lie_between_the_values_that_enclose_them() {
        let spread = Spread::of(vec![4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!((spread.low, spread.median, spread.high, spread.count), (1.75, 2.5, 3.25, 4));
        let one = Spread::of(vec![7.0]).unwrap();
        assert_eq!((one.low, one.median, one.high), (7.0, 7.0, 7.0));
        assert_eq!(Spread::of(Vec::new()), None);
    }

    #[test]
    fn a_trial_that_has_ended_keeps_its_last_belief() {
        let errors = |friction: &[f64], obstacle_m: &[Option<f64>]| {
            let n = friction.len();
            let rest = || vec![0.5; n];
            BeliefErrors {
                friction: friction.to_vec(),
                log_mass: rest(),
                com_m: rest(),
                size_m: rest(),
                shape_probability: rest(),
                obstacle_probability: rest(),
                obstacle_m: obstacle_m.to_vec(),
            }
        };
        let mut part = part("paper", "D1", &[(Method::NoRnn, &[true, false]), (Method::Oracle, &[true])]);
        let short = errors(&[0.4, 0.2], &[None, Some(0.1)]);
        let long = errors(&[0.6, 0.6, 0.4], &[None, None, None]);
        for (trial, errors) in [(0, short), (1, long)] {
            part.trials.get_mut(&(Method::NoRnn, trial)).unwrap().belief_errors = Some(errors);
        }
        let curves = curves(&[part]);
        assert_eq!(curves.len(), Quantity::ALL.len(), "the oracle has no belief");
        let medians = |quantity: Quantity| -> Vec<Option<f64>> {
            let curve = curves.iter().find(|curve| curve.quantity == quantity).unwrap();
            curve.steps.iter().map(|step| step.map(|spread| (spread.median * 1e12).round() / 1e12)).collect()
        };
        assert_eq!(medians(Quantity::Friction), [Some(0.5), Some(0.4), Some(0.3)]);
        assert_eq!(medians(Quantity::ObstaclePlace), [None, Some(0.1), Some(0.1)]);
        let csv = to_csv(&curves);
        assert!(csv.lines().nth(3).unwrap().starts_with("D1,paper,no-rnn,2,2,0.2500,0.3000,0.3500,"), "{csv}");
        assert!(csv.lines().all(|line| line.split(',').count() == 5 + 21), "{csv}");
    }
}
