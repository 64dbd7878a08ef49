//! Long work beside an interpreter that stays responsive.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use discrepancy::{Error, Progress};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::exception;

/// Time between two looks at signals and progress.
const EVERY: Duration = Duration::from_millis(100);
/// Stack of a thread, bytes: what a program's first one has on Linux.
const STACK_BYTES: usize = 8 << 20;

/// How far the work is, and whether it is still wanted.
#[derive(Debug, Default)]
struct State {
    stage: Mutex<&'static str>,
    done: AtomicUsize,
    budget: AtomicUsize,
    unwanted: AtomicBool,
}

impl Progress for State {
    fn stage(&self, stage: &'static str) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = stage;
    }

    fn simulated(&self, episodes: usize, budget: usize) {
        if self.unwanted.load(Ordering::Relaxed) {
            resume_unwind(Box::new("nobody waits any longer"));
        }
        // Threads report in any order.
        self.done.fetch_max(episodes, Ordering::Relaxed);
        self.budget.store(budget.max(episodes), Ordering::Relaxed);
    }
}

/// Does `work` on so many threads of its own (0: one a core), detached from the interpreter. The calling thread asks for signals meanwhile, and tells
/// `told` stage, simulated episodes and their limit. A signal, or an exception of `told`, ends the work at its next simulation.
///
/// # Errors
///
/// The exception of a signal or of `told`, or that of the error of the work.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    threads: usize,
    told: Option<&Py<PyAny>>,
    work: impl FnOnce(&dyn Progress) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES).build();
    let pool = pool.map_err(|error| PyRuntimeError::new_err(format!("cannot start threads: {error}")))?;
    let state = State::default();
    let look = |py: Python<'_>| -> PyResult<()> {
        py.check_signals()?;
        let Some(told) = told else { return Ok(()) };
        let stage = *state.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let counts = [&state.done, &state.budget].map(|count| count.load(Ordering::Relaxed));
        told.call1(py, (stage, counts[0], counts[1])).map(drop)
    };
    py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = channel();
            let state = &state;
            scope.spawn(move || {
                let done = catch_unwind(AssertUnwindSafe(|| pool.install(|| work(state))));
                // The other end waits until this is sent.
                let _ = sender.send(done);
            });
            let mut interrupted = None;
            loop {
                match (receiver.recv_timeout(EVERY), &interrupted) {
                    (Err(RecvTimeoutError::Timeout), None) => {
                        interrupted = Python::attach(look).err();
                        state.unwanted.store(interrupted.is_some(), Ordering::Relaxed);
                    }
                    (Err(RecvTimeoutError::Timeout), Some(_)) => {}
                    (Err(RecvTimeoutError::Disconnected), _) => {
                        let lost = || PyRuntimeError::new_err("the thread that worked has ended without an answer");
                        return Err(interrupted.unwrap_or_else(lost));
                    }
                    (Ok(_), Some(_)) => return Err(interrupted.expect("it is there")),
                    (Ok(Ok(result)), None) => return result.map_err(|error| exception(&error)),
                    (Ok(Err(panic)), None) => resume_unwind(panic),
                }
            }
        })
    })
}
