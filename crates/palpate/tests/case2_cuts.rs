//! A hundred cuts through the organs of case 2: after every one the trees are whole and find what new ones
//! find, and time and again all is compared with loops over all pairs of elements.

use std::path::Path;
use std::sync::Arc;

use palpate::contact::{IntersectionOptions, PairKind, Penetration, Proximity, TrianglePair};
use palpate::geometry::{
    Aabb, Point, edge_edge, point_triangle, predicates, triangles_intersect, vec3,
};
use palpate::{
    Blade, CutOptions, Mesh, ReadOptions, Scene, SceneCuts, SceneOptions, Simulation,
    SimulationOptions, load_model,
};
use palpate_testing::Random;

/// [m]
const CLOSE: f64 = 0.0001;

const EVERY: IntersectionOptions =
    IntersectionOptions { self_contact: true, same_leaf: true, shared_nodes: false };

/// After so many cuts the loops are run; `PALPATE_CUTS=1` after every one.
fn compared_every() -> usize {
    std::env::var("PALPATE_CUTS").map_or(20, |text| text.parse().expect("a number"))
}

/// A square of some centimetres, or a stroke that goes on from one place to the next.
fn blade(at: Point, random: &mut Random) -> Blade {
    let down = random.vector(0.015);
    if random.below(2) == 0 {
        return Blade::plane(at, down, Some(0.01 * (1 + random.below(3)) as f64)).unwrap();
    }
    let along = random.vector(0.006);
    let edge = |step: f64| {
        let heel = [0, 1, 2].map(|k| at[k] + step * along[k] - down[k]);
        [heel, [0, 1, 2].map(|k| heel[k] + 2.0 * down[k])]
    };
    Blade::stroke(&[edge(-1.0), edge(0.0), edge(1.0)]).unwrap()
}

/// Surface nodes moved along their normals, by a part of the smallest height of a tetrahedron around each:
/// below a half, none turns over. Outwards, the lips of cuts pass each other; inwards, they gape.
fn swollen(mesh: &Mesh, positions: &[Point], part: f64) -> Vec<Point> {
    let mut heights = vec![f64::INFINITY; positions.len()];
    for nodes in mesh.tetrahedra() {
        let corners = nodes.map(|node| positions[node as usize]);
        let [a, b, c, d] = corners;
        let volume = vec3::dot(vec3::sub(b, a), vec3::cross(vec3::sub(c, a), vec3::sub(d, a)));
        let faces = [[a, b, c], [a, b, d], [a, c, d], [b, c, d]];
        let largest = faces.map(|face| vec3::norm(normal(&face))).into_iter().fold(0.0, f64::max);
        for &node in nodes {
            heights[node as usize] = heights[node as usize].min(volume / largest);
        }
    }
    if mesh.is_surface_only() {
        return positions.to_vec();
    }
    let mut normals = vec![[0.0; 3]; positions.len()];
    for nodes in mesh.triangles() {
        let out = normal(&nodes.map(|node| positions[node as usize]));
        for &node in nodes {
            normals[node as usize] = vec3::add(normals[node as usize], out);
        }
    }
    let moved = |node: usize| {
        let out = vec3::normalized(normals[node]).unwrap_or_default();
        vec3::add_scaled(positions[node], out, part * heights[node])
    };
    (0..positions.len()).map(moved).collect()
}

fn normal([a, b, c]: &[Point; 3]) -> Point {
    vec3::cross(vec3::sub(*b, *a), vec3::sub(*c, *a))
}

/// The elements of a body where they are.
struct Elements {
    mesh: Arc<Mesh>,
    nodes: Vec<u32>,
    points: Vec<Point>,
    edges: Vec<[Point; 2]>,
    triangles: Vec<[Point; 3]>,
    tetrahedra: Vec<[Point; 4]>,
}

impl Elements {
    fn of(scene: &Scene, body: usize) -> Self {
        let (mesh, positions) = (Arc::clone(scene.mesh(body)), scene.positions(body));
        let at = |node: u32| positions[node as usize];
        let nodes = mesh.surface_nodes().to_vec();
        Self {
            points: nodes.iter().map(|&node| at(node)).collect(),
            edges: mesh.surface_edges().iter().map(|nodes| nodes.map(at)).collect(),
            triangles: mesh.triangles().iter().map(|nodes| nodes.map(at)).collect(),
            tetrahedra: mesh.tetrahedra().iter().map(|nodes| nodes.map(at)).collect(),
            nodes,
            mesh,
        }
    }
}

/// Every pair of elements whose boxes are no further apart than `distance`.
fn for_boxes<const N: usize, const M: usize>(
    a: &[[Point; N]],
    b: &[[Point; M]],
    distance: f64,
    mut visit: impl FnMut(usize, usize),
) {
    let boxes: Vec<Aabb> = b.iter().map(Aabb::from_points).collect();
    // Those of b by where they begin along x: only some of them reach a box of a.
    let mut order: Vec<usize> = (0..b.len()).collect();
    order.sort_by(|&i, &j| boxes[i].min[0].total_cmp(&boxes[j].min[0]));
    let widest = boxes.iter().map(|each| each.max[0] - each.min[0]).fold(0.0, f64::max);
    let reach = distance * (1.0 + 1e-6);
    for (i, corners) in a.iter().enumerate() {
        let mut near = Aabb::from_points(corners);
        near.min = near.min.map(|value| value - reach);
        near.max = near.max.map(|value| value + reach);
        let first = order.partition_point(|&j| boxes[j].min[0] < near.min[0] - 1.001 * widest);
        for &j in order[first..].iter().take_while(|&&j| boxes[j].min[0] <= near.max[0]) {
            let meet = |axis: usize| {
                boxes[j].min[axis] <= near.max[axis] && near.min[axis] <= boxes[j].max[axis]
            };
            if (0..3).all(meet) {
                visit(i, j);
            }
        }
    }
}

fn share<const N: usize, const M: usize>(a: &[u32; N], b: &[u32; M]) -> bool {
    a.iter().any(|node| b.contains(node))
}

/// Kind, bodies and elements of a close pair, and the bits of its distance.
type Close = (PairKind, [u32; 2], [u32; 2], u64);

/// What loops over all pairs of elements find.
#[derive(Default)]
struct Expected {
    meeting: Vec<TrianglePair>,
    close: Vec<Close>,
    /// Body, node and the body that it is inside of, which may be its own.
    inside: Vec<(u32, u32, u32)>,
}

impl Expected {
    fn of(scene: &Scene) -> Self {
        let bodies: Vec<Elements> =
            (0..scene.body_count()).map(|body| Elements::of(scene, body)).collect();
        let mut expected = Self::default();
        for (a, of_a) in bodies.iter().enumerate() {
            for (b, of_b) in bodies.iter().enumerate() {
                if a <= b {
                    expected.meeting([a, b], of_a, of_b);
                    expected.close_edges([a, b], of_a, of_b);
                }
                expected.close_nodes([a, b], of_a, of_b);
                expected.inside([a, b], of_a, of_b);
            }
        }
        expected.meeting.sort_unstable();
        expected
            .close
            .sort_unstable_by_key(|&(kind, bodies, elements, _)| (kind, bodies, elements));
        expected.inside.sort_unstable_by_key(|&(body, node, into)| (body, node, into));
        expected
    }

    fn meeting(&mut self, bodies: [usize; 2], a: &Elements, b: &Elements) {
        let [body_a, body_b] = bodies.map(|body| body as u32);
        let nodes = [a.mesh.triangles(), b.mesh.triangles()];
        for_boxes(&a.triangles, &b.triangles, 0.0, |i, j| {
            let wanted = body_a != body_b || (i < j && !share(&nodes[0][i], &nodes[1][j]));
            if wanted && triangles_intersect(&a.triangles[i], &b.triangles[j]) {
                let [triangle_a, triangle_b] = [i as u32, j as u32];
                self.meeting.push(TrianglePair { body_a, triangle_a, body_b, triangle_b });
            }
        });
    }

    fn close_edges(&mut self, bodies: [usize; 2], a: &Elements, b: &Elements) {
        let nodes = [a.mesh.surface_edges(), b.mesh.surface_edges()];
        for_boxes(&a.edges, &b.edges, CLOSE, |i, j| {
            if bodies[0] != bodies[1] || (i < j && !share(&nodes[0][i], &nodes[1][j])) {
                let found = edge_edge(&a.edges[i], &b.edges[j]).distance_squared;
                self.close(PairKind::EdgeEdge, bodies, [i as u32, j as u32], found);
            }
        });
    }

    fn close_nodes(&mut self, bodies: [usize; 2], a: &Elements, b: &Elements) {
        let points: Vec<[Point; 1]> = a.points.iter().map(|&point| [point]).collect();
        for_boxes(&points, &b.triangles, CLOSE, |i, j| {
            let node = a.nodes[i];
            if bodies[0] != bodies[1] || !b.mesh.triangles()[j].contains(&node) {
                let found = point_triangle(a.points[i], &b.triangles[j]).distance_squared;
                self.close(PairKind::VertexTriangle, bodies, [node, j as u32], found);
            }
        });
    }

    fn close(&mut self, kind: PairKind, bodies: [usize; 2], elements: [u32; 2], squared: f64) {
        let distance = squared.sqrt();
        if distance < CLOSE {
            let bodies = bodies.map(|body| body as u32);
            self.close.push((kind, bodies, elements, distance.to_bits()));
        }
    }

    /// Nodes of a in tetrahedra of b, but for those on its surface; their own do not count.
    fn inside(&mut self, [body_a, body_b]: [usize; 2], a: &Elements, b: &Elements) {
        let own = |nodes: &[u32], node: u32| body_a == body_b && nodes.contains(&node);
        let points: Vec<[Point; 1]> = a.points.iter().map(|&point| [point]).collect();
        let (mut covered, mut touches) = (vec![false; points.len()], vec![false; points.len()]);
        for_boxes(&points, &b.tetrahedra, 0.0, |i, j| {
            if !own(&b.mesh.tetrahedra()[j], a.nodes[i]) && holds(&b.tetrahedra[j], a.points[i]) {
                covered[i] = true;
            }
        });
        for_boxes(&points, &b.triangles, 0.0, |i, j| {
            if !own(&b.mesh.triangles()[j], a.nodes[i])
                && triangles_intersect(&[a.points[i]; 3], &b.triangles[j])
            {
                touches[i] = true;
            }
        });
        for (i, &node) in a.nodes.iter().enumerate() {
            if covered[i] && !touches[i] {
                self.inside.push((body_a as u32, node, body_b as u32));
            }
        }
    }
}

/// Whether a tetrahedron, closed, holds a point.
fn holds(&[a, b, c, d]: &[Point; 4], point: Point) -> bool {
    assert!(predicates::orient3d(a, b, c, d) > 0, "no tetrahedron is turned over");
    let faces = [[a, c, b], [a, b, d], [a, d, c], [b, c, d]];
    faces.iter().all(|&[a, b, c]| predicates::orient3d(a, b, c, point) <= 0)
}

/// What a scene finds.
fn found(scene: &mut Scene) -> (Vec<TrianglePair>, Proximity, Penetration) {
    let meeting = scene.intersections(&EVERY).pairs.clone();
    let close = scene.proximity(&|_, _| Some(CLOSE)).clone();
    (meeting, close, scene.penetration(&|_, _| true).clone())
}

/// Compares a scene with a new one of the same bodies, and with the loops if `thoroughly`; how many pairs
/// meet, are close, how many nodes are inside others and their own body.
fn compare(scene: &mut Scene, thoroughly: bool, name: &str) -> [usize; 4] {
    let bodies = 0..scene.body_count();
    for body in bodies.clone() {
        let valid = scene.tree(body).validate(scene.mesh(body), scene.positions(body));
        assert_eq!(valid, Ok(()), "{name}: body {body}");
    }
    let meshes = bodies.clone().map(|body| Arc::clone(scene.mesh(body))).collect();
    let mut fresh = Scene::new(meshes, None, SceneOptions::default()).unwrap();
    let positions: Vec<&[Point]> = bodies.map(|body| scene.positions(body)).collect();
    fresh.update(&positions).unwrap();
    let (meeting, close, inside) = found(scene);
    let (meeting_fresh, close_fresh, inside_fresh) = found(&mut fresh);
    assert!(meeting == meeting_fresh, "{name}: pairs that meet");
    assert!(close.pairs == close_fresh.pairs, "{name}: close pairs");
    assert!(inside.nodes == inside_fresh.nodes, "{name}: nodes inside");
    if thoroughly {
        let expected = Expected::of(scene);
        assert!(meeting == expected.meeting, "{name}: pairs that meet, against the loops");
        let keys = close.pairs.iter();
        let keys =
            keys.map(|pair| (pair.kind, pair.bodies, pair.elements, pair.distance.to_bits()));
        assert!(keys.eq(expected.close), "{name}: close pairs, against the loops");
        // Nodes inside their own body are looked for where its triangles meet; the tray is a surface.
        let folded = |body: u32| meeting.iter().any(|pair| [pair.body_a, pair.body_b] == [body; 2]);
        let keys = inside.nodes.iter().map(|node| (node.body, node.node, node.into_body));
        let looked_for = |&(body, _, into): &(u32, u32, u32)| {
            let solid = !scene.mesh(into as usize).is_surface_only();
            solid && (body != into || folded(body))
        };
        let expected: Vec<_> = expected.inside.into_iter().filter(looked_for).collect();
        let keys: Vec<_> = keys.filter(looked_for).collect();
        assert!(keys == expected, "{name}: nodes inside, against the loops");
    }
    let own = inside.nodes.iter().filter(|node| node.body == node.into_body).count();
    [meeting.len(), close.pairs.len(), inside.nodes.len() - own, own]
}

#[test]
fn after_a_hundred_cuts_of_case_2_the_pairs_are_those_of_the_double_loop() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/case2.bml");
    let model = load_model(&path, &ReadOptions::default()).unwrap();
    let soft: Vec<usize> = (0..5).filter(|&body| model.bodies[body].rigid.is_none()).collect();
    let mut simulation = Simulation::new(model, SimulationOptions::default()).unwrap();
    for _ in 0..90 {
        simulation.step().unwrap();
    }
    // From here on without mechanics: the lips of every cut are to pass each other, coincide and gape.
    let meshes = simulation.model().bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
    let mut rest: Vec<Vec<Point>> =
        (0..5).map(|body| simulation.positions(body).to_vec()).collect();
    let mut scene = Scene::new(meshes, None, SceneOptions::default()).unwrap();
    let (mut random, mut cuts) = (Random(4), SceneCuts::default());
    let (mut changed, mut sums) = (0, [0; 4]);
    let every = compared_every();
    for cut in 0..100 {
        // Not in time with the loops, so that they meet all of these.
        let part = [-0.2, -0.3, 0.3, -0.1, 0.02, 0.0, -0.05][cut % 7];
        let moved: Vec<Vec<Point>> =
            (0..5).map(|body| swollen(scene.mesh(body), &rest[body], part)).collect();
        scene.update(&moved.iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
        let body = soft[random.below(soft.len())];
        let at = scene.positions(body)[random.below(scene.positions(body).len())];
        let blade = blade(at, &mut random);
        let found = cuts.cut(&mut scene, &soft, &blade, &CutOptions::default()).unwrap();
        changed += found.len();
        for (body, found) in found {
            rest[body] = found.change.positions(&rest[body]);
        }
        let here = compare(&mut scene, cut % every == every - 1, &format!("cut {cut}"));
        sums = [0, 1, 2, 3].map(|kind| sums[kind] + here[kind]);
    }
    assert!(changed > 80, "{changed}");
    assert!(sums.iter().all(|&sum| sum > 1000), "{sums:?}");
}
