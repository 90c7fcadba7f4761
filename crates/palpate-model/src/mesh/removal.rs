//! A mesh without some of its tetrahedra.

use super::{Mesh, MeshChange, MeshError, NONE, NodeOrigin};

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
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::row::row;
    use super::*;

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
