//! The rotating frame: the rotation that fits the body best.

use glam::{DMat3, DQuat, DVec3};

/// The rotation R that maximises tr(R^T A), the mass-weighted best fit for A = sum m x X^T.
///
/// Davenport's q-method: the eigenvector of the largest eigenvalue of a symmetric 4x4 matrix. It
/// needs no start value and never returns a reflection, so that a body turned inside out still has a
/// frame; where several rotations fit equally well, one of them is returned.
pub(super) fn best_rotation(a: DMat3) -> DMat3 {
    let largest = a.to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return DMat3::IDENTITY;
    }
    let b = a * largest.recip();
    let at = |row: usize, col: usize| b.col(col)[row];
    let z = DVec3::new(at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1));
    let trace = at(0, 0) + at(1, 1) + at(2, 2);
    let k = std::array::from_fn(|i| {
        std::array::from_fn(|j| match (i, j) {
            (3, 3) => trace,
            (3, other) | (other, 3) => z[other],
            _ => at(i, j) + at(j, i) - if i == j { trace } else { 0.0 },
        })
    });
    let [x, y, z, w] = dominant_eigenvector(k);
    DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
}

/// Unit eigenvector of the largest eigenvalue of a symmetric matrix, by cyclic Jacobi rotations.
fn dominant_eigenvector(mut k: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors = [[0.0; 4]; 4];
    for (i, row) in vectors.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..16 {
        let mut off = 0.0;
        for p in 0..3 {
            for q in p + 1..4 {
                off += k[p][q] * k[p][q];
                if k[p][q] == 0.0 {
                    continue;
                }
                let theta = (k[q][q] - k[p][p]) / (2.0 * k[p][q]);
                let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                let c = t.hypot(1.0).recip();
                let s = t * c;
                for row in &mut k {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (first, second) = (k[p], k[q]);
                k[p] = std::array::from_fn(|i| c * first[i] - s * second[i]);
                k[q] = std::array::from_fn(|i| s * first[i] + c * second[i]);
                for row in &mut vectors {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
        if off < 1e-34 {
            break;
        }
    }
    let best = (0..4).fold(0, |best, i| if k[i][i] > k[best][best] { i } else { best });
    vectors.map(|row| row[best])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotation_of_a_stretched_body_is_found() {
        for axis in [DVec3::X, DVec3::new(1.0, 2.0, -3.0).normalize(), DVec3::Z] {
            for angle in [0.0, 1e-9, 0.3, 2.0, 3.1] {
                let rotation = DMat3::from_axis_angle(axis, angle);
                let stretch = DMat3::from_cols_array(&[2., 0.1, 0.3, 0.1, 1., 0.2, 0.3, 0.2, 0.7]);
                let found = best_rotation(rotation * stretch);
                assert!(found.abs_diff_eq(rotation, 1e-14), "{found} {rotation}");
            }
        }
    }

    #[test]
    fn degenerate_and_mirrored_bodies_get_a_rotation() {
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        let line = DMat3::from_cols(DVec3::X, DVec3::ZERO, DVec3::ZERO);
        for a in [mirror, line, DMat3::ZERO, DMat3::from_diagonal(DVec3::splat(f64::NAN))] {
            let r = best_rotation(a);
            assert!((r.determinant() - 1.0).abs() < 1e-12, "{a}");
            assert!((r * r.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
        }
    }
}
