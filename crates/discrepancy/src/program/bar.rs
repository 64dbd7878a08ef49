//! What somebody sees while a diagnosis works: a bar on a terminal, plain lines elsewhere.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use discrepancy::Progress;
use indicatif::{ProgressBar, ProgressStyle};

/// Time between two lines where there is no terminal, s.
const EVERY_SECS: u64 = 10;

/// Shows how far a diagnosis is. The search has a budget, of which most take almost all; the comparison at the end is not in it.
#[derive(Debug)]
pub(crate) struct Bar {
    bar: ProgressBar,
    /// Seconds after which the next line is due.
    due_secs: AtomicU64,
}

impl Bar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::new(0);
        let style = "{bar:30} {pos} of about {len} simulated episodes, {elapsed}, about {eta} left: {msg}";
        bar.set_style(ProgressStyle::with_template(style).expect("the template is fixed"));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { bar, due_secs: AtomicU64::new(EVERY_SECS) }
    }

    fn line(&self) {
        let (done, budget) = (self.bar.position(), self.bar.length().unwrap_or_default());
        let left = if done == 0 { String::new() } else { format!(", about {} s left", self.bar.eta().as_secs()) };
        let elapsed = self.bar.elapsed().as_secs();
        program::say!("{}: {done} of about {budget} simulated episodes, {elapsed} s{left}", self.bar.message());
    }
}

impl Progress for Bar {
    fn stage(&self, stage: &'static str) {
        self.bar.set_message(stage);
        if self.bar.is_hidden() {
            self.line();
        }
    }

    fn simulated(&self, episodes: usize, budget: usize) {
        self.bar.set_length(budget.max(episodes) as u64);
        // Threads report in any order.
        self.bar.update(|state| state.set_pos(state.pos().max(episodes as u64)));
        if self.bar.is_hidden() {
            let due = self.due_secs.load(Ordering::Relaxed);
            let elapsed = self.bar.elapsed().as_secs();
            let next = elapsed + EVERY_SECS;
            if elapsed >= due && self.due_secs.compare_exchange(due, next, Ordering::Relaxed, Ordering::Relaxed).is_ok()
            {
                self.line();
            }
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
