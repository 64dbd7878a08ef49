//! Fresh particles after depletion: noise on old ones, and copies of what is left.

use pomdp::{Belief, Perturb, Rng};
use rand::seq::SliceRandom as _;

/// A draw from `belief` with the model's artificial noise.
///
/// The noise is added before the step, not after it: what is kept has then been checked against the observation.
pub(crate) fn perturbed<M, B>(model: &M, belief: &B, rng: &mut Rng) -> M::State
where
    M: Perturb,
    B: Belief<State = M::State>,
{
    let mut state = belief.sample(rng).clone();
    model.perturb(&mut state, rng);
    state
}

/// Indices below `available` that fill `wanted` places: each once, then again in random order, so that copies differ by at most
/// one in number. Independent draws would be as unbiased, but would lose particles by chance.
pub(crate) fn copies(available: usize, wanted: usize, rng: &mut Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..available).collect();
    if available < wanted {
        order.shuffle(rng);
    }
    order.into_iter().cycle().take(wanted).collect()
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_particle_is_equally_likely_to_get_the_odd_copy() {
        // Null: 5 places for 3 particles leave two odd copies, so each particle has a second one with probability 2/3.
        // n = 3000, standard deviation 25.8; tolerance 4 of them.
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let mut doubled = [0_i32; 3];
        for _ in 0..3000 {
            let order = copies(3, 5, &mut rng);
            for (index, count) in doubled.iter_mut().enumerate() {
                *count += i32::from(order.iter().filter(|&&i| i == index).count() == 2);
            }
        }
        assert!(doubled.iter().all(|count| (count - 2000).abs() < 104), "{doubled:?}");
    }

    proptest! {
        #[test]
        fn copies_differ_by_at_most_one_in_number(available in 1_usize..50, more in 0_usize..200, item in 0_u64..100) {
            let mut rng = Seed(1).stream(Purpose::Test, item);
            let wanted = available + more;
            let order = copies(available, wanted, &mut rng);
            prop_assert_eq!(order.len(), wanted);
            let mut counts = vec![0; available];
            for index in order {
                counts[index] += 1;
            }
            let least = wanted / available;
            prop_assert!(counts.iter().all(|&c| c == least || c == least + 1), "{:?}", counts);
        }
    }
}
