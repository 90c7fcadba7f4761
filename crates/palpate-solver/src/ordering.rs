//! Fill-reducing order of a node graph.

mod amd;
mod elimination_tree;
mod metis;

use crate::BlockPattern;
use elimination_tree::EliminationTree;

/// Which method gave the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrderingMethod {
    /// Approximate minimum degree, best on tubes and shells.
    MinimumDegree,
    /// Nested dissection (METIS), best on solid bodies.
    NestedDissection,
    /// The caller's own.
    Given,
}

pub(crate) const NONE: u32 = u32::MAX;

/// An order of elimination for the nodes of a matrix.
#[derive(Clone, Debug)]
pub struct NodeOrder {
    /// The method that won.
    pub method: OrderingMethod,
    /// `nodes[new]` is the node that is eliminated at place `new`.
    pub nodes: Vec<u32>,
    /// Entries of the scalar factor, the diagonal included.
    pub factor_entries: u64,
    /// Multiplications and additions of the factorisation.
    pub flops: f64,
    /// Elimination tree and column counts, by place; [`NONE`] at the root.
    parents: Vec<u32>,
    column_counts: Vec<u32>,
}

/// Adjacency lists without the node itself, each ascending.
struct Graph {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Graph {
    fn new(pattern: &BlockPattern) -> Self {
        let count = pattern.node_count();
        let mut starts = vec![0_u32; count + 1];
        let pairs = || {
            (0..count as u32).flat_map(|col| {
                pattern.column(col as usize)[1..].iter().map(move |&row| (row, col))
            })
        };
        for (row, col) in pairs() {
            starts[row as usize + 1] += 1;
            starts[col as usize + 1] += 1;
        }
        for node in 0..count {
            starts[node + 1] += starts[node];
        }
        let mut next = starts.clone();
        let mut neighbours = vec![0; starts[count] as usize];
        let mut push = |from: u32, to: u32| {
            neighbours[next[from as usize] as usize] = to;
            next[from as usize] += 1;
        };
        for (row, col) in pairs() {
            push(row, col);
            push(col, row);
        }
        // In the order of the columns, so that every list is ascending.
        Self { starts, neighbours }
    }

    fn node_count(&self) -> usize {
        self.starts.len() - 1
    }

    fn neighbours(&self, node: u32) -> &[u32] {
        let node = node as usize;
        &self.neighbours[self.starts[node] as usize..self.starts[node + 1] as usize]
    }
}

impl NodeOrder {
    /// The better of minimum degree and nested dissection by the work of the factorisation, as a
    /// postorder of its elimination tree (supernodes are runs of consecutive columns).
    pub fn new(pattern: &BlockPattern) -> Self {
        let graph = Graph::new(pattern);
        let mut best = Self::finish(&graph, OrderingMethod::MinimumDegree, &amd::order(pattern));
        if let Some(order) = metis::order(&graph) {
            let other = Self::finish(&graph, OrderingMethod::NestedDissection, &order);
            if other.flops < best.flops {
                best = other;
            }
        }
        best
    }

    /// An order of the caller's as a postorder of its elimination tree; of an order that is one already,
    /// the same.
    ///
    /// # Panics
    /// If `order` does not name every node of the pattern once.
    pub fn given(pattern: &BlockPattern, order: &[u32]) -> Self {
        let mut seen = vec![false; pattern.node_count()];
        let new = |&node: &u32| !std::mem::replace(&mut seen[node as usize], true);
        assert!(
            order.len() == pattern.node_count() && order.iter().all(new),
            "the order must name every node once"
        );
        Self::finish(&Graph::new(pattern), OrderingMethod::Given, order)
    }

    /// The parent of each place in the elimination tree; [`NONE`] at a root.
    pub(crate) fn parents(&self) -> &[u32] {
        &self.parents
    }

    /// Blocks of the factor in the column of each place, the diagonal one included.
    pub(crate) fn column_counts(&self) -> &[u32] {
        &self.column_counts
    }

    fn finish(graph: &Graph, method: OrderingMethod, order: &[u32]) -> Self {
        let tree = EliminationTree::new(graph, order);
        let postorder = tree.postorder();
        let mut new_places = vec![NONE; order.len()];
        for (new, &old) in postorder.iter().enumerate() {
            new_places[old as usize] = new as u32;
        }
        let parent = |&old: &u32| match tree.parent[old as usize] {
            NONE => NONE,
            parent => new_places[parent as usize],
        };
        let parents = postorder.iter().map(parent).collect();
        let column_counts =
            postorder.iter().map(|&old| tree.column_counts()[old as usize]).collect();
        let nodes = postorder.into_iter().map(|place| order[place as usize]).collect();
        let mut factor_entries = 0;
        let mut flops = 0.0;
        for &count in tree.column_counts() {
            // A node's three columns have 3c, 3c - 1 and 3c - 2 entries.
            let rows = 3 * u64::from(count);
            factor_entries += 3 * rows - 3;
            flops += (0..3).map(|k| ((rows - k) * (rows - k)) as f64).sum::<f64>();
        }
        Self { method, nodes, factor_entries, flops, parents, column_counts }
    }
}
