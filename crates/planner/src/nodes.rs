//! Arena of history nodes: one slot per action, N(ha), V(ha) and where its branches start.
//!
//! The slots of node n start at n × actions. N(h) is not stored: it is the sum of N(ha) over the legal actions. Node 0
//! is the root. A node is always added after its parent, so a parent's index is the smaller one.

use pomdp::ActionPrior;

use crate::ActionStats;

/// Index of a node in its tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeId(u32);

impl NodeId {
    /// The history that is searched from.
    pub(crate) const ROOT: Self = Self(0);
    /// No node, where a branch is asked for: nothing branches to the root.
    pub(crate) const NONE: Self = Self(0);

    pub(crate) fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("a tree holds at most 2³² nodes"))
    }

    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// What is known of one action at one node. Sixteen bytes, for a simulation reads all slots of every node it passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slot {
    pub(crate) value: f64,
    visits: u32,
    /// First branch, or [`NodeId::NONE`].
    pub(crate) branch: NodeId,
}

impl Slot {
    /// Mark of an illegal action in place of its visits.
    const ILLEGAL: u32 = u32::MAX;
    const NEW: Self = Self { value: 0.0, visits: 0, branch: NodeId::NONE };

    pub(crate) fn legal(self) -> bool {
        self.visits != Self::ILLEGAL
    }

    /// N(ha); zero for an illegal action.
    pub(crate) fn visits(self) -> u32 {
        if self.legal() { self.visits } else { 0 }
    }

    /// Takes in one return.
    pub(crate) fn record(&mut self, discounted_return: f64) {
        // From 2³² − 2 visits on, the oldest returns are forgotten at that rate instead of overflowing.
        self.visits = (self.visits + 1).min(Self::ILLEGAL - 1);
        self.value += (discounted_return - self.value) / f64::from(self.visits);
    }

    pub(crate) fn stats(self) -> ActionStats {
        ActionStats { visits: u64::from(self.visits()), value: self.value }
    }

    #[cfg(test)]
    pub(crate) fn of(visits: u32, value: f64) -> Self {
        Self { value, visits, branch: NodeId::NONE }
    }
}

/// The slots of all nodes of one tree.
#[derive(Debug)]
pub struct Nodes {
    actions: usize,
    limit: usize,
    slots: Vec<Slot>,
}

impl Nodes {
    /// A root without statistics, in a tree that may grow to `limit` nodes.
    pub(crate) fn new(actions: usize, limit: usize) -> Self {
        assert!(actions > 0, "a model without actions cannot be planned for");
        assert!(limit > 0, "a tree needs a root");
        Self { actions, limit, slots: vec![Slot::NEW; actions] }
    }

    pub(crate) fn actions(&self) -> usize {
        self.actions
    }

    pub(crate) fn count(&self) -> usize {
        self.slots.len() / self.actions
    }

    /// Whether the limit is reached by the nodes of the arena and `more` states that are stored elsewhere.
    pub(crate) fn full(&self, more: usize) -> bool {
        self.count() + more >= self.limit
    }

    /// The node's actions, in the model's order.
    pub(crate) fn slots(&self, node: NodeId) -> &[Slot] {
        let first = node.index() * self.actions;
        &self.slots[first..first + self.actions]
    }

    pub(crate) fn slot(&self, node: NodeId, action: usize) -> Slot {
        self.slots[node.index() * self.actions + action]
    }

    pub(crate) fn slot_mut(&mut self, node: NodeId, action: usize) -> &mut Slot {
        &mut self.slots[node.index() * self.actions + action]
    }

    /// Adds a node without statistics.
    pub(crate) fn add(&mut self) -> NodeId {
        let node = NodeId::new(self.count());
        self.slots.resize(self.slots.len() + self.actions, Slot::NEW);
        node
    }

    /// N(h): visits of all actions, initial ones included.
    pub(crate) fn visits(&self, node: NodeId) -> u64 {
        self.slots(node).iter().map(|slot| u64::from(slot.visits())).sum()
    }

    /// Writes prior knowledge into a node without statistics; initial visits and values only where `full`.
    pub(crate) fn set_priors(&mut self, node: NodeId, priors: &[ActionPrior], full: bool) {
        assert!(priors.iter().any(|p| p.legal), "a policy called every action of a state illegal");
        let first = node.index() * self.actions;
        for (slot, prior) in self.slots[first..first + self.actions].iter_mut().zip(priors) {
            if !prior.legal {
                slot.visits = Slot::ILLEGAL;
            } else if full && prior.visits > 0 {
                (slot.visits, slot.value) = (prior.visits.min(Slot::ILLEGAL - 1), prior.value);
            }
        }
    }

    /// Keeps the nodes that `moved` maps to a new index, which must keep their order.
    pub(crate) fn compact(&mut self, moved: &[Option<NodeId>]) {
        let actions = self.actions;
        let mut kept = 0;
        for (old, _) in moved.iter().enumerate().filter(|(_, new)| new.is_some()) {
            self.slots.copy_within(old * actions..(old + 1) * actions, kept * actions);
            kept += 1;
        }
        self.slots.truncate(kept * actions);
        for slot in &mut self.slots {
            if slot.branch != NodeId::NONE {
                slot.branch = moved[slot.branch.index()].expect("what branches off a kept node is kept");
            }
        }
    }
}
