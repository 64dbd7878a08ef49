use agent::Reason;

use super::*;
use crate::{Pool, Provenance, RunIdentity, RunPlan, TrialRecord};

/// A plan of runs on D1 and D2 and both together.
pub(crate) fn plan() -> TablePlan {
    let run = RunPlan {
        name: "paper".into(),
        preset: "paper".into(),
        methods: vec![Method::NoRnn, Method::RnnSampling],
        set: Vec::new(),
        python_world: None,
        published: None,
    };
    TablePlan {
        version: 1,
        order: 1,
        title: "A table".into(),
        success_figure: None,
        robot: "sawyer".into(),
        domains: vec!["D1".into(), "D2".into()],
        pools: vec![Pool { name: "D1–D2".into(), domains: vec!["D1".into(), "D2".into()] }],
        include: Vec::new(),
        runs: vec![run],
        name: "t".into(),
    }
}

/// A run in which the methods solved the worlds of `outcomes`.
pub(crate) fn part(run: &str, domain: &str, outcomes: &[(Method, &[bool])]) -> Part {
    let mut trials = Trials::new();
    for &(method, successes) in outcomes {
        for (trial, &success) in (0..).zip(successes) {
            let reason = if success { Reason::Goal } else { Reason::Depleted };
            let record = TrialRecord { method, trial, success, reason, ..crate::trial::tests::record() };
            trials.insert((method, trial), record);
        }
    }
    let methods: Vec<Method> = outcomes.iter().map(|(method, _)| *method).collect();
    let run_identity = RunIdentity {
        version: 1,
        scenario_hash: "abc".into(),
        seed: 1,
        prior_hash: None,
        urdf_hash: "def".into(),
        commit: "none".into(),
        world: None,
    };
    let longest = outcomes.iter().map(|(_, successes)| successes.len()).max().unwrap_or(0);
    let provenance =
        Provenance { run: run_identity, program: "test".into(), methods: methods.clone(), trials: longest as u32 };
    let published = [("no-rnn".to_string(), Published { successes: 3, trials: 30 })].into();
    let table = Table::new(domain, "sawyer", "paper", &provenance, &trials, &published);
    let folder = format!("t-{run}-{domain}");
    Part { run: run.into(), folder, methods, included: false, set: Vec::new(), published: None, table, trials }
}

pub(crate) fn common() -> Common {
    Common { version: 1, seed: 1, quick: false, set: Vec::new() }
}

const YES: bool = true;
const NO: bool = false;

fn parts() -> Vec<Part> {
    let (none, sampling) = (Method::NoRnn, Method::RnnSampling);
    vec![
        part("paper", "D1", &[(none, &[YES, YES, NO, NO]), (sampling, &[YES, NO, NO, NO])]),
        part("paper", "D2", &[(none, &[NO, YES, YES, NO]), (sampling, &[YES, NO, YES, NO])]),
        part("better", "D1", &[(none, &[YES, YES, YES, NO])]),
    ]
}

#[test]
fn totals_are_sums_over_the_domains_that_an_arm_has_played() {
    let combined = Combined::new(&plan(), &parts(), Vec::new(), &common());
    assert_eq!(combined.rows.len(), 5);
    assert_eq!(combined.domains(), ["D1", "D2"]);
    let labels: Vec<String> = combined.arms().iter().map(Arm::label).collect();
    assert_eq!(labels, ["paper no-rnn", "paper rnn-sampling", "better no-rnn"]);
    // `better` has not played D2.
    let totals: Vec<_> = combined.totals.iter().map(|t| (t.method, t.successes, t.trials)).collect();
    assert_eq!(totals, [(Method::NoRnn, 4, 8), (Method::RnnSampling, 3, 8)]);
    assert_eq!(combined.totals[0].published, Some(Published { successes: 6, trials: 60 }));
    assert_eq!(combined.totals[1].published, None, "the paper has no figure");
    assert_eq!(combined.totals[0].failures, [(Failure::Depleted, 4)].into());
    // 4 of 8: the centre is a half, the half width z √(n/4 + z²/4) / (n + z²) with z = 1.96.
    let [low, high] = combined.totals[0].interval95;
    assert!((low - 0.2152).abs() < 1e-4 && (high - 0.7848).abs() < 1e-4, "{low}, {high}");
}

#[test]
fn arms_are_compared_on_each_domain_and_on_their_sums() {
    let combined = Combined::new(&plan(), &parts(), Vec::new(), &common());
    let cells = |domains: &str, first: usize, second: usize| {
        let arms = combined.arms();
        let found = combined
            .comparisons
            .iter()
            .find(|c| c.domains == domains && c.first == arms[first] && c.second == arms[second]);
        // The p-value to twelve digits.
        found.map(|c| ([c.both, c.first_only, c.second_only, c.neither], (c.p * 1e12).round() / 1e12))
    };
    assert_eq!(cells("D1", 0, 1), Some(([1, 1, 0, 2], 1.0)));
    assert_eq!(cells("D2", 0, 1), Some(([1, 1, 1, 1], 1.0)));
    assert_eq!(cells("D1–D2", 0, 1), Some(([2, 2, 1, 3], 1.0)));
    // Across runs; only where both have played.
    assert_eq!(cells("D1", 1, 2), Some(([1, 0, 2, 1], 0.5)));
    assert_eq!((cells("D2", 1, 2), cells("D1–D2", 1, 2)), (None, None));
    assert_eq!(combined.comparisons.len(), 5);
}

#[test]
fn runs_of_another_table_are_compared_with_this_ones_and_only_with_those() {
    let mut parts = parts();
    for part in &mut parts[..2] {
        part.included = true;
    }
    parts[0].methods = vec![Method::NoRnn];
    parts[1].methods = vec![Method::NoRnn];
    let combined = Combined::new(&plan(), &parts, Vec::new(), &common());
    assert_eq!(combined.rows.len(), 3);
    let pairs: Vec<_> = combined.comparisons.iter().map(|c| (c.first.label(), c.second.label())).collect();
    assert_eq!(pairs, [("paper no-rnn".into(), "better no-rnn".into())]);
}

#[test]
fn runs_in_different_worlds_are_not_compared() {
    let mut parts = parts();
    let address = "/home/me/python world.py".to_string();
    let world = agent::WorldIdentity { address, name: "mujoco".into(), version: "1".into() };
    parts[2].table.provenance.run.world = Some(world);
    let combined = Combined::new(&plan(), &parts, Vec::new(), &common());
    assert!(combined.comparisons.iter().all(|c| c.first.run == "paper" && c.second.run == "paper"));
    assert_eq!(combined.rows[4].world.as_deref(), Some("mujoco 1"));
    let json = serde_json::to_string(&combined).unwrap();
    assert!(!json.contains("/home"), "no path of a machine: {json}");
}

#[test]
fn published_figures_of_a_run_replace_those_of_the_domain() {
    let mut parts = parts();
    parts[0].published = Some([("rnn-sampling".to_string(), Published { successes: 23, trials: 30 })].into());
    let combined = Combined::new(&plan(), &parts, Vec::new(), &common());
    let published: Vec<_> = combined.rows.iter().map(|r| r.row.published.map(|p| p.successes)).collect();
    assert_eq!(published, [None, Some(23), Some(3), None, Some(3)]);
}

#[test]
fn the_table_for_people_has_a_column_a_domain_and_says_what_is_missing() {
    let combined = Combined::new(&plan(), &parts(), vec!["t-better-D2".into()], &common());
    let text = combined.to_markdown();
    for part in [
        "Not played: t-better-D2.",
        "| run | method | D1 | D2 | D1–D2 |",
        "| paper | no-rnn | 2/4 (0.15–0.85) [3/30] | 2/4 (0.15–0.85) [3/30] | 4/8 (0.22–0.78) [6/60] |",
        "| better | no-rnn | 3/4 (0.30–0.95) [3/30] | – | – |",
        "| paper rnn-sampling | better no-rnn | 0 : 2, p 0.50 | – | – |",
        "depleted 2",
        "Seed 1.",
        "| t-better-D1 | none | 4 | abc |",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    let csv = combined.to_csv();
    let columns: BTreeSet<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert_eq!((csv.lines().count(), columns), (8, [24].into()), "{csv}");
    assert!(csv.lines().nth(1).unwrap().ends_with(",depleted 2,1,none,abc"), "seed, commit and scenario: {csv}");
    assert_eq!(combined.comparisons_csv().lines().count(), 6);
}
