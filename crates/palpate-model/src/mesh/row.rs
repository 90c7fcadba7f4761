//! Tetrahedra in a row, for the tests of what changes a mesh.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Mesh, MeshData};

/// `count` tetrahedra in a row along x, each one's last face the next one's first.
pub(super) fn row(count: u32) -> Arc<Mesh> {
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
