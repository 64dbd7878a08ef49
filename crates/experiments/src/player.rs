//! Plays what a run lacks, on all threads.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use agent::Method;
use indicatif::{ProgressBar, ProgressStyle};
use pomdp::Seed;
use rayon::prelude::*;
use scenario::Problem;

use crate::{Error, Evaluation, Run, TrialRecord, play, play_external};

/// How trials are played. Nothing of it changes a result.
#[derive(Clone, Copy, Debug)]
pub struct Player<'a> {
    /// Worker threads, each of which plays a trial. Where `None`, all cores; they search together for one trial at a time where the world is behind a socket.
    pub threads: Option<u32>,
    /// Set when the run is to stop: trials that have begun end first.
    pub interrupted: &'a AtomicBool,
}

impl Player<'_> {
    /// Plays what is missing; false where it was interrupted.
    ///
    /// # Errors
    ///
    /// The first trial that cannot be played or kept. Finished ones are kept.
    ///
    /// # Panics
    ///
    /// Never: the template of the progress bar is fixed.
    pub fn play(&self, evaluation: &Evaluation, run: &Run) -> Result<bool, Error> {
        let missing = run.missing();
        let bar = ProgressBar::new(missing.len() as u64);
        let style = "{bar:40} {pos}/{len} trials, {per_sec}, {eta} left {msg}";
        bar.set_style(ProgressStyle::with_template(style).expect("the template is fixed"));
        bar.enable_steady_tick(Duration::from_millis(200));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads.unwrap_or(0) as usize).build()?;
        // One robot behind a socket plays one trial at a time, unless more are asked for.
        let one_at_a_time = evaluation.socket && self.threads.is_none();
        let problem = if one_at_a_time {
            &evaluation.problem.searched_by(pool.current_num_threads())
        } else {
            &*evaluation.problem
        };
        let failed = AtomicBool::new(false);
        let stop = || self.interrupted.load(Ordering::Relaxed) || failed.load(Ordering::Relaxed);
        let one = |&(method, trial): &(Method, u32)| {
            if stop() {
                return Ok(());
            }
            let kept =
                play_one(evaluation, problem, method, trial).and_then(|record| run.keep(&record).map(|()| record));
            let record = kept.inspect_err(|_| failed.store(true, Ordering::Relaxed))?;
            report(&bar, &record);
            Ok(())
        };
        let results: Vec<Result<(), Error>> = pool.install(|| {
            if one_at_a_time {
                missing.iter().map(one).collect()
            } else {
                missing.par_iter().with_max_len(1).map(one).collect()
            }
        });
        bar.finish_and_clear();
        results.into_iter().collect::<Result<Vec<()>, Error>>()?;
        Ok(!self.interrupted.load(Ordering::Relaxed))
    }
}

fn play_one(evaluation: &Evaluation, problem: &Problem, method: Method, trial: u32) -> Result<TrialRecord, Error> {
    let Evaluation { prior, worlds, .. } = evaluation;
    let seed = Seed(evaluation.provenance.run.seed);
    let played = match worlds {
        Some(worlds) => play_external(problem, method, prior.as_ref(), seed, trial, worlds),
        None => play(problem, method, prior.as_ref(), seed, trial),
    };
    Ok(played?.0)
}

/// A step of the progress bar, or a line where there is no terminal.
fn report(bar: &ProgressBar, record: &TrialRecord) {
    let TrialRecord { method, trial, reason, steps, seconds, failure, .. } = record;
    if let Some(failure) = failure
        && !bar.is_hidden()
    {
        bar.suspend(|| program::say!("{} trial {trial}: {failure}", method.name()));
    }
    bar.inc(1);
    if bar.is_hidden() {
        let why = failure.as_ref().map_or_else(String::new, |failure| format!(" ({failure})"));
        let (method, reason) = (method.name(), reason.name());
        program::say!("{method} trial {trial}: {reason} after {steps} actions, {seconds:.1} s{why}");
    }
}
