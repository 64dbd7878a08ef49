//! A log's answer: verdict, effects with joints and values, where the gap is, and what the pieces that were held out say.

use serde::{Deserialize, Serialize};

use crate::decision::{Decision, Verdict};
use crate::design::{Design, Rows};
use crate::estimate::Estimate;
use crate::features::Catalogue;
use crate::group::{Findings, Group, Leftover, groups, is_friction, leftover};
use crate::kinds::{Kind, kinds};
use crate::log::Log;
use crate::prepared::Prepared;
use crate::search::{Found, Search, left};
use crate::values::{Value, values};

/// How to diagnose.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Of the pieces that are held out.
    pub seed: u64,
    /// Share of the pieces that is held out.
    pub holdout: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { seed: 1, holdout: 0.3 }
    }
}

/// An effect that is named.
#[derive(Clone, Debug, Serialize)]
pub struct NamedEffect {
    /// Name in the catalogue.
    pub name: &'static str,
    /// What it is.
    pub summary: &'static str,
    /// How probable it is, kind of friction included.
    pub confidence: f64,
    /// The same with all kinds of friction taken for one: what decides whether it is named.
    pub probability: f64,
    /// Where it is, strongest first; one entry without a joint for an effect of the arm.
    pub joints: Vec<InJoint>,
}

/// An effect in one joint.
#[derive(Clone, Debug, Serialize)]
pub struct InJoint {
    /// Index of the joint; none for an effect of the arm.
    pub joint: Option<usize>,
    /// Its name in the URDF.
    pub joint_name: Option<String>,
    /// ln of the evidence with it over that without.
    pub log_evidence: f64,
    /// The kind of friction that explains most here; of other effects the name itself.
    pub form: &'static str,
    /// Values.
    pub parameters: Vec<Value>,
    /// Of friction: all kinds of it in this joint, fewest values first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub kinds: Vec<Kind>,
}

/// An effect that the evidence is for.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Considered {
    /// Its name.
    pub name: String,
    /// Its joints, strongest first; empty for an effect of the arm.
    pub joints: Vec<usize>,
    /// How probable it is.
    pub probability: f64,
    /// What speaks for it.
    pub findings: Findings,
}

/// Share of what the nominal model leaves, by joint and what the joint does.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// Index of the joint.
    pub joint: usize,
    /// `standstill`, `reversal`, `slow` or `fast`.
    pub phase: &'static str,
    /// Share of the squared gap, in variances of the noise.
    pub share: f64,
    /// Share of the rows.
    pub rows: f64,
}

/// Errors of torque on the pieces that were held out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HeldOut {
    /// Of the re-tuned nominal model, in variances of the sensors' noise.
    pub before: f64,
    /// With the named effects.
    pub after: f64,
    /// What noise alone would leave.
    pub noise_floor: f64,
    /// Share of the squared torque error that is gone.
    pub closed_fraction: f64,
    /// Root mean square torque errors of each joint, N·m: as the file says, re-tuned, with the named effects.
    pub torque_rms_nm: Vec<[f64; 3]>,
    /// Pieces that were fitted, and held out.
    pub pieces: [usize; 2],
}

/// What is left in a joint when everything that the catalogue has is fitted.
#[derive(Clone, Debug, Serialize)]
pub struct Remainder {
    /// Standard deviation that noise of torques and of the motion makes in a window of 0.04 s, N·m; at least a thousandth of the joint's usual torque.
    pub noise_nm: f64,
    /// What is left while the joint moves, and while it stands, N·m.
    pub moving_nm: f64,
    /// See `moving_nm`.
    pub standing_nm: f64,
    /// Correlation of what is left between neighbouring windows.
    pub lasting: f64,
}

/// The answer to a log.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// In short.
    pub verdict: Verdict,
    /// Probabilities of `effect`, `none` and `unknown`.
    pub probabilities: [f64; 3],
    /// Named effects, what explains most first.
    pub effects: Vec<NamedEffect>,
    /// The same of all effects that the evidence is for, named or not.
    #[serde(skip)]
    pub found: Vec<NamedEffect>,
    /// Others that explain nearly as much as the first.
    pub confusion_set: Vec<String>,
    /// Where the nominal model fails.
    pub located: Vec<Cell>,
    /// On the pieces that were not fitted.
    pub heldout: HeldOut,
    /// What is left, by joint.
    pub remainder: Vec<Remainder>,
    /// Factors by which masses of the file, their centres and their inertias are less certain than usual.
    pub mass_uncertainty: [f64; 3],
    /// What was assumed about robot and log.
    pub notes: Vec<String>,
    /// What all that was found leaves.
    pub leftover: Leftover,
    /// All effects that the evidence is for, named or not, with the numbers that the decision is made of.
    pub considered: Vec<Considered>,
    /// For the page: rate, rad/s, measured less rigid torque, N·m, and what the model makes of that, by joint.
    #[serde(skip)]
    pub curves: Vec<Vec<[f64; 3]>>,
}

/// Diagnoses a log. None where it is too short, or no joint moves enough, to fit anything.
#[must_use]
pub fn diagnose(log: &Log, settings: &Settings) -> Option<Diagnosis> {
    diagnose_with(log, settings, Decision::shipped())
}

/// As [`diagnose`], by another decision.
#[must_use]
pub fn diagnose_with(log: &Log, settings: &Settings, decision: &Decision) -> Option<Diagnosis> {
    let mut prepared = Prepared::new(log);
    if !prepared.says_something() {
        return None;
    }
    let search = |prepared: &Prepared| {
        let design = Design::new(prepared, settings.holdout, settings.seed);
        Search::new(prepared, Catalogue::new(prepared), design)?.run()
    };
    let first = search(&prepared)?;
    prepared.linearise(&first.masses(&prepared), first.gains(&prepared), first.delay_secs());
    let found = search(&prepared)?;
    let left = leftover(&prepared, &found);
    let mut groups: Vec<(f64, Group)> =
        groups(&prepared, &found)?.into_iter().map(|group| (decision.right(&group.findings, &left), group)).collect();
    groups.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = groups.first().map_or(0.0, |(probability, _)| *probability);
    let probabilities = decision.verdict(best, &left);
    let verdict = match probabilities {
        _ if best > 0.5 => Verdict::Effect,
        [_, none, unknown] if unknown > none => Verdict::Unknown,
        _ => Verdict::None,
    };
    let estimate = Estimate::new(&prepared, &found)?;
    let all: Vec<NamedEffect> = groups
        .iter()
        .map(|(probability, group)| NamedEffect {
            name: group.effect.name,
            summary: group.effect.summary,
            confidence: probability * decision.kind(&group.findings, group.effect.name, &left),
            probability: *probability,
            joints: joints(&prepared, &found, &estimate, group, decision),
        })
        .collect();
    let considered = all.iter().zip(&groups).map(|(effect, (probability, group))| Considered {
        name: effect.name.to_owned(),
        joints: effect.joints.iter().filter_map(|joint| joint.joint).collect(),
        probability: *probability,
        findings: group.findings,
    });
    let considered = considered.collect();
    let effects: Vec<NamedEffect> = all.iter().filter(|effect| effect.probability > 0.5).cloned().collect();
    let mut notes: Vec<String> = log.arm.notes().iter().chain(&log.notes).cloned().collect();
    if !log.unread.is_empty() {
        notes.push(format!("columns that nothing reads: {}", log.unread.join(", ")));
    }
    notes.extend((0..prepared.joints()).filter_map(|joint| inverted(&prepared, joint)));
    Some(Diagnosis {
        verdict,
        probabilities,
        effects,
        found: all,
        confusion_set: groups.first().map_or_else(Vec::new, |(_, group)| confused(&found, group)),
        located: located(&prepared, &found),
        heldout: held_out(&prepared, &found, verdict == Verdict::Effect),
        remainder: remainder(&prepared, &found),
        mass_uncertainty: found.mass_factors.0,
        notes,
        leftover: left,
        considered,
        curves: curves(&prepared, &found),
    })
}

/// A sentence where a joint's torques look like those of the file with the other sign.
fn inverted(prepared: &Prepared, joint: usize) -> Option<String> {
    /// Correlation from which that is said: friction alone does not make it.
    const CLEARLY: f64 = -0.7;
    let pairs = prepared.measured[joint].iter().zip(&prepared.nominal[joint]).filter(|(read, _)| read.is_finite());
    let [mut product, mut read_square, mut own_square] = [0.0; 3];
    for (read, own) in pairs {
        product += read * own;
        read_square += read * read;
        own_square += own * own;
    }
    let correlation = product / (read_square * own_square).sqrt().max(1e-300);
    (correlation < CLEARLY).then(|| {
        let name = &prepared.log.arm.joints()[joint].name;
        format!("torques of joint \"{name}\" are taken as they stand, but look like the file's with the other sign")
    })
}

fn joints(prepared: &Prepared, found: &Found, estimate: &Estimate, group: &Group, decision: &Decision) -> Vec<InJoint> {
    let mut joints: Vec<InJoint> = group
        .terms
        .iter()
        .map(|place| {
            let term = &found.terms[*place];
            let candidate = &found.catalogue.candidates[term.candidate];
            InJoint {
                joint: candidate.joint,
                joint_name: candidate.joint.map(|joint| prepared.log.arm.joints()[joint].name.clone()),
                log_evidence: term.gain,
                form: candidate.effect.name,
                parameters: wider(values(prepared, found, estimate, term), decision.wider(candidate.effect.name)),
                kinds: kinds(prepared, found, term),
            }
        })
        .collect();
    joints.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    joints
}

/// Values whose intervals are wider by a factor.
fn wider(mut values: Vec<Value>, factor: f64) -> Vec<Value> {
    for value in &mut values {
        value.interval90 = value.interval90.map(|end| (value.value + factor * (end - value.value)).max(value.least));
    }
    values
}

/// The group's name, and those that would explain its strongest term within a factor of twenty of evidence.
fn confused(found: &Found, group: &Group) -> Vec<String> {
    let mut names = vec![group.effect.name.to_owned()];
    let best = group.terms.iter().map(|place| &found.terms[*place]).max_by(|a, b| a.gain.total_cmp(&b.gain));
    if let Some(term) = best {
        for (place, gain) in &term.rivals {
            let name = found.catalogue.candidates[*place].effect.name.to_owned();
            if term.gain - gain < 20.0_f64.ln() && !names.contains(&name) {
                names.push(name);
            }
        }
        let own = found.catalogue.candidates[term.candidate].effect;
        if is_friction(own) && !names.iter().any(|name| name == own.name) {
            names.push(own.name.to_owned());
        }
    }
    names
}

/// What a joint does in each window.
fn phases(prepared: &Prepared, found: &Found, joint: usize) -> Vec<&'static str> {
    let rates = &prepared.motion[joint].rate;
    let all = prepared.windows.iter().enumerate().map(|(window, ticks)| {
        let (first, last) = (rates[ticks.start], rates[ticks.end - 1]);
        if found.design.stands(joint, window) && first.abs().max(last.abs()) < 5e-3 {
            "standstill"
        } else if first * last < 0.0 {
            "reversal"
        } else if (first + last).abs() < prepared.usual_rate[joint] {
            "slow"
        } else {
            "fast"
        }
    });
    all.collect()
}

fn located(prepared: &Prepared, found: &Found) -> Vec<Cell> {
    let left = left(&found.design.gap, &found.catalogue, &found.null, prepared);
    let windows = prepared.windows.len();
    let mut cells = Vec::new();
    let (mut total, mut rows) = (0.0, 0.0);
    for joint in 0..prepared.joints() {
        let phases = phases(prepared, found, joint);
        for phase in ["standstill", "reversal", "slow", "fast"] {
            let chosen =
                (0..windows).filter(|window| phases[*window] == phase && left[joint * windows + window].is_finite());
            let squares = chosen
                .clone()
                .map(|window| (left[joint * windows + window] / prepared.noise[joint]).powi(2))
                .sum::<f64>();
            let count = chosen.count() as f64;
            // What is more than noise.
            let excess = (squares - count).max(0.0);
            total += excess;
            rows += count;
            cells.push(Cell { joint, phase, share: excess, rows: count });
        }
    }
    for cell in &mut cells {
        cell.share /= f64::max(total, 1e-300);
        cell.rows /= f64::max(rows, 1.0);
    }
    cells.sort_by(|a, b| b.share.total_cmp(&a.share));
    cells
}

fn held_out(prepared: &Prepared, found: &Found, named: bool) -> HeldOut {
    let rows: &Rows = &found.design.held_out;
    // Re-tuned as far as is plausible: a gain that is off by 40 % is no re-tuning.
    let null = found.null.plausible(&found.catalogue, &found.mass_factors);
    let fit = if named { &found.fit } else { &null };
    let gaps = [
        found.design.gap.clone(),
        left(&found.design.gap, &found.catalogue, &null, prepared),
        left(&found.design.gap, &found.catalogue, fit, prepared),
    ];
    let joints = 0..prepared.joints();
    let squares = |gap: &[f64], joint: usize| found.design.chi2(gap, rows, joint, 1.0);
    let noise = |gap: &[f64]| {
        let sum: f64 = joints.clone().map(|joint| squares(gap, joint).0 / prepared.noise[joint].powi(2)).sum();
        sum / rows.rows.len().max(1) as f64
    };
    let torque =
        |gap: &[f64]| joints.clone().map(|joint| squares(gap, joint).0 / prepared.scale[joint].powi(2)).sum::<f64>();
    let rms = |gap: &[f64], joint: usize| {
        let (sum, count) = squares(gap, joint);
        (sum / count.max(1) as f64).sqrt()
    };
    let held: std::collections::BTreeSet<usize> = rows.rows.iter().map(|row| prepared.piece[row.window]).collect();
    HeldOut {
        before: noise(&gaps[1]),
        after: noise(&gaps[2]),
        noise_floor: 1.0,
        closed_fraction: 1.0 - torque(&gaps[2]) / torque(&gaps[1]).max(1e-300),
        torque_rms_nm: joints.clone().map(|joint| [0, 1, 2].map(|which| rms(&gaps[which], joint))).collect(),
        pieces: [prepared.pieces - held.len(), held.len()],
    }
}

fn remainder(prepared: &Prepared, found: &Found) -> Vec<Remainder> {
    let all = found.design.discrepancy.iter().enumerate().map(|(joint, left)| Remainder {
        noise_nm: prepared.noise[joint],
        moving_nm: left.moving,
        standing_nm: left.standing,
        lasting: left.lasting,
    });
    all.collect()
}

fn curves(prepared: &Prepared, found: &Found) -> Vec<Vec<[f64; 3]>> {
    let before = left(&found.design.gap, &found.catalogue, &found.null, prepared);
    let after = left(&found.design.gap, &found.catalogue, &found.fit, prepared);
    let windows = prepared.windows.len();
    let of = |joint: usize| {
        let rates = prepared.means(&prepared.motion[joint].rate);
        (0..windows)
            .map(|window| [rates[window], before[joint * windows + window], after[joint * windows + window]])
            .collect()
    };
    (0..prepared.joints()).map(of).collect()
}
