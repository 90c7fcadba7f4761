//! Boxes of cells.

/// Along which axis the numbers of neighbouring nodes differ by one; tetrahedra come in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fastest {
    /// Along the first axis.
    First,
    /// Along the last axis.
    Last,
}

impl Fastest {
    /// The `index`th of `count` places along each axis.
    fn place(self, index: usize, count: [usize; 3]) -> [usize; 3] {
        let [nx, ny, nz] = count;
        match self {
            Self::First => [index % nx, index / nx % ny, index / (nx * ny)],
            Self::Last => [index / (ny * nz), index / nz % ny, index % nz],
        }
    }

    fn number(self, [i, j, k]: [usize; 3], [nx, ny, nz]: [usize; 3]) -> u32 {
        match self {
            Self::First => (i + nx * (j + ny * k)) as u32,
            Self::Last => ((i * ny + j) * nz + k) as u32,
        }
    }
}

/// Nodes and tetrahedra of a box of `cells` along each axis, six tetrahedra each around the diagonal from the
/// lowest corner to the highest, all of positive volume; `place` says where the node at (i, j, k) cells from the
/// corner is, and is asked in the order of the nodes.
pub fn box_of_cells(
    cells: [usize; 3],
    fastest: Fastest,
    mut place: impl FnMut([f64; 3]) -> [f64; 3],
) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let count = cells.map(|cells| cells + 1);
    let nodes = (0..count.iter().product())
        .map(|node| place(fastest.place(node, count).map(|index| index as f64)))
        .collect();
    let mut tetrahedra = Vec::with_capacity(6 * cells.iter().product::<usize>());
    for cell in 0..cells.iter().product() {
        let lowest = fastest.place(cell, cells);
        let corner = |bits: usize| {
            let at = std::array::from_fn(|axis| lowest[axis] + (bits >> axis & 1));
            fastest.number(at, count)
        };
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            tetrahedra.push([0, a, b, 7].map(corner));
        }
    }
    (nodes, tetrahedra)
}

/// Nodes and triangles of a rectangle of two triangles at height `z`, facing up.
pub fn rectangle(low: [f64; 2], high: [f64; 2], z: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let ([x0, y0], [x1, y1]) = (low, high);
    let nodes = vec![[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]];
    (nodes, vec![[0, 1, 2], [0, 2, 3]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tetrahedra_fill_the_box_and_none_is_inverted() {
        for fastest in [Fastest::First, Fastest::Last] {
            let (nodes, tetrahedra) = box_of_cells([3, 1, 2], fastest, |p| p);
            assert_eq!((nodes.len(), tetrahedra.len()), (4 * 2 * 3, 6 * 3 * 2));
            for corners in tetrahedra {
                let [a, b, c, d] = corners.map(|node| nodes[node as usize]);
                let [u, v, w] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
                let volume = u[0] * (v[1] * w[2] - v[2] * w[1])
                    + u[1] * (v[2] * w[0] - v[0] * w[2])
                    + u[2] * (v[0] * w[1] - v[1] * w[0]);
                assert_eq!(volume.to_bits(), 1.0_f64.to_bits(), "six of them are a unit cell");
            }
        }
    }

    #[test]
    fn neighbours_along_the_fastest_axis_follow_each_other() {
        let (nodes, _) = box_of_cells([2, 2, 2], Fastest::First, |p| p);
        assert_eq!(nodes[1], [1.0, 0.0, 0.0]);
        let (nodes, _) = box_of_cells([2, 2, 2], Fastest::Last, |p| p);
        assert_eq!(nodes[1], [0.0, 0.0, 1.0]);
    }
}
