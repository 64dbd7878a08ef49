//! Slurm. Checked with 22.05.

use crate::Error;
use crate::command::Asked;
use crate::job::{Active, Submission, ranges};

const NAME: &str = "slurm";

/// `squeue` by name, not by number: a job that has ended is no error then.
pub(crate) fn active(name: &str) -> Result<Option<Active>, Error> {
    let printed = Asked::new(NAME, "squeue")
        .with(|c| {
            c.args(["--me", "--array", "--noheader", "--format=%F|%T|%r", "--name", name]);
        })
        .output()?;
    parse(&printed)
}

fn parse(printed: &str) -> Result<Option<Active>, Error> {
    let mut active: Option<Active> = None;
    for line in printed.lines() {
        let fields: Vec<&str> = line.trim().splitn(3, '|').collect();
        let &[job, state, reason] = fields.as_slice() else {
            let expected = "JOB|STATE|REASON";
            return Err(Error::Answer { executor: NAME, program: "squeue".into(), answer: line.into(), expected });
        };
        let active = active.get_or_insert_with(|| Active { job: job.into(), ..Active::default() });
        if state == "PENDING" {
            active.pending += 1;
            active.reason = Some(reason.into()).filter(|r| r != "None");
        } else {
            active.running += 1;
        }
    }
    Ok(active)
}

/// `sbatch`, with everything that matters on the command line, which beats the `SBATCH_` variables that the rest is left to.
pub(crate) fn submit(submission: &Submission<'_>) -> Result<String, Error> {
    // A per cent sign begins a field, two stand for one.
    let logs = submission.logs.to_string_lossy().replace('%', "%%");
    let printed = Asked::new(NAME, "sbatch")
        .with(|c| {
            c.args(["--parsable", "--requeue", "--open-mode=append", "--ntasks=1", "--job-name", submission.name])
                .arg(format!("--array={}", ranges(submission.shards)))
                .arg(format!("--cpus-per-task={}", submission.processors))
                .arg(format!("--output={logs}/%A_%a.log"))
                .arg(submission.script);
        })
        .output()?;
    // "12" or "12;cluster".
    let job = printed.split(';').next().unwrap_or_default().trim().to_string();
    if job.is_empty() || !job.bytes().all(|b| b.is_ascii_digit()) {
        let expected = "the number of a job";
        return Err(Error::Answer { executor: NAME, program: "sbatch".into(), answer: printed, expected });
    }
    Ok(job)
}

pub(crate) fn cancel(job: &str) -> Result<(), Error> {
    Asked::new(NAME, "scancel").with(|c| _ = c.arg(job)).output().map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_are_counted_with_the_reason_of_those_that_wait() {
        assert_eq!(parse("").unwrap(), None);
        let active = parse("12|RUNNING|None\n12|COMPLETING|None\n12|PENDING|Resources").unwrap().unwrap();
        assert_eq!(active.to_string(), "job 12: 2 running, 1 waiting (Resources)");
        let message = parse("slurm is down").unwrap_err().to_string();
        assert!(message.contains("squeue") && message.contains("expected JOB|STATE|REASON"), "{message}");
    }
}
