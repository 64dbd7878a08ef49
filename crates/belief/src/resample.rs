//! Stratified resampling, with a quota for each structure.

use pomdp::Rng;
use rand::RngExt as _;

/// One drawn particle: its index and its new weight.
pub(crate) type Drawn = (usize, f64);

/// How many particles each structure gets, and how many the unlikely ones share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quota {
    /// Fewest particles of a likely structure.
    pub(crate) particles: usize,
    /// Probability above which a structure is a likely one.
    pub(crate) threshold: f64,
}

/// `count` draws from the normalised `weights`, stratified within each structure (Douc, Cappé and Moulines 2005).
/// `kinds` is the structure of each particle, an index below `structures`.
///
/// Each likely structure κ gets n_κ particles of weight P_κ / n_κ, where P_κ is its probability. The expected weight of
/// every particle stays the same for any n_κ. The unlikely structures are drawn as one group. A group whose weights
/// could underflow to 0 is not drawn, and the others get its draws: no particle has weight 0.
pub(crate) fn resample(
    weights: &[f64],
    kinds: &[usize],
    structures: usize,
    count: usize,
    quota: Quota,
    rng: &mut Rng,
) -> Vec<Drawn> {
    resample_with_shares(weights, kinds, structures, count, quota, rng).0
}

/// [`resample`], and the new weight that a particle of each structure has or would have.
pub(crate) fn resample_with_shares(
    weights: &[f64],
    kinds: &[usize],
    structures: usize,
    count: usize,
    quota: Quota,
    rng: &mut Rng,
) -> (Vec<Drawn>, Vec<f64>) {
    let mut mass = vec![0.0; structures];
    weights.iter().zip(kinds).for_each(|(w, &kind)| mass[kind] += w);
    // The last group is that of the unlikely structures, or of all where there are more of them than draws.
    let present = mass.iter().filter(|&&p| p > 0.0).count();
    let threshold = if present <= count { quota.threshold } else { 1.0 };
    let group_of: Vec<usize> =
        mass.iter().enumerate().map(|(k, &p)| if p > threshold { k } else { structures }).collect();
    let mut members = vec![Vec::new(); structures + 1];
    for (index, (&weight, &kind)) in weights.iter().zip(kinds).enumerate() {
        if weight > 0.0 {
            members[group_of[kind]].push(index);
        }
    }
    let mass_of = |members: &Vec<usize>| members.iter().map(|&i| weights[i]).sum::<f64>();
    let divisible = |mass: f64| if mass / count as f64 > 0.0 { mass } else { 0.0 };
    let group_mass: Vec<f64> = members.iter().map(mass_of).map(divisible).collect();
    let counts = allocate(&group_mass, structures, count, quota.particles);
    let mut drawn = Vec::with_capacity(count);
    for ((members, &count), &mass) in members.iter().zip(&counts).zip(&group_mass) {
        if count > 0 {
            let chosen = stratified(members.iter().map(|&i| weights[i]), mass, count, rng);
            drawn.extend(chosen.into_iter().map(|at| (members[at], mass / count as f64)));
        }
    }
    let new_weight = |&group: &usize| group_mass[group] / counts[group].max(1) as f64;
    (drawn, group_of.iter().map(new_weight).collect())
}

/// Particles of each group: proportional to its mass, at least the quota (the last group: at least one).
fn allocate(mass: &[f64], structures: usize, count: usize, quota: usize) -> Vec<usize> {
    let present = mass[..structures].iter().filter(|&&p| p > 0.0).count();
    let least = if present == 0 { 0 } else { quota.min(count / (2 * present)).max(1) };
    let floor: Vec<usize> = mass
        .iter()
        .enumerate()
        .map(|(g, &p)| {
            if p <= 0.0 {
                0
            } else if g < structures {
                least
            } else {
                1
            }
        })
        .collect();
    // Groups whose proportional part is below their floor take the floor; the rest is shared by the others, which may push more of them
    // below theirs.
    let mut fixed = vec![false; mass.len()];
    loop {
        let left = count.saturating_sub((0..mass.len()).filter(|&g| fixed[g]).map(|g| floor[g]).sum());
        let open: f64 = (0..mass.len()).filter(|&g| !fixed[g]).map(|g| mass[g]).sum();
        let part = |g: usize| if open > 0.0 { left as f64 * mass[g] / open } else { 0.0 };
        let below: Vec<usize> = (0..mass.len()).filter(|&g| !fixed[g] && part(g) < floor[g] as f64).collect();
        if below.is_empty() {
            let mut counts: Vec<usize> =
                (0..mass.len()).map(|g| if fixed[g] { floor[g] } else { part(g) as usize }).collect();
            // Largest remainders first; ties go to the earlier group. Any choice is as unbiased.
            let mut open: Vec<usize> = (0..mass.len()).filter(|&g| !fixed[g] && mass[g] > 0.0).collect();
            open.sort_by(|&a, &b| part(b).fract().total_cmp(&part(a).fract()));
            let missing = count.saturating_sub(counts.iter().sum());
            open.into_iter().take(missing).for_each(|g| counts[g] += 1);
            return counts;
        }
        below.into_iter().for_each(|g| fixed[g] = true);
    }
}

/// `count` positions in `weights`, which sum to `total`: one uniform draw from each of `count` equal strata.
pub(crate) fn stratified(
    weights: impl ExactSizeIterator<Item = f64>,
    total: f64,
    count: usize,
    rng: &mut Rng,
) -> Vec<usize> {
    let last = weights.len() - 1;
    let mut chosen = Vec::with_capacity(count);
    let mut weights = weights.enumerate();
    let (mut at, mut reached) = weights.next().expect("a group with a positive mass has members");
    for stratum in 0..count {
        let draw = (stratum as f64 + rng.random::<f64>()) / count as f64 * total;
        while reached <= draw && at < last {
            let (next, weight) = weights.next().expect("the last member ends the search");
            (at, reached) = (next, reached + weight);
        }
        chosen.push(at);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Rng, Seed};
    use proptest::prelude::*;

    use super::*;

    const NO_QUOTA: Quota = Quota { particles: 0, threshold: 0.0 };

    fn rng(item: u64) -> Rng {
        Seed(1).stream(Purpose::Test, item)
    }

    #[test]
    fn the_expected_weight_of_every_particle_stays() {
        // Null: E[new weight of i] = w_i. n = 20,000 repetitions of 16 draws. The standard error of a particle's new
        // weight is estimated from the repetitions. Tolerance: 4.5 standard errors, for 12 particles times two quotas.
        // Structure 2 (mass 0.01) has a quota of 4 in the second case, that is 25 times its share; structure 3 is
        // unlikely in it.
        let raw = [5.0, 0.1, 3.0, 2.0, 0.7, 0.2, 4.0, 0.05, 0.06, 0.02, 0.03, 0.5];
        let kinds = [0, 0, 1, 1, 0, 1, 0, 2, 2, 3, 3, 0];
        let total: f64 = raw.iter().sum();
        let weights = raw.map(|w| w / total);
        for (case, quota) in [NO_QUOTA, Quota { particles: 4, threshold: 0.005 }].into_iter().enumerate() {
            let (mut sum, mut squares) = ([0.0; 12], [0.0; 12]);
            let n = 20_000;
            let mut rng = rng(case as u64);
            for _ in 0..n {
                let mut new = [0.0; 12];
                let drawn = resample(&weights, &kinds, 4, 16, quota, &mut rng);
                assert_eq!(drawn.len(), 16);
                drawn.iter().for_each(|&(index, weight)| new[index] += weight);
                for i in 0..12 {
                    sum[i] += new[i];
                    squares[i] += new[i] * new[i];
                }
            }
            for i in 0..12 {
                let mean = sum[i] / f64::from(n);
                let error = ((squares[i] / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
                assert!((mean - weights[i]).abs() < 4.5 * error + 1e-12, "{case} {i}: {mean} for {}", weights[i]);
            }
        }
    }

    #[test]
    fn alternating_particles_are_drawn_independently_of_each_other() {
        // Particles true, false, true, …: systematic resampling with half as many draws would pick only one kind, all or nothing. Strata
        // of two particles are independent coin tosses: n = 2000 repetitions of 32, the number of true ones is binomial(32, 1/2) with
        // variance 8. Null: that variance; its standard error over n is 8 √(2 / n) = 0.25, tolerance 4 of them.
        let weights = [1.0 / 64.0; 64];
        let mut rng = rng(2);
        let counts: Vec<f64> = (0..2000)
            .map(|_| {
                let drawn = resample(&weights, &[0; 64], 1, 32, NO_QUOTA, &mut rng);
                drawn.iter().filter(|(index, _)| index % 2 == 0).count() as f64
            })
            .collect();
        let variance = counts.iter().map(|c| (c - 16.0).powi(2)).sum::<f64>() / 2000.0;
        assert!((variance - 8.0).abs() < 1.0, "{variance}");
    }

    #[test]
    fn a_group_too_light_to_be_shared_is_not_drawn() {
        // Structure 1 asks for four particles; a quarter of the smallest positive number is 0.
        let weights = [0.5, 0.5, f64::from_bits(1)];
        for (quota, threshold) in [(4, 0.0), (4, 0.5), (1, 0.0)] {
            let drawn = resample(&weights, &[0, 0, 1], 2, 16, Quota { particles: quota, threshold }, &mut rng(3));
            assert!(drawn.len() == 16 && drawn.iter().all(|&(_, w)| w > 0.0), "{quota} {threshold}: {drawn:?}");
            assert!((drawn.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn counts_weights_and_quotas_hold(
            raw in prop::collection::vec((prop_oneof![Just(0.0), 1e-9..1.0_f64], 0_usize..4), 1..60),
            count in 1_usize..100,
            particles in 0_usize..20,
            threshold in 0.0..0.2_f64,
            item in 0_u64..100,
        ) {
            let total: f64 = raw.iter().map(|(w, _)| w).sum();
            prop_assume!(total > 0.0);
            let weights: Vec<f64> = raw.iter().map(|(w, _)| w / total).collect();
            let kinds: Vec<usize> = raw.iter().map(|&(_, k)| k).collect();
            let drawn = resample(&weights, &kinds, 4, count, Quota { particles, threshold }, &mut rng(item));
            prop_assert_eq!(drawn.len(), count);
            prop_assert!((drawn.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(drawn.iter().all(|&(i, _)| weights[i] > 0.0));
            for kind in 0..4 {
                let old: f64 = weights.iter().zip(&kinds).filter(|&(_, &k)| k == kind).map(|(w, _)| w).sum();
                let of_kind = || drawn.iter().filter(|&&(i, _)| kinds[i] == kind);
                if old > threshold && count >= 4 {
                    // Exactly its probability, and at least its quota where that can be kept.
                    prop_assert!((of_kind().map(|(_, w)| w).sum::<f64>() - old).abs() < 1e-9);
                    prop_assert!(of_kind().count() >= particles.min(count / 8).max(1));
                }
            }
        }
    }
}
