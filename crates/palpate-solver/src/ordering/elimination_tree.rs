//! The elimination tree of a permuted graph, its column counts and its postorder.

use super::{Graph, NONE};

pub(super) struct EliminationTree {
    pub(super) parent: Vec<u32>,
    column_counts: Vec<u32>,
}

impl EliminationTree {
    /// Tree (Liu 1990) and column counts (diagonal included; Gilbert, Ng and Peyton 1994) for eliminating
    /// `order[0]`, `order[1]`, ..., in time that hardly grows with the fill.
    pub(super) fn new(graph: &Graph, order: &[u32]) -> Self {
        let count = graph.node_count();
        let mut place = vec![0_u32; count];
        for (new, &old) in order.iter().enumerate() {
            place[old as usize] = new as u32;
        }
        let places = |row: u32| {
            let neighbours = graph.neighbours(order[row as usize]);
            neighbours.iter().map(|&neighbour| place[neighbour as usize])
        };
        let mut parent = vec![NONE; count];
        // Of each node the highest one known above it, the tree being cut short to it.
        let mut ancestor = vec![NONE; count];
        for row in 0..count as u32 {
            for mut col in places(row).filter(|&col| col < row) {
                while col != row && col != NONE {
                    let next = std::mem::replace(&mut ancestor[col as usize], row);
                    if next == NONE {
                        parent[col as usize] = row;
                    }
                    col = next;
                }
            }
        }
        let column_counts = column_counts(&parent, places);
        Self { parent, column_counts }
    }

    pub(super) fn column_counts(&self) -> &[u32] {
        &self.column_counts
    }

    /// Places in postorder, of each node's children the one with the longest column last: only that
    /// child can be merged with its parent into one supernode.
    pub(super) fn postorder(&self) -> Vec<u32> {
        let counts = self.column_counts.iter().zip(0_u32..);
        let mut by_weight: Vec<(u32, u32)> = counts.map(|(&count, node)| (count, node)).collect();
        by_weight.sort_unstable();
        postorder(&self.parent, by_weight.into_iter().map(|(_, node)| node))
    }
}

/// Postorder of a tree, children in the order in which `nodes` names them.
fn postorder(parent: &[u32], nodes: impl Iterator<Item = u32>) -> Vec<u32> {
    let count = parent.len();
    // Pushed on a stack, the child that comes out first must come last into the list.
    let mut first_child = vec![NONE; count];
    let mut next_sibling = vec![NONE; count];
    let mut roots = Vec::new();
    for node in nodes {
        match parent[node as usize] {
            NONE => roots.push(node),
            parent => {
                next_sibling[node as usize] = first_child[parent as usize];
                first_child[parent as usize] = node;
            }
        }
    }
    // A reversed preorder that visits the last child first is the wanted postorder.
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

/// Entries of each column of the factor. The rows of a column are those whose part of the tree holds it;
/// that part is found from its leaves, each of which adds a path to where it meets the one before.
fn column_counts<I: Iterator<Item = u32>>(
    parent: &[u32],
    neighbours: impl Fn(u32) -> I,
) -> Vec<u32> {
    let count = parent.len();
    let postorder = postorder(parent, 0..count as u32);
    // The first node in postorder below each, by its place there.
    let mut first = vec![NONE; count];
    let mut counts = vec![0_u32; count];
    for (place, &leaf) in postorder.iter().enumerate() {
        counts[leaf as usize] = u32::from(first[leaf as usize] == NONE);
        let mut node = leaf;
        while node != NONE && first[node as usize] == NONE {
            first[node as usize] = place as u32;
            node = parent[node as usize];
        }
    }
    let mut ancestor: Vec<u32> = (0..count as u32).collect();
    // Of each row, the last leaf, and the first node below it.
    let mut last_leaf = vec![NONE; count];
    let mut last_first = vec![NONE; count];
    for &col in &postorder {
        // Wrapping: a column's sum is at least 1 at the end only.
        if let Some(above) = counts.get_mut(parent[col as usize] as usize) {
            *above = above.wrapping_sub(1);
        }
        for row in neighbours(col).filter(|&row| row > col) {
            let (first, seen) = (first[col as usize], &mut last_first[row as usize]);
            if *seen != NONE && first <= *seen {
                continue;
            }
            *seen = first;
            counts[col as usize] = counts[col as usize].wrapping_add(1);
            let last = std::mem::replace(&mut last_leaf[row as usize], col);
            if last != NONE {
                let mut meeting = last;
                while ancestor[meeting as usize] != meeting {
                    meeting = ancestor[meeting as usize];
                }
                let mut node = last;
                while node != meeting {
                    node = std::mem::replace(&mut ancestor[node as usize], meeting);
                }
                counts[meeting as usize] = counts[meeting as usize].wrapping_sub(1);
            }
        }
        if parent[col as usize] != NONE {
            ancestor[col as usize] = parent[col as usize];
        }
    }
    for col in 0..count {
        if parent[col] != NONE {
            let above = parent[col] as usize;
            counts[above] = counts[above].wrapping_add(counts[col]);
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::BlockPattern;

    /// Each row of the factor is the union of the paths up the tree from its entries.
    fn plainly(graph: &Graph, order: &[u32]) -> (Vec<u32>, Vec<u32>) {
        let count = graph.node_count();
        let mut rows = vec![std::collections::BTreeSet::new(); count];
        for row in 0..count {
            for &neighbour in graph.neighbours(order[row]) {
                let col = order.iter().position(|&node| node == neighbour).unwrap();
                rows[col.min(row)].insert(col.max(row));
            }
        }
        let mut parent = vec![NONE; count];
        for col in 0..count {
            let below = rows[col].clone();
            if let Some(&first) = below.first() {
                parent[col] = first as u32;
                rows[first].extend(below.range(first + 1..));
            }
        }
        (parent, rows.iter().map(|rows| 1 + rows.len() as u32).collect())
    }

    proptest! {
        #[test]
        fn tree_and_counts_are_those_of_the_elimination(
            count in 1_usize..40,
            cliques in prop::collection::vec(prop::array::uniform3(0_u32..40), 0..50),
            stride in 1_usize..40,
        ) {
            let cliques: Vec<[u32; 3]> =
                cliques.into_iter().map(|c| c.map(|node| node % count as u32)).collect();
            let graph = Graph::new(&BlockPattern::from_cliques(count, &cliques));
            let mut order: Vec<u32> = (0..count as u32).collect();
            order.rotate_left(stride % count);
            order.sort_by_key(|&node| (node as usize * stride) % 41);
            let tree = EliminationTree::new(&graph, &order);
            let (parent, counts) = plainly(&graph, &order);
            prop_assert_eq!(&tree.parent, &parent);
            prop_assert_eq!(&tree.column_counts, &counts);
        }
    }

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
