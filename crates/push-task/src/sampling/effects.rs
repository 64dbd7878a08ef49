//! Distributions of parameters of effects that the robot does not know.

use std::collections::BTreeMap;

use physics_model::effect::{EffectKind, EffectParameter, EffectValue};
use pomdp::Rng;

use super::TruncatedNormal;

/// Distributions of unknown parameters: effect, then parameter. In a scenario `[distribution.effects.table_tilt]`, with
/// `slope_x_rad = { mean = …, stddev = …, low = …, high = … }`.
pub type EffectDistributions = BTreeMap<EffectKind, BTreeMap<String, TruncatedNormal>>;

/// All parameters of `distributions` with their distributions, in a fixed order. Those that do not exist are left out: see [`problem`].
fn parameters(distributions: &EffectDistributions) -> impl Iterator<Item = (EffectParameter, &TruncatedNormal)> {
    distributions.iter().flat_map(|(kind, parameters)| {
        let named = parameters.iter();
        named.filter_map(|(name, distribution)| Some((EffectParameter::new(*kind, name).ok()?, distribution)))
    })
}

/// One draw of every parameter; no random number where there are none.
#[must_use]
pub fn sample(distributions: &EffectDistributions, rng: &mut Rng) -> Vec<EffectValue> {
    parameters(distributions)
        .map(|(parameter, distribution)| EffectValue { parameter, value: distribution.sample(rng) })
        .collect()
}

/// Number of unknown parameters.
#[must_use]
pub fn count(distributions: &EffectDistributions) -> usize {
    parameters(distributions).count()
}

/// Every parameter at a quantile in [0, 1], in the order of [`sample`].
#[must_use]
pub(crate) fn at(distributions: &EffectDistributions, quantiles: impl Iterator<Item = f64>) -> Vec<EffectValue> {
    parameters(distributions)
        .zip(quantiles)
        .map(|((parameter, distribution), u)| EffectValue { parameter, value: distribution.quantile(u) })
        .collect()
}

/// What is wrong with the distributions, if anything: key and expectation.
#[must_use]
pub fn problem(distributions: &EffectDistributions) -> Option<String> {
    distributions.iter().find_map(|(kind, parameters)| {
        parameters.iter().find_map(|(name, distribution)| {
            let key = format!("effects.{}.{name}", kind.name());
            let parameter = match EffectParameter::new(*kind, name) {
                Ok(parameter) => parameter.parameter(),
                Err(error) => return Some(format!("{key}: {error}")),
            };
            let [low, high] = parameter.limits;
            let inside = low <= distribution.low && distribution.high <= high;
            distribution.problem().map(|problem| format!("{key}: {problem}")).or_else(|| {
                let unit = parameter.unit;
                (!inside)
                    .then(|| format!("{key}: expected a range within {low} to {high} {unit}, found {distribution:?}"))
            })
        })
    })
}

#[cfg(test)]
mod tests {
    use physics_model::effect::unknown::build;
    use pomdp::{Purpose, Seed};

    use super::*;

    fn tilt() -> EffectDistributions {
        let slope = TruncatedNormal { mean: 0.0, stddev: 0.02, low: -0.03, high: 0.05 };
        [(EffectKind::TableTilt, [("slope_y_rad".to_string(), slope)].into())].into()
    }

    #[test]
    fn a_draw_takes_its_place_in_the_list() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let values = sample(&tilt(), &mut rng);
        let list = [EffectKind::QuadraticDrag.start(), EffectKind::TableTilt.start()];
        let built = build(&list, &values);
        let mut gravity = [0.0, 0.0, -10.0];
        for effect in &built {
            effect.gravity(&mut gravity);
        }
        assert!((gravity[1] - 10.0 * values[0].value.sin()).abs() < 1e-12 && gravity[0] == 0.0, "{gravity:?}");
        let text = serde_json::to_string(&values).unwrap();
        assert!(text.contains("table_tilt.slope_y_rad"), "{text}");
        assert_eq!(serde_json::from_str::<Vec<EffectValue>>(&text).unwrap(), values);
    }

    #[test]
    fn problems_name_the_key() {
        let mut distributions = tilt();
        assert_eq!(problem(&distributions), None);
        let slopes = distributions.get_mut(&EffectKind::TableTilt).unwrap();
        slopes.get_mut("slope_y_rad").unwrap().high = 1.0;
        assert!(
            problem(&distributions).unwrap().starts_with("effects.table_tilt.slope_y_rad: expected a range within")
        );
        let wrong = TruncatedNormal { mean: 0.0, stddev: 0.02, low: -0.03, high: 0.05 };
        distributions.insert(EffectKind::Tether, [("length_m".to_string(), wrong)].into());
        distributions.remove(&EffectKind::TableTilt);
        assert!(problem(&distributions).unwrap().contains("stiffness_npm, anchor_x_m"));
    }
}
