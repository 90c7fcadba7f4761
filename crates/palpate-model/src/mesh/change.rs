//! A mesh that came from another one by cutting or removal, and what in it was what before.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use serde::{Deserialize, Serialize};

use super::{Mesh, MeshData, MeshError, NONE};

/// Where a node of a changed mesh was in the mesh before: the affine combination of nodes of one
/// tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct NodeOrigin {
    /// Nodes of the mesh before; one of weight 0 may be repeated.
    pub nodes: [u32; 4],
    /// Their weights, whose sum is 1.
    pub weights: [f64; 4],
}

impl NodeOrigin {
    /// A node that is, or is a copy of, a node of the mesh before.
    pub const fn kept(node: u32) -> Self {
        Self { nodes: [node; 4], weights: [1.0, 0.0, 0.0, 0.0] }
    }

    /// The node of the mesh before that this is, or is a copy of.
    pub fn kept_node(&self) -> Option<u32> {
        let mut parts = self.parts();
        let first = parts.next();
        if parts.next().is_none() { first.map(|(node, _)| node) } else { None }
    }

    /// The nodes of the mesh before that count, with their weights.
    pub fn parts(&self) -> impl Iterator<Item = (u32, f64)> {
        self.nodes.into_iter().zip(self.weights).filter(|(_, weight)| *weight != 0.0)
    }

    /// A value given at the nodes of the mesh before, here.
    ///
    /// # Panics
    /// If there are fewer values than nodes.
    pub fn value(&self, of_nodes: &[Point]) -> Point {
        if let Some(node) = self.kept_node() {
            return of_nodes[node as usize];
        }
        let sum = |sum: DVec3, (node, weight): (u32, f64)| {
            sum + weight * DVec3::from_array(of_nodes[node as usize])
        };
        self.parts().fold(DVec3::ZERO, sum).to_array()
    }
}

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

    /// This change of `old`, and `next` after it, as one. A node that `next` made of nodes which come
    /// from more than one old tetrahedron is expressed by the one that its own tetrahedron is a part
    /// of.
    ///
    /// # Panics
    /// If `next` is no change of this mesh, or this is no change of `old`.
    pub fn then(&self, next: &Self, old: &Mesh) -> Self {
        let tetrahedra = of_parents(&self.tetrahedra, &next.tetrahedra);
        let mut tetrahedron_of = vec![NONE; next.nodes.len()];
        for (corners, &parent) in next.mesh.tetrahedra().iter().zip(&tetrahedra).rev() {
            for &corner in corners {
                tetrahedron_of[corner as usize] = parent;
            }
        }
        let origin = |(node, origin): (usize, &NodeOrigin)| {
            let direct = origin.kept_node().map(|kept| self.nodes[kept as usize]);
            direct.or_else(|| self.sum(origin)).unwrap_or_else(|| {
                let corners = old.tetrahedra()[tetrahedron_of[node] as usize];
                let at = |node: u32| old.nodes()[node as usize];
                NodeOrigin {
                    nodes: corners,
                    weights: weights_in(&corners.map(at), next.mesh.nodes()[node]),
                }
            })
        };
        let nodes = next.nodes.iter().enumerate().map(origin).collect();
        Self { mesh: Arc::clone(&next.mesh), nodes, tetrahedra }
    }

    /// A combination of nodes of this mesh as one of nodes before; `None` when these are more than 4.
    fn sum(&self, origin: &NodeOrigin) -> Option<NodeOrigin> {
        let mut sum: BTreeMap<u32, f64> = BTreeMap::new();
        for (node, weight) in origin.parts() {
            for (old, share) in self.nodes[node as usize].parts() {
                *sum.entry(old).or_default() += weight * share;
            }
        }
        let (&first, _) = sum.first_key_value()?;
        let mut result = NodeOrigin { nodes: [first; 4], weights: [0.0; 4] };
        if sum.len() > 4 {
            return None;
        }
        for (place, (node, weight)) in sum.into_iter().enumerate() {
            result.nodes[place] = node;
            result.weights[place] = weight;
        }
        Some(result)
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

/// Barycentric coordinates of a point.
fn weights_in(corners: &[Point; 4], point: Point) -> [f64; 4] {
    let [a, b, c, d] = corners.map(DVec3::from_array);
    let edges = DMat3::from_cols(b - a, c - a, d - a);
    let [s, t, u] = (edges.inverse() * (DVec3::from_array(point) - a)).to_array();
    [1.0 - s - t - u, s, t, u]
}

impl Mesh {
    /// The mesh without some of its tetrahedra, in any order; nodes that no tetrahedron is left of go as
    /// well. The others keep their order.
    ///
    /// # Errors
    /// If an index is out of range or comes twice, or no tetrahedron would be left.
    pub fn remove(&self, tetrahedra: &[u32]) -> Result<MeshChange, MeshError> {
        let count = self.tetrahedra().len();
        let mut keep = vec![true; count];
        for &tetrahedron in tetrahedra {
            let Some(kept) = keep.get_mut(tetrahedron as usize) else {
                return Err(MeshError::RemovedOutOfRange { tetrahedron, count });
            };
            if !std::mem::replace(kept, false) {
                return Err(MeshError::RemovedTwice { tetrahedron });
            }
        }
        let parents: Vec<u32> =
            (0..count as u32).filter(|&tetrahedron| keep[tetrahedron as usize]).collect();
        if parents.is_empty() {
            return Err(MeshError::NothingRemains { removed: count });
        }
        let mut new_index = vec![NONE; self.nodes().len()];
        for &parent in &parents {
            for node in self.tetrahedra()[parent as usize] {
                new_index[node as usize] = 0;
            }
        }
        let used = (0..new_index.len() as u32).filter(|&node| new_index[node as usize] != NONE);
        let used: Vec<u32> = used.collect();
        for (new, &node) in used.iter().enumerate() {
            new_index[node as usize] = new as u32;
        }
        let corners =
            |&parent: &u32| self.tetrahedra()[parent as usize].map(|node| new_index[node as usize]);
        MeshChange::new(
            self,
            used.iter().map(|&node| self.nodes()[node as usize]).collect(),
            parents.iter().map(corners).collect(),
            used.into_iter().map(NodeOrigin::kept).collect(),
            parents,
        )
    }

    /// The tetrahedra that hang together, each piece sorted, by their first tetrahedra: those of two
    /// pieces have no node in common.
    pub fn pieces(&self) -> Vec<Vec<u32>> {
        let mut label: Vec<u32> = (0..self.nodes().len() as u32).collect();
        let root = |label: &mut Vec<u32>, mut node: u32| {
            while label[node as usize] != node {
                label[node as usize] = label[label[node as usize] as usize];
                node = label[node as usize];
            }
            node
        };
        for corners in self.tetrahedra() {
            let first = root(&mut label, corners[0]);
            for &corner in &corners[1..] {
                let other = root(&mut label, corner);
                label[other as usize] = first;
            }
        }
        let mut piece_of: BTreeMap<u32, usize> = BTreeMap::new();
        let mut pieces: Vec<Vec<u32>> = Vec::new();
        for (tetrahedron, corners) in self.tetrahedra().iter().enumerate() {
            let label = root(&mut label, corners[0]);
            let piece = *piece_of.entry(label).or_insert(pieces.len());
            if piece == pieces.len() {
                pieces.push(Vec::new());
            }
            pieces[piece].push(tetrahedron as u32);
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// `count` tetrahedra in a row along x, each one's last face the next one's first.
    fn row(count: u32) -> Arc<Mesh> {
        let node = |k: u32| {
            let angle = 2.1 * f64::from(k);
            [0.4 * f64::from(k), angle.cos(), angle.sin()]
        };
        let data = MeshData {
            nodes: (0..count + 3).map(node).collect(),
            tetrahedra: (0..count).map(|k| [k, k + 1, k + 2, k + 3]).collect(),
            node_sets: BTreeMap::from([("first".into(), vec![0, 1, 2])]),
            regions: (0..count as i32).collect(),
            fibres: [(0..count).map(|k| [1.0, f64::from(k), 0.0]).collect(), Vec::new()],
            ..MeshData::default()
        };
        Arc::new(Mesh::repaired(data).unwrap().0)
    }

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
                let at = |node: u32| positions.get(node as usize).map_or(DVec3::ZERO, |&p| p.into());
                let [a, b, c, d] = nodes.map(at);
                if (b - a).cross(c - a).dot(d - a) < 0.0 {
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

    #[test]
    fn what_is_left_keeps_its_place_and_its_data() {
        let mesh = row(6);
        let change = mesh.remove(&[3, 0]).unwrap();
        assert_eq!(change.tetrahedra, [1, 2, 4, 5]);
        assert_eq!(change.mesh.regions(), [1, 2, 4, 5]);
        assert_eq!(change.mesh.fibres()[0][2], [1.0, 4.0, 0.0]);
        // Node 0 is gone, and the set has lost it.
        let kept: Vec<_> = change.nodes.iter().map(|node| node.kept_node().unwrap()).collect();
        assert_eq!(kept, [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(change.mesh.node_sets()["first"], [0, 1]);
        assert_eq!(change.positions(mesh.nodes()), change.mesh.nodes());
        assert_eq!(mesh.remove(&[]).unwrap(), MeshChange::identity(&mesh));
    }

    #[test]
    fn what_cannot_be_removed_is_refused_by_name() {
        let mesh = row(3);
        let message = |tetrahedra: &[u32]| mesh.remove(tetrahedra).unwrap_err().to_string();
        assert_eq!(message(&[3]), "tetrahedron 3 cannot be removed: the mesh has 3 tetrahedra");
        assert_eq!(message(&[1, 1]), "tetrahedron 1 is to be removed twice; name each one once");
        assert_eq!(
            message(&[2, 0, 1]),
            "removing all 3 tetrahedra would leave nothing; leave at least one"
        );
    }

    #[test]
    fn pieces_have_no_node_in_common() {
        // Tetrahedra k and k + 3 still share a node, k and k + 4 do not.
        let two = row(9).remove(&[3, 4, 5]).unwrap().mesh;
        assert_eq!(two.pieces(), [vec![0, 1, 2], vec![3, 4, 5]]);
        assert_eq!(row(9).remove(&[3, 4]).unwrap().mesh.pieces(), [vec![0, 1, 2, 3, 4, 5, 6]]);
    }

    /// The last tetrahedron cut through at the middle of its first edge.
    fn halved(mesh: &Mesh) -> MeshChange {
        let [a, b, c, d] = *mesh.tetrahedra().last().unwrap();
        let mut nodes: Vec<_> = (0..mesh.nodes().len() as u32).map(NodeOrigin::kept).collect();
        let middle = nodes.len() as u32;
        nodes.push(NodeOrigin { nodes: [a, b, a, a], weights: [0.5, 0.5, 0.0, 0.0] });
        let mut corners = mesh.tetrahedra().to_vec();
        let mut parents: Vec<u32> = (0..corners.len() as u32).collect();
        *corners.last_mut().unwrap() = [a, middle, c, d];
        corners.push([middle, b, c, d]);
        parents.push(parents.len() as u32 - 1);
        let positions = nodes.iter().map(|origin| origin.value(mesh.nodes())).collect();
        MeshChange::new(mesh, positions, corners, nodes, parents).unwrap()
    }

    #[test]
    fn changes_one_after_the_other_are_one() {
        let mesh = row(4);
        let first = halved(&mesh);
        let second = halved(&first.mesh);
        let both = first.then(&second, &mesh);
        assert_eq!(both.tetrahedra, [0, 1, 2, 3, 3, 3]);
        assert_close(&both.positions(mesh.nodes()), both.mesh.nodes());
        let sum: f64 = both.nodes.last().unwrap().weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-15);
        let third = both.then(&second.mesh.remove(&[0, 3]).unwrap(), &mesh);
        assert_eq!(third.tetrahedra, [1, 2, 3, 3]);
        assert_close(&third.positions(mesh.nodes()), third.mesh.nodes());
    }

    fn assert_close(found: &[Point], expected: &[Point]) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    #[test]
    fn a_node_made_of_five_is_expressed_by_its_tetrahedron() {
        let mesh = row(2);
        let identity = MeshChange::identity(&mesh);
        // The first node moved into the second tetrahedron's direction: as if snapped.
        let mixed = MeshChange {
            nodes: vec![NodeOrigin { nodes: [0, 1, 2, 3], weights: [0.5, 0.2, 0.2, 0.1] }; 5],
            ..identity.clone()
        };
        let spread = NodeOrigin { nodes: [0, 4, 1, 2], weights: [0.25; 4] };
        let mut next = identity;
        next.nodes[4] = spread;
        let mut with_last = mixed;
        with_last.nodes[4] = NodeOrigin::kept(4);
        let both = with_last.then(&next, &mesh);
        let own = both.nodes[4];
        assert_eq!(own.nodes, mesh.tetrahedra()[1]);
        assert_close(&[own.value(mesh.nodes())], &mesh.nodes()[4..]);
    }

    proptest! {
        #[test]
        fn removing_one_by_one_is_removing_at_once(
            removed in proptest::collection::btree_set(0_u32..12, 0..11),
        ) {
            let mesh = row(12);
            let all: Vec<u32> = removed.iter().copied().collect();
            let at_once = mesh.remove(&all).unwrap();
            let mut one_by_one = MeshChange::identity(&mesh);
            for &tetrahedron in &all {
                let now = one_by_one.tetrahedra.iter().position(|&old| old == tetrahedron).unwrap();
                let next = one_by_one.mesh.remove(&[now as u32]).unwrap();
                one_by_one = one_by_one.then(&next, &mesh);
            }
            prop_assert_eq!(one_by_one, at_once);
        }
    }
}
