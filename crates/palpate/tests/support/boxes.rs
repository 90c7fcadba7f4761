//! Boxes of cells.

use palpate::MeshData;

/// A box of `cells` cubic cells with edge `h` [m], six tetrahedra each, every second of them inverted.
pub(crate) fn box_data(cells: [usize; 3], h: f64, origin: [f64; 3]) -> MeshData {
    let [nx, ny, nz] = cells;
    let number = |i: usize, j: usize, k: usize| ((i * (ny + 1) + j) * (nz + 1) + k) as u32;
    let mut data = MeshData::default();
    for i in 0..=nx {
        for j in 0..=ny {
            for k in 0..=nz {
                let at = [i, j, k].map(|index| index as f64 * h);
                data.nodes.push(std::array::from_fn(|axis| origin[axis] + at[axis]));
            }
        }
    }
    let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
    for i in 0..nx {
        for j in 0..ny {
            for k in 0..nz {
                let corner = |c: usize| number(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                for [a, b] in paths {
                    data.tetrahedra.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    data
}
