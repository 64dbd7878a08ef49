//! The external worlds of a run: one for each thread that plays. A failed world is replaced.

use std::sync::{Arc, Mutex, PoisonError};

use agent::{ExternalWorld, Method, Timeouts, WorldAddress, WorldError, WorldIdentity};
use scenario::Problem;

use crate::Error;

/// Worlds that are not in use, and how to get another.
pub struct Worlds {
    address: WorldAddress,
    timeouts: Timeouts,
    problem: Arc<Problem>,
    identity: WorldIdentity,
    idle: Mutex<Vec<ExternalWorld>>,
}

impl Worlds {
    /// Starts the first world, which says what all of them are.
    ///
    /// # Errors
    ///
    /// If it does not start or does not fit the problem.
    pub fn start(address: WorldAddress, timeouts: Timeouts, problem: Arc<Problem>) -> Result<Self, WorldError> {
        let first = ExternalWorld::start(&address, timeouts, &problem)?;
        let identity = first.identity().clone();
        Ok(Self { address, timeouts, problem, identity, idle: Mutex::new(vec![first]) })
    }

    /// What they are.
    #[must_use]
    pub fn identity(&self) -> &WorldIdentity {
        &self.identity
    }

    /// Ends the worlds that are not in use: trials that come much later start fresh ones.
    pub fn rest(&self) {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// A world for a trial.
    pub(crate) fn take(&self, method: Method, trial: u32) -> Result<ExternalWorld, Error> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        if let Some(world) = idle {
            return Ok(world);
        }
        let world = ExternalWorld::start(&self.address, self.timeouts, &self.problem)
            .map_err(|source| Error::NoWorld { trial, method: method.name(), source })?;
        if *world.identity() != self.identity {
            let name = |identity: &WorldIdentity| format!("{} {}", identity.name, identity.version);
            return Err(Error::OtherWorld { found: name(world.identity()), expected: name(&self.identity) });
        }
        Ok(world)
    }

    /// A world after a trial that it did not fail.
    pub(crate) fn give_back(&self, world: ExternalWorld) {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(world);
    }
}
