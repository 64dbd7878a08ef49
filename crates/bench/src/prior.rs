//! Training and inference of the prior, in turn with PyTorch: the same network, loss, data, first weights and order of the batches.
//!
//! A training step is a quarter of an epoch of four batches of 128 sequences of 30 steps: forward and backward pass, Adam, and what the trainer does
//! besides (packing, norm of the gradient, the likelihood of two held-out sequences). Both programs keep running; each round times one epoch of ours
//! and one of PyTorch's, so that a shared machine slows both alike, and the medians of CPU time are compared. PyTorch: `nn.LSTM` by oneDNN (its
//! default), one linear map for all heads, fused Adam, subnormal numbers flushed to 0 (as ours are).

mod problem;
mod pytorch;
mod tensors;

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use prior::fused::{Batch, Workspace};
use prior::{Dimensions, Inference, Parameters, Sequence};
use rayon::ThreadPool;
use serde_json::{Map, Value, json};

use crate::physics::machine;
use problem::{BATCH, BATCHES, Problem, STEPS};
use pytorch::PyTorch;
use tensors::Tensors;

/// Most that held-out likelihoods may differ after an epoch that ends within [`CHECKED_STEPS`], nats a step; an error of the loss or of the gradient
/// moves them by tenths.
const HELD_OUT_TOLERANCE: f64 = 0.005;
/// Optimiser steps over which rounding stays rounding (the first epoch counts in any case). Some hundred steps on, two trainings that differ in the
/// order of their sums alone are different trainings; how different is measured as well.
const CHECKED_STEPS: usize = 64;
/// Most that losses (relative) and gradients (relative to the largest of a tensor) may differ in f64 and in f32.
const TOLERANCE_F64: f64 = 1e-9;
const TOLERANCE_F32: f64 = 1e-4;
/// Most that an output of the single step may differ, relative to the largest.
const OUTPUT_TOLERANCE: f64 = 1e-4;
/// Sequences that loss and gradient are compared on.
const COMPARED: usize = 64;

/// How long to measure, and on what.
#[derive(Clone, Debug)]
pub struct Effort {
    /// Epochs of every program; medians of these are compared.
    pub rounds: usize,
    /// Inference steps in a batch.
    pub steps: usize,
    /// Dataset for the epochs; without one they are left out.
    pub data: Option<PathBuf>,
    /// Whether PyTorch also compiles its step, which takes a C++ compiler and a minute.
    pub compile: bool,
}

/// Runs everything in turn; the object of the contract in DESIGN.md.
///
/// # Errors
///
/// A dataset that cannot be read, a peer that is installed but fails, or results of both that differ by more than rounding.
pub fn run(root: &Path, effort: &Effort, mut note: impl FnMut(&str)) -> Result<Value> {
    let recorded = effort.data.as_deref().map(Problem::recorded).transpose()?;
    let folder = tempfile::tempdir().context("no temporary folder")?;
    let mut peer = PyTorch::start(root, folder.path(), &mut note)?;
    let load = [load(), Value::Null];
    let synthetic = Problem::synthetic();
    let mut agreement = Map::new();
    let batch = batches(&synthetic, effort, folder.path(), peer.as_mut(), &mut note)?;
    let step = steps(&synthetic, effort, folder.path(), peer.as_mut(), &mut agreement, &mut note)?;
    let mut epoch = Value::Null;
    if let Some(recorded) = &recorded {
        epoch = epochs(recorded, effort, folder.path(), peer.as_mut(), &mut agreement, &mut note)?;
        epoch["data"] = json!(effort.data);
    } else {
        note("no dataset: cargo xtask datagen --quick");
    }
    let (ours, theirs) = (&batch["fused_ms"]["median"], &batch["pytorch_ms"]["median"]);
    Ok(json!({
        "batch_ms": ours,
        "pytorch_batch_ms": theirs,
        "ratio": batch["ratio"]["median"],
        "step_us": step["us"]["median"],
        "pytorch_step_us": step["pytorch_us"]["median"],
        "step_ratio": step["ratio"]["median"],
        "batch": batch,
        "step": step,
        "epoch": epoch,
        "agreement": agreement,
        "provenance": {
            "machine": machine(),
            "commit": scenario::commit(root),
            "rounds": effort.rounds,
            "versions": peer.as_ref().map(|peer| &peer.versions),
            "load": [load[0].clone(), self::load()],
        },
    }))
}

/// CPU and wall time of one call, s.
#[derive(Clone, Copy, Debug)]
struct Time {
    cpu: f64,
    wall: f64,
}

fn timed<T>(call: impl FnOnce() -> T) -> (Time, T) {
    let cpu = || {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    };
    #[expect(clippy::disallowed_methods, reason = "a benchmark measures time; no result depends on it")]
    let (start, before) = (Instant::now(), cpu());
    let result = call();
    (Time { cpu: cpu() - before, wall: start.elapsed().as_secs_f64() }, result)
}

/// Times of one kind over the rounds.
#[derive(Clone, Debug, Default)]
struct Series(Vec<f64>);

impl Series {
    /// Median with the extremes and the number of rounds; null without any.
    fn json(&self) -> Value {
        let at = |level| statistics::nearest_rank(self.0.iter().copied(), level).expect("at least one epoch was timed");
        if self.0.is_empty() {
            return Value::Null;
        }
        json!({ "median": at(0.5), "min": at(0.0), "max": at(1.0), "n": self.0.len() })
    }

    /// Of the quotients round by round.
    fn over(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(ours, theirs)| ours / theirs).collect())
    }
}

/// One training step on synthetic sequences, one thread.
fn batches(
    problem: &Problem,
    effort: &Effort,
    folder: &Path,
    mut peer: Option<&mut PyTorch>,
    note: &mut impl FnMut(&str),
) -> Result<Value> {
    let pool = threads(1)?;
    let mut ours = [("fused", problem.trainer(4)?), ("fused_one_chunk", problem.trainer(1)?)];
    if let Some(peer) = peer.as_deref_mut() {
        problem.write(&folder.join("synthetic"), ours[0].1.parameters(), effort.rounds + 1)?;
        peer.ask(&json!({ "do": "open", "folder": "synthetic", "threads": 1 }))?;
    }
    let mut times: BTreeMap<&str, Series> = BTreeMap::new();
    // Round 0 warms up both: pages, caches, and what libraries set up at their first call.
    for round in 0..=effort.rounds {
        note(&format!("training step: round {round} of {}", effort.rounds));
        let mut keep = |name, cpu: f64| {
            if round > 0 {
                times.entry(name).or_default().0.push(1e3 * cpu / BATCHES as f64);
            }
        };
        for (name, trainer) in &mut ours {
            keep(name, pool.install(|| timed(|| trainer.epoch())).0.cpu);
        }
        if let Some(peer) = peer.as_deref_mut() {
            for (name, loss) in [("pytorch", "mixture"), ("pytorch_network_alone", "square")] {
                let answer = peer.ask(&json!({ "do": "epoch", "epoch": round + 1, "loss": loss }))?;
                keep(name, number(&answer, "cpu_s")?);
            }
        }
    }
    let none = Series::default();
    let theirs = times.get("pytorch").unwrap_or(&none);
    let mut result = Map::new();
    for (name, series) in &times {
        result.insert(format!("{name}_ms"), series.json());
    }
    result.insert("ratio".into(), times["fused"].over(theirs).json());
    result.insert("sequences".into(), json!(BATCH));
    result.insert("time_steps".into(), json!(STEPS));
    Ok(Value::Object(result))
}

/// One observation in, one mixture out.
fn steps(
    problem: &Problem,
    effort: &Effort,
    folder: &Path,
    peer: Option<&mut PyTorch>,
    agreement: &mut Map<String, Value>,
    note: &mut impl FnMut(&str),
) -> Result<Value> {
    let sizes = Dimensions::new(&problem.config.network, &problem.layout)?;
    let trainer = problem.trainer(1)?;
    let mut inference = Inference::new(&sizes, &problem.normalisation(), trainer.parameters());
    let rows: Vec<Vec<f64>> = problem.data[0]
        .observations
        .chunks_exact(sizes.observations)
        .map(|row| row.iter().map(|&value| f64::from(value)).collect())
        .collect();
    let batch = |inference: &mut Inference| {
        let calls = || (0..effort.steps).for_each(|call| _ = black_box(inference.step(&rows[call % rows.len()])));
        1e6 * timed(calls).0.cpu / effort.steps as f64
    };
    let (mut ours, mut theirs) = (Series::default(), BTreeMap::<String, Series>::new());
    let Some(peer) = peer else {
        ours.0.extend((0..=effort.rounds).map(|_| batch(&mut inference)).skip(1));
        return Ok(json!({ "us": ours.json(), "pytorch_us": null, "ratio": null }));
    };
    // The synthetic problem, opened afresh: its first weights.
    problem.write(&folder.join("step"), trainer.parameters(), 1)?;
    peer.ask(&json!({ "do": "open", "folder": "step", "threads": 1 }))?;
    for round in 0..=effort.rounds {
        note(&format!("inference step: round {round} of {}", effort.rounds));
        let us = batch(&mut inference);
        let compile = effort.compile && round > 0;
        let answer = peer.ask(&json!({ "do": "step", "calls": effort.steps.min(2000), "compile": compile }))?;
        if round > 0 {
            ours.0.push(us);
            for (name, us) in answer.as_object().context("expected times by variant")? {
                theirs.entry(name.clone()).or_default().0.push(us.as_f64().context("expected a time")?);
            }
        }
    }
    let normalised = problem.normalisation().apply(&problem.data[0]);
    inference.reset();
    let outputs: Vec<f32> = rows
        .iter()
        .flat_map(|row| {
            inference.step(row);
            inference.raw_outputs().to_vec()
        })
        .collect();
    let mut tensors = Tensors::default();
    let bytes = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    tensors.add("observations", "F32", &[rows.len(), sizes.observations], bytes(&normalised.observations));
    tensors.add("outputs", "F32", &[rows.len(), sizes.outputs()], bytes(&outputs));
    tensors.write(&folder.join("outputs.safetensors"))?;
    let answer = peer.ask(&json!({ "do": "outputs", "ours": "outputs.safetensors" }))?;
    let difference = number(&answer, "difference")? / number(&answer, "largest")?;
    ensure!(difference <= OUTPUT_TOLERANCE, "outputs of a step differ from PyTorch's by {difference} of the largest");
    agreement.insert("step_outputs".into(), json!({ "difference": difference, "tolerance": OUTPUT_TOLERANCE }));
    // The fastest of those that run without compiling and do the same work.
    let eager = ["lstm", "cells"].into_iter().filter_map(|name| theirs.get(name));
    let median = |series: &Series| statistics::nearest_rank(series.0.iter().copied(), 0.5).unwrap_or(f64::INFINITY);
    let fastest = eager.min_by(|a, b| median(a).total_cmp(&median(b))).context("expected an eager variant")?;
    let variants: Map<String, Value> = theirs.iter().map(|(name, series)| (name.clone(), series.json())).collect();
    Ok(json!({
        "us": ours.json(),
        "pytorch_us": fastest.json(),
        "ratio": ours.over(fastest).json(),
        "pytorch_variants_us": variants,
    }))
}

/// Epochs on recorded data with one and with two threads, and what both have learned by them.
fn epochs(
    problem: &Problem,
    effort: &Effort,
    folder: &Path,
    mut peer: Option<&mut PyTorch>,
    agreement: &mut Map<String, Value>,
    note: &mut impl FnMut(&str),
) -> Result<Value> {
    let (training, held_out) = (problem.part(false).len(), problem.part(true).len());
    let first = problem.trainer(problem.config.chunks)?;
    if let Some(peer) = peer.as_deref_mut() {
        problem.write(&folder.join("recorded"), first.parameters(), effort.rounds)?;
        peer.ask(&json!({ "do": "open", "folder": "recorded", "threads": 1 }))?;
        gradients(problem, first.parameters(), folder, peer, agreement)?;
    }
    drop(first);
    let mut by_threads = Map::new();
    let mut weights: Vec<Parameters<f32>> = Vec::new();
    for count in [1, 2] {
        let pool = threads(count)?;
        let mut trainer = problem.trainer(problem.config.chunks)?;
        if let Some(peer) = peer.as_deref_mut() {
            peer.ask(&json!({ "do": "open", "folder": "recorded", "threads": count }))?;
        }
        // The same sums in another order: how far rounding alone drives two trainings apart.
        let mut twin = if count == 1 { Some(problem.trainer(1)?) } else { None };
        let mut times: BTreeMap<&str, Series> = BTreeMap::new();
        let mut curves = Curves::default();
        for round in 1..=effort.rounds {
            note(&format!("epoch with {count} threads: round {round} of {}", effort.rounds));
            let (ours, report) = pool.install(|| timed(|| trainer.epoch()));
            let report = report?;
            times.entry("cpu").or_default().0.push(ours.cpu);
            times.entry("wall").or_default().0.push(ours.wall);
            let Some(peer) = peer.as_deref_mut() else { continue };
            let epoch = peer.ask(&json!({ "do": "epoch", "epoch": round, "loss": "mixture" }))?;
            // Our epoch ends with the held-out likelihood, so theirs does too.
            let after = peer.ask(&json!({ "do": "held_out" }))?;
            times.entry("pytorch_cpu").or_default().0.push(number(&epoch, "cpu_s")? + number(&after, "cpu_s")?);
            times.entry("pytorch_wall").or_default().0.push(number(&epoch, "wall_s")? + number(&after, "wall_s")?);
            if let Some(twin) = &mut twin {
                let rounded = pool.install(|| twin.epoch())?.held_out_nll;
                let theirs = number(&after, "nll")?;
                note(&format!("  held out {:.4}, in one chunk {rounded:.4}, PyTorch {theirs:.4}", report.held_out_nll));
                curves.ours.push(report.held_out_nll);
                curves.rounded.push(rounded);
                curves.theirs.push(theirs);
            }
        }
        if twin.is_some() && peer.is_some() {
            agreement.insert("likelihood".into(), curves.check(training.div_ceil(BATCH))?);
        }
        weights.push(trainer.parameters().clone());
        let none = Series::default();
        let series = |name| times.get(name).unwrap_or(&none);
        let mut row: Map<String, Value> = times.iter().map(|(name, s)| (format!("{name}_s"), s.json())).collect();
        row.insert("cpu_ratio".into(), series("cpu").over(series("pytorch_cpu")).json());
        row.insert("wall_ratio".into(), series("wall").over(series("pytorch_wall")).json());
        by_threads.insert(count.to_string(), Value::Object(row));
    }
    ensure!(weights[0] == weights[1], "one and two threads gave different weights");
    let transitions: usize = problem.data.iter().map(|sequence| sequence.steps).sum();
    Ok(json!({
        "training_sequences": training,
        "held_out_sequences": held_out,
        "transitions": transitions,
        "threads": by_threads,
        "same_weights": true,
    }))
}

/// Held-out negative log-likelihood by epoch, nats a step.
#[derive(Debug, Default)]
struct Curves {
    ours: Vec<f64>,
    /// Ours with the sums of a batch in another order.
    rounded: Vec<f64>,
    theirs: Vec<f64>,
}

impl Curves {
    /// `batches`: optimiser steps of an epoch.
    fn check(&self, batches: usize) -> Result<Value> {
        let checked = (CHECKED_STEPS / batches).clamp(1, self.ours.len());
        let apart = |other: &[f64]| -> Vec<f64> { self.ours.iter().zip(other).map(|(a, b)| (a - b).abs()).collect() };
        let differences = apart(&self.theirs);
        let worst = differences[..checked].iter().copied().fold(0.0, f64::max);
        ensure!(
            worst <= HELD_OUT_TOLERANCE,
            "held-out likelihood differs from PyTorch's by {worst} nats a step within {checked} epochs: {:?} and {:?}",
            self.ours,
            self.theirs
        );
        Ok(json!({
            "held_out_nll": self.ours,
            "pytorch_held_out_nll": self.theirs,
            "one_chunk_held_out_nll": self.rounded,
            "differences": differences,
            "differences_by_order_of_sums": apart(&self.rounded),
            "optimiser_steps_an_epoch": batches,
            "checked_epochs": checked,
            "tolerance": HELD_OUT_TOLERANCE,
        }))
    }
}

/// Loss and gradient of the first weights on the first training sequences, in both precisions.
fn gradients(
    problem: &Problem,
    weights: &Parameters<f32>,
    folder: &Path,
    peer: &mut PyTorch,
    agreement: &mut Map<String, Value>,
) -> Result<()> {
    let sizes = Dimensions::new(&problem.config.network, &problem.layout)?;
    let normalisation = problem.normalisation();
    let sequences: Vec<Sequence> = problem.part(false).iter().take(COMPARED).map(|s| normalisation.apply(s)).collect();
    let sequences: Vec<&Sequence> = sequences.iter().collect();
    let batch = Batch::<f64>::pack(&sequences, &sizes);
    let mut space = Workspace::<f64>::new(&sizes);
    let scale = 1.0 / batch.rows as f64;
    let loss = scale * space.loss_and_gradient(&weights.map(f64::from), &batch, None, scale);
    Tensors::weights_f64(&space.gradient, &sizes).write(&folder.join("f64.safetensors"))?;
    let batch = Batch::<f32>::pack(&sequences, &sizes);
    let mut space = Workspace::<f32>::new(&sizes);
    let narrow_loss = scale * space.loss_and_gradient(weights, &batch, None, scale as f32);
    Tensors::weights_f32(&space.gradient, &sizes).write(&folder.join("f32.safetensors"))?;
    for (name, loss, tolerance) in [("f64", loss, TOLERANCE_F64), ("f32", narrow_loss, TOLERANCE_F32)] {
        let request = json!({ "do": "gradient", "count": sequences.len(), "ours": format!("{name}.safetensors") });
        let answer = peer.ask(&request)?;
        let theirs = number(&answer, "loss")?;
        let (of_loss, of_gradient) = ((loss / theirs - 1.0).abs(), number(&answer, "gradient_difference")?);
        ensure!(
            of_loss <= tolerance && of_gradient <= tolerance,
            "{name}: loss {loss} against PyTorch's {theirs}, gradient of {} differs by {of_gradient} of its largest value",
            answer["tensor"]
        );
        let row = json!({ "loss": loss, "loss_difference": of_loss, "gradient_difference": of_gradient,
            "tensor": answer["tensor"], "sequences": sequences.len(), "tolerance": tolerance });
        agreement.insert(format!("gradient_{name}"), row);
    }
    Ok(())
}

fn threads(count: usize) -> Result<ThreadPool> {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().context("no thread pool")
}

fn number(answer: &Value, key: &str) -> Result<f64> {
    answer[key].as_f64().with_context(|| format!("pytorch_prior.py: expected {key} in {answer}"))
}

/// Mean number of programs that want to run, over the last minute.
fn load() -> Value {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    json!(text.split_whitespace().next().and_then(|text| text.parse::<f64>().ok()))
}

/// The result as Markdown.
#[must_use]
pub fn table(result: &Value) -> String {
    let cell = |value: &Value, digits: usize| match value["median"].as_f64() {
        Some(median) => {
            let end = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
            format!("{median:.digits$} ({:.digits$}–{:.digits$})", end("min"), end("max"))
        }
        None => "–".into(),
    };
    let mut text = String::from("| one thread, median (least–most) | ours | PyTorch | ratio |\n|---|---|---|---|\n");
    let (batch, step) = (&result["batch"], &result["step"]);
    text += &format!(
        "| training step, 128 × 30, CPU ms | {} | {} | {} |\n",
        cell(&batch["fused_ms"], 1),
        cell(&batch["pytorch_ms"], 1),
        cell(&batch["ratio"], 2)
    );
    text += &format!("| the same in one chunk | {} | | |\n", cell(&batch["fused_one_chunk_ms"], 1));
    text += &format!("| the same without the mixture loss | | {} | |\n", cell(&batch["pytorch_network_alone_ms"], 1));
    text += &format!(
        "| inference step, µs | {} | {} | {} |\n",
        cell(&step["us"], 1),
        cell(&step["pytorch_us"], 1),
        cell(&step["ratio"], 3)
    );
    for (name, times) in step["pytorch_variants_us"].as_object().into_iter().flatten() {
        text += &format!("| PyTorch, {name} | | {} | |\n", cell(times, 1));
    }
    for (count, row) in result["epoch"]["threads"].as_object().into_iter().flatten() {
        for clock in ["cpu", "wall"] {
            let (ours, theirs) = (&row[format!("{clock}_s")], &row[format!("pytorch_{clock}_s")]);
            let ratio = cell(&row[format!("{clock}_ratio")], 2);
            text +=
                &format!("| epoch, {count} threads, {clock} s | {} | {} | {ratio} |\n", cell(ours, 2), cell(theirs, 2));
        }
    }
    text + &format!("\nAgreement: {}\n\n{}\n", result["agreement"], result["provenance"])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curves(theirs: &[f64]) -> Curves {
        Curves {
            ours: vec![-69.196, -78.434, -84.146],
            rounded: vec![-69.196, -78.436, -84.095],
            theirs: theirs.to_vec(),
        }
    }

    #[test]
    fn likelihoods_apart_before_rounding_has_grown_are_refused() {
        let message = curves(&[-69.19, -78.434, -84.146]).check(43).unwrap_err().to_string();
        assert!(message.contains("within 1 epochs"), "{message}");
        let message = curves(&[-69.196, -78.44, -84.146]).check(30).unwrap_err().to_string();
        assert!(message.contains("within 2 epochs"), "{message}");
    }

    #[test]
    fn likelihoods_apart_after_many_steps_are_reported_only() {
        let result = curves(&[-69.196, -78.548, -84.292]).check(43).unwrap();
        assert_eq!(result["checked_epochs"], 1);
        assert!((result["differences"][1].as_f64().unwrap() - 0.114).abs() < 1e-9);
        assert!((result["differences_by_order_of_sums"][2].as_f64().unwrap() - 0.051).abs() < 1e-9);
    }

    #[test]
    fn ratios_are_taken_round_by_round() {
        let ratio = Series(vec![1.0, 4.0, 9.0]).over(&Series(vec![2.0, 4.0, 3.0])).json();
        assert_eq!(ratio, json!({ "median": 1.0, "min": 0.5, "max": 3.0, "n": 3 }));
        assert_eq!(Series(vec![1.0]).over(&Series::default()).json(), Value::Null);
    }
}
