//! After a change of topology: the tree is whole, and all methods find what the double loop finds.

use std::sync::Arc;

use palpate_contact::{
    ChangedSurface, IntersectionOptions, Method, Scene, SceneError, SceneOptions,
};
use palpate_cutting::{Blade, CutOptions, cut};
use palpate_model::{Mesh, MeshChange};

use crate::intersections::{scene, validate};
use crate::scenes::{Point, Positions, Random, as_slices, block, horseshoe, jittered, positions};

const COMPLETE: IntersectionOptions =
    IntersectionOptions { self_contact: true, same_leaf: true, shared_nodes: false };

/// Leaf size of the scenes in which changes are prepared.
const PREPARED: usize = 4;

/// Scenes of one and the same bodies, the last one by the double loop.
struct Twins(Vec<Scene>);

impl Twins {
    fn new(meshes: &[Arc<Mesh>]) -> Self {
        let of = |(method, leaf_size)| {
            scene(meshes, SceneOptions { method, leaf_size, ..SceneOptions::default() })
        };
        let kinds = [(Method::Wide, 2), (Method::Wide, PREPARED), (Method::Paper, 1)];
        let kinds = kinds.into_iter().chain([(Method::Paper, PREPARED), (Method::Hash, 3)]);
        Self(kinds.chain([(Method::AllPairs, 2)]).map(of).collect())
    }

    fn change(&mut self, body: usize, change: &MeshChange) {
        for scene in &mut self.0 {
            if scene.options().leaf_size == PREPARED {
                let basis = scene.surface_basis(body).expect("there is such a body");
                // Elsewhere than the body is by now.
                let rest = change.mesh.nodes();
                let made = ChangedSurface::new(basis, change, rest).expect("a change of its mesh");
                scene.go_on_with(body, made, change).expect("its mesh");
            } else {
                scene.change_body(body, change).expect("a change of its mesh");
            }
        }
    }

    fn update(&mut self, positions: &Positions) {
        for scene in &mut self.0 {
            scene.update(&as_slices(positions)).expect("finite positions");
        }
    }

    /// Compares all results; returns how many pairs met, were close, and how many nodes were inside.
    fn compare(&mut self, distance: f64, name: &str) -> [usize; 3] {
        let (slow, fast) = self.0.split_last_mut().expect("some scenes");
        let shared = IntersectionOptions { shared_nodes: true, ..COMPLETE };
        let expected = slow.intersections(&shared).pairs.clone();
        let apart = slow.intersections(&COMPLETE).pairs.clone();
        let close = slow.proximity(&|_, _| Some(distance)).pairs.clone();
        let inside = slow.penetration(&|_, _| true).nodes.clone();
        for scene in &mut *fast {
            validate(scene);
            assert!(scene.intersections(&shared).pairs == expected, "{name}");
            assert!(scene.intersections(&COMPLETE).pairs == apart, "{name}");
            assert!(scene.proximity(&|_, _| Some(distance)).pairs == close, "{name}");
            assert!(scene.penetration(&|_, _| true).nodes == inside, "{name}");
        }
        [apart.len(), close.len(), inside.len()]
    }
}

fn bodies(random: &mut Random) -> Vec<Arc<Mesh>> {
    vec![horseshoe(8, 2, [0.0; 3]), jittered([3, 3, 3], [0.2, 0.9, 1.1], 0.1, random)]
}

/// Some tetrahedra around a random one, or all over the body.
fn some_tetrahedra(mesh: &Mesh, random: &mut Random) -> Vec<u32> {
    let count = mesh.tetrahedra().len() as u64;
    if random.between(0.0, 1.0) < 0.5 {
        let center = mesh.tetrahedra()[(random.bits() % count) as usize];
        let around = |corners: &[u32; 4]| corners.iter().any(|node| center[..2].contains(node));
        return (0..).zip(mesh.tetrahedra()).filter(|(_, c)| around(c)).map(|(i, _)| i).collect();
    }
    let mut chosen: Vec<u32> =
        (0..random.bits() % 6).map(|_| (random.bits() % count) as u32).collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// A blade through a random place: a square, or a bent stroke.
fn some_blade(positions: &[Point], random: &mut Random) -> Blade {
    let count = positions.len() as u64;
    let at = positions[(random.bits() % count) as usize];
    let size = random.between(0.5, 4.0);
    if random.between(0.0, 1.0) < 0.5 {
        return Blade::plane(at, random.vector(1.0), Some(size)).expect("a normal of some length");
    }
    let (along, down) = (random.vector(0.4 * size), random.vector(size));
    let bend = random.vector(0.1 * size);
    let edges: Vec<[Point; 2]> = (-2..=2)
        .map(|step| {
            let s = f64::from(step);
            let heel = std::array::from_fn(|k| at[k] + s * along[k] + s * s * bend[k] - down[k]);
            [heel, std::array::from_fn(|k| heel[k] + 2.0 * down[k])]
        })
        .collect();
    Blade::stroke(&edges).expect("edges that move")
}

/// Cuts and removes, moves, compares; begins again with fresh bodies when they are in small pieces.
fn cuts(changes: usize, seed: u64) {
    let mut random = Random(seed);
    let mut twins = Twins::new(&bodies(&mut random));
    let (mut sums, mut made) = ([0; 3], 0);
    for number in 0..changes {
        let body = (random.bits() % 2) as usize;
        let scene = &twins.0[0];
        let mesh = Arc::clone(scene.mesh(body));
        if mesh.tetrahedra().len() > 500 {
            twins = Twins::new(&bodies(&mut random));
            continue;
        }
        let blade = some_blade(scene.positions(body), &mut random);
        let options = CutOptions { min_edge: Some(0.05), ..CutOptions::default() };
        let found = cut(&mesh, scene.positions(body), &blade, &options).expect("a mesh to cut");
        if let Some(found) = found {
            twins.change(body, &found.change);
            made += 1;
        }
        // Lips that coincide are the hardest; then they move.
        if number % 2 == 0 {
            let mut moved: Positions = (0..2).map(|b| twins.0[0].positions(b).to_vec()).collect();
            for point in moved.iter_mut().flatten() {
                let noise = random.vector(0.02);
                *point = std::array::from_fn(|axis| point[axis] + noise[axis]);
            }
            twins.update(&moved);
        }
        let found = twins.compare(random.between(0.01, 0.05), &format!("cut {number}"));
        sums = std::array::from_fn(|i| sums[i] + found[i]);
    }
    assert!(made > changes / 2, "{made}");
    assert!(sums.iter().all(|&sum| sum > 2 * changes), "{sums:?}");
}

#[test]
fn after_every_cut_the_pairs_are_those_of_the_double_loop() {
    // Ten thousand with PALPATE_CHANGES=10000.
    let changes = std::env::var("PALPATE_CHANGES").map(|text| text.parse().expect("a number"));
    cuts(changes.unwrap_or(16), 21);
}

/// Removes, moves, compares; begins again with fresh bodies when little is left.
fn removals(changes: usize, seed: u64) {
    let mut random = Random(seed);
    let mut twins = Twins::new(&bodies(&mut random));
    let mut sums = [0; 3];
    for number in 0..changes {
        let body = (random.bits() % 2) as usize;
        let mesh = Arc::clone(twins.0[0].mesh(body));
        match mesh.remove(&some_tetrahedra(&mesh, &mut random)) {
            Ok(change) if change.mesh.tetrahedra().len() > 20 => twins.change(body, &change),
            _ => twins = Twins::new(&bodies(&mut random)),
        }
        let mut moved: Positions = (0..2).map(|b| twins.0[0].positions(b).to_vec()).collect();
        if random.between(0.0, 1.0) < 0.5 {
            for point in moved.iter_mut().flatten() {
                let noise = random.vector(0.05);
                *point = std::array::from_fn(|axis| point[axis] + noise[axis]);
            }
            twins.update(&moved);
        }
        let found = twins.compare(random.between(0.02, 0.2), &format!("change {number}"));
        sums = std::array::from_fn(|i| sums[i] + found[i]);
    }
    assert!(sums.iter().all(|&sum| sum > 2 * changes), "{sums:?}");
}

#[test]
fn after_every_removal_the_pairs_are_those_of_the_double_loop() {
    // Ten thousand with PALPATE_CHANGES=10000.
    let changes = std::env::var("PALPATE_CHANGES").map(|text| text.parse().expect("a number"));
    removals(changes.unwrap_or(200), 20);
}

#[test]
fn leaves_keep_their_tetrahedra_and_may_be_empty() {
    let mesh = block([4, 4, 4], |p| p);
    let options = SceneOptions { leaf_size: 1, ..SceneOptions::default() };
    let mut scene = scene(std::slice::from_ref(&mesh), options);
    let before = scene.tree(0).clone();
    let removed: Vec<u32> = (0..mesh.tetrahedra().len() as u32).filter(|t| t % 7 < 3).collect();
    let change = mesh.remove(&removed).expect("most are left");
    scene.change_body(0, &change).expect("its mesh");
    validate(&scene);
    let after = scene.tree(0);
    assert_eq!(after.leaves(), before.leaves());
    for &leaf in before.leaves() {
        let old = before.elements(leaf as usize);
        let new = after.elements(leaf as usize).iter().map(|&t| change.tetrahedra[t as usize]);
        let kept = old.iter().copied().filter(|t| !removed.contains(t));
        assert!(new.eq(kept), "leaf {leaf}");
    }
    assert!(after.stats().leaf_fill[0] > 0);
    assert_eq!(after.stats().node_count, before.stats().node_count);
}

#[test]
fn other_bodies_and_ignored_pairs_stay_and_groups_follow() {
    let mut random = Random(5);
    let mut meshes = bodies(&mut random);
    meshes.push(block([2, 2, 2], |p| [p[0] + 0.3, p[1] + 1.4, p[2] + 0.4]));
    let mut twins = Twins::new(&meshes);
    for scene in &mut twins.0 {
        scene.ignore(0, 2, true).expect("three bodies");
        for body in 0..2 {
            let count = scene.mesh(body).triangles().len();
            let groups: Vec<u32> = (0..count as u32).map(|triangle| triangle % 3).collect();
            scene.set_groups(body, &groups).expect("one for each");
        }
    }
    let change = meshes[0].remove(&[0, 5, 40]).expect("most are left");
    twins.change(0, &change);
    twins.compare(0.2, "ignored pairs and groups");
    // The same scene, made with groups by the nodes that the triangles had.
    let mut fresh = Twins::new(&[change.mesh.clone(), meshes[1].clone(), meshes[2].clone()]);
    let origin = |node: u32| change.nodes[node as usize].kept_node().expect("only removal");
    for scene in &mut fresh.0 {
        scene.ignore(0, 2, true).expect("three bodies");
        let triangles = scene.mesh(0).triangles().to_vec();
        let old = |triangle: &[u32; 3]| {
            let nodes = triangle.map(origin);
            let place = meshes[0].triangles().iter().position(|other| *other == nodes);
            place.map_or(0, |place| place as u32 % 3)
        };
        let groups: Vec<u32> = triangles.iter().map(old).collect();
        assert!(groups.contains(&0) && groups.contains(&2));
        scene.set_groups(0, &groups).expect("one for each");
        let count = scene.mesh(1).triangles().len();
        let groups: Vec<u32> = (0..count as u32).map(|triangle| triangle % 3).collect();
        scene.set_groups(1, &groups).expect("one for each");
    }
    for (kept, fresh) in twins.0.iter_mut().zip(&mut fresh.0) {
        assert_eq!(kept.intersections(&COMPLETE).pairs, fresh.intersections(&COMPLETE).pairs);
        let close = |_: usize, _: usize| Some(0.3);
        assert_eq!(kept.proximity(&close).pairs, fresh.proximity(&close).pairs);
    }
}

#[test]
fn a_change_of_another_mesh_is_refused() {
    let mut random = Random(6);
    let meshes = bodies(&mut random);
    let mut scene = scene(&meshes, SceneOptions::default());
    let change = meshes[0].remove(&[3]).expect("most are left");
    let error = scene.change_body(1, &change).expect_err("of body 0");
    assert!(matches!(error, SceneError::OtherMesh { body: 1, .. }), "{error}");
    assert!(error.to_string().contains("not one of the mesh of body 1"), "{error}");
    assert_eq!(
        scene.change_body(2, &change),
        Err(SceneError::BodyOutOfRange { body: 2, count: 2 })
    );
    let basis = scene.surface_basis(1).expect("two bodies");
    assert!(ChangedSurface::new(basis, &change, change.mesh.nodes()).is_err());
    let basis = || scene.surface_basis(0).expect("two bodies");
    assert!(ChangedSurface::new(basis(), &change, &[]).is_err(), "no positions");
    let made = || ChangedSurface::new(basis(), &change, change.mesh.nodes()).expect("its mesh");
    let [first, second, third] = [made(), made(), made()];
    assert!(matches!(
        scene.go_on_with(1, first, &change),
        Err(SceneError::OtherMesh { body: 1, .. })
    ));
    let other = meshes[0].remove(&[4]).expect("most are left");
    assert!(scene.go_on_with(0, second, &other).is_err(), "made for another change");
    assert_eq!(scene.positions(1).len(), positions(&meshes)[1].len());
    assert_eq!(scene.positions(0).len(), positions(&meshes)[0].len());
    validate(&scene);
    scene.go_on_with(0, third, &change).expect("its mesh");
    validate(&scene);
}
