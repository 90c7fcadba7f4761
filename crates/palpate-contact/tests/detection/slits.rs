//! Nodes inside their own body at slits whose lips have passed each other: the lips are, the front is not,
//! and nothing beyond.

use std::sync::Arc;

use palpate_contact::{Method, PenetratingNode, SceneOptions};
use palpate_model::Mesh;
use proptest::prelude::*;

use crate::intersections::scene;
use crate::penetration::{check, is_solid};
use crate::scenes::{Case, Point, Positions, Random, as_slices, block, block_data, rounded};

/// A block slit at z = 1 where `open` holds, and its lips: nodes below and above.
struct Slit {
    mesh: Arc<Mesh>,
    lips: Vec<[u32; 2]>,
}

impl Slit {
    fn new(cells: [usize; 3], open: impl Fn(Point) -> bool) -> Self {
        let mut data = block_data(cells, |p| p);
        let mut lips = Vec::new();
        for node in 0..data.nodes.len() as u32 {
            let at = data.nodes[node as usize];
            if at[2] == 1.0 && open(at) {
                lips.push([node, data.nodes.len() as u32]);
                data.nodes.push(at);
            }
        }
        let copy = |node: u32| lips.iter().find(|lip| lip[0] == node).map_or(node, |lip| lip[1]);
        for nodes in &mut data.tetrahedra {
            if nodes.iter().all(|&node| data.nodes[node as usize][2] >= 1.0) {
                *nodes = nodes.map(copy);
            }
        }
        Self { mesh: Arc::new(Mesh::new(data).expect("a slit block")), lips }
    }

    /// The lips moved past each other by `depth` [m], or apart, and up to `noise` for every node.
    fn moved(&self, depth: f64, noise: f64, random: &mut Random) -> Vec<Point> {
        let mut positions = self.mesh.nodes().to_vec();
        for &[below, above] in &self.lips {
            positions[below as usize][2] += 0.5 * depth;
            positions[above as usize][2] -= 0.5 * depth;
        }
        for point in &mut positions {
            let offset = random.vector(noise);
            *point = [0, 1, 2].map(|axis| point[axis] + offset[axis]);
        }
        positions
    }

    fn case(&self, frames: Positions) -> Case {
        let mut case = Case::new("slit", vec![Arc::clone(&self.mesh)]);
        case.frames = frames.into_iter().map(|positions| vec![positions]).collect();
        case
    }
}

fn half(p: Point) -> bool {
    p[0] > 2.0
}

fn within(p: Point) -> bool {
    p[..2].iter().all(|&value| 1.0 < value && value < 4.0)
}

fn inside(meshes: &[Arc<Mesh>], positions: &Positions, method: Method) -> Vec<PenetratingNode> {
    let mut scene = scene(meshes, SceneOptions { method, ..SceneOptions::default() });
    scene.update(&as_slices(positions)).expect("finite positions");
    scene.penetration(&|a, b| a == b).nodes.clone()
}

#[test]
fn lips_that_have_passed_each_other_are_inside_and_nothing_else() {
    let mut random = Random(1);
    // Open to the side, and all within the body.
    for slit in [Slit::new([4, 2, 2], half), Slit::new([5, 5, 2], within)] {
        let (gaping, closed) = (slit.moved(-0.2, 0.0, &mut random), slit.mesh.nodes().to_vec());
        for positions in [gaping, closed] {
            let meshes = std::slice::from_ref(&slit.mesh);
            assert_eq!(inside(meshes, &vec![positions], Method::Wide), []);
        }
        // So that the rims of the lips are not exactly on the surface.
        let positions = slit.moved(0.3, 1e-3, &mut random);
        let found =
            inside(std::slice::from_ref(&slit.mesh), &vec![positions.clone()], Method::Wide);
        let is_lip = |node: u32| slit.lips.as_flattened().contains(&node);
        assert!(found.iter().all(|node| is_lip(node.node)), "{found:?}");
        let deep = slit.lips.as_flattened().iter().filter(|&&node| {
            let [x, y, _] = slit.mesh.nodes()[node as usize];
            let [width, depth, _] = slit.mesh.bounds().max;
            x < width && 0.0 < y && y < depth
        });
        for node in deep {
            let record = found.iter().find(|record| record.node == *node).expect("a lip is inside");
            assert!((record.depth - 0.3).abs() < 0.05, "{record:?}");
        }
        assert!(check(&slit.case(vec![positions]), &[true]) > 1);
    }
}

#[test]
fn what_is_found_of_a_body_does_not_depend_on_those_beside_it() {
    let mut random = Random(2);
    let slit = Slit::new([4, 2, 2], half);
    let positions = slit.moved(0.3, 0.1, &mut random);
    // Triangles meet that share the front only, which alone is no fold.
    let short = Slit::new([1, 1, 2], |p| p[0] == 1.0 && p[1] == 1.0);
    let shallow = short.moved(0.3, 1e-3, &mut random);
    let apart = block([1, 1, 1], |p| p.map(|value| value + 9.0));
    for method in [Method::Wide, Method::AllPairs] {
        let alone = |mesh: &Arc<Mesh>, positions: &Vec<Point>| {
            inside(std::slice::from_ref(mesh), &vec![positions.clone()], method)
        };
        let meshes = [Arc::clone(&short.mesh), Arc::clone(&slit.mesh), Arc::clone(&apart)];
        let together = vec![shallow.clone(), positions.clone(), apart.nodes().to_vec()];
        let mut expected = alone(&short.mesh, &shallow);
        for mut node in alone(&slit.mesh, &positions) {
            (node.body, node.into_body) = (1, 1);
            expected.push(node);
        }
        assert_eq!(inside(&meshes, &together, method), expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_slits(seed: u64, depth in -0.2_f64..0.6, noise in 0.0_f64..0.15, digits in 0_i32..8) {
        let mut random = Random(seed);
        for slit in [Slit::new([4, 2, 2], half), Slit::new([5, 5, 2], within)] {
            let exact = slit.moved(depth, noise, &mut random);
            let rounded = exact.iter().copied().map(rounded(digits)).collect();
            for positions in [exact, rounded] {
                let case = slit.case(vec![positions]);
                let mut scene = scene(&case.meshes, SceneOptions::default());
                scene.update(&as_slices(&case.frames[0])).expect("finite positions");
                if is_solid(&scene, 0) {
                    check(&case, &[true]);
                }
            }
        }
    }
}
