//! Where earlier cuts are.
//!
//! At rest the lips of a cut lie on each other: the copies of a node are at the same place, to the
//! bit.

use palpate_geometry::{Point, vec3};
use palpate_model::Mesh;

/// How exactly opposite the normals of two lips are at rest, where they are the same but for
/// rounding.
const CLOSED: f64 = 1.0 - 1e-9;

/// A blade goes along a lip when their normals are less than 45° apart.
const ALONG_SQUARED: f64 = 0.5;

/// The lips of earlier cuts.
#[derive(Clone)]
pub(crate) struct Wounds {
    /// By node the direction of the lip's normal, of any length and either sign; zero off the lips.
    normals: Vec<Point>,
}

impl Wounds {
    /// Finds them in a mesh whose nodes are at `positions` now; `pending` faces are cut as well.
    pub(crate) fn find(mesh: &Mesh, positions: &[Point], pending: &[[u32; 3]]) -> Self {
        let mut is_lip = copies(mesh);
        if is_lip.contains(&true) {
            add_fronts(mesh, &mut is_lip);
        }
        let mut normals = vec![[0.0; 3]; positions.len()];
        let is_in_lip = |triangle: &&[u32; 3]| triangle.iter().all(|&node| is_lip[node as usize]);
        for triangle in mesh.triangles().iter().filter(is_in_lip).chain(pending) {
            let normal = normal(&triangle.map(|node| positions[node as usize]));
            for &node in triangle {
                let sum = &mut normals[node as usize];
                // At a front both lips meet.
                let sign = if vec3::dot(*sum, normal) < 0.0 { -1.0 } else { 1.0 };
                *sum = vec3::add_scaled(*sum, normal, sign);
            }
        }
        Self { normals }
    }

    /// Whether a blade of this unit normal at a node goes along a lip there.
    pub(crate) fn is_along(&self, node: u32, blade_normal: Point) -> bool {
        self.normals.get(node as usize).is_some_and(|&normal| {
            let cosine = vec3::dot(normal, blade_normal);
            cosine * cosine > ALONG_SQUARED * vec3::norm_squared(normal)
        })
    }
}

/// Of each node whether another one has its place at rest.
fn copies(mesh: &Mesh) -> Vec<bool> {
    let place = |node: u32| mesh.nodes()[node as usize].map(f64::to_bits);
    let mut placed: Vec<_> = mesh.surface_nodes().iter().map(|&node| (place(node), node)).collect();
    placed.sort_unstable();
    let mut is_copy = vec![false; mesh.nodes().len()];
    for same in placed.chunk_by(|left, right| left.0 == right.0).filter(|same| same.len() > 1) {
        for &(_, node) in same {
            is_copy[node as usize] = true;
        }
    }
    is_copy
}

/// Adds the nodes where cuts ended: those of edges where two lips meet.
fn add_fronts(mesh: &Mesh, is_lip: &mut [bool]) {
    let normal = |triangle: u32| {
        normal(&mesh.triangles()[triangle as usize].map(|node| mesh.nodes()[node as usize]))
    };
    let mut first = vec![u32::MAX; mesh.surface_edges().len()];
    for (triangle, edges) in (0..).zip(mesh.triangle_edges()) {
        for &edge in edges {
            let other = std::mem::replace(&mut first[edge as usize], triangle);
            if other == u32::MAX {
                continue;
            }
            let [u, v] = [normal(other), normal(triangle)];
            let cosine = vec3::dot(u, v);
            let squares = vec3::norm_squared(u) * vec3::norm_squared(v);
            if cosine < 0.0 && cosine * cosine >= CLOSED * squares {
                for node in mesh.surface_edges()[edge as usize] {
                    is_lip[node as usize] = true;
                }
            }
        }
    }
}

fn normal(&[a, b, c]: &[Point; 3]) -> Point {
    vec3::cross(vec3::sub(b, a), vec3::sub(c, a))
}
