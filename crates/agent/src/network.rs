//! The network that a method asks: of the kind that its filter needs.

use std::path::{Path, PathBuf};

use prior::{PosteriorNetwork, Suggester, default_folder};
use scenario::{Filter, Problem};

/// A trained network.
#[derive(Clone, Debug)]
pub enum Network {
    /// The published one: where everything is now, for the rejection filter.
    Suggester(Box<Suggester>),
    /// What the episode began with, for the bridge filter.
    Posterior(Box<PosteriorNetwork>),
}

impl Network {
    /// Loads that of `folder`, of the kind that the problem's filter needs.
    ///
    /// # Errors
    ///
    /// A file that is missing, damaged, or made for another arm or filter.
    pub fn load(folder: &Path, problem: &Problem) -> Result<Self, prior::Error> {
        let robot = &problem.scenario.robot.name;
        let filter = problem.scenario.belief.filter;
        let (expected, found) = match filter {
            Filter::Rejection => (prior::checkpoint::FILE, prior::posterior::FILE),
            Filter::Bridge => (prior::posterior::FILE, prior::checkpoint::FILE),
        };
        if !folder.join(expected).exists() && folder.join(found).exists() {
            let (folder, filter) = (folder.to_path_buf(), filter.name());
            return Err(prior::Error::OtherKind { folder, found, expected, filter });
        }
        Ok(match filter {
            Filter::Rejection => Self::Suggester(Box::new(Suggester::load(folder, robot, &problem.model)?)),
            Filter::Bridge => Self::Posterior(Box::new(PosteriorNetwork::load(folder, robot, &problem.model)?)),
        })
    }

    /// The folder of the network that is taken where none is named.
    #[must_use]
    pub fn default_folder(root: &Path, problem: &Problem, quick: bool) -> PathBuf {
        let file = match problem.scenario.belief.filter {
            Filter::Rejection => prior::checkpoint::FILE,
            Filter::Bridge => prior::posterior::FILE,
        };
        default_folder(root, &problem.scenario.prior_name(), file, quick)
    }

    pub(crate) fn suggester(&mut self) -> Option<&mut Suggester> {
        if let Self::Suggester(network) = self { Some(network) } else { None }
    }

    pub(crate) fn posterior(&mut self) -> Option<&mut PosteriorNetwork> {
        if let Self::Posterior(network) = self { Some(network) } else { None }
    }

    /// Hash of the weights.
    #[must_use]
    pub fn hash(&self) -> &str {
        match self {
            Self::Suggester(network) => network.hash(),
            Self::Posterior(network) => network.hash(),
        }
    }
}
