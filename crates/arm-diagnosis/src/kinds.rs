//! The kinds of friction of a joint side by side: what each explains, and what it leaves on the pieces that were not fitted.

use serde::Serialize;

use crate::fit::Fit;
use crate::group::is_friction;
use crate::masses::stddevs;
use crate::prepared::Prepared;
use crate::search::{Found, Term, columns, left};

/// A kind of friction in a joint, with its best setting.
#[derive(Clone, Debug, Serialize)]
pub struct Kind {
    /// Name of the effect.
    pub name: &'static str,
    /// Values that it has beside its setting.
    pub values: usize,
    /// ln of the evidence over that of the kind with the most.
    pub log_evidence: f64,
    /// Root mean square of the held-out torque error of the joint, N·m.
    pub heldout_rms_nm: f64,
}

/// All kinds that the evidence ranks for the joint of a term of friction, fewest values first; empty for other terms.
pub(crate) fn kinds(prepared: &Prepared, found: &Found, term: &Term) -> Vec<Kind> {
    let all = &found.catalogue.candidates;
    let own = &all[term.candidate];
    let Some(joint) = own.joint.filter(|_| is_friction(own.effect)) else { return Vec::new() };
    let mut ranked: Vec<(usize, f64)> = term.rivals.iter().copied().chain([(term.candidate, term.gain)]).collect();
    ranked.retain(|(place, _)| all[*place].joint == Some(joint) && is_friction(all[*place].effect));
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = ranked[0].1;
    // The best setting of each kind.
    let mut named = Vec::new();
    ranked.retain(|(place, _)| {
        let new = !named.contains(&all[*place].effect.name);
        named.push(all[*place].effect.name);
        new
    });
    let others: Vec<usize> =
        found.terms.iter().map(|term| term.candidate).filter(|place| *place != term.candidate).collect();
    let heldout_rms_nm = |candidate: usize| -> Option<f64> {
        let chosen: Vec<usize> = others.iter().copied().chain([candidate]).collect();
        let columns = columns(&found.catalogue, &chosen);
        let spreads = stddevs(&found.catalogue, &columns, &found.mass_factors);
        let fit = Fit::new(&found.all, columns, &spreads)?;
        let left = left(&found.design.gap, &found.catalogue, &fit, prepared);
        let (sum, count) = found.design.chi2(&left, &found.design.held_out, joint, 1.0);
        Some((sum / count.max(1) as f64).sqrt())
    };
    let mut kinds: Vec<Kind> = ranked
        .into_iter()
        .filter_map(|(place, gain)| {
            Some(Kind {
                name: all[place].effect.name,
                values: all[place].features.len(),
                log_evidence: gain - most,
                heldout_rms_nm: heldout_rms_nm(place)?,
            })
        })
        .collect();
    kinds.sort_by(|a, b| a.values.cmp(&b.values).then(b.log_evidence.total_cmp(&a.log_evidence)));
    kinds
}
