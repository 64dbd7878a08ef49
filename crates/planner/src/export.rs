//! The tree as data to look at: JSON by serde, DOT for Graphviz.

use std::fmt::Write as _;

use crate::branching::Export;
use crate::nodes::NodeId;

/// How much of a tree is exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExportLimit {
    /// Levels of nodes, the root's included: 1 shows its actions alone.
    pub depth: usize,
    /// Fewest visits of an action or a node that is shown.
    pub visits: u64,
}

/// A history with its actions.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TreeNode {
    /// N(h): visits of all actions, initial ones included.
    pub visits: u64,
    /// Actions with enough visits, in the model's order.
    pub actions: Vec<TreeAction>,
}

/// An action at a history.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TreeAction {
    /// Its debug format.
    pub action: String,
    /// N(ha), initial visits included.
    pub visits: u64,
    /// Mean discounted return V(ha).
    pub value: f64,
    /// Branches with enough visits, ordered by class of observation (by age in a widened tree).
    pub branches: Vec<TreeBranch>,
}

/// What followed an observation.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TreeBranch {
    /// Debug format of its class; a number in a widened tree.
    pub observation: String,
    /// The history after it.
    pub node: TreeNode,
}

pub(crate) fn node(tree: &impl Export, at: NodeId, actions: &[String], limit: ExportLimit) -> TreeNode {
    let nodes = tree.arena();
    let named = actions.iter().enumerate().map(|(index, name)| (index, name, nodes.slot(at, index).stats()));
    let shown = named.filter(|(_, _, stats)| stats.visits > 0 && stats.visits >= limit.visits);
    let actions = shown.map(|(index, name, stats)| TreeAction {
        action: name.clone(),
        visits: stats.visits,
        value: stats.value,
        branches: branches(tree, at, index, actions, limit),
    });
    TreeNode { visits: nodes.visits(at), actions: actions.collect() }
}

fn branches(tree: &impl Export, at: NodeId, action: usize, names: &[String], limit: ExportLimit) -> Vec<TreeBranch> {
    if limit.depth <= 1 {
        return Vec::new();
    }
    let below = ExportLimit { depth: limit.depth - 1, ..limit };
    let all = tree.branches(at, action).into_iter();
    let shown = all.filter(|(_, child)| tree.arena().visits(*child) >= limit.visits);
    shown.map(|(observation, child)| TreeBranch { observation, node: node(tree, child, names, below) }).collect()
}

impl TreeNode {
    /// The tree in the DOT language of Graphviz: histories as points, actions as boxes with visits and value.
    ///
    /// # Example
    ///
    /// `dot -Tsvg tree.dot -o tree.svg` draws what this writes.
    ///
    /// ```
    /// let root = planner::TreeNode { visits: 0, actions: Vec::new() };
    /// assert_eq!(root.to_dot(), "digraph tree {\n  rankdir=LR\n  n0 [shape=point]\n}\n");
    /// ```
    #[must_use]
    pub fn to_dot(&self) -> String {
        let mut text = String::from("digraph tree {\n  rankdir=LR\n  n0 [shape=point]\n");
        self.write_dot(0, &mut 1, &mut text);
        text + "}\n"
    }

    fn write_dot(&self, own: usize, next: &mut usize, text: &mut String) {
        let mut number = || {
            *next += 1;
            *next - 1
        };
        let mut below = Vec::new();
        for action in &self.actions {
            let box_number = number();
            let (name, visits, value) = (escaped(&action.action), action.visits, action.value);
            let _ = writeln!(text, "  n{box_number} [shape=box, label=\"{name}\\n{value:.3} ({visits})\"]");
            let _ = writeln!(text, "  n{own} -> n{box_number}");
            for branch in &action.branches {
                let point = number();
                let label = escaped(&branch.observation);
                let _ = writeln!(text, "  n{point} [shape=point]");
                let _ = writeln!(text, "  n{box_number} -> n{point} [label=\"{label}\"]");
                below.push((point, &branch.node));
            }
        }
        for (point, node) in below {
            node.write_dot(point, next, text);
        }
    }
}

fn escaped(label: &str) -> String {
    label.replace('\\', "\\\\").replace('"', "\\\"")
}
