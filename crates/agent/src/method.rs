//! The compared methods.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// How the belief is kept and actions are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// POMCP; depleted beliefs are refilled by Gaussian noise.
    NoRnn,
    /// The network's strongest component joins the belief, by its mean.
    RnnMax,
    /// Draws from the network's mixture join the belief.
    RnnSampling,
    /// Draws from the network's mixture join the belief with importance weights, for a filter that weighs its particles.
    Mixture,
    /// Upper bound: the same search, from the true state and parameters.
    Oracle,
    /// Lower bound: the heuristic policy on the measured object, without search.
    Heuristic,
}

impl Method {
    /// All methods, in the order of tables.
    pub const ALL: [Self; 6] =
        [Self::NoRnn, Self::RnnMax, Self::RnnSampling, Self::Mixture, Self::Oracle, Self::Heuristic];
    /// The methods of the published tables.
    pub const PUBLISHED: [Self; 3] = [Self::NoRnn, Self::RnnMax, Self::RnnSampling];

    /// Name in tables and on command lines.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoRnn => "no-rnn",
            Self::RnnMax => "rnn-max",
            Self::RnnSampling => "rnn-sampling",
            Self::Mixture => "mixture",
            Self::Oracle => "oracle",
            Self::Heuristic => "heuristic",
        }
    }

    /// Whether it needs a trained prior.
    #[must_use]
    pub const fn needs_prior(self) -> bool {
        matches!(self, Self::RnnMax | Self::RnnSampling | Self::Mixture)
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        Self::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(|m| m.name()).collect();
            format!("unknown method `{text}`: expected one of {}", known.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_on_the_command_line_and_in_files_agree() {
        for method in Method::ALL {
            assert_eq!(method.name().parse(), Ok(method));
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("\"{}\"", method.name()));
        }
        assert!("rnn".parse::<Method>().unwrap_err().contains("rnn-sampling"));
    }
}
