//! The natural pose of real organs, where their meshes are at hand: `PALPATE_DATA` names the folder.

use std::path::PathBuf;
use std::sync::Arc;

use palpate_contact::{IntersectionOptions, Method, SceneOptions};
use palpate_model::{Mesh, ReadOptions, read_mesh};

use crate::intersections::{scene, validate};

fn organ(name: &str) -> Option<Arc<Mesh>> {
    let folder = PathBuf::from(std::env::var_os("PALPATE_DATA")?);
    let path = folder.join("organs").join(name).with_extension("vtk");
    let read = read_mesh(&path, &ReadOptions::default());
    Some(Arc::new(read.unwrap_or_else(|error| panic!("{error}")).mesh))
}

#[test]
fn the_natural_pose_crosses_where_it_is_known_to() {
    let names = ["aorta_paper", "vena_cava_paper", "kidney_r_paper", "kidney_l_paper"];
    let Some(meshes) = names.iter().map(|name| organ(name)).collect::<Option<Vec<_>>>() else {
        return;
    };
    let mut previous = None;
    for (method, leaf_size) in
        [(Method::Paper, 1), (Method::Paper, 5), (Method::Hash, 2), (Method::AllPairs, 2)]
    {
        let options = SceneOptions { method, leaf_size, ..SceneOptions::default() };
        let mut scene = scene(&meshes, options);
        validate(&scene);
        let found = scene.intersections(&IntersectionOptions::default()).pairs.clone();
        for a in 0..4 {
            for b in a..4 {
                let of_bodies = found.iter().filter(|pair| (pair.body_a, pair.body_b) == (a, b));
                let expected = match (a, b) {
                    (0, 1) => 37,
                    (1, 2) => 14,
                    _ => 0,
                };
                assert_eq!(of_bodies.count(), expected, "{a} and {b}, {method:?}");
            }
        }
        assert_eq!(*previous.get_or_insert(found.clone()), found);
    }
}

#[test]
fn close_pairs_and_inner_nodes_of_organs_are_those_of_the_double_loops() {
    let names = ["vena_cava_paper", "kidney_r_paper"];
    let Some(meshes) = names.iter().map(|name| organ(name)).collect::<Option<Vec<_>>>() else {
        return;
    };
    let of = |method| scene(&meshes, SceneOptions { method, ..SceneOptions::default() });
    let extent = meshes[1].bounds().extent()[2];
    let distance = |a: usize, b: usize| (a != b).then_some(0.005 * extent);
    let mut fast = of(Method::Paper);
    let found = fast.proximity(&distance).pairs.clone();
    assert!(found.len() > 14);
    assert!(found == of(Method::AllPairs).proximity(&distance).pairs);
    let inner = fast.penetration(&|_, _| true).nodes.clone();
    assert!(!inner.is_empty());
    for node in inner {
        let into = &meshes[node.into_body as usize];
        let point = meshes[node.body as usize].nodes()[node.node as usize];
        let inside = into.tetrahedra().iter().any(|tetrahedron| {
            let [a, b, c, d] = tetrahedron.map(|corner| into.nodes()[corner as usize]);
            let behind = |a, b, c| palpate_geometry::predicates::orient3d(a, b, c, point) <= 0;
            behind(a, c, b) && behind(a, b, d) && behind(a, d, c) && behind(b, c, d)
        });
        assert!(inside, "{node:?}");
    }
}
