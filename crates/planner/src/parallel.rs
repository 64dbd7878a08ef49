//! Root parallelism: independent trees on a few threads.
//!
//! The threads are scoped threads of the standard library. Starting them takes some 50 µs, a search milliseconds to
//! seconds. With a pool that the caller's own parallel work shares, each of them would wait for the other's trees.

use std::sync::Mutex;

use pomdp::Rng;
use rand::{Rng as _, SeedableRng as _};

/// Runs `work` once per tree, with its index and a random stream of its own, on `threads` threads. The results come in the order
/// of the trees, whichever thread was faster.
pub(crate) fn for_each<T, R>(
    trees: &mut [T],
    threads: usize,
    rng: &mut Rng,
    work: impl Fn(usize, &mut T, &mut Rng) -> R + Sync,
) -> Vec<R>
where
    T: Send,
    R: Send,
{
    if let [tree] = trees {
        return vec![work(0, tree, rng)];
    }
    let mut key = [0; 32];
    rng.fill_bytes(&mut key);
    // One key, one stream number a tree: ChaCha's streams of one key do not overlap.
    let stream = |index: usize| {
        let mut rng = Rng::from_seed(key);
        rng.set_stream(index as u64);
        rng
    };
    let count = trees.len();
    let queue = Mutex::new(trees.iter_mut().enumerate());
    let worker = || {
        let mut done = Vec::new();
        loop {
            let next = queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
            let Some((index, tree)) = next else { return done };
            done.push((index, work(index, tree, &mut stream(index))));
        }
    };
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads.min(count)).map(|_| scope.spawn(worker)).collect();
        let mut done = worker();
        for other in others {
            done.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        done
    });
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use pomdp::{Purpose, Seed};
    use rand::Rng as _;

    use super::*;

    /// First draw of every tree, and the caller's next one.
    fn draws(threads: usize, trees: usize) -> (Vec<u64>, u64) {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let drawn = for_each(&mut vec![(); trees], threads, &mut rng, |index, (), rng| (index, rng.next_u64()));
        assert!(drawn.iter().enumerate().all(|(place, (index, _))| place == *index), "{drawn:?}");
        (drawn.into_iter().map(|(_, draw)| draw).collect(), rng.next_u64())
    }

    #[test]
    fn results_come_in_the_order_of_the_trees_for_any_number_of_threads() {
        let one = draws(1, 7);
        let different: std::collections::BTreeSet<&u64> = one.0.iter().collect();
        assert_eq!(different.len(), 7, "each tree has a stream of its own");
        for threads in [2, 3, 7, 20] {
            assert_eq!(draws(threads, 7), one);
        }
    }

    #[test]
    fn a_single_tree_draws_from_the_callers_generator() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        let expected = (vec![rng.next_u64()], rng.next_u64());
        assert_eq!(draws(4, 1), expected);
    }

    #[test]
    #[should_panic(expected = "tree 3")]
    fn a_panic_in_a_tree_reaches_the_caller() {
        let mut rng = Seed(1).stream(Purpose::Test, 0);
        for_each(&mut [(); 5], 2, &mut rng, |index, (), _| assert!(index != 3, "tree {index}"));
    }
}
