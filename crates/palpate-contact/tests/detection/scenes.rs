//! Meshes and motions that the tests share: structured blocks of tetrahedra, bent, jittered, flattened.

use std::sync::Arc;

use palpate_model::{Mesh, MeshData};
pub(crate) use palpate_testing::Random;
use palpate_testing::{Fastest, box_of_cells};

pub(crate) type Point = [f64; 3];
pub(crate) type Positions = Vec<Vec<Point>>;

/// Data of a block of unit cells from the origin, its nodes moved by `map`.
pub(crate) fn block_data(cells: [usize; 3], map: impl Fn(Point) -> Point) -> MeshData {
    let (nodes, tetrahedra) = box_of_cells(cells, Fastest::Last, map);
    MeshData { nodes, tetrahedra, ..MeshData::default() }
}

pub(crate) fn block(cells: [usize; 3], map: impl Fn(Point) -> Point) -> Arc<Mesh> {
    Arc::new(Mesh::new(block_data(cells, map)).expect("a block is a mesh"))
}

/// A block whose nodes are jittered by up to `jitter` of a cell.
pub(crate) fn jittered(
    cells: [usize; 3],
    at: Point,
    jitter: f64,
    random: &mut Random,
) -> Arc<Mesh> {
    let mut data = block_data(cells, |p| std::array::from_fn(|axis| p[axis] + at[axis]));
    for point in &mut data.nodes {
        let offset = random.vector(jitter);
        *point = std::array::from_fn(|axis| point[axis] + offset[axis]);
    }
    Arc::new(Mesh::new(data).expect("the jitter is too small to turn a tetrahedron over"))
}

/// A bar of `length` cells, bent into a half circle around `at` whose ends come close.
pub(crate) fn horseshoe(length: usize, width: usize, at: Point) -> Arc<Mesh> {
    let turn = 1.85 * std::f64::consts::PI / length as f64;
    let radius = 1.2 / turn;
    block([width, width, length], |[x, y, z]| {
        let r = radius + y;
        let angle = turn * z;
        [at[0] + x, at[1] + r * angle.cos(), at[2] + r * angle.sin()]
    })
}

/// An open sheet of triangles in the xy plane, `nx` by `ny` cells.
pub(crate) fn sheet(nx: usize, ny: usize, map: impl Fn(Point) -> Point) -> Arc<Mesh> {
    let node = |x: usize, y: usize| (x * (ny + 1) + y) as u32;
    let mut data = MeshData::default();
    for x in 0..=nx {
        for y in 0..=ny {
            data.nodes.push(map([x as f64, y as f64, 0.0]));
        }
    }
    for x in 0..nx {
        for y in 0..ny {
            let (a, b, c, d) = (node(x, y), node(x + 1, y), node(x + 1, y + 1), node(x, y + 1));
            data.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Arc::new(Mesh::new(data).expect("a sheet is a mesh"))
}

/// The surface of a mesh as a closed mesh of triangles only.
pub(crate) fn shell(mesh: &Mesh) -> Arc<Mesh> {
    let nodes = mesh.surface_nodes();
    let new_index = |node: u32| nodes.binary_search(&node).expect("a surface node") as u32;
    let data = MeshData {
        nodes: nodes.iter().map(|&node| mesh.nodes()[node as usize]).collect(),
        triangles: mesh.triangles().iter().map(|triangle| triangle.map(new_index)).collect(),
        ..MeshData::default()
    };
    Arc::new(Mesh::new(data).expect("a surface is a mesh"))
}

/// Separate tetrahedra at random places of a box of the given size, one body.
pub(crate) fn soup(count: usize, size: f64, random: &mut Random) -> Arc<Mesh> {
    let mut data = MeshData::default();
    for tetrahedron in 0..count as u32 {
        let center = random.vector(size);
        loop {
            let corners: [Point; 4] = std::array::from_fn(|_| {
                let offset = random.vector(1.0);
                std::array::from_fn(|axis| center[axis] + offset[axis])
            });
            let edge = |i: usize| -> [f64; 3] {
                std::array::from_fn(|axis| corners[i][axis] - corners[0][axis])
            };
            let [u, v, w] = [edge(1), edge(2), edge(3)];
            let volume = u[0] * (v[1] * w[2] - v[2] * w[1])
                + u[1] * (v[2] * w[0] - v[0] * w[2])
                + u[2] * (v[0] * w[1] - v[1] * w[0]);
            if volume > 0.01 {
                data.nodes.extend(corners);
                break;
            }
        }
        data.tetrahedra.push([0, 1, 2, 3].map(|corner| 4 * tetrahedron + corner));
    }
    Arc::new(Mesh::new(data).expect("separate tetrahedra are a mesh"))
}

pub(crate) fn positions(meshes: &[Arc<Mesh>]) -> Positions {
    meshes.iter().map(|mesh| mesh.nodes().to_vec()).collect()
}

/// Every position mapped.
pub(crate) fn mapped(positions: &Positions, map: impl Fn(Point) -> Point) -> Positions {
    positions.iter().map(|body| body.iter().map(|&point| map(point)).collect()).collect()
}

pub(crate) fn as_slices(positions: &Positions) -> Vec<&[Point]> {
    positions.iter().map(Vec::as_slice).collect()
}

/// A scene of a test: bodies and the frames that they go through.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) meshes: Vec<Arc<Mesh>>,
    pub(crate) frames: Vec<Positions>,
}

impl Case {
    pub(crate) fn new(name: &'static str, meshes: Vec<Arc<Mesh>>) -> Self {
        let frames = vec![positions(&meshes)];
        Self { name, meshes, frames }
    }

    /// Also the frames that `maps` make of the first.
    pub(crate) fn and(mut self, map: impl Fn(Point) -> Point) -> Self {
        self.frames.push(mapped(&self.frames[0], map));
        self
    }
}

/// Leaves coordinates so many binary digits: few make coincidences, such as coplanar and collinear corners.
pub(crate) fn rounded(digits: i32) -> impl Fn(Point) -> Point {
    let grid = 2.0_f64.powi(digits);
    move |p| p.map(|value| (value * grid).round() / grid)
}

fn shifted(by: Point) -> impl Fn(Point) -> Point {
    move |p| std::array::from_fn(|axis| p[axis] + by[axis])
}

/// Smooth waves and noise on top, ever stronger: the bodies end up through themselves.
pub(crate) fn deforming(meshes: Vec<Arc<Mesh>>, frames: usize, random: &mut Random) -> Case {
    let rest = positions(&meshes);
    let phase = random.vector(3.0);
    let mut case = Case::new("deforming", meshes);
    for frame in 1..=frames {
        let strength = 0.5 * frame as f64;
        let mut moved = mapped(&rest, |p| {
            std::array::from_fn(|axis| {
                p[axis] + strength * (0.7 * p[(axis + 1) % 3] + phase[axis]).sin()
            })
        });
        for point in moved.iter_mut().flatten() {
            let noise = random.vector(0.1 * frame as f64);
            *point = std::array::from_fn(|axis| point[axis] + noise[axis]);
        }
        case.frames.push(moved);
    }
    case
}

/// The scenes that every fast path is compared on.
pub(crate) fn cases() -> Vec<Case> {
    let mut random = Random(7);
    let cube = || block([2, 2, 2], |p| p);
    let twisted = |p: Point| {
        let (sin, cos) = (0.9 * p[2]).sin_cos();
        [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]]
    };
    let mut cases = vec![
        Case::new("single tetrahedron", vec![soup(1, 0.0, &mut random)]),
        Case::new("soup", vec![soup(40, 1.5, &mut random), soup(25, 1.5, &mut random)]),
        Case::new(
            "jittered blocks",
            vec![
                jittered([3, 3, 3], [0.0; 3], 0.15, &mut random),
                jittered([2, 4, 2], [2.3, 1.1, 0.7], 0.15, &mut random),
                jittered([2, 2, 5], [1.2, -1.3, -0.4], 0.15, &mut random),
            ],
        )
        .and(twisted),
        Case::new("coplanar faces", vec![cube(), block([2, 2, 2], shifted([2.0, 0.5, 0.0]))]),
        Case::new("touching in an edge", vec![cube(), block([2, 2, 2], shifted([2.0, 2.0, 0.0]))]),
        Case::new("touching in a node", vec![cube(), block([2, 2, 2], shifted([2.0; 3]))]),
        Case::new("twins", vec![cube(), cube()]).and(|p| [p[0], 0.0, p[2]]),
        Case::new(
            "nested against a face",
            vec![block([4, 4, 4], |p| p), block([2, 2, 2], shifted([0.0, 1.0, 1.0]))],
        ),
        Case::new(
            "nested apart",
            vec![block([5, 5, 5], |p| p), block([1, 1, 1], shifted([2.1, 1.9, 2.2]))],
        ),
        Case::new(
            "slivers",
            vec![
                block([6, 1, 6], |p| [p[0], 1e-7 * p[1] + 1e-3 * p[0], p[2]]),
                block([1, 6, 6], |p| [2.5 + 1e-9 * p[0], p[1] - 3.0, p[2] + 0.3]),
            ],
        ),
        Case::new("flattened", vec![horseshoe(8, 2, [0.0; 3]), cube()])
            .and(|p| [p[0], p[1], 0.0])
            .and(|p| [0.0, p[1], 0.0])
            .and(|_| [1.0, 2.0, 3.0]),
        Case::new(
            "triangles only",
            vec![
                sheet(5, 5, |p| [p[0], p[1], 0.4 * (p[0] + p[1]).sin()]),
                shell(&block([2, 2, 2], shifted([1.3, 1.2, -0.9]))),
                sheet(4, 4, |p| [p[0], 2.0, p[1] - 1.0]),
            ],
        ),
    ];
    let pair = || vec![cube(), block([3, 2, 2], shifted([1.25, 0.75, 0.5]))];
    for (name, scale, origin) in
        [("tiny", 1e-9, 0.0), ("huge", 1e9, 0.0), ("far", 1.0, 1e8), ("far and tiny", 1e-3, 1e8)]
    {
        let map = move |p: Point| p.map(|value| origin + scale * value);
        cases.push(Case { name, ..Case::new(name, pair()).and(map) });
    }
    let soft = vec![
        horseshoe(9, 2, [0.0; 3]),
        jittered([3, 2, 3], [0.5, 1.0, 1.0], 0.1, &mut random),
        block([2, 5, 1], shifted([-1.0, -2.0, 0.5])),
    ];
    cases.push(deforming(soft, 3, &mut random));
    cases
}
