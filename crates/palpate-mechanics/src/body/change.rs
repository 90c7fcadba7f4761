//! A body after a change of topology, in the same motion.

use palpate_geometry::Point;
use palpate_model::{Body, MeshChange, NodeOrigin};

use super::{BodyKind, ElasticBody, Known, MatrixBefore, MovingBody};
use crate::error::MechanicsError;

/// What the matrix of a body after a change of its mesh is made from: what no step changes, so that steps
/// can be taken meanwhile.
#[derive(Clone)]
pub struct BodyBasis {
    /// The free nodes in their order of elimination.
    order: Vec<u32>,
    /// Arms [m] of the shape that A is made of, in its frame; empty: that at rest.
    shape: Vec<Point>,
    /// The nodes that contacts move, ascending.
    touched: Vec<u32>,
    matrix: Option<MatrixBefore>,
}

impl BodyBasis {
    /// The same with another shape, as [`crate::Dynamics::next_stiff_shape`] gives it.
    #[must_use]
    pub fn with_shape(mut self, shape: Vec<Point>) -> Self {
        if let Some(matrix) = self.matrix.as_mut().filter(|_| shape != self.shape) {
            matrix.stiffness = None;
        }
        Self { shape, ..self }
    }
}

impl MovingBody {
    /// What the body after a change is made from, `touched` being the nodes that contacts move.
    pub(crate) fn basis(&self, touched: &[u32]) -> BodyBasis {
        let nodes = |elastic: &ElasticBody| elastic.order_of_nodes().collect();
        BodyBasis {
            order: self.elastic().map_or_else(Vec::new, nodes),
            shape: self.stiff_shape().to_vec(),
            touched: touched.to_vec(),
            matrix: self.elastic().map(ElasticBody::matrix),
        }
    }

    /// The body with the mesh that `change` has made of its own, `body` being its description now, at
    /// rest where the mesh is.
    ///
    /// A is made of the stiffness in the shape that it was made of, in the order of elimination that it
    /// had, new nodes next to those that they come from, so that it stays as it was where the mesh has
    /// not changed.
    pub(crate) fn after(
        index: usize,
        body: &Body,
        change: &MeshChange,
        gravity: Point,
        time_step: f64,
        basis: &BodyBasis,
    ) -> Result<Self, MechanicsError> {
        let order = order_after(&basis.order, body, change);
        let shape = match &*basis.shape {
            [] => Vec::new(),
            shape => change.positions(shape),
        };
        let before = basis.matrix.as_ref();
        let origins = before.map_or_else(Vec::new, |old| origins(old, body, change));
        let before = before.map(|old| (old, &*origins));
        let known = Known { order: &order, shape: &shape, before };
        Self::new(index, body, gravity, time_step, known)
    }

    /// Solves for the compliance of what contacts are likely to move; returns these nodes, ascending.
    pub(crate) fn prepare_as_before(&mut self, basis: &BodyBasis, change: &MeshChange) -> Vec<u32> {
        let nodes = self.likely_nodes(&basis.touched, change);
        self.prepare_compliance(&nodes, 0);
        nodes
    }

    /// What contacts are likely to move, ascending: what they moved before `change`, `touched`, and the lips
    /// that it opened.
    pub(crate) fn likely_nodes(&self, touched: &[u32], change: &MeshChange) -> Vec<u32> {
        let Some(elastic) = self.elastic() else { return Vec::new() };
        let kept = |node: u32| change.nodes[node as usize].kept_node();
        let count = (0..change.nodes.len() as u32).filter_map(kept).max();
        let mut copies = vec![0_u32; count.map_or(0, |node| node as usize + 1)];
        for old in (0..change.nodes.len() as u32).filter_map(kept) {
            copies[old as usize] += 1;
        }
        let is_likely = |old: u32| copies[old as usize] > 1 || touched.binary_search(&old).is_ok();
        let surface = change.mesh.surface_nodes().iter().copied();
        let free = surface.filter(|&node| elastic.is_free(node as usize));
        free.filter(|&node| kept(node).is_none_or(is_likely)).collect()
    }

    /// Takes over the motion of the body `before` the change that made it.
    ///
    /// Positions and velocities are those of the material points, so that linear momentum is kept: a
    /// tetrahedron's parts have the momentum of the whole. (Spin changes by what the lumped masses move, of
    /// second order in the size of the tetrahedra that are split.) Copies of a node share its external
    /// force by their masses.
    pub(crate) fn move_as(&mut self, before: &Self, change: &MeshChange) {
        self.positions = change.positions(&before.positions);
        self.velocities = change.positions(&before.velocities);
        if let BodyKind::Elastic(elastic) = &self.kind {
            for (node, velocity) in self.velocities.iter_mut().enumerate() {
                if !elastic.is_free(node) {
                    *velocity = [0.0; 3];
                }
            }
            self.forces = shared(&before.forces, change, elastic.masses());
        }
    }

    /// Goes on in the memory of the body before a change, for what every change makes anew.
    pub(crate) fn take_memory(&mut self, before: Self) {
        if let (BodyKind::Elastic(now), BodyKind::Elastic(before)) = (&mut self.kind, before.kind) {
            now.take_memory(*before);
        }
        self.compliance.take_memory(before.compliance);
    }
}

/// For each free node after a change, in the order of the nodes: which of the free nodes before it is.
fn origins(old: &MatrixBefore, body: &Body, change: &MeshChange) -> Vec<Option<u32>> {
    let origin = |node: u32| {
        let kept = change.nodes[node as usize].kept_node()?;
        old.free_place(kept)
    };
    free_nodes(body, change).map(origin).collect()
}

fn free_nodes(body: &Body, change: &MeshChange) -> impl Iterator<Item = u32> {
    let fixed = |node: &u32| body.fixed_nodes.binary_search(node).is_ok();
    (0..change.nodes.len() as u32).filter(move |node| !fixed(node))
}

/// The free nodes after a change, by their places, in the `order` of the nodes before.
fn order_after(order: &[u32], body: &Body, change: &MeshChange) -> Vec<u32> {
    let count = order.iter().max().map_or(0, |&node| node as usize + 1);
    let mut ranks = vec![u32::MAX; count];
    for (rank, &node) in (0..).zip(order) {
        ranks[node as usize] = rank;
    }
    // The first of its origins: what the new node is joined with, that one was joined with.
    let rank = |origin: &NodeOrigin| {
        let ranks = origin.parts().filter_map(|(node, _)| ranks.get(node as usize));
        ranks.min().copied().unwrap_or(u32::MAX)
    };
    let mut order: Vec<(u32, u32)> = (0..)
        .zip(free_nodes(body, change))
        .map(|(place, node)| (rank(&change.nodes[node as usize]), place))
        .collect();
    order.sort_unstable();
    order.into_iter().map(|(_, place)| place).collect()
}

/// Forces on the nodes before, on their copies in the ratio of the masses; none on nodes in between.
fn shared(forces: &[Point], change: &MeshChange, masses: &[f64]) -> Vec<Point> {
    let mut mass_of = vec![0.0; forces.len()];
    let kept = || change.nodes.iter().zip(masses).map(|(origin, &m)| (origin.kept_node(), m));
    for (node, mass) in kept() {
        if let Some(node) = node {
            mass_of[node as usize] += mass;
        }
    }
    kept()
        .map(|(node, mass)| {
            let share =
                |node: u32| forces[node as usize].map(|f| f * (mass / mass_of[node as usize]));
            node.map_or([0.0; 3], share)
        })
        .collect()
}
