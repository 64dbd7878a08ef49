//! A bounded run of all fuzz targets, the same cases each time: see [`fuzzing`].

use std::panic::{AssertUnwindSafe, catch_unwind};

use fuzzing::{TARGETS, Target, Verdict, mutate};

/// Runs `cases` cases of a target. `most_bytes`: what a case may hold at once, on the heap, of what its own thread allocates.
fn run(name: &str, cases: u64, most_bytes: u64) {
    let target: &Target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let seeds = (target.seeds)();
    for (number, seed) in seeds.iter().enumerate() {
        assert_eq!((target.body)(seed), Verdict::Accepted, "seed {number} of {name}");
    }
    let (mut accepted, mut largest, mut broken) = (0, 0, Vec::new());
    for number in 0..cases {
        let bytes = mutate::case(&seeds, number);
        let mut verdict = None;
        let counted = allocation_counter::measure(|| {
            verdict = catch_unwind(AssertUnwindSafe(|| (target.body)(&bytes))).ok();
        });
        accepted += u64::from(verdict == Some(Verdict::Accepted));
        largest = largest.max(counted.bytes_max);
        if verdict.is_none() || counted.bytes_max > most_bytes {
            let kept = std::env::temp_dir().join(format!("surmise-fuzzing-{name}-{number}"));
            std::fs::write(&kept, &bytes).unwrap();
            broken.push(format!("{}, {} bytes allocated", kept.display(), counted.bytes_max));
        }
    }
    println!("{name}: {cases} cases, {accepted} accepted, {} refused, at most {largest} bytes", cases - accepted);
    assert!(broken.is_empty(), "{} of {cases} cases break the rule, kept as:\n{}", broken.len(), broken.join("\n"));
    assert!(accepted > 0 && accepted < cases, "{accepted} of {cases} accepted: the run has looked at one side alone");
}

/// One MiB of input may become so much: values of a tree are larger than their text.
const MOST_BYTES: u64 = 256 << 20;

#[test]
fn scenarios_are_read_or_refused() {
    run("scenario_toml", 4000, MOST_BYTES);
}

#[test]
fn arms_are_read_or_refused() {
    run("robot", 2000, MOST_BYTES);
}

#[test]
fn datasets_are_read_or_refused() {
    run("dataset_shard", 6000, MOST_BYTES);
}

#[test]
fn priors_are_read_or_refused() {
    run("checkpoint", 8000, MOST_BYTES);
}

#[test]
fn networks_of_bridge_filters_are_read_or_refused() {
    run("posterior", 2000, MOST_BYTES);
}

#[test]
fn recordings_of_others_are_imported_or_refused() {
    run("import_log", 2000, MOST_BYTES);
}

#[test]
fn measured_logs_are_read_or_refused() {
    run("measured_log", 6000, MOST_BYTES);
}

#[test]
fn models_of_a_diagnosis_are_read_or_refused() {
    run("model_toml", 2000, MOST_BYTES);
}

#[test]
fn answers_of_worlds_are_read_or_refused() {
    run("world_protocol", 6000, MOST_BYTES);
}
