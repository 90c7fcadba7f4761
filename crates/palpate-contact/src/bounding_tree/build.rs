//! Top-down construction: split the longest axis until a leaf holds at most K elements.

use palpate_geometry::{Aabb, Point};
use palpate_model::Mesh;

use super::{BoundingTree, Split, TreeNode};

/// A mesh seen as elements: its tetrahedra, or its triangles when it has no others.
pub(super) struct Elements<'a> {
    mesh: &'a Mesh,
}

impl<'a> Elements<'a> {
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        Self { mesh }
    }

    pub(super) fn mesh(&self) -> &'a Mesh {
        self.mesh
    }

    pub(super) fn len(&self) -> usize {
        if self.mesh.tetrahedra().is_empty() {
            self.mesh.triangles().len()
        } else {
            self.mesh.tetrahedra().len()
        }
    }

    /// The element that a surface triangle belongs to.
    pub(super) fn owner(&self, triangle: usize) -> u32 {
        if self.mesh.tetrahedra().is_empty() {
            triangle as u32
        } else {
            self.mesh.triangle_owners()[triangle]
        }
    }

    fn nodes(&self, element: usize) -> &[u32] {
        if self.mesh.tetrahedra().is_empty() {
            &self.mesh.triangles()[element]
        } else {
            &self.mesh.tetrahedra()[element]
        }
    }

    fn bounds(&self, element: usize) -> Aabb {
        Aabb::from_points(self.nodes(element).iter().map(|&node| &self.mesh.nodes()[node as usize]))
    }

    fn centroid(&self, element: usize) -> Point {
        let nodes = self.nodes(element);
        let share = 1.0 / nodes.len() as f64;
        let mut sum = [0.0; 3];
        for &node in nodes {
            for (total, value) in sum.iter_mut().zip(self.mesh.nodes()[node as usize]) {
                *total += share * value;
            }
        }
        sum
    }
}

/// The tree's shape over `mesh`, its boxes still empty.
pub(super) fn build(mesh: &Mesh, leaf_size: usize, split: Split) -> BoundingTree {
    let elements = Elements::new(mesh);
    let mut element_order: Vec<u32> = (0..elements.len() as u32).collect();
    let nodes = split_all(&elements, &mut element_order, leaf_size, split);

    let mut tree = BoundingTree {
        nodes,
        leaves: Vec::new(),
        element_order,
        triangle_order: Vec::new(),
        corners: Vec::new(),
        triangle_bounds: Vec::new(),
        leaf_size,
        changed: false,
    };
    tree.place_triangles(&elements);
    tree.leaves =
        (0..tree.nodes.len() as u32).filter(|&node| tree.is_leaf(node as usize)).collect();
    tree
}

/// Nodes in preorder, their elements ranges of `order`, which is permuted to leaf order.
fn split_all(
    elements: &Elements,
    order: &mut [u32],
    leaf_size: usize,
    split: Split,
) -> Vec<TreeNode> {
    let centroids: Vec<Point> = (0..elements.len()).map(|e| elements.centroid(e)).collect();
    let mut nodes: Vec<TreeNode> = Vec::new();
    // A stack of our own: clustered elements can make the tree deeper than a thread's stack allows.
    let mut pending = vec![(0, order.len())];
    while let Some((start, end)) = pending.pop() {
        let index = nodes.len() as u32;
        let node = TreeNode {
            bounds: Aabb::EMPTY,
            skip: index + 1,
            first_element: start as u32,
            triangles: [0; 2],
        };
        nodes.push(node);
        if end - start > leaf_size {
            let middle = start + split_range(elements, &centroids, &mut order[start..end], split);
            // Marks an inner node until the size of its subtree is known.
            nodes[index as usize].skip = 0;
            pending.push((middle, end));
            pending.push((start, middle));
        }
    }
    for index in (0..nodes.len()).rev() {
        if nodes[index].skip == 0 {
            let right = nodes[index + 1].skip as usize;
            nodes[index].skip = nodes[right].skip;
        }
    }
    nodes
}

/// Permutes `range` into two parts, neither empty, and returns the length of the first.
fn split_range(elements: &Elements, centroids: &[Point], range: &mut [u32], split: Split) -> usize {
    let bounds = range
        .iter()
        .fold(Aabb::EMPTY, |bounds, &element| bounds.union(&elements.bounds(element as usize)));
    let axis = bounds.longest_axis();
    if split == Split::Middle {
        let middle = bounds.center()[axis];
        let count = partition(range, |element| centroids[element as usize][axis] < middle);
        if 0 < count && count < range.len() {
            return count;
        }
    }
    let half = range.len() / 2;
    // Ties by index: the same tree on every machine, and progress on identical centroids.
    range.select_nth_unstable_by(half, |&left, &right| {
        let order = centroids[left as usize][axis].total_cmp(&centroids[right as usize][axis]);
        order.then(left.cmp(&right))
    });
    half
}

/// Moves the elements that satisfy `first` to the front and returns their number.
fn partition(range: &mut [u32], first: impl Fn(u32) -> bool) -> usize {
    let mut count = 0;
    for index in 0..range.len() {
        if first(range[index]) {
            range.swap(count, index);
            count += 1;
        }
    }
    count
}
