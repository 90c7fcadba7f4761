//! Cuts of a scene without mechanics: one goes on where the last one ended, and bad ones change nothing.

#[path = "support/boxes.rs"]
mod boxes;

use std::ops::Range;
use std::sync::Arc;

use boxes::box_data;
use palpate::cutting::CutError;
use palpate::model::Body;
use palpate::{
    Blade, CutOptions, Mesh, Model, Scene, SceneCutError, SceneCuts, SceneError, SceneOptions,
    Simulation, SimulationOptions,
};

fn soft_box(origin: [f64; 3]) -> Arc<Mesh> {
    Arc::new(Mesh::repaired(box_data([4, 3, 2], 0.02, origin)).unwrap().0)
}

fn scene() -> Scene {
    let meshes = vec![soft_box([0.0; 3]), soft_box([0.003, 0.002, 0.05])];
    Scene::new(meshes, None, SceneOptions::default()).unwrap()
}

/// A scalpel that goes down through both boxes in steps of 1.5 mm, of 20 mm edges.
fn cut_slowly(cuts: &mut SceneCuts, scene: &mut Scene, steps: Range<usize>) {
    for step in steps {
        let edge = |step: usize| {
            let y = 0.0015 * step as f64 - 0.002;
            [[0.033, y, -0.1], [0.036, y, 0.2]]
        };
        let blade = Blade::stroke(&[edge(step), edge(step + 1)]).unwrap();
        cuts.cut(scene, &[0, 1], &blade, &CutOptions::default()).unwrap();
    }
}

fn pieces(scene: &Scene) -> [usize; 2] {
    [0, 1].map(|body| scene.mesh(body).pieces().len())
}

#[test]
fn steps_shorter_than_an_edge_leave_no_bridges() {
    let (mut cuts, mut scene) = (SceneCuts::default(), scene());
    cut_slowly(&mut cuts, &mut scene, 0..48);
    assert_eq!(pieces(&scene), [2, 2]);
    for body in 0..2 {
        let valid = scene.tree(body).validate(scene.mesh(body), scene.positions(body));
        assert_eq!(valid, Ok(()));
    }
}

/// A box whose nodes are up to 2.5 mm from their places.
fn jittered(mut seed: u64) -> Arc<Mesh> {
    let mut mesh = box_data([5, 4, 3], 0.02, [0.0; 3]);
    for value in mesh.nodes.as_flattened_mut() {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *value += 0.005 * ((seed >> 40) as f64 / f64::from(1 << 24) - 0.5);
    }
    Arc::new(Mesh::repaired(mesh).unwrap().0)
}

/// Cuts a box, but for its floor, by a slanted scalpel in steps of 1 mm, in a simulation that does not move and in a scene,
/// with and without what the cut before left. Returns the three meshes.
fn by_simulation_and_scene(mesh: &Arc<Mesh>) -> [Arc<Mesh>; 3] {
    let model = Model::from_bodies(vec![Body::new("box", Arc::clone(mesh))]);
    let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
    let [mut kept, mut forgetful] =
        [0, 1].map(|_| Scene::new(vec![Arc::clone(mesh)], None, SceneOptions::default()).unwrap());
    let (mut cuts, options) = (SceneCuts::default(), CutOptions::default());
    let edge = |step: u32| {
        let y = 0.001 * f64::from(step) - 0.005;
        [[0.043 + 0.1 * y, y, 0.075], [0.043 + 0.1 * y, y - 0.02, 0.023]]
    };
    for step in 0..110 {
        let blade = Blade::stroke(&[edge(step), edge(step + 1)]).unwrap();
        simulation.cut(&blade, &options).unwrap();
        cuts.cut(&mut kept, &[0], &blade, &options).unwrap();
        SceneCuts::default().cut(&mut forgetful, &[0], &blade, &options).unwrap();
    }
    [&simulation.model().bodies[0].mesh, kept.mesh(0), forgetful.mesh(0)].map(Arc::clone)
}

#[test]
fn a_scene_is_cut_as_a_simulation_is() {
    let mut deeper = 0;
    for seed in 0..6 {
        let [simulated, kept, forgotten] = by_simulation_and_scene(&jittered(seed));
        assert_eq!(kept.nodes(), simulated.nodes());
        assert_eq!(kept.tetrahedra(), simulated.tetrahedra());
        assert!(kept.triangles().len() >= forgotten.triangles().len());
        deeper += u32::from(kept.triangles().len() > forgotten.triangles().len());
    }
    assert!(deeper > 1, "what a cut left must open with the next one");
}

#[test]
fn cuts_are_known_by_the_mesh_of_their_body() {
    let (mut cuts, mut first) = (SceneCuts::default(), scene());
    cut_slowly(&mut cuts, &mut first, 0..20);
    let half = [0, 1].map(|body| Arc::clone(first.mesh(body)));
    let mut begun = cuts.clone();
    cut_slowly(&mut cuts, &mut first, 20..48);
    let expected = [0, 1].map(|body| Arc::clone(first.mesh(body)));

    // A body in front of them is taken out half-way: theirs is another index.
    let mut second = Scene::new(
        vec![soft_box([9.0; 3]), half[0].clone(), half[1].clone()],
        None,
        SceneOptions::default(),
    )
    .unwrap();
    second.remove(0).unwrap();
    cut_slowly(&mut begun, &mut second, 20..48);
    for (body, mesh) in expected.iter().enumerate() {
        assert_eq!(second.mesh(body).tetrahedra(), mesh.tetrahedra());
        assert_eq!(second.mesh(body).nodes(), mesh.nodes());
    }
    // Another mesh in its place begins anew.
    second.replace(0, soft_box([0.0; 3])).unwrap();
    cut_slowly(&mut begun, &mut second, 0..48);
    assert_eq!(pieces(&second), [2, 2]);
}

#[test]
fn a_cut_that_fails_changes_nothing() {
    let sheet = palpate::MeshData {
        nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..palpate::MeshData::default()
    };
    let mut scene = scene();
    scene.add(Arc::new(Mesh::new(sheet).unwrap()));
    let before = [0, 1, 2].map(|body| Arc::clone(scene.mesh(body)));
    let mut cuts = SceneCuts::default();
    let blade = Blade::plane([0.031, 0.0, 0.0], [1.0, 0.1, 0.0], None).unwrap();
    let usual = CutOptions::default();
    let error = cuts.cut(&mut scene, &[0, 2], &blade, &usual).unwrap_err();
    assert_eq!(error, SceneCutError::Cut { body: 2, source: CutError::SurfaceOnly });
    let error = cuts.cut(&mut scene, &[0, 3], &blade, &usual).unwrap_err();
    let none = SceneError::BodyOutOfRange { body: 3, count: 3 };
    assert_eq!(error, SceneCutError::Scene(none));
    let options = CutOptions { snap: 0.7, ..usual };
    let error = cuts.cut(&mut scene, &[1], &blade, &options).unwrap_err();
    assert!(
        error.to_string().starts_with("body 1 cannot be cut: the option snap is 0.7"),
        "{error}"
    );
    for (body, mesh) in before.iter().enumerate() {
        assert!(Arc::ptr_eq(scene.mesh(body), mesh));
    }
    // Named twice is cut once.
    let found = cuts.cut(&mut scene, &[1, 1], &blade, &usual).unwrap();
    assert_eq!(found.iter().map(|(body, _)| *body).collect::<Vec<_>>(), [1]);
}
