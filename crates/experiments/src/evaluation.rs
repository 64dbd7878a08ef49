//! One run: methods on a domain, from the request to the table.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use agent::{Agent, Method, Network, Timeouts, WorldAddress};
use scenario::{Filter, Problem, Published, Scenario, Selection};

use crate::files::check_claim;
use crate::run::OURS;
use crate::{Error, Provenance, Run, RunIdentity, Shard, Table, Worlds};

/// What is asked for.
#[derive(Clone, Debug)]
pub struct Request {
    /// Scenario.
    pub selection: Selection,
    /// Methods. If empty: all that fit the scenario's filter.
    pub methods: Vec<Method>,
    /// Trials a method; the scenario's where `None`.
    pub trials: Option<u32>,
    /// Root seed.
    pub seed: u64,
    /// Folder of the trained prior; the default one where `None`.
    pub prior: Option<PathBuf>,
    /// World to play in, and how long it may take; the simulated one where `None`.
    pub world: Option<(WorldAddress, Timeouts)>,
}

/// A run that is ready to be played: its input is good.
pub struct Evaluation {
    pub(crate) scenario: Scenario,
    pub(crate) problem: Arc<Problem>,
    pub(crate) prior: Option<Network>,
    prior_folder: Option<PathBuf>,
    pub(crate) worlds: Option<Worlds>,
    /// Whether all trials share one world behind a socket.
    pub(crate) socket: bool,
    pub(crate) provenance: Provenance,
}

impl Evaluation {
    /// Loads and checks everything that the run needs. Nothing is written.
    ///
    /// # Errors
    ///
    /// A scenario, prior or world that is missing or does not fit, and methods that do not go with them.
    pub fn prepare(request: &Request) -> Result<Self, Error> {
        let root = &request.selection.root;
        let mut scenario = request.selection.load()?;
        if let Some(trials) = request.trials {
            scenario.evaluation.trials = trials;
        }
        let methods = methods(&request.methods, scenario.belief.filter);
        let problem = Arc::new(Problem::assemble(&scenario, root)?);
        let default = || Network::default_folder(root, &problem, request.selection.quick);
        let needs_prior = methods.iter().any(|method| method.needs_prior());
        let prior_folder = needs_prior.then(|| request.prior.clone().unwrap_or_else(default));
        let load = |folder: &PathBuf| Network::load(folder, &problem);
        let prior = prior_folder.as_ref().map(load).transpose()?;
        // What a method cannot do is said before a folder is made.
        for method in &methods {
            Agent::new(&problem, *method, prior.as_ref())?;
        }
        let worlds = match &request.world {
            Some(_) if methods.contains(&Method::Oracle) => return Err(agent::Error::NoTruth.into()),
            Some((address, timeouts)) => Some(Worlds::start(address.clone(), *timeouts, Arc::clone(&problem))?),
            None => None,
        };
        let provenance = Provenance {
            run: RunIdentity {
                version: 1,
                scenario_hash: scenario.hash(),
                seed: request.seed,
                prior_hash: prior.as_ref().map(|prior| prior.hash().to_string()),
                urdf_hash: scenario.urdf_hash(root)?,
                commit: scenario::commit(root),
                world: worlds.as_ref().map(|worlds| worlds.identity().clone()),
            },
            program: format!("eval {}", env!("CARGO_PKG_VERSION")),
            methods,
            trials: scenario.evaluation.trials,
        };
        let socket = matches!(request.world, Some((WorldAddress::Tcp(_), _)));
        Ok(Self { scenario, problem, prior, prior_folder, worlds, socket, provenance })
    }

    /// The resolved scenario.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Where the prior comes from; `None` where no method needs one.
    #[must_use]
    pub fn prior_folder(&self) -> Option<&Path> {
        self.prior_folder.as_deref()
    }

    /// Name for a run directory: domain, arm, preset and, where it is not ours, the world.
    #[must_use]
    pub fn name(&self) -> String {
        let s = &self.scenario;
        let world = self.provenance.run.world.as_ref().map_or_else(String::new, |world| format!("-{}", world.name));
        format!("{}-{}-{}{world}", s.name, s.robot.name, s.preset)
    }

    /// Ends the world that was started only to learn its name.
    pub fn rest(&self) {
        if let Some(worlds) = &self.worlds {
            worlds.rest();
        }
    }

    /// Takes over the commit of the run in `folder`, if that run is finished and differs in nothing else.
    ///
    /// # Errors
    ///
    /// Records that cannot be read.
    pub fn adopt(&mut self, folder: &Path) -> Result<(), Error> {
        if let Some(commit) = crate::run::finished_by(folder, &self.provenance)? {
            self.provenance.run.commit = commit;
        }
        Ok(())
    }

    /// Opens or creates the run directory `folder`.
    ///
    /// # Errors
    ///
    /// As [`Run::open`].
    pub fn open(&self, folder: &Path) -> Result<Run, Error> {
        Run::open(folder, self.provenance.clone(), &self.scenario.to_toml())
    }

    /// Refuses a folder that [`Self::open`] would refuse for whose it is, and writes nothing.
    pub(crate) fn check(&self, folder: &Path) -> Result<(), Error> {
        check_claim(folder, "run.json", &self.provenance.run, &OURS)
    }

    /// Opens the run directory `folder`, which is there, for one of its workers.
    ///
    /// # Errors
    ///
    /// As [`Run::open_worker`].
    pub fn open_worker(&self, folder: &Path, shard: Shard) -> Result<Run, Error> {
        Run::open_worker(folder, self.provenance.clone(), shard)
    }

    /// Writes the tables of a run whose trials are all played.
    ///
    /// # Errors
    ///
    /// Where a file cannot be read or written.
    pub fn finish(&self, run: &Run) -> Result<Table, Error> {
        let s = &self.scenario;
        // The published figures come from the paper's own simulation.
        let none = BTreeMap::<String, Published>::new();
        let published = if self.worlds.is_some() { &none } else { &s.evaluation.published };
        run.finish(&s.name, &s.robot.name, &s.preset, published)
    }
}

/// The requested methods in the order of tables. If none: all that fit the filter.
fn methods(asked: &[Method], filter: Filter) -> Vec<Method> {
    let mut methods = match filter {
        _ if !asked.is_empty() => asked.to_vec(),
        Filter::Rejection => Method::PUBLISHED.to_vec(),
        Filter::Bridge => vec![Method::NoRnn, Method::Mixture],
    };
    methods.sort();
    methods.dedup();
    methods
}
