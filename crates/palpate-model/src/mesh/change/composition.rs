//! Two changes of a mesh, one after the other, as one.

use std::collections::BTreeMap;
use std::sync::Arc;

use palpate_geometry::tetrahedron::barycentric;

use super::super::{Mesh, NONE};
use super::{MeshChange, NodeOrigin, of_parents};

impl MeshChange {
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
                let nodes = old.tetrahedra()[tetrahedron_of[node] as usize];
                let corners = nodes.map(|node| old.nodes()[node as usize]);
                NodeOrigin { nodes, weights: barycentric(next.mesh.nodes()[node], &corners) }
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

#[cfg(test)]
mod tests {
    use palpate_geometry::Point;

    use super::super::super::row::row;
    use super::*;

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
}
