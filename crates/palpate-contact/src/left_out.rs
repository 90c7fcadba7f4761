//! What is not tested: ignored pairs of bodies, and surface elements of a common group.

use palpate_model::Mesh;

use crate::scene::SceneBody;

/// Pairs of bodies that are not tested against each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct IgnoredPairs {
    /// Each with a <= b, sorted.
    pairs: Vec<[u32; 2]>,
}

impl IgnoredPairs {
    #[inline]
    pub(crate) fn holds(&self, a: u32, b: u32) -> bool {
        !self.pairs.is_empty() && self.find(a, b).is_ok()
    }

    pub(crate) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    pub(crate) fn set(&mut self, a: u32, b: u32, ignored: bool) {
        match (self.find(a, b), ignored) {
            (Err(index), true) => self.pairs.insert(index, [a.min(b), a.max(b)]),
            (Ok(index), false) => drop(self.pairs.remove(index)),
            _ => {}
        }
    }

    /// Forgets a body.
    pub(crate) fn forget(&mut self, body: u32) {
        self.pairs.retain(|pair| !pair.contains(&body));
    }

    /// Forgets a body; those after it move down by one index.
    pub(crate) fn remove_body(&mut self, removed: u32) {
        self.forget(removed);
        for body in self.pairs.as_flattened_mut() {
            *body -= u32::from(*body > removed);
        }
    }

    fn find(&self, a: u32, b: u32) -> Result<usize, usize> {
        self.pairs.binary_search(&[a.min(b), a.max(b)])
    }
}

/// Groups of a body's surface triangles, 0 being none, and with them of the nodes and edges that they
/// lie around.
#[derive(Clone, Debug)]
pub(crate) struct Groups {
    triangles: Vec<u32>,
    nodes: Rows,
    edges: Rows,
}

impl Groups {
    /// `None` where no triangle has a group.
    pub(crate) fn new(mesh: &Mesh, of_triangles: &[u32]) -> Option<Self> {
        let around = |corners: &[[u32; 3]], count: usize| {
            let in_group = corners.iter().zip(of_triangles).filter(|(_, group)| **group != 0);
            let pairs = in_group.flat_map(|(corners, &group)| corners.map(|index| (index, group)));
            Rows::new(pairs.collect(), count)
        };
        of_triangles.iter().any(|&group| group != 0).then(|| Self {
            triangles: of_triangles.to_vec(),
            nodes: around(mesh.triangles(), mesh.nodes().len()),
            edges: around(mesh.triangle_edges(), mesh.surface_edges().len()),
        })
    }

    /// The group of each triangle.
    pub(crate) fn of_triangles(&self) -> &[u32] {
        &self.triangles
    }

    fn of_triangle(&self, triangle: u32) -> &[u32] {
        let group = &self.triangles[triangle as usize];
        if *group == 0 { &[] } else { std::slice::from_ref(group) }
    }
}

/// The groups of each element of some kind.
#[derive(Clone, Debug)]
struct Rows {
    starts: Vec<u32>,
    groups: Vec<u32>,
}

impl Rows {
    fn new(mut pairs: Vec<(u32, u32)>, count: usize) -> Self {
        pairs.sort_unstable();
        pairs.dedup();
        let start = |element: u32| pairs.partition_point(|pair| pair.0 < element) as u32;
        let starts = (0..=count as u32).map(start).collect();
        Self { starts, groups: pairs.into_iter().map(|pair| pair.1).collect() }
    }

    fn row(&self, element: u32) -> &[u32] {
        let [start, end] = [self.starts[element as usize], self.starts[element as usize + 1]];
        &self.groups[start as usize..end as usize]
    }
}

/// The groups of two bodies, or of one with itself: which of their elements have one in common.
#[derive(Clone, Copy)]
pub(crate) struct CommonGroups<'a>([&'a Groups; 2]);

impl<'a> CommonGroups<'a> {
    /// `None` where one has no groups at all.
    #[inline]
    pub(crate) fn of(a: &'a SceneBody, b: &'a SceneBody) -> Option<Self> {
        Some(Self([a.groups.as_ref()?, b.groups.as_ref()?]))
    }

    /// A triangle of a and one of b.
    pub(crate) fn of_triangles(self, [triangle_a, triangle_b]: [u32; 2]) -> bool {
        let [a, b] = self.0;
        meet(a.of_triangle(triangle_a), b.of_triangle(triangle_b))
    }

    /// A node of a and a triangle of b.
    pub(crate) fn of_node_and_triangle(self, [node, triangle]: [u32; 2]) -> bool {
        let [a, b] = self.0;
        meet(a.nodes.row(node), b.of_triangle(triangle))
    }

    /// An edge of a and one of b.
    pub(crate) fn of_edges(self, [edge_a, edge_b]: [u32; 2]) -> bool {
        let [a, b] = self.0;
        meet(a.edges.row(edge_a), b.edges.row(edge_b))
    }
}

/// Whether two short lists have an entry in common.
fn meet(a: &[u32], b: &[u32]) -> bool {
    a.iter().any(|group| b.contains(group))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ignored_pairs_have_no_order_and_follow_the_bodies() {
        let mut ignored = IgnoredPairs::default();
        for (a, b) in [(3, 1), (2, 2), (0, 4), (1, 3)] {
            ignored.set(a, b, true);
        }
        assert_eq!(ignored.pairs(), [[0, 4], [1, 3], [2, 2]]);
        assert!(ignored.holds(3, 1) && ignored.holds(1, 3) && !ignored.holds(1, 1));
        ignored.remove_body(1);
        assert_eq!(ignored.pairs(), [[0, 3], [1, 1]]);
        ignored.set(3, 0, false);
        ignored.set(0, 1, false);
        assert_eq!(ignored.pairs(), [[1, 1]]);
    }
}
