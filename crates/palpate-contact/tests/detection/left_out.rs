//! Pairs that are left out: ignored bodies, common groups, what is close at rest. Every method against
//! the double loop's complete lists, thinned here by definition.

use std::sync::Arc;

use palpate_contact::{
    IntersectionOptions, LOCAL_MINIMUM_SLACK, Method, PairKind, ProximityOptions, ProximityPair,
    Scene, SceneError, SceneOptions, TrianglePair,
};
use palpate_geometry::{edge_edge, point_triangle, vec3};
use palpate_model::Mesh;
use proptest::prelude::*;

use crate::intersections::scene;
use crate::scenes::{
    Case, Positions, Random, as_slices, block, cases, deforming, horseshoe, jittered, rounded,
    sheet, soup,
};

const SHARED: IntersectionOptions =
    IntersectionOptions { self_contact: true, same_leaf: true, shared_nodes: true };

/// What a scene is asked to leave out.
#[derive(Clone, Debug, Default)]
struct LeftOut {
    ignored: Vec<[usize; 2]>,
    /// Per body; empty for none.
    groups: Vec<Vec<u32>>,
}

impl LeftOut {
    /// Some body pairs, and groups of few numbers on most bodies, most triangles being without.
    fn random(meshes: &[Arc<Mesh>], random: &mut Random) -> Self {
        let mut left_out = Self::default();
        for a in 0..meshes.len() {
            left_out.ignored.extend(
                (a..meshes.len()).map(|b| [b, a]).filter(|_| random.bits().is_multiple_of(4)),
            );
            let count =
                if random.bits().is_multiple_of(4) { 0 } else { meshes[a].triangles().len() };
            let group = |random: &mut Random| (random.bits() % 8).saturating_sub(4) as u32;
            left_out.groups.push((0..count).map(|_| group(random)).collect());
        }
        left_out
    }

    fn apply(&self, scene: &mut Scene) {
        for &[a, b] in &self.ignored {
            scene.ignore(a, b, true).expect("the bodies are there");
        }
        for (body, groups) in
            self.groups.iter().enumerate().filter(|(_, groups)| !groups.is_empty())
        {
            scene.set_groups(body, groups).expect("one for each triangle");
        }
    }

    fn ignores(&self, [a, b]: [u32; 2]) -> bool {
        let [a, b] = [a, b].map(|body| body as usize);
        self.ignored.contains(&[a, b]) || self.ignored.contains(&[b, a])
    }

    /// Groups of the triangles of a body that have all these nodes.
    fn groups_around(&self, meshes: &[Arc<Mesh>], body: u32, nodes: &[u32]) -> Vec<u32> {
        let groups = self.groups.get(body as usize).map_or(&[][..], Vec::as_slice);
        let triangles = meshes[body as usize].triangles().iter().zip(groups);
        let around =
            triangles.filter(|(corners, _)| nodes.iter().all(|node| corners.contains(node)));
        around.map(|(_, &group)| group).filter(|&group| group != 0).collect()
    }

    fn in_common_group(&self, meshes: &[Arc<Mesh>], bodies: [u32; 2], nodes: [&[u32]; 2]) -> bool {
        let [a, b] = [0, 1].map(|side| self.groups_around(meshes, bodies[side], nodes[side]));
        a.iter().any(|group| b.contains(group))
    }

    fn keeps_triangles(&self, pair: &TrianglePair) -> bool {
        let group = |body: u32, triangle: u32| {
            let groups = self.groups.get(body as usize);
            groups.and_then(|groups| groups.get(triangle as usize)).copied().unwrap_or(0)
        };
        let [a, b] = [group(pair.body_a, pair.triangle_a), group(pair.body_b, pair.triangle_b)];
        !self.ignores([pair.body_a, pair.body_b]) && (a == 0 || a != b)
    }

    fn keeps_features(&self, meshes: &[Arc<Mesh>], pair: &ProximityPair) -> bool {
        let (of_a, of_b) = match pair.kind {
            PairKind::VertexTriangle => pair.nodes.split_at(1),
            PairKind::EdgeEdge => pair.nodes.split_at(2),
        };
        !self.ignores(pair.bodies) && !self.in_common_group(meshes, pair.bodies, [of_a, of_b])
    }
}

fn close_at_rest(meshes: &[Arc<Mesh>], pair: &ProximityPair, distance: f64) -> bool {
    let at =
        |side: usize, i: usize| meshes[pair.bodies[side] as usize].nodes()[pair.nodes[i] as usize];
    let squared = match pair.kind {
        PairKind::VertexTriangle => {
            point_triangle(at(0, 0), &[at(1, 1), at(1, 2), at(1, 3)]).distance_squared
        }
        PairKind::EdgeEdge => {
            edge_edge(&[at(0, 0), at(0, 1)], &[at(1, 2), at(1, 3)]).distance_squared
        }
    };
    squared.sqrt() < distance
}

fn contact_nodes(meshes: &[Arc<Mesh>], pairs: &[TrianglePair]) -> Vec<Vec<u32>> {
    let mut nodes = vec![Vec::new(); meshes.len()];
    for pair in pairs {
        for (body, triangle) in [(pair.body_a, pair.triangle_a), (pair.body_b, pair.triangle_b)] {
            nodes[body as usize].extend(meshes[body as usize].triangles()[triangle as usize]);
        }
    }
    for nodes in &mut nodes {
        nodes.sort_unstable();
        nodes.dedup();
    }
    nodes
}

/// Whether no earlier triangle has the node or edge that is closest, and no end of an edge is.
fn is_first(meshes: &[Arc<Mesh>], pair: &ProximityPair) -> bool {
    let on: Vec<u32> = (0..4).filter(|&k| pair.weights[k] != 0.0).map(|k| pair.nodes[k]).collect();
    if pair.kind == PairKind::EdgeEdge {
        return on.len() == 4;
    }
    let triangles = meshes[pair.bodies[1] as usize].triangles();
    let first = triangles.iter().position(|corners| on[1..].iter().all(|n| corners.contains(n)));
    first == Some(pair.elements[1] as usize)
}

/// Whether no triangle at the closest features leads from one surface towards the other.
fn is_local_minimum(meshes: &[Arc<Mesh>], frame: &Positions, pair: &ProximityPair) -> bool {
    let ends = if pair.kind == PairKind::EdgeEdge { 2 } else { 1 };
    (0..4).all(|corner| {
        let side = usize::from(corner >= ends);
        let on = |k: &usize| usize::from(*k >= ends) == side && pair.weights[*k] != 0.0;
        let feature: Vec<u32> = (0..4).filter(on).map(|k| pair.nodes[k]).collect();
        let at = |node: u32| frame[pair.bodies[side] as usize][node as usize];
        let triangles = meshes[pair.bodies[side] as usize].triangles().iter();
        let around = triangles.filter(|corners| feature.iter().all(|n| corners.contains(n)));
        let towards = if side == 0 { -1.0 } else { 1.0 };
        // Around a node alone the other surface is not asked.
        pair.distance == 0.0
            || (ends == 1 && side == 0)
            || around.flatten().filter(|node| !feature.contains(node)).all(|&node| {
                let steps = feature.iter().map(|&from| vec3::sub(at(node), at(from)));
                let longest = steps.clone().map(vec3::norm).fold(0.0, f64::max);
                let closer = steps.map(|step| towards * vec3::dot(step, pair.normal));
                closer.fold(0.0, f64::max) <= LOCAL_MINIMUM_SLACK * longest
            })
    })
}

/// Compares all methods; returns how many pairs were found, how many were left out, and how many
/// would have been left out as no local minima.
fn check(case: &Case, left_out: &LeftOut, distance: f64) -> [usize; 3] {
    let of =
        |method| scene(&case.meshes, SceneOptions { method, leaf_size: 3, ..Default::default() });
    let mut slow = of(Method::AllPairs);
    let mut scenes = Method::ALL.map(of);
    for scene in &mut scenes {
        left_out.apply(scene);
    }
    let at_rest = ProximityOptions { close_at_rest: false, ..ProximityOptions::default() };
    let (mut kept, mut thinned, mut not_local) = (0, 0, 0);
    for frame in &case.frames {
        slow.update(&as_slices(frame)).expect("finite positions");
        let mut pairs = slow.intersections(&SHARED).pairs.clone();
        let mut close = slow.proximity(&|_, _| Some(distance)).pairs.clone();
        thinned += pairs.len() + close.len();
        pairs.retain(|pair| left_out.keeps_triangles(pair));
        close.retain(|pair| left_out.keeps_features(&case.meshes, pair));
        let mut new = close.clone();
        new.retain(|pair| !close_at_rest(&case.meshes, pair, distance));
        let mut local = new.clone();
        local.retain(|pair| is_first(&case.meshes, pair));
        let first = local.len();
        local.retain(|pair| is_local_minimum(&case.meshes, frame, pair));
        not_local += first - local.len();
        kept += pairs.len() + close.len();
        thinned += close.len() - new.len();
        for scene in &mut scenes {
            scene.update(&as_slices(frame)).expect("finite positions");
            let name = format!("{}: {:?}", case.name, scene.options());
            assert_eq!(scene.intersections(&SHARED).pairs, pairs, "{name}");
            assert_eq!(scene.proximity(&|_, _| Some(distance)).pairs, close, "{name}");
            assert_eq!(scene.proximity_with(&|_, _| Some(distance), &at_rest).pairs, new, "{name}");
            let minima = ProximityOptions { local_minima: true, ..at_rest };
            let found = &scene.proximity_with(&|_, _| Some(distance), &minima).pairs;
            assert_eq!(*found, local, "{name}");
            let nodes = &scene.contact_nodes(&SHARED).nodes;
            assert_eq!(*nodes, contact_nodes(&case.meshes, &pairs), "{name}");
        }
    }
    [kept, thinned - kept, not_local]
}

#[test]
fn what_is_left_out_is_left_out_by_every_method() {
    let mut random = Random(31);
    let mut counts = [0; 3];
    for case in cases().iter().filter(|case| !["huge", "tiny", "far and tiny"].contains(&case.name))
    {
        for left_out in [LeftOut::default(), LeftOut::random(&case.meshes, &mut random)] {
            let found = check(case, &left_out, 0.2);
            counts = [0, 1, 2].map(|k| counts[k] + found[k]);
        }
    }
    let [kept, out, not_local] = counts;
    assert!(kept > 1000 && out > 1000 && not_local > 500, "{counts:?}");
}

#[test]
fn it_stays_left_out_while_bodies_come_and_go() {
    let mut random = Random(37);
    let meshes: Vec<_> = (0..5).map(|_| soup(12, 1.2, &mut random)).collect();
    let grouped = |mesh: &Mesh, group: u32| vec![group; mesh.triangles().len()];
    for method in Method::ALL {
        let options = SceneOptions { method, ..SceneOptions::default() };
        let mut scene = scene(&meshes[..4], options);
        let pairs_of = |scene: &mut Scene, a: u32, b: u32| {
            let pairs = &scene.intersections(&IntersectionOptions::default()).pairs;
            let among = pairs.iter().filter(|pair| [pair.body_a, pair.body_b] == [a, b]).count();
            let close = &scene.proximity(&|_, _| Some(0.1)).pairs;
            let close = close.iter().filter(|pair| pair.bodies == [a, b]).count();
            assert_eq!(among == 0, close == 0);
            among
        };
        scene.ignore(3, 1, true).expect("there are four");
        scene.ignore(2, 2, true).expect("there are four");
        scene.set_groups(0, &grouped(&meshes[0], 7)).expect("one each");
        scene.set_groups(3, &grouped(&meshes[3], 7)).expect("one each");
        for (a, b, found) in
            [(1, 3, false), (2, 2, false), (0, 3, false), (0, 0, false), (1, 2, true)]
        {
            assert_eq!(pairs_of(&mut scene, a, b) > 0, found, "{method:?}: {a}, {b}");
        }
        assert!(scene.is_ignored(1, 3) && scene.is_ignored(3, 1) && !scene.is_ignored(1, 2));
        scene.remove(0).expect("there are four");
        for (a, b, found) in
            [(0, 2, false), (1, 1, false), (0, 1, true), (1, 2, true), (2, 2, false)]
        {
            assert_eq!(pairs_of(&mut scene, a, b) > 0, found, "{method:?}: {a}, {b}");
        }
        scene.replace(2, meshes[4].clone()).expect("there are three");
        scene.ignore(1, 1, false).expect("there are three");
        for (a, b, found) in [(0, 2, false), (1, 1, true), (2, 2, true)] {
            assert_eq!(pairs_of(&mut scene, a, b) > 0, found, "{method:?}: {a}, {b}");
        }
        assert_eq!(scene.add(meshes[0].clone()), 3);
        assert!(pairs_of(&mut scene, 0, 3) > 0 && pairs_of(&mut scene, 3, 3) > 0);
    }
}

#[test]
fn a_sheet_at_rest_is_close_to_itself_and_folded_it_is_new() {
    let flat = sheet(6, 2, |p| p);
    for method in Method::ALL {
        let mut scene =
            scene(std::slice::from_ref(&flat), SceneOptions { method, ..Default::default() });
        let new = ProximityOptions { close_at_rest: false, ..ProximityOptions::default() };
        let distance = |_: usize, _: usize| Some(1.1);
        let all = scene.proximity(&distance).pairs.len();
        assert!(scene.proximity_with(&distance, &new).pairs.is_empty());
        let folded: Vec<_> = flat
            .nodes()
            .iter()
            .map(|&[x, y, z]| if x > 3.0 { [6.0 - x, y, 0.5] } else { [x, y, z] })
            .collect();
        scene.update(&[&folded]).expect("finite positions");
        let between_layers = scene.proximity_with(&distance, &new).pairs.len();
        assert!(all > 0 && between_layers > 0);
        assert!(scene.proximity(&distance).pairs.len() > between_layers);
    }
}

#[test]
fn wrong_arguments_are_named() {
    let mut scene = scene(&[block([1, 1, 1], |p| p)], SceneOptions::default());
    let out_of_range = SceneError::BodyOutOfRange { body: 1, count: 1 };
    assert_eq!(scene.ignore(0, 1, true), Err(out_of_range.clone()));
    assert_eq!(scene.ignore(1, 0, true), Err(out_of_range.clone()));
    assert_eq!(scene.set_groups(1, &[]), Err(out_of_range));
    let error = scene.set_groups(0, &[1, 2]).expect_err("there are twelve");
    assert_eq!(error, SceneError::GroupCount { body: 0, given: 2, expected: 12 });
    assert!(error.to_string().contains("one for each surface triangle of body 0"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_scenes(seed: u64, digits in 0_i32..6) {
        let mut random = Random(seed);
        let at = random.vector(2.0);
        let meshes = vec![
            soup(6, 1.2, &mut random),
            jittered([2, 2, 2], at, 0.2, &mut random),
            horseshoe(6, 1, [0.0; 3]),
        ];
        let left_out = LeftOut::random(&meshes, &mut random);
        let case = deforming(meshes, 1, &mut random).and(rounded(digits));
        check(&case, &left_out, 0.3);
    }
}
