//! What a report says of re-tuning: clocks, contacts and numbers of the log.

use crate::report::{Report, Retuned};

/// Contacts that differ by less than this factor in their natural frequency are the model's.
const FACTOR: f64 = 1.5;
/// A number of the log that is this many standard deviations from its mean is wrong, or its spread is.
const FAR: f64 = 4.0;
/// Exponent of Coulomb's cone of friction, and the factor beyond which another one is a pyramid's.
const COULOMB: f64 = 1.0;
const PYRAMID: f64 = 2.0;

impl Report {
    /// What re-tuning found of clocks and contacts, and which numbers of the log it left far behind.
    #[must_use]
    pub fn retuned_sentences(&self) -> Vec<String> {
        let contacts = self.contact_sentence().into_iter().chain(self.cone_sentence()).collect();
        [self.clock_sentences(), contacts, self.far_sentences()].concat()
    }

    /// How contacts differ from the model's, if they do by a factor.
    fn contact_sentence(&self) -> Option<String> {
        let value = self.retuned.iter().find(|value| value.key == "contact.frequency_hz")?;
        let ([low, high], nominal) = (value.interval90, value.prior[0]);
        let ratio = value.value / nominal;
        let than = if ratio > 1.0 { "stiffer" } else { "softer" };
        let clear = ratio.ln().abs() > FACTOR.ln() && (low > nominal || high < nominal);
        (clear && [ratio, low, high].iter().all(|value| value.is_finite())).then(|| {
            format!(
                "Contacts are {than} than the model's: their natural frequency is {:.0} Hz instead of {nominal:.0} (90 %: {low:.0} to {high:.0} Hz); \
                 re-tuned, no effect.",
                value.value
            )
        })
    }

    /// Whether friction on the table acts along axes, as engines with pyramids have it.
    fn cone_sentence(&self) -> Option<String> {
        let value = self.retuned.iter().find(|value| value.key == "contact.cone_exponent")?;
        let [low, high] = value.interval90;
        let clear = (value.value / COULOMB).ln().abs() > PYRAMID.ln() && (low > COULOMB || high < COULOMB);
        let between = if value.value > COULOMB { "less" } else { "more" };
        (clear && [value.value, low, high].iter().all(|value| value.is_finite())).then(|| {
            format!(
                "Friction on the table acts along x and y, as in engines with a friction pyramid: it is {between} between these axes (exponent {:.2} \
                 instead of {COULOMB:.0}; 90 %: {low:.2} to {high:.2}); re-tuned, no effect.",
                value.value
            )
        })
    }

    /// Numbers of the log that re-tuning has moved beyond what their spread allows.
    fn far_sentences(&self) -> Vec<String> {
        let own = |value: &&Retuned| !value.key.starts_with("clock.") && !value.key.starts_with("contact.");
        let far = |value: &Retuned| {
            let [mean, stddev] = value.prior;
            let by = (value.value - mean).abs() / stddev;
            (by > FAR && by.is_finite() && mean.is_finite()).then(|| {
                format!(
                    "Re-tuning has moved {} to {:.3}, {by:.0} standard deviations from the {mean:.3} of log.toml: check it. Contacts that are unlike the engine's can do that too.",
                    value.key, value.value
                )
            })
        };
        self.retuned.iter().filter(own).filter_map(far).collect()
    }

    /// Which clocks differ from the tool's by more than their intervals, and than clocks do.
    fn clock_sentences(&self) -> Vec<String> {
        let clock = |value: &Retuned| {
            let whose = value.key.strip_prefix("clock.")?.strip_suffix("_secs")?;
            let [low, high] = value.interval90;
            let late = if value.value > 0.0 { "late" } else { "early" };
            (low * high > 0.0 && value.value.abs() > 0.5 * value.prior[1]).then(|| {
                let [ms, low, high] = [value.value, low, high].map(|secs| 1e3 * secs);
                format!("The clock of the {whose} is {:.1} ms {late} against the tool's (90 %: {low:.1} to {high:.1} ms); re-tuned, no effect.", ms.abs())
            })
        };
        self.retuned.iter().filter_map(clock).collect()
    }
}
