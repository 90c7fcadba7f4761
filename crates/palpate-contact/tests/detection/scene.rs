//! The scene as a container: bodies come and go, wrong arguments change nothing.

use std::sync::Arc;

use palpate_contact::{IntersectionOptions, Method, Scene, SceneError, SceneOptions, TrianglePair};
use palpate_model::{Mesh, Structure};

use crate::intersections::{scene, validate};
use crate::scenes::{Random, as_slices, block, horseshoe, jittered, positions, sheet};

fn pairs(scene: &mut Scene) -> Vec<TrianglePair> {
    scene.intersections(&IntersectionOptions::default()).pairs.clone()
}

fn meshes() -> Vec<Arc<Mesh>> {
    let mut random = Random(2);
    vec![
        horseshoe(8, 2, [0.0; 3]),
        jittered([3, 3, 3], [0.0, 1.0, 1.0], 0.1, &mut random),
        block([2, 2, 4], |p| [p[0] + 0.5, p[1] - 0.7, p[2] - 1.2]),
        sheet(6, 6, |p| [p[0] - 1.0, p[1] - 1.0, 0.6]),
    ]
}

#[test]
fn adding_removing_and_replacing_give_the_scene_of_what_is_left() {
    let meshes = meshes();
    let of = |indices: &[usize], options| {
        let chosen: Vec<_> = indices.iter().map(|&index| meshes[index].clone()).collect();
        pairs(&mut scene(&chosen, options))
    };
    for method in Method::ALL {
        let options = SceneOptions { method, ..SceneOptions::default() };
        let mut scene = scene(&meshes[..2], options);
        assert_eq!(scene.add(meshes[2].clone()), 2);
        assert_eq!(scene.add(meshes[3].clone()), 3);
        validate(&scene);
        let all = pairs(&mut scene);
        assert!(!all.is_empty());
        assert_eq!(all, of(&[0, 1, 2, 3], options));
        assert!(Arc::ptr_eq(&scene.remove(1).expect("there are four"), &meshes[1]));
        validate(&scene);
        assert_eq!(pairs(&mut scene), of(&[0, 2, 3], options));
        assert!(Arc::ptr_eq(
            &scene.replace(0, meshes[1].clone()).expect("there are three"),
            &meshes[0]
        ));
        validate(&scene);
        assert_eq!(pairs(&mut scene), of(&[1, 2, 3], options));
        for _ in 0..3 {
            scene.remove(0).expect("not yet empty");
        }
        assert_eq!(scene.body_count(), 0);
        assert!(pairs(&mut scene).is_empty());
        assert!(scene.proximity(&|_, _| Some(1.0)).pairs.is_empty());
        assert!(scene.penetration(&|_, _| true).nodes.is_empty());
        assert!(scene.update(&[]).is_ok());
        assert_eq!(scene.add(meshes[3].clone()), 0);
        assert_eq!(pairs(&mut scene), []);
    }
}

#[test]
fn the_structure_does_not_change_the_result() {
    let meshes = meshes();
    let expected = pairs(&mut scene(&meshes, SceneOptions::default()));
    let join = |a, b| Structure::Join(Box::new(a), Box::new(b));
    let body = Structure::Body;
    for structure in [
        join(join(body(0), body(1)), join(body(2), body(3))),
        join(body(3), join(body(1), join(body(0), body(2)))),
        join(join(join(body(2), body(0)), body(3)), body(1)),
    ] {
        let made = Scene::new(meshes.clone(), Some(&structure), SceneOptions::default());
        let mut scene = made.expect("each body once");
        assert_eq!(pairs(&mut scene), expected);
    }
    let missing = Scene::new(meshes, Some(&body(1)), SceneOptions::default());
    assert_eq!(missing.err(), Some(SceneError::StructureMisses { body: 0 }));
}

#[test]
fn wrong_arguments_are_named_and_change_nothing() {
    let options = SceneOptions::default();
    let refused = |meshes, options| Scene::new(meshes, None, options).err();
    assert_eq!(refused(Vec::new(), options), Some(SceneError::NoMeshes));
    let zero_leaf = SceneOptions { leaf_size: 0, ..options };
    assert_eq!(refused(meshes(), zero_leaf), Some(SceneError::LeafSize));
    let no_threads = SceneOptions { threads: 0, ..options };
    assert_eq!(refused(meshes(), no_threads), Some(SceneError::Threads));

    let meshes = meshes();
    let mut scene = scene(&meshes, options);
    let before = pairs(&mut scene);
    let rest = positions(&meshes);
    assert_eq!(
        scene.update(&as_slices(&rest)[..3]),
        Err(SceneError::BodyCount { given: 3, expected: 4 })
    );
    let mut moved = crate::scenes::mapped(&rest, |p| [p[0], p[1], 0.0]);
    let last = moved[3].pop().expect("a sheet has nodes");
    assert_eq!(
        scene.update(&as_slices(&moved)),
        Err(SceneError::NodeCount { body: 3, given: 48, expected: 49 })
    );
    moved[3].push([last[0], f64::NAN, 0.0]);
    let error = scene.update(&as_slices(&moved)).expect_err("a NaN");
    assert!(matches!(error, SceneError::NotFinite { body: 3, node: 48, .. }));
    let text = error.to_string();
    assert!(text.contains("positions[3][48]") && text.contains("NaN"), "{text}");
    moved[3][48] = last;
    moved[0][5][2] = f64::INFINITY;
    assert!(matches!(
        scene.update(&as_slices(&moved)),
        Err(SceneError::NotFinite { body: 0, node: 5, .. })
    ));
    let out_of_range = SceneError::BodyOutOfRange { body: 4, count: 4 };
    assert_eq!(scene.remove(4).err(), Some(out_of_range.clone()));
    assert_eq!(scene.replace(4, meshes[0].clone()).err(), Some(out_of_range));

    validate(&scene);
    for (body, rest) in rest.iter().enumerate() {
        assert_eq!(scene.positions(body), rest);
    }
    assert_eq!(pairs(&mut scene), before);
}

#[test]
fn statistics_add_up() {
    let meshes = meshes();
    for method in Method::ALL {
        let mut scene = scene(&meshes, SceneOptions { method, ..SceneOptions::default() });
        let counts: Vec<u64> = meshes.iter().map(|mesh| mesh.triangles().len() as u64).collect();
        let total: u64 = counts.iter().sum();
        let stats = scene.intersections(&IntersectionOptions::default()).stats;
        assert_eq!(stats.all_pairs, total * (total - 1) / 2);
        assert_eq!(stats.tested_fraction(), stats.polygon_tests as f64 / stats.all_pairs as f64);
        let own: u64 = counts.iter().map(|count| count * (count - 1) / 2).sum();
        let others = IntersectionOptions { self_contact: false, ..Default::default() };
        assert_eq!(scene.intersections(&others).stats.all_pairs, stats.all_pairs - own);
        match method {
            Method::Paper | Method::Wide => {
                assert!(stats.nodes_visited > 0 && stats.leaf_pairs > 0);
            }
            Method::Hash => assert!(stats.cell_entries >= total),
            _ => assert!(stats.tested_fraction() > 0.9),
        }
        if method != Method::AllPairs {
            assert!(stats.box_tests >= stats.polygon_tests && stats.tested_fraction() < 0.2);
        }
    }
}
