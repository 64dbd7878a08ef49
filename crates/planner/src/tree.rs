//! The search tree of discrete observations: branches keyed by the class of the observation.
//!
//! The branches of one action are a binary search tree over their keys, threaded through the nodes that they lead to: no allocation
//! per branch and no hashing. Keys arrive in the random order of the simulations, which keeps it about 2 ln n deep for n classes.

use std::cmp::Ordering;

use pomdp::{Discretise, Rng, Step};

use crate::branching::{Branching, Export, Next};
use crate::nodes::{NodeId, Nodes};
use crate::{Config, Error, Observations};

/// The branch that leads to a node.
#[derive(Debug)]
struct Branch<K> {
    key: K,
    parent: NodeId,
    /// Siblings with smaller and with larger keys, or [`NodeId::NONE`].
    less: NodeId,
    greater: NodeId,
}

/// All histories under the current one.
#[derive(Debug)]
pub struct KeyTree<K> {
    nodes: Nodes,
    /// Entry n − 1 is the branch to node n: nothing leads to the root.
    branches: Vec<Branch<K>>,
}

impl<K: Ord> KeyTree<K> {
    /// A root without statistics.
    pub(crate) fn new(actions: usize, limit: usize) -> Self {
        Self { nodes: Nodes::new(actions, limit), branches: Vec::new() }
    }

    /// The history after `action` and an observation of class `key`; added where it is new and the node limit allows it.
    pub(crate) fn child(&mut self, node: NodeId, action: usize, key: K) -> Next {
        let mut at = self.nodes.slot(node, action).branch;
        let mut last = None;
        while at != NodeId::NONE {
            let branch = &self.branches[at.index() - 1];
            let order = key.cmp(&branch.key);
            last = Some((at, order));
            at = match order {
                Ordering::Equal => return Next::Known(at),
                Ordering::Less => branch.less,
                Ordering::Greater => branch.greater,
            };
        }
        if self.nodes.full(0) {
            return Next::Full;
        }
        let new = self.nodes.add();
        self.branches.push(Branch { key, parent: node, less: NodeId::NONE, greater: NodeId::NONE });
        match last {
            None => self.nodes.slot_mut(node, action).branch = new,
            Some((sibling, Ordering::Less)) => self.branches[sibling.index() - 1].less = new,
            Some((sibling, _)) => self.branches[sibling.index() - 1].greater = new,
        }
        Next::New(new)
    }

    /// The history after `action` and `key`, if it is in the tree.
    fn find(&self, node: NodeId, action: usize, key: &K) -> Option<NodeId> {
        let mut at = self.nodes.slot(node, action).branch;
        while at != NodeId::NONE {
            let branch = &self.branches[at.index() - 1];
            at = match key.cmp(&branch.key) {
                Ordering::Equal => return Some(at),
                Ordering::Less => branch.less,
                Ordering::Greater => branch.greater,
            };
        }
        None
    }

    /// Makes the history after `action` and `key` the root and drops all that is not under it; whether that history was in the
    /// tree. If it was not, the tree is of no use any more.
    pub(crate) fn prune(&mut self, action: usize, key: &K) -> bool {
        let Some(root) = self.find(NodeId::ROOT, action, key) else { return false };
        // A parent's index is smaller than its children's: one pass in order of indices finds the subtree.
        let mut moved = vec![None; self.nodes.count()];
        moved[root.index()] = Some(NodeId::ROOT);
        let mut kept = 1;
        for index in root.index() + 1..moved.len() {
            if moved[self.branches[index - 1].parent.index()].is_some() {
                moved[index] = Some(NodeId::new(kept));
                kept += 1;
            }
        }
        self.nodes.compact(&moved);
        let to = |old: NodeId| if old == NodeId::NONE { old } else { moved[old.index()].expect("a sibling is kept") };
        let mut index = 0;
        self.branches.retain_mut(|branch| {
            index += 1;
            let keep = moved[index].is_some() && index != root.index();
            if keep {
                branch.parent = moved[branch.parent.index()].expect("a parent is kept");
                (branch.less, branch.greater) = (to(branch.less), to(branch.greater));
            }
            keep
        });
        true
    }
}

impl<M> Branching<M> for KeyTree<M::Key>
where
    M: Discretise,
    M::Key: Send,
{
    fn check(config: &Config) -> Result<(), Error> {
        match config.observations {
            Observations::Classes if config.branch_states > 0 => Err(Error::Config {
                key: "branch_states",
                value: config.branch_states.to_string(),
                limit: "0 for `Pomcp`; `Pomcpow` holds states in its branches".into(),
            }),
            Observations::Classes => Ok(()),
            Observations::Widening { .. } => Err(Error::Config {
                key: "observations",
                value: "widening".into(),
                limit: "\"classes\" for `Pomcp`; `Pomcpow` widens".into(),
            }),
        }
    }

    fn new(_config: &Config, actions: usize, limit: usize) -> Self {
        Self::new(actions, limit)
    }

    fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    fn nodes_mut(&mut self) -> &mut Nodes {
        &mut self.nodes
    }

    fn size(&self) -> usize {
        self.nodes.count()
    }

    #[inline]
    fn follow(
        &mut self,
        model: &M,
        node: NodeId,
        action: usize,
        _state: &mut M::State,
        step: &mut Step<M::Observation>,
        _rng: &mut Rng,
    ) -> Next {
        self.child(node, action, model.key(&step.observation))
    }
}

impl<K: Ord + std::fmt::Debug> Export for KeyTree<K> {
    fn arena(&self) -> &Nodes {
        &self.nodes
    }

    fn branches(&self, node: NodeId, action: usize) -> Vec<(String, NodeId)> {
        let mut found = Vec::new();
        let mut open = vec![self.nodes.slot(node, action).branch];
        while let Some(at) = open.pop() {
            if at != NodeId::NONE {
                let branch = &self.branches[at.index() - 1];
                found.push((&branch.key, at));
                open.extend([branch.less, branch.greater]);
            }
        }
        found.sort_by(|a, b| a.0.cmp(b.0));
        found.into_iter().map(|(key, at)| (format!("{key:?}"), at)).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;
    use crate::ActionStats;

    type History = [(usize, u8)];

    fn stats(tree: &KeyTree<u8>, node: NodeId) -> Vec<ActionStats> {
        tree.nodes.slots(node).iter().map(|slot| slot.stats()).collect()
    }

    /// Statistics of the node behind a history, found from the root.
    fn at(tree: &KeyTree<u8>, history: &History) -> Option<Vec<ActionStats>> {
        let mut node = NodeId::ROOT;
        for (action, key) in history {
            node = tree.find(node, *action, key)?;
        }
        Some(stats(tree, node))
    }

    /// Adds a history and records `value` for every action on the way.
    fn insert(tree: &mut KeyTree<u8>, history: &History, value: f64) {
        let mut node = NodeId::ROOT;
        for &(action, key) in history {
            tree.nodes.slot_mut(node, action).record(value);
            match tree.child(node, action, key) {
                Next::Known(child) => node = child,
                _ => break,
            }
        }
    }

    #[test]
    fn a_history_is_new_once() {
        let mut tree = KeyTree::new(2, 100);
        assert_eq!(tree.nodes.count(), 1);
        assert_eq!(tree.child(NodeId::ROOT, 1, 7), Next::New(NodeId::new(1)));
        assert_eq!(tree.child(NodeId::ROOT, 1, 7), Next::Known(NodeId::new(1)));
        let other = tree.child(NodeId::ROOT, 0, 7);
        assert_eq!(other, Next::New(NodeId::new(2)), "the same key under another action is another history");
        assert_eq!(tree.nodes.count(), 3);
    }

    #[test]
    fn a_full_tree_keeps_what_it_has_and_adds_nothing() {
        let mut tree = KeyTree::new(2, 2);
        assert_eq!(tree.child(NodeId::ROOT, 1, 7), Next::New(NodeId::new(1)));
        assert_eq!(tree.child(NodeId::ROOT, 1, 8), Next::Full);
        assert_eq!(tree.child(NodeId::ROOT, 1, 7), Next::Known(NodeId::new(1)));
        assert_eq!(tree.nodes.count(), 2);
    }

    #[test]
    fn an_unknown_history_cannot_become_the_root() {
        let mut tree = KeyTree::new(2, 100);
        insert(&mut tree, &[(0, 1)], 5.0);
        assert!(!tree.prune(0, &2));
    }

    proptest! {
        /// Whatever was known of the histories below the new root is known after pruning, and nothing else is kept.
        #[test]
        fn pruning_keeps_exactly_the_subtree(
            histories in prop::collection::vec(prop::collection::vec((0_usize..3, 0_u8..5), 1..6), 1..200),
            action in 0_usize..3,
            key in 0_u8..5,
        ) {
            let mut tree = KeyTree::new(3, 10_000);
            for (value, history) in histories.iter().enumerate() {
                insert(&mut tree, history, value as f64);
            }
            let mut below = BTreeMap::new();
            for history in &histories {
                for end in 1..=history.len() {
                    let prefix = &history[..end];
                    if prefix[0] == (action, key) && let Some(stats) = at(&tree, prefix) {
                        below.insert(prefix[1..].to_vec(), stats);
                    }
                }
            }
            prop_assert_eq!(tree.prune(action, &key), !below.is_empty());
            if !below.is_empty() {
                for (history, stats) in &below {
                    prop_assert_eq!(at(&tree, history), Some(stats.clone()));
                }
                prop_assert_eq!(tree.nodes.count(), below.len());
                prop_assert_eq!(tree.branches.len(), below.len() - 1);
                // It still grows as a tree should.
                let before = tree.nodes.count();
                prop_assert_eq!(tree.child(NodeId::ROOT, 2, 200), Next::New(NodeId::new(before)));
                prop_assert_eq!(tree.find(NodeId::ROOT, 2, &200), Some(NodeId::new(before)));
            }
        }
    }
}
