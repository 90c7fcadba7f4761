//! Boxes hold what they stand for; both paths of every kernel give the same bits.

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::{Mesh, MeshData};
use palpate_testing::Random;

use super::adjacency::{Adjacency, bits};
use super::boxes::Block;
use super::traverse::{Overlap, Pairs, padding};
use super::{
    CrossTriangles, EdgePairs, Hierarchy, Reach, SeparateTriangles, VertexPairs, WideBody,
};
use crate::simd::Isa;

/// Numbers that round badly: neighbours of `f32` values and of the ends of its range.
fn awkward(random: &mut Random) -> f64 {
    const EDGES: [f64; 8] = [
        0.0,
        1.0,
        f32::MAX as f64,
        f32::MIN_POSITIVE as f64,
        1e-45,
        1e300,
        f64::MIN_POSITIVE,
        16_777_216.0,
    ];
    let value = match random.below(4) {
        0 => EDGES[random.below(EDGES.len())],
        1 => f64::from(random.between(-0.5, 0.5) as f32),
        2 => 10_f64.powi(random.below(80) as i32 - 40) * random.between(-0.5, 0.5),
        _ => random.between(-0.5, 0.5),
    };
    let value = if random.below(2) == 0 { value } else { -value };
    match random.below(3) {
        0 => value.next_up(),
        1 => value.next_down(),
        _ => value,
    }
}

/// A tangle of `count` triangles over few nodes.
fn tangle(count: usize, random: &mut Random) -> Arc<Mesh> {
    let node_count = 3 + count;
    let nodes =
        (0..node_count).map(|_| std::array::from_fn(|_| random.between(-0.5, 0.5))).collect();
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    while triangles.len() < count {
        let first = random.below(node_count - 2);
        let mut corners = [first, first + 1, first + 2].map(|node| node as u32);
        corners[2] = random.below(node_count) as u32;
        let new = triangles.iter().all(|other| !corners.iter().all(|node| other.contains(node)));
        if new && corners[2] != corners[0] && corners[2] != corners[1] {
            triangles.push(corners);
        }
    }
    Arc::new(Mesh::new(MeshData { nodes, triangles, ..MeshData::default() }).expect("a tangle"))
}

fn largest_coordinate(body: &WideBody) -> f32 {
    body.triangles.boxes.largest_coordinate()
}

fn bits_of(blocks: &[Block]) -> Vec<u32> {
    blocks.iter().flat_map(|b| b.min.iter().chain(&b.max).flatten().map(|v| v.to_bits())).collect()
}

fn positions(mesh: &Mesh, round: usize, random: &mut Random) -> Vec<Point> {
    let awkward_point = |random: &mut Random| std::array::from_fn(|_| awkward(random));
    match round % 3 {
        0 => mesh.nodes().to_vec(),
        1 => mesh.nodes().iter().map(|_| awkward_point(random)).collect(),
        _ => {
            let offset: Point = std::array::from_fn(|_| 1e8 * random.between(-0.5, 0.5));
            mesh.nodes().iter().map(|p| std::array::from_fn(|i| p[i] + offset[i])).collect()
        }
    }
}

#[test]
fn boxes_hold_their_triangles_and_children_at_any_scale() {
    let mut random = Random(11);
    for round in 0..300 {
        let mesh = tangle(1 + random.below(200), &mut random);
        let mut body = WideBody::pack(&mesh, mesh.nodes());
        let positions = positions(&mesh, round, &mut random);
        let origin = if round % 2 == 0 { [0.0; 3] } else { positions[0] };
        body.refit(Isa::detect(), &positions, origin);
        let mut seen = vec![0; mesh.triangles().len()];
        for slot in 0..body.triangles.corners.len() {
            let (block, lane) = (&body.triangles.boxes.level(0)[slot / 8], slot % 8);
            if slot >= body.triangles.count {
                assert!((0..3).all(|axis| block.min[axis][lane] > block.max[axis][lane]));
                continue;
            }
            let triangle = body.triangles.element(slot as u32);
            seen[triangle as usize] += 1;
            for node in mesh.triangles()[triangle as usize] {
                for axis in 0..3 {
                    // What is beyond f32 counts as its end.
                    let value = positions[node as usize][axis] - origin[axis];
                    let value = value.clamp(-f64::from(f32::MAX), f64::from(f32::MAX));
                    assert!(f64::from(block.min[axis][lane]) <= value);
                    assert!(f64::from(block.max[axis][lane]) >= value);
                }
            }
        }
        assert!(seen.iter().all(|&count| count == 1));
        for level in 0..body.triangles.boxes.depth() {
            for (index, block) in body.triangles.boxes.level(level).iter().enumerate() {
                let parent = &body.triangles.boxes.level(level + 1)[index / 8];
                for axis in 0..3 {
                    for lane in 0..8 {
                        assert!(parent.min[axis][index % 8] <= block.min[axis][lane]);
                        assert!(parent.max[axis][index % 8] >= block.max[axis][lane]);
                    }
                }
            }
        }
    }
}

#[test]
fn adjacency_is_what_the_corners_say() {
    let mut random = Random(5);
    for count in [1, 7, 8, 9, 64, 65, 150] {
        let mesh = tangle(count, &mut random);
        let body = WideBody::pack(&mesh, mesh.nodes());
        let (a, b, c) = (&body.triangles, &body.edges, &body.points);
        check_adjacency(a, a, true, &body.triangles_of_triangles);
        check_adjacency(b, b, true, &body.edges_of_edges);
        check_adjacency(c, a, false, &body.triangles_of_points);
    }
}

/// Each pair of elements shares a node, or is left to the masks of neighbouring blocks, or to the
/// traversal.
fn check_adjacency<const A: usize, const B: usize>(
    a: &Hierarchy<A>,
    b: &Hierarchy<B>,
    same: bool,
    adjacency: &Adjacency,
) {
    let pairs: Vec<[u32; 2]> = adjacency.pairs(0..adjacency.len()).collect();
    assert!(pairs.is_sorted_by_key(|pair| pair[0]));
    // From any start.
    for start in 0..pairs.len() {
        let end = pairs.len().min(start + 70);
        assert!(adjacency.pairs(start..end).eq(pairs[start..end].iter().copied()));
    }
    let mut apart = Vec::new();
    for (&[i, j], &mask) in pairs.iter().zip(&adjacency.apart) {
        assert!(!same || i <= j);
        assert_eq!(adjacency.child_pairs([i / 8, j / 8]) >> (8 * (i % 8) + j % 8) & 1, 1);
        apart.extend(bits(mask).map(|bit| [8 * i + bit as u32 / 8, 8 * j + bit as u32 % 8]));
    }
    let mut sorted = apart.clone();
    for pair in &mut sorted {
        if same {
            pair.sort_unstable();
        }
    }
    sorted.sort_unstable();
    let child_pairs = |i: usize, j: usize| adjacency.child_pairs([i as u32, j as u32]).count_ones();
    let (rows, columns) = (a.boxes.level(1).len(), b.boxes.level(1).len());
    let children: u32 = (0..rows)
        .flat_map(|i| (0..columns).map(move |j| (i, j)))
        .map(|(i, j)| child_pairs(i, j))
        .sum();
    assert_eq!(children as usize, pairs.len());
    let is_adjacent = |i: u32, j: u32| pairs.contains(&[i / 8, j / 8]);
    let (count_a, count_b) = (a.count as u32, b.count as u32);
    for i in 0..count_a {
        for j in 0..count_b {
            if same && j <= i {
                continue;
            }
            let (corners_a, corners_b) = (a.corners[i as usize], b.corners[j as usize]);
            let share = corners_a.iter().any(|node| corners_b.contains(node));
            let end = |pair: &[u32; 2]| *pair <= [i, j];
            let occurs =
                sorted.partition_point(end) - sorted.partition_point(|pair| *pair < [i, j]);
            assert_eq!(occurs, usize::from(!share && is_adjacent(i, j)));
            assert!(!share || is_adjacent(i, j));
        }
    }
    assert!(apart.iter().all(|&[i, j]| i < count_a && j < count_b));
}

#[test]
fn every_kernel_gives_the_same_bits_on_all_paths() {
    for fast in Isa::all().into_iter().flatten() {
        kernels_give_the_bits_of_plain_rust(fast);
    }
}

fn kernels_give_the_bits_of_plain_rust(fast: Isa) {
    let mut random = Random(3);
    for round in 0..60 {
        let meshes = [90, 37].map(|count| tangle(count, &mut random));
        let moved = [0, 1].map(|i| positions(&meshes[i], round, &mut random));
        let packed = |isa: Isa| -> [WideBody; 2] {
            [0, 1].map(|i| {
                let mut body = WideBody::pack(&meshes[i], meshes[i].nodes());
                body.refit(isa, &moved[i], moved[0][0]);
                body.refit_features(isa);
                body
            })
        };
        let ([a, b], [slow_a, slow_b]) = (packed(fast), packed(Isa::Scalar));
        for (body, slow) in [(&a, &slow_a), (&b, &slow_b)] {
            for (fast, slow) in [
                (&body.triangles.boxes, &slow.triangles.boxes),
                (&body.edges.boxes, &slow.edges.boxes),
                (&body.points.boxes, &slow.points.boxes),
            ] {
                for level in 0..=fast.depth() {
                    assert_eq!(bits_of(fast.level(level)), bits_of(slow.level(level)));
                }
            }
        }
        for margin in [0.0, 1e-3, 0.2, 1e300] {
            let blocks = |body: &WideBody| body.triangles.boxes.level(0).len() as u32;
            let pairs: Vec<[u32; 2]> =
                (0..blocks(&a)).flat_map(|i| (0..blocks(&b)).map(move |j| [i, j])).collect();
            let largest = largest_coordinate(&a).max(largest_coordinate(&b));
            let padding = padding(margin, largest);
            assert!(padding.is_none_or(|padding| f64::from(padding) > margin));
            let masks = |isa: Isa| {
                let mut masks = Vec::new();
                let (a, b) = (a.triangles.boxes.level(0), b.triangles.boxes.level(0));
                isa.run(Overlap {
                    a,
                    b,
                    pairs: Pairs::Listed(&pairs),
                    margin,
                    padding,
                    masks: &mut masks,
                });
                masks
            };
            assert_eq!(masks(fast), masks(Isa::Scalar));
            let reach = Reach::new(&a, &b, margin);
            let mut candidate = |ends: [usize; 2]| ends.map(|end| random.below(end) as u32);
            let triangles: Vec<_> = (0..99).map(|_| candidate([90, 37])).collect();
            let nodes: Vec<_> = (0..99).map(|_| candidate([a.nodes.len(), 37])).collect();
            let counts = [0, 1].map(|i| meshes[i].surface_edges().len());
            let edges: Vec<_> = (0..99).map(|_| candidate(counts)).collect();
            let kept = |isa: Isa, local: bool| {
                let (a, b) = (&a, &b);
                let mut lists: [Vec<[u32; 2]>; 5] = Default::default();
                let [kept, near_nodes, near_edges, crossing, open] = &mut lists;
                isa.run(CrossTriangles { a, b, reach, candidates: &triangles, crossing, open });
                isa.run(SeparateTriangles { a, b, reach, candidates: &triangles, kept });
                let kept = near_nodes;
                isa.run(VertexPairs { from: a, to: b, reach, local, candidates: &nodes, kept });
                let kept = near_edges;
                isa.run(EdgePairs { a, b, reach, local, candidates: &edges, kept });
                lists
            };
            assert_eq!(kept(fast, true), kept(Isa::Scalar, true));
            let lists = kept(fast, false);
            assert_eq!(lists, kept(Isa::Scalar, false));
            if round % 3 == 0 {
                let filtered = &lists[..3];
                let some = |list: &Vec<_>| (margin < 1.0) == (list.len() < 99);
                assert!(filtered.iter().all(some), "{margin}");
                let local = kept(fast, true);
                let fewer = (1..3).all(|list| local[list].len() < lists[list].len());
                assert!(fewer || margin < 0.1, "what is not closest is left out");
                assert!(!lists[3].is_empty() && !lists[4].is_empty());
            }
        }
    }
}

#[test]
fn what_certainly_crosses_meets() {
    let mut random = Random(19);
    let mut certain = 0;
    for round in 0..600 {
        let meshes = [60, 60].map(|count| tangle(count, &mut random));
        let moved = [0, 1].map(|i| positions(&meshes[i], round, &mut random));
        let origin = if round % 2 == 0 { [0.0; 3] } else { moved[0][0] };
        let [a, b] = [0, 1].map(|i| {
            let mut body = WideBody::pack(&meshes[i], meshes[i].nodes());
            body.refit(Isa::detect(), &moved[i], origin);
            body
        });
        let all: Vec<[u32; 2]> = (0..60).flat_map(|i| (0..60).map(move |j| [i, j])).collect();
        let reach = Reach::new(&a, &b, 0.0);
        let mut lists = [Vec::new(), Vec::new()];
        let [crossing, open] = &mut lists;
        Isa::detect().run(CrossTriangles { a: &a, b: &b, reach, candidates: &all, crossing, open });
        let [crossing, open] = lists;
        let triangle = |side: usize, element: u32| {
            meshes[side].triangles()[element as usize].map(|node| moved[side][node as usize])
        };
        for &[i, j] in &crossing {
            let (p, q) = (triangle(0, a.triangles.element(i)), triangle(1, b.triangles.element(j)));
            assert!(palpate_geometry::triangles_intersect(&p, &q), "{p:?} {q:?}");
        }
        assert_eq!(crossing.len() + open.len(), all.len());
        if round % 3 == 0 {
            let meets = |&&[i, j]: &&[u32; 2]| {
                let p = triangle(0, a.triangles.element(i));
                let q = triangle(1, b.triangles.element(j));
                palpate_geometry::triangles_intersect(&p, &q)
            };
            // Nearly all that meet in general position are certain.
            assert!(open.iter().filter(meets).count() * 50 <= crossing.len());
            certain += crossing.len();
        }
    }
    assert!(certain > 10_000);
}
