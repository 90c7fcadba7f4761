//! A body after a change of topology, in the same motion.

use palpate_geometry::Point;
use palpate_model::{Body, MeshChange, NodeOrigin};

use super::{BodyKind, ElasticBody, Known, MovingBody};
use crate::error::MechanicsError;

impl MovingBody {
    /// The body with the mesh that `change` has made of its own, `body` being its description now.
    ///
    /// Positions and velocities are those of the material points, so that linear momentum is kept: a
    /// tetrahedron's parts have the momentum of the whole. (Spin changes by what the lumped masses move, of
    /// second order in the size of the tetrahedra that are split.) Copies of a node share its external
    /// force by their masses. A is made of the stiffness in the shape that it was made of, in the order of
    /// elimination that it had, new nodes next to those that they come from, so that it stays as it was
    /// where the mesh has not changed.
    pub(crate) fn changed(
        &self,
        body: &Body,
        change: &MeshChange,
        gravity: Point,
        time_step: f64,
    ) -> Result<Self, MechanicsError> {
        let positions = change.positions(&self.positions);
        let order = self.elastic().map_or_else(Vec::new, |old| order_after(old, body, change));
        let shape = match self.stiff_shape() {
            [] => Vec::new(),
            shape => change.positions(shape),
        };
        let origins = self.elastic().map_or_else(Vec::new, |old| origins(old, body, change));
        let before = self.elastic().map(|old| (old, &*origins));
        let known = Known { order: &order, shape: &shape, before };
        let mut result = Self::new(self.index, body, gravity, time_step, known)?;
        result.positions = positions;
        result.velocities = change.positions(&self.velocities);
        if let BodyKind::Elastic(elastic) = &result.kind {
            for (node, velocity) in result.velocities.iter_mut().enumerate() {
                if !elastic.is_free(node) {
                    *velocity = [0.0; 3];
                }
            }
            result.forces = shared(&self.forces, change, elastic.masses());
        }
        Ok(result)
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
fn origins(old: &ElasticBody, body: &Body, change: &MeshChange) -> Vec<Option<u32>> {
    let origin = |node: u32| {
        let kept = change.nodes[node as usize].kept_node()?;
        old.free_place(kept).map(|place| place as u32)
    };
    free_nodes(body, change).map(origin).collect()
}

fn free_nodes(body: &Body, change: &MeshChange) -> impl Iterator<Item = u32> {
    let fixed = |node: &u32| body.fixed_nodes.binary_search(node).is_ok();
    (0..change.nodes.len() as u32).filter(move |node| !fixed(node))
}

/// The free nodes after a change in the order of those before.
fn order_after(old: &ElasticBody, body: &Body, change: &MeshChange) -> Vec<u32> {
    let mut ranks = vec![u32::MAX; old.order().len()];
    for (rank, &place) in old.order().iter().enumerate() {
        ranks[place as usize] = rank as u32;
    }
    // The first of its origins: what the new node is joined with, that one was joined with.
    let rank = |origin: &NodeOrigin| {
        let free = origin.parts().filter_map(|(node, _)| old.free_place(node));
        free.map(|place| ranks[place]).min().unwrap_or(u32::MAX)
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
