//! Meshes to play with.

use palpate::{Mesh, MeshData};

/// A box of cells (i, j, k) of edge `h`, six tetrahedra each; nodes of the lowest layer are the set
/// `base`, and layers along x regions 0 and 1 by turns.
pub(crate) fn box_of(cells: [usize; 3], h: f64, origin: [f64; 3]) -> Mesh {
    let [nx, ny, nz] = cells;
    let number = |i: usize, j: usize, k: usize| ((i * (ny + 1) + j) * (nz + 1) + k) as u32;
    let mut data = MeshData::default();
    for i in 0..=nx {
        for j in 0..=ny {
            for k in 0..=nz {
                let at = [i as f64 * h, j as f64 * h, k as f64 * h];
                data.nodes.push(std::array::from_fn(|axis| origin[axis] + at[axis]));
                if k == 0 {
                    data.node_sets.entry("base".into()).or_default().push(number(i, j, k));
                }
            }
        }
    }
    for i in 0..nx {
        for j in 0..ny {
            for k in 0..nz {
                let corner = |c: usize| number(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    data.tetrahedra.push([corner(0), corner(a), corner(b), corner(7)]);
                    data.regions.push((i % 2) as i32);
                }
            }
        }
    }
    Mesh::repaired(data).expect("a box is a mesh").0
}

/// A square of two triangles.
pub(crate) fn plate(size: f64, height: f64) -> Mesh {
    let [low, high] = [-size, size];
    let corners = [[low, low], [high, low], [high, high], [low, high]];
    Mesh::new(MeshData {
        nodes: corners.map(|[x, y]| [x, y, height]).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..MeshData::default()
    })
    .expect("a plate is a mesh")
}
