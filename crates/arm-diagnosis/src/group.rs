//! What a model's terms say about each effect: where it is, how much it explains, and how well that holds on pieces that were not fitted.

use serde::{Deserialize, Serialize};

use crate::effect::Effect;
use crate::features::{Candidate, Feature};
use crate::fit::Fit;
use crate::masses::stddevs;
use crate::prepared::{Prepared, rms};
use crate::search::{Found, columns};

/// An effect with the joints that have it.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    pub(crate) effect: &'static Effect,
    /// Places of its terms in the model.
    pub(crate) terms: Vec<usize>,
    pub(crate) findings: Findings,
}

/// The numbers that a decision is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Findings {
    /// ln of the evidence with the effect over that without, and over its prior.
    pub log_evidence: f64,
    /// By how much others in its stead would have less.
    pub ahead: f64,
    /// What it gains in ln likelihood on the held-out pieces, over the standard error of that sum.
    pub heldout_steadiness: f64,
    /// Share of the held-out error of its joints that goes with it.
    pub closed: f64,
    /// Its torque over the typical torque of the joint, root mean squares; the largest of its joints.
    pub size: f64,
    /// Of friction: by how much the evidence of another kind in its stead would be less, and which share of what plain friction leaves goes with this kind.
    pub form_ahead: f64,
    /// See `form_ahead`.
    pub form_share: f64,
}

/// What all terms together leave on the held-out pieces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leftover {
    /// Mean square in variances of the sensors' noise; the largest of the joints.
    pub after: f64,
    /// Root mean square over the typical torque; the largest of the joints.
    pub left: f64,
    /// Share that the ten windows before foretell; the largest of the joints.
    pub foretold: f64,
}

/// Groups of a model, what explains most first.
pub(crate) fn groups(prepared: &Prepared, found: &Found) -> Option<Vec<Group>> {
    let catalogue = &found.catalogue;
    let mut families: Vec<(&'static str, Vec<usize>)> = Vec::new();
    for (place, term) in found.terms.iter().enumerate() {
        let effect = catalogue.candidates[term.candidate].effect;
        let family = if is_friction(effect) { "friction" } else { effect.name };
        match families.iter_mut().find(|(name, _)| *name == family) {
            Some((_, terms)) => terms.push(place),
            None => families.push((family, vec![place])),
        }
    }
    let after = left_over(prepared, found, &found.fit);
    let mut groups = Vec::new();
    for (_, terms) in families {
        let kept: Vec<usize> = (0..found.terms.len())
            .filter(|place| !terms.contains(place))
            .map(|place| found.terms[place].candidate)
            .collect();
        let columns = columns(catalogue, &kept);
        let without = Fit::new(&found.all, columns.clone(), &stddevs(catalogue, &columns, &found.mass_factors))?;
        let form = form(found, &terms);
        let findings = findings(prepared, found, &terms, &without.plausible(catalogue, &found.mass_factors), &after);
        let findings = Findings { form_ahead: form.ahead, form_share: form.share, ..findings };
        groups.push(Group { effect: form.effect, terms, findings });
    }
    groups.sort_by(|a, b| b.findings.log_evidence.total_cmp(&a.findings.log_evidence));
    Some(groups)
}

/// Whether it is a kind of friction of a joint.
#[must_use]
pub fn is_friction(effect: &Effect) -> bool {
    effect.name == "joint_friction" || effect.extends_friction()
}

/// A kind of friction that takes away less than this share of the squares that a simpler one leaves is not told from it.
pub(crate) const FINER: f64 = 0.05;

/// A kind of friction: what it explains beyond plain friction, and beyond the next kind, in ln evidence.
struct Form {
    effect: &'static Effect,
    more: f64,
    ahead: f64,
    share: f64,
}

/// Of several kinds of friction the one that explains most beyond plain friction, where that is something.
fn form(found: &Found, terms: &[usize]) -> Form {
    let catalogue = &found.catalogue;
    let effect = |place: usize| catalogue.candidates[found.terms[place].candidate].effect;
    let first = effect(terms[0]);
    if !is_friction(first) {
        return Form { effect: first, more: 0.0, ahead: 0.0, share: 0.0 };
    }
    let plain = Effect::find("joint_friction").expect("the name of an effect");
    let mut forms: Vec<Form> = vec![Form { effect: plain, more: 0.0, ahead: 0.0, share: 0.0 }];
    let (mut rows, mut total) = (0.0, 0.0);
    for place in terms {
        let term = &found.terms[*place];
        let joint = catalogue.candidates[term.candidate].joint;
        let own = effect(*place);
        let best = |wanted: &dyn Fn(&Candidate) -> bool| {
            let rival =
                |other: &usize| catalogue.candidates[*other].joint == joint && wanted(&catalogue.candidates[*other]);
            term.rivals.iter().find(|(other, _)| rival(other)).map_or(0.0, |(_, gain)| gain.max(0.0))
        };
        let less = if own.name == plain.name { term.gain } else { best(&|other| other.effect.name == plain.name) };
        let next = best(&|other| is_friction(other.effect) && other.effect.name != own.name);
        rows += joint.map_or(0.0, |joint| found.design.fitted.of(joint).len() as f64);
        total += term.gain - less;
        let place = forms.iter().position(|form| form.effect.name == own.name).unwrap_or_else(|| {
            forms.push(Form { effect: own, more: 0.0, ahead: 0.0, share: 0.0 });
            forms.len() - 1
        });
        forms[place].more += term.gain - less;
        forms[place].ahead += term.gain - next;
    }
    // Twice a gain in evidence is what the sum of squares loses, in variances of what is left.
    let share = 2.0 * total / (rows + 2.0 * total).max(1.0);
    let best = forms.into_iter().max_by(|a, b| a.more.total_cmp(&b.more).then(a.ahead.total_cmp(&b.ahead)));
    match best {
        Some(form) if share > FINER => Form { share, ..form },
        _ => Form { effect: plain, more: 0.0, ahead: 0.0, share },
    }
}

/// What is left of each joint's held-out rows: sum of squares, N²·m², and their number.
struct Left {
    squares: Vec<f64>,
    rows: Vec<usize>,
    /// White, for likelihoods.
    white: Vec<f64>,
    /// Of all windows, joint after joint, N·m.
    all: Vec<f64>,
}

fn left_over(prepared: &Prepared, found: &Found, fit: &Fit) -> Left {
    let left = crate::search::left(&found.design.gap, &found.catalogue, fit, prepared);
    let (mut squares, mut counts) = (Vec::new(), Vec::new());
    for joint in 0..prepared.joints() {
        let (sum, count) = found.design.chi2(&left, &found.design.held_out, joint, 1.0);
        squares.push(sum);
        counts.push(count);
    }
    let white = found.design.whiten(None, &left, &found.design.held_out).values;
    Left { squares, rows: counts, white, all: left }
}

fn findings(prepared: &Prepared, found: &Found, terms: &[usize], without: &Fit, after: &Left) -> Findings {
    let catalogue = &found.catalogue;
    let chosen = |place: &usize| &catalogue.candidates[found.terms[*place].candidate];
    let log_evidence = found.fit.log_evidence - without.log_evidence;
    let best = terms
        .iter()
        .max_by(|a, b| found.terms[**a].gain.total_cmp(&found.terms[**b].gain))
        .copied()
        .unwrap_or(terms[0]);
    let other = |candidate: &Candidate| {
        let own = chosen(&best);
        candidate.joint != own.joint
            || (candidate.effect.name != own.effect.name && !(is_friction(candidate.effect) && is_friction(own.effect)))
    };
    let rival = found.terms[best].rivals.iter().find(|(place, _)| other(&catalogue.candidates[*place]));
    let before = left_over(prepared, found, without);
    let joints: Vec<usize> = if terms.iter().any(|place| chosen(place).joint.is_none()) {
        (0..prepared.joints()).collect()
    } else {
        terms.iter().filter_map(|place| chosen(place).joint).collect()
    };
    let joints: Vec<usize> = joints.into_iter().filter(|joint| prepared.is_read(*joint)).collect();
    // In units of each joint's own variance, so that strong joints do not hide weak ones.
    let sum =
        |left: &Left| joints.iter().map(|joint| left.squares[*joint] / before.squares[*joint].max(1e-300)).sum::<f64>();
    let size =
        joints.iter().map(|joint| size_in(prepared, found, terms, *joint) / prepared.scale[*joint]).fold(0.0, f64::max);
    Findings {
        log_evidence,
        ahead: found.terms[best].gain - rival.map_or(0.0, |(_, gain)| gain.max(0.0)),
        heldout_steadiness: steadiness(prepared, found, &before, after),
        closed: 1.0 - sum(after) / sum(&before).max(1e-300),
        size,
        form_ahead: 0.0,
        form_share: 0.0,
    }
}

/// What the model of a log leaves.
pub(crate) fn leftover(prepared: &Prepared, found: &Found) -> Leftover {
    let after = left_over(prepared, found, &found.fit);
    let most = |of: &dyn Fn(usize) -> f64| (0..prepared.joints()).map(of).fold(0.0, f64::max);
    let mean = |joint: usize| after.squares[joint] / after.rows[joint].max(1) as f64;
    Leftover {
        after: most(&|joint| mean(joint) / prepared.noise[joint].powi(2)),
        left: most(&|joint| mean(joint).sqrt() / prepared.scale[joint]),
        foretold: most(&|joint| found.design.foretold(&after.all, joint, prepared)),
    }
}

/// Gain of ln likelihood over its standard error, by pieces.
fn steadiness(prepared: &Prepared, found: &Found, before: &Left, after: &Left) -> f64 {
    let rows = &found.design.held_out;
    let mut pieces: Vec<(usize, f64)> = Vec::new();
    for (row, (old, new)) in rows.rows.iter().zip(before.white.iter().zip(&after.white)) {
        let piece = prepared.piece[row.window];
        let gain = 0.5 * (old * old - new * new);
        match pieces.iter_mut().find(|(other, _)| *other == piece) {
            Some((_, sum)) => *sum += gain,
            None => pieces.push((piece, gain)),
        }
    }
    let count = pieces.len() as f64;
    let total: f64 = pieces.iter().map(|(_, gain)| gain).sum();
    let mean = total / count.max(1.0);
    let variance = pieces.iter().map(|(_, gain)| (gain - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    // Each piece alone has a standard error of about its root: no steadier than that.
    total / (count * variance).sqrt().max(1.0)
}

/// Torque that terms make in a joint, N·m, root mean square.
fn size_in(prepared: &Prepared, found: &Found, terms: &[usize], joint: usize) -> f64 {
    let windows = prepared.windows.len();
    let mut sum = vec![0.0; windows];
    let mut seen = Vec::new();
    for place in terms {
        for feature in &found.catalogue.candidates[found.terms[*place].candidate].features {
            if seen.contains(feature) {
                continue;
            }
            seen.push(*feature);
            let coefficient = coefficient(found, *feature);
            let Feature { joint: own, values, .. } = &found.catalogue.features[*feature];
            let start = match own {
                Some(own) if *own == joint => 0,
                Some(_) => continue,
                None => joint * windows,
            };
            for (total, value) in sum.iter_mut().zip(&values[start..start + windows]) {
                *total += coefficient * value;
            }
        }
    }
    rms(&sum)
}

/// Fitted value of a column; 0 of one that the model does not have.
pub(crate) fn coefficient(found: &Found, feature: usize) -> f64 {
    let place = found.fit.columns.iter().position(|column| *column == feature);
    place.map_or(0.0, |place| found.fit.coefficients[place])
}
