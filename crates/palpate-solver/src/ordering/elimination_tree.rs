//! The elimination tree of a permuted graph, its column counts and its postorder.

use super::{Graph, NONE};

pub(super) struct EliminationTree {
    pub(super) parent: Vec<u32>,
    column_counts: Vec<u32>,
}

impl EliminationTree {
    /// Tree and column counts (diagonal included) for eliminating `order[0]`, `order[1]`, ...
    ///
    /// Each row of the factor is the union of tree paths from its entries (Liu 1990), so walking
    /// them costs as much time as the factor has blocks.
    pub(super) fn new(graph: &Graph, order: &[u32]) -> Self {
        let count = graph.node_count();
        let mut place = vec![0_u32; count];
        for (new, &old) in order.iter().enumerate() {
            place[old as usize] = new as u32;
        }
        let mut parent = vec![NONE; count];
        let mut column_counts = vec![1_u32; count];
        let mut visited = vec![NONE; count];
        for row in 0..count as u32 {
            visited[row as usize] = row;
            for &neighbour in graph.neighbours(order[row as usize]) {
                let mut col = place[neighbour as usize];
                if col > row {
                    continue;
                }
                while visited[col as usize] != row {
                    visited[col as usize] = row;
                    column_counts[col as usize] += 1;
                    if parent[col as usize] == NONE {
                        parent[col as usize] = row;
                    }
                    col = parent[col as usize];
                }
            }
        }
        Self { parent, column_counts }
    }

    pub(super) fn column_counts(&self) -> &[u32] {
        &self.column_counts
    }

    /// Places in postorder, of each node's children the one with the longest column last: only that
    /// child can be merged with its parent into one supernode.
    pub(super) fn postorder(&self) -> Vec<u32> {
        let count = self.parent.len();
        let mut by_weight: Vec<u32> = (0..count as u32).collect();
        by_weight.sort_by_key(|&node| (self.column_counts[node as usize], node));
        // Pushed on a stack, the child that comes out first must come last into the list.
        let mut first_child = vec![NONE; count];
        let mut next_sibling = vec![NONE; count];
        let mut roots = Vec::new();
        for &node in &by_weight {
            match self.parent[node as usize] {
                NONE => roots.push(node),
                parent => {
                    next_sibling[node as usize] = first_child[parent as usize];
                    first_child[parent as usize] = node;
                }
            }
        }
        // A reversed preorder that visits the heaviest child first is the wanted postorder.
        let mut reversed = Vec::with_capacity(count);
        let mut stack = roots;
        while let Some(node) = stack.pop() {
            reversed.push(node);
            let begin = stack.len();
            let mut child = first_child[node as usize];
            while child != NONE {
                stack.push(child);
                child = next_sibling[child as usize];
            }
            stack[begin..].reverse();
        }
        reversed.reverse();
        reversed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BlockPattern;

    #[test]
    fn a_star_eliminated_from_its_leaves_has_no_fill() {
        let pattern = BlockPattern::from_cliques(5, &[[0, 4], [1, 4], [2, 4], [3, 4]]);
        let tree = EliminationTree::new(&Graph::new(&pattern), &[0, 1, 2, 3, 4]);
        assert_eq!(tree.column_counts(), [2, 2, 2, 2, 1]);
        assert_eq!(tree.postorder(), [0, 1, 2, 3, 4]);
        let tree = EliminationTree::new(&Graph::new(&pattern), &[4, 0, 1, 2, 3]);
        assert_eq!(tree.column_counts(), [5, 4, 3, 2, 1]);
    }

    #[test]
    fn the_heaviest_child_stands_next_to_its_parent() {
        // 0 - 4 and the path 1 - 2 - 4, 3 - 2: node 2 has the longer column of the children of 4.
        let pattern = BlockPattern::from_cliques(6, &[[0, 4], [1, 2], [2, 4], [2, 5], [4, 5]]);
        let tree = EliminationTree::new(&Graph::new(&pattern), &[0, 1, 2, 3, 4, 5]);
        let order = tree.postorder();
        let at = |node: u32| order.iter().position(|&other| other == node).unwrap();
        assert_eq!(at(4), at(2) + 1);
        for (child, &parent) in tree.parent.iter().enumerate() {
            assert!(parent == NONE || at(child as u32) < at(parent));
        }
    }
}
