//! A mesh that came from another one by cutting or removal, and what in it was what before.

mod composition;
mod origin;

use std::sync::Arc;

use palpate_geometry::Point;

use super::{Mesh, MeshData, MeshError};

pub use origin::NodeOrigin;

/// A mesh after a change of topology, and what in it was what before.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshChange {
    /// The mesh after the change.
    pub mesh: Arc<Mesh>,
    /// Where each of its nodes comes from.
    pub nodes: Vec<NodeOrigin>,
    /// The tetrahedron of the mesh before that each of its tetrahedra is, or is a part of.
    pub tetrahedra: Vec<u32>,
}

impl MeshChange {
    /// The change of `old` to the tetrahedra `corners` on nodes at the rest positions `positions` [m]
    /// that come from `nodes`; `tetrahedra` names the old tetrahedron of each. Regions and fibres
    /// follow the tetrahedra, node sets as [`MeshChange::node_set`] says.
    ///
    /// # Errors
    /// If the arrays do not make a mesh, as [`Mesh::new`].
    ///
    /// # Panics
    /// If there is not one origin for each position and one old tetrahedron for each new one, or an
    /// origin or an old tetrahedron is out of range.
    pub fn new(
        old: &Mesh,
        positions: Vec<Point>,
        corners: Vec<[u32; 4]>,
        nodes: Vec<NodeOrigin>,
        tetrahedra: Vec<u32>,
    ) -> Result<Self, MeshError> {
        assert_eq!(positions.len(), nodes.len(), "one origin for each node");
        assert_eq!(corners.len(), tetrahedra.len(), "one old tetrahedron for each new one");
        let sets = old.node_sets().iter();
        let regions = old.regions();
        let follow = |values: &Vec<Point>| of_parents(values, &tetrahedra);
        let data = MeshData {
            node_sets: sets.map(|(name, set)| (name.clone(), node_set(&nodes, set))).collect(),
            regions: of_parents(regions, &tetrahedra),
            fibres: old.fibres().each_ref().map(follow),
            nodes: positions,
            tetrahedra: corners,
            triangles: Vec::new(),
        };
        let mesh = match changed_tetrahedra(old, &data, &tetrahedra) {
            Some(is_changed) => old.after_change(data, &is_changed)?,
            None => Mesh::new(data)?,
        };
        Ok(Self { mesh: Arc::new(mesh), nodes, tetrahedra })
    }

    /// The change of `mesh` that changes nothing.
    pub fn identity(mesh: &Arc<Mesh>) -> Self {
        Self {
            mesh: Arc::clone(mesh),
            nodes: (0..mesh.nodes().len() as u32).map(NodeOrigin::kept).collect(),
            tetrahedra: (0..mesh.tetrahedra().len() as u32).collect(),
        }
    }

    /// Values at the nodes of the mesh before (positions, velocities), shape (n, 3), at the nodes now.
    ///
    /// # Panics
    /// If there are fewer values than nodes before.
    pub fn positions(&self, old: &[Point]) -> Vec<Point> {
        self.nodes.iter().map(|origin| origin.value(old)).collect()
    }

    /// A set of nodes of the mesh before as nodes now, sorted: those made of nothing but nodes of the
    /// set, so that copies belong to it as well.
    pub fn node_set(&self, old: &[u32]) -> Vec<u32> {
        node_set(&self.nodes, old)
    }
}

/// Of each tetrahedron whether it, or one that it shares or shared a face with, is not what it was;
/// `None` where old nodes have moved or old tetrahedra have other numbers.
fn changed_tetrahedra(old: &Mesh, data: &MeshData, parents: &[u32]) -> Option<Vec<bool>> {
    let old_tetrahedra = old.tetrahedra();
    let keeps_nodes = data.nodes.get(..old.nodes().len()) == Some(old.nodes());
    let keeps_tetrahedra = !old_tetrahedra.is_empty()
        && parents.len() >= old_tetrahedra.len()
        && (0..).zip(&parents[..old_tetrahedra.len()]).all(|(index, &parent)| index == parent);
    if !keeps_nodes || !keeps_tetrahedra {
        return None;
    }
    let mut is_near = vec![false; data.nodes.len()];
    for (index, corners) in data.tetrahedra.iter().enumerate() {
        let before = old_tetrahedra.get(index);
        if before != Some(corners) {
            for &node in corners.iter().chain(before.into_iter().flatten()) {
                // What is out of range is refused later.
                if let Some(is_near) = is_near.get_mut(node as usize) {
                    *is_near = true;
                }
            }
        }
    }
    let is_near = |node: &&u32| is_near.get(**node as usize).is_none_or(|&is_near| is_near);
    let is_changed = |corners: &[u32; 4]| corners.iter().filter(is_near).count() >= 3;
    Some(data.tetrahedra.iter().map(is_changed).collect())
}

fn of_parents<T: Copy>(values: &[T], parents: &[u32]) -> Vec<T> {
    if values.is_empty() {
        return Vec::new();
    }
    parents.iter().map(|&parent| values[parent as usize]).collect()
}

fn node_set(nodes: &[NodeOrigin], old: &[u32]) -> Vec<u32> {
    let inside =
        |origin: &NodeOrigin| origin.parts().all(|(node, _)| old.binary_search(&node).is_ok());
    let members = nodes.iter().enumerate().filter(|(_, origin)| inside(origin));
    members.map(|(node, _)| node as u32).collect()
}

#[cfg(test)]
mod tests {
    use palpate_geometry::tetrahedron::orientation;
    use proptest::prelude::*;

    use super::super::row::row;
    use super::*;

    proptest! {
        #[test]
        fn what_has_changed_is_enough_to_look_at(
            count in 1_u32..8,
            replaced in proptest::collection::vec((0_usize..12, proptest::array::uniform4(0_u32..13)), 0..6),
        ) {
            let old = row(count);
            let mut corners = old.tetrahedra().to_vec();
            let mut parents: Vec<u32> = (0..count).collect();
            let mut positions = old.nodes().to_vec();
            positions.extend([[5.0, 4.0, 3.0], [-3.0, 5.0, 4.0]]);
            for (place, nodes) in replaced {
                // Most are in range and turned right.
                let mut nodes = nodes.map(|node| node % (positions.len() as u32 + u32::from(node == 12)));
                let at = |node: u32| positions.get(node as usize).copied().unwrap_or_default();
                if orientation(&nodes.map(at)) < 0 {
                    nodes.swap(2, 3);
                }
                let place = place.min(corners.len());
                if place == corners.len() {
                    corners.push(nodes);
                    parents.push(0);
                } else {
                    corners[place] = nodes;
                }
            }
            let nodes = vec![NodeOrigin::kept(0); positions.len()];
            let found =
                MeshChange::new(&old, positions.clone(), corners.clone(), nodes, parents);
            let data = MeshData { nodes: positions, tetrahedra: corners, ..MeshData::default() };
            let expected = Mesh::new(data);
            match (found, expected) {
                (Ok(found), Ok(expected)) => {
                    prop_assert_eq!(found.mesh.triangles(), expected.triangles());
                    prop_assert_eq!(found.mesh.triangle_owners(), expected.triangle_owners());
                    prop_assert_eq!(found.mesh.surface_edges(), expected.surface_edges());
                    prop_assert_eq!(found.mesh.surface_nodes(), expected.surface_nodes());
                }
                (found, expected) => {
                    prop_assert_eq!(found.err(), expected.err());
                }
            }
        }
    }
}
