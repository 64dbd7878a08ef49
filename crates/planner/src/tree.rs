//! The search tree: an arena of history nodes, each with one slot per action.
//!
//! A node is a history h. Slot a of a node holds N(ha), V(ha) and the branches to the histories hao, keyed by the class of o.
//! N(h) is not stored: it is the sum of N(ha). Node 0 is the root.

use std::collections::BTreeMap;

use crate::ucb::ActionStats;

/// Index of a node in its tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NodeId(u32);

impl NodeId {
    fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("a tree holds fewer than 2³² nodes"))
    }

    fn index(self) -> usize {
        self.0 as usize
    }
}

/// What following an observation led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Child {
    /// A history that the tree held already.
    Known(NodeId),
    /// A history that was added by this call.
    New,
}

/// All histories under the current one. Slots lie side by side: those of node n at n × actions.
#[derive(Debug)]
pub(crate) struct Tree<K> {
    actions: usize,
    stats: Vec<ActionStats>,
    branches: Vec<BTreeMap<K, NodeId>>,
}

impl<K: Ord> Tree<K> {
    pub(crate) const ROOT: NodeId = NodeId(0);

    /// A root without statistics.
    pub(crate) fn new(actions: usize) -> Self {
        assert!(actions > 0, "a model without actions cannot be planned for");
        let mut tree = Self { actions, stats: Vec::new(), branches: Vec::new() };
        tree.grow();
        tree
    }

    pub(crate) fn node_count(&self) -> usize {
        self.stats.len() / self.actions
    }

    /// Statistics of the node's actions, in the model's order.
    pub(crate) fn stats(&self, node: NodeId) -> &[ActionStats] {
        let first = node.index() * self.actions;
        &self.stats[first..first + self.actions]
    }

    /// Takes in a return that followed `action` at `node`.
    pub(crate) fn record(&mut self, node: NodeId, action: usize, discounted_return: f64) {
        self.stats[node.index() * self.actions + action].record(discounted_return);
    }

    /// The history after `action` and an observation of class `key`; added where it is new.
    pub(crate) fn child(&mut self, node: NodeId, action: usize, key: K) -> Child {
        let next = NodeId::new(self.node_count());
        let found = *self.branches[node.index() * self.actions + action].entry(key).or_insert(next);
        if found == next {
            self.grow();
            Child::New
        } else {
            Child::Known(found)
        }
    }

    /// Makes the history after `action` and `key` the root and drops all that is not under it. A history that was never
    /// simulated leaves a root without statistics.
    pub(crate) fn prune(&mut self, action: usize, key: &K) {
        let mut old = std::mem::replace(self, Self::new(self.actions));
        let Some(&child) = old.branches[Self::ROOT.index() * old.actions + action].get(key) else { return };
        self.stats.clear();
        self.branches.clear();
        // Breadth first: a node's new index is its place in this queue.
        let mut kept = vec![child];
        let mut index = 0;
        while let Some(&node) = kept.get(index) {
            self.stats.extend_from_slice(old.stats(node));
            let first = node.index() * old.actions;
            for branch in &mut old.branches[first..first + old.actions] {
                let mut branch = std::mem::take(branch);
                for target in branch.values_mut() {
                    let moved = NodeId::new(kept.len());
                    kept.push(*target);
                    *target = moved;
                }
                self.branches.push(branch);
            }
            index += 1;
        }
    }

    fn grow(&mut self) {
        self.stats.resize(self.stats.len() + self.actions, ActionStats::default());
        self.branches.resize_with(self.branches.len() + self.actions, BTreeMap::new);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    type History = [(usize, u8)];

    /// Statistics of the node behind a history, found from the root.
    fn at<'a>(tree: &'a Tree<u8>, history: &History) -> Option<&'a [ActionStats]> {
        let mut node = Tree::<u8>::ROOT;
        for &(action, key) in history {
            node = *tree.branches[node.index() * tree.actions + action].get(&key)?;
        }
        Some(tree.stats(node))
    }

    /// Adds a history and records `value` for every action on the way.
    fn insert(tree: &mut Tree<u8>, history: &History, value: f64) {
        let mut node = Tree::<u8>::ROOT;
        for &(action, key) in history {
            tree.record(node, action, value);
            match tree.child(node, action, key) {
                Child::Known(child) => node = child,
                Child::New => break,
            }
        }
    }

    #[test]
    fn a_history_is_new_once() {
        let mut tree = Tree::new(2);
        let root = Tree::<u8>::ROOT;
        assert_eq!(tree.node_count(), 1);
        assert_eq!(tree.child(root, 1, 7), Child::New);
        assert_eq!(tree.child(root, 1, 7), Child::Known(NodeId(1)));
        assert_eq!(tree.child(root, 0, 7), Child::New, "the same key under another action is another history");
        assert_eq!(tree.node_count(), 3);
    }

    #[test]
    fn pruning_an_unknown_history_leaves_an_empty_root() {
        let mut tree = Tree::new(2);
        insert(&mut tree, &[(0, 1)], 5.0);
        tree.prune(0, &2);
        assert_eq!(tree.node_count(), 1);
        assert_eq!(tree.stats(Tree::<u8>::ROOT), &[ActionStats::default(); 2]);
    }

    proptest! {
        /// Whatever was known of the histories below the new root is known after pruning, and nothing else is kept.
        #[test]
        fn pruning_keeps_exactly_the_subtree(
            histories in prop::collection::vec(prop::collection::vec((0_usize..3, 0_u8..3), 1..6), 1..200),
            action in 0_usize..3,
            key in 0_u8..3,
        ) {
            let mut tree = Tree::new(3);
            for (value, history) in histories.iter().enumerate() {
                insert(&mut tree, history, value as f64);
            }
            let mut below = std::collections::BTreeMap::new();
            for history in &histories {
                for end in 1..=history.len() {
                    let prefix = &history[..end];
                    if prefix[0] == (action, key) && let Some(stats) = at(&tree, prefix) {
                        below.insert(prefix[1..].to_vec(), stats.to_vec());
                    }
                }
            }
            tree.prune(action, &key);
            for (history, stats) in &below {
                prop_assert_eq!(at(&tree, history), Some(stats.as_slice()));
            }
            prop_assert_eq!(tree.node_count(), below.len().max(1));
            prop_assert_eq!(tree.branches.len(), tree.stats.len());
        }
    }
}
