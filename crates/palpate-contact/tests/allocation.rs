//! At steady state a frame allocates nothing: counted by the allocator of this test binary.

#[path = "detection/scenes.rs"]
#[expect(dead_code, reason = "the other tests use the rest")]
mod scenes;

use palpate_contact::{IntersectionOptions, Method, ProximityOptions, Scene, SceneOptions};
use palpate_testing::{Counting, allocations};

use scenes::{Random, as_slices, deforming, horseshoe, jittered, soup};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_frame_allocates_nothing() {
    let mut random = Random(4);
    let meshes = vec![
        horseshoe(20, 2, [0.0; 3]),
        jittered([5, 5, 5], [0.0, 2.0, 2.0], 0.1, &mut random),
        soup(60, 4.0, &mut random),
    ];
    let case = deforming(meshes, 3, &mut random);
    let frames: Vec<_> = case.frames.iter().map(as_slices).collect();
    for method in Method::ALL {
        let options = SceneOptions { method, ..SceneOptions::default() };
        let mut scene = Scene::new(case.meshes.clone(), None, options).expect("three meshes");
        let groups: Vec<u32> =
            (0..case.meshes[2].triangles().len() as u32).map(|i| i % 5).collect();
        scene.set_groups(2, &groups).expect("one for each triangle");
        scene.ignore(1, 1, true).expect("there are three");
        let shared = IntersectionOptions { shared_nodes: true, ..IntersectionOptions::default() };
        let at_rest = ProximityOptions { close_at_rest: false, ..ProximityOptions::default() };
        let mut found = [0; 9];
        let mut round = |scene: &mut Scene| {
            for frame in &frames {
                scene.update(frame).expect("finite positions");
                found[0] += scene.intersections(&IntersectionOptions::default()).pairs.len();
                found[1] += scene.proximity(&|_, _| Some(0.1)).pairs.len();
                found[2] += scene.penetration(&|_, _| true).nodes.len();
                found[3] += scene.intersections(&shared).pairs.len();
                found[4] += scene.proximity_with(&|_, _| Some(0.1), &at_rest).pairs.len();
                found[5] += scene.contact_nodes(&shared).nodes[2].len();
                let points = &frame[0][..50];
                let hits = scene.closest(points, None, 1.0).expect("finite");
                found[6] += hits.iter().flatten().count();
                let inside = scene.contains(points, None).expect("finite");
                found[7] += inside.iter().filter(|&&inside| inside).count();
                let hits = scene.cast(points, &[[1.0, 2.0, 3.0]; 50], None, f64::INFINITY);
                found[8] += hits.expect("finite").iter().flatten().count();
            }
        };
        round(&mut scene);
        let before = allocations();
        round(&mut scene);
        assert_eq!(allocations() - before, 0, "{method:?}");
        assert!(found.iter().all(|&count| count > 0), "{found:?}");
    }
}
