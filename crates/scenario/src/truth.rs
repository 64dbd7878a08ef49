//! Effects that the model has and the simulated true world lacks: nothing is wrong with that, but nobody should do it unawares.

use toml::Value;

use crate::Scenario;

impl Scenario {
    /// Names of the effects that the model has and the true world lacks. A world behind the protocol has what it has.
    #[must_use]
    pub fn effects_without_truth(&self) -> Vec<&'static str> {
        let truth = &self.effects.truth;
        let lacks = |name: &&'static str| !truth.iter().any(|effect| effect.kind().name() == *name);
        self.effects.model.iter().map(|effect| effect.kind().name()).filter(lacks).collect()
    }

    /// The override that gives the true world these effects too: `effects.truth=[…]`.
    #[must_use]
    pub fn truth_with_model(&self) -> String {
        let missing = self.effects_without_truth();
        let added = self.effects.model.iter().filter(|effect| missing.contains(&effect.kind().name()));
        let effects: Vec<_> = self.effects.truth.iter().chain(added).collect();
        // Plain data always has a TOML form.
        let list = Value::try_from(effects).map_or_else(|_| "[]".into(), |list| list.to_string());
        format!("effects.truth={list}")
    }

    /// What somebody should know who plans with such a model in a simulated world; `None` where the world has all that the model has.
    #[must_use]
    pub fn truth_warning(&self) -> Option<String> {
        let missing = self.effects_without_truth();
        (!missing.is_empty()).then(|| {
            format!(
                "warning: the simulated world has no {}, which the model plans with; --set '{}' adds what is missing",
                missing.join(" and no "),
                self.truth_with_model()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::{Scenario, Selection, find_root};

    fn load(set: &[String]) -> Scenario {
        let root = find_root(env!("CARGO_MANIFEST_DIR").as_ref()).unwrap();
        Selection { set: set.to_vec(), ..Selection::new(root) }.load().unwrap()
    }

    #[test]
    fn a_model_with_more_than_the_world_is_told_and_what_adds_it_works() {
        assert_eq!(load(&[]).truth_warning(), None);
        let model = "effects.model=[{ rolling_resistance = { lever_m = 0.002 } }, { table_tilt = { slope_x_rad = 0.0, slope_y_rad = 0.05 } }]";
        let scenario = load(&[model.into()]);
        assert_eq!(scenario.effects_without_truth(), ["table_tilt"]);
        let warning = scenario.truth_warning().unwrap();
        assert!(warning.contains("no table_tilt") && warning.contains(&scenario.truth_with_model()), "{warning}");
        let both = load(&[model.into(), scenario.truth_with_model()]);
        assert_eq!((both.truth_warning(), &both.effects.truth), (None, &both.effects.model));
    }
}
