//! No effect may be named because re-tuning had not gone far enough.

use physics_model::{EffectConfig, EffectKind};

use super::Search;
use crate::fit::{Begin, Effort, Fit, cost, fit};
use crate::rival::Round;

impl Search<'_> {
    /// Fits the model without an effect again where that can do what the first rival does.
    pub(super) fn tune(&self, round: &mut Round) {
        let again = (round.rivals.first())
            .filter(|first| self.affords(&self.study, &first.fit.model))
            .and_then(|first| self.retuned(&round.base, &first.fit));
        if let Some(again) = again {
            let gained = again.log_evidence() - round.base.log_evidence();
            round.rivals.iter_mut().chain(&mut round.passed_over).for_each(|rival| rival.gain -= gained);
            round.before = self.heldout(&again);
            round.base = again;
        }
    }

    /// What a bounce gains by its finer steps alone, which are no bounce: they suit balls.
    pub(super) fn finer_steps(&self, base: &Fit, rival: &Fit) -> f64 {
        let Some(bounce) = rival.model.parts.last().filter(|part| part.kind() == EffectKind::Restitution) else {
            return 0.0;
        };
        let mut hypothesis = base.model.hypothesis(&base.x);
        hypothesis.effects.push(bounce.effect(&vec![0.0; bounce.coordinates.len()]));
        let white = self.study.white(&self.study.raw(&hypothesis), base.model.engine_errors(&base.x));
        (base.cost() - cost(&base.x, &white)).max(0.0)
    }

    /// The model without the last effect of `rival` where re-tuning can do the same, fitted from there, if that is better than `base`: no effect may be
    /// named because re-tuning had not gone far enough.
    fn retuned(&self, base: &Fit, rival: &Fit) -> Option<Fit> {
        let (part, coordinates) = rival.added()?;
        let tunables = &self.study.simulator.nominal.tunables;
        let place = |key: &str| tunables.iter().position(|tunable| tunable.key == key);
        let value = |place: usize| tunables[place].value(rival.x[place]);
        let (place, value) = match part.effect(coordinates) {
            EffectConfig::FrictionLevel(level) => (place("table.friction")?, level.coefficient),
            // Forces at all speeds and weights are in proportion to the mass.
            EffectConfig::ForceGain(gain) => place("object.mass_kg").map(|place| (place, value(place) * gain.gain))?,
            _ => return None,
        };
        let mut x = rival.x[..base.x.len()].to_vec();
        let [low, high] = base.model.range(place);
        x[place] = tunables[place].coordinate(value).clamp(low, high);
        let raw = self.study.raw(&base.model.hypothesis(&x));
        if cost(&x, &self.study.white(&raw, base.model.engine_errors(&x))) > base.cost() {
            return None;
        }
        let begin = Begin { x, raw: Some(raw), jacobian: Vec::new() };
        let again = fit(&self.study, base.model.clone(), begin, Effort::Quick);
        (again.log_evidence() > base.log_evidence()).then_some(again)
    }
}
