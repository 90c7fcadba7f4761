//! The matrix of an organ, and medians.

use std::sync::Arc;
use std::time::Instant;

use palpate_solver::{BlockMatrix, BlockPattern};

/// Median times of some kinds of work, by turns [ms].
pub(crate) fn times<const N: usize>(rounds: usize, mut work: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut times: [Vec<f64>; N] = std::array::from_fn(|_| Vec::new());
    for _ in 0..rounds {
        for (work, times) in work.iter_mut().zip(&mut times) {
            let start = Instant::now();
            work();
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}

/// M/dt² + K of an organ of 5 kPa, nu = 0.45, at 60 steps/s.
pub(crate) fn system(nodes: &[[f64; 3]], tetrahedra: &[[u32; 4]]) -> BlockMatrix {
    let (mu, lambda, density, rate) = (1724.0, 15_517.0, 1000.0, 60.0_f64);
    let mut matrix =
        BlockMatrix::zeros(Arc::new(BlockPattern::from_cliques(nodes.len(), tetrahedra)));
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for corners in tetrahedra {
        let [o, a, b, c] = corners.map(|node| nodes[node as usize]);
        let (a, b, c) = (sub(a, o), sub(b, o), sub(c, o));
        let six_volumes = dot(a, cross(b, c));
        let volume = six_volumes / 6.0;
        let inner = [cross(b, c), cross(c, a), cross(a, b)].map(|g| g.map(|x| x / six_volumes));
        let first = std::array::from_fn(|k| -inner.iter().map(|g| g[k]).sum::<f64>());
        let gradients = [first, inner[0], inner[1], inner[2]];
        for (&row, gi) in corners.iter().zip(gradients) {
            for (&col, gj) in corners.iter().zip(gradients) {
                if col > row {
                    continue;
                }
                let inertia = if row == col { 0.25 * density * volume * rate * rate } else { 0.0 };
                let block = std::array::from_fn(|r| {
                    std::array::from_fn(|c| {
                        let same = f64::from(u8::from(r == c));
                        let shear = mu * (gj[r] * gi[c] + same * dot(gi, gj));
                        volume * (lambda * gi[r] * gj[c] + shear) + same * inertia
                    })
                });
                matrix.add(row, col, &block);
            }
        }
    }
    matrix
}
