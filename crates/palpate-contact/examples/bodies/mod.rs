//! The bodies of the micro-benchmarks: the four organs of the paper where `PALPATE_DATA` names their
//! folder, else four bent bars.

#[path = "../../tests/detection/scenes.rs"]
#[expect(dead_code, reason = "the tests use the rest")]
mod scenes;

use std::path::PathBuf;
use std::sync::Arc;

use palpate_geometry::{Aabb, vec3};
use palpate_model::{Mesh, ReadOptions, read_mesh};

/// Four bodies of about 12,000 surface triangles in all.
pub(crate) fn four() -> Vec<Arc<Mesh>> {
    let Some(folder) = std::env::var_os("PALPATE_DATA") else {
        return (0..4).map(|i| scenes::horseshoe(45, 8, [5.0 * f64::from(i), 0.0, 0.0])).collect();
    };
    let read = |name: &str| {
        let path = PathBuf::from(&folder).join("organs").join(name).with_extension("vtk");
        Arc::new(read_mesh(&path, &ReadOptions::default()).expect("an organ").mesh)
    };
    ["aorta_paper", "kidney_l_paper", "kidney_r_paper", "vena_cava_paper"].map(read).to_vec()
}

/// A thousandth of the scene's diagonal \[m\].
pub(crate) fn proximity_distance(meshes: &[Arc<Mesh>]) -> f64 {
    let bounds = Aabb::from_points(meshes.iter().flat_map(|mesh| mesh.nodes()));
    1e-3 * vec3::norm(bounds.extent())
}
