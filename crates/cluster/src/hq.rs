//! HyperQueue. Checked with 0.26.

use serde::Deserialize;

use crate::Error;
use crate::command::Asked;
use crate::job::{Active, Submission, ranges};

const NAME: &str = "hq";

/// An entry of `hq job list`.
#[derive(Deserialize)]
struct Job {
    id: u64,
    name: String,
    task_stats: Tasks,
}

/// Its tasks.
#[derive(Deserialize)]
struct Tasks {
    running: usize,
    waiting: usize,
}

pub(crate) fn active(name: &str) -> Result<Option<Active>, Error> {
    let printed = Asked::new(NAME, "hq")
        .with(|c| {
            c.args(["job", "list", "--filter", "waiting,running", "--output-mode", "json"]);
        })
        .output()?;
    parse(&printed, name)
}

fn parse(printed: &str, name: &str) -> Result<Option<Active>, Error> {
    let jobs: Vec<Job> = serde_json::from_str(printed).map_err(|_| Error::Answer {
        executor: NAME,
        program: "hq job list".into(),
        answer: printed.chars().take(200).collect(),
        expected: "a JSON list of jobs with `id`, `name` and `task_stats`",
    })?;
    let active = |job: &Job| Active {
        job: job.id.to_string(),
        running: job.task_stats.running,
        pending: job.task_stats.waiting,
        reason: None,
    };
    Ok(jobs.iter().find(|job| job.name == name).map(active))
}

pub(crate) fn submit(submission: &Submission<'_>) -> Result<String, Error> {
    let logs = submission.logs.display();
    let printed = Asked::new(NAME, "hq")
        .with(|c| {
            c.args(["submit", "--output-mode", "quiet", "--name", submission.name])
                .arg(format!("--array={}", ranges(submission.shards)))
                .arg(format!("--cpus={}", submission.processors))
                .arg(format!("--stdout={logs}/%{{JOB_ID}}_%{{TASK_ID}}.log"))
                .args(["--stderr=none", "--", "/bin/sh"])
                .arg(submission.script);
        })
        .output()?;
    if printed.parse::<u64>().is_err() {
        let expected = "the number of a job";
        return Err(Error::Answer { executor: NAME, program: "hq submit".into(), answer: printed, expected });
    }
    Ok(printed)
}

pub(crate) fn cancel(job: &str) -> Result<(), Error> {
    Asked::new(NAME, "hq").with(|c| _ = c.args(["job", "cancel", job])).output().map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_job_of_the_name_is_found_among_others() {
        let job = |id: u64, name: &str| {
            serde_json::json!({"id": id, "name": name, "task_count": 9, "is_open": false, "cancel_reason": null,
                "task_stats": {"running": 2, "finished": 3, "failed": 0, "canceled": 0, "aborted": 0, "waiting": 4}})
        };
        let list = serde_json::json!([job(1, "other"), job(7, "ours")]).to_string();
        let active = parse(&list, "ours").unwrap().unwrap();
        assert_eq!(active.to_string(), "job 7: 2 running, 4 waiting");
        assert_eq!(parse(&list, "none").unwrap(), None);
        assert!(parse("[{}]", "ours").unwrap_err().to_string().contains("task_stats"));
    }
}
