//! The rotation in a deformation gradient.

use glam::{DMat3, DVec3};
use proptest::prelude::*;

use super::super::polar;
use super::support::{dot, matrices, matrix, norm, rotations, rows};

fn rotation(f: DMat3) -> DMat3 {
    matrix(&polar::rotation(&rows(f)))
}

fn assert_rotation(r: DMat3) {
    assert!(norm(r.transpose() * r - DMat3::IDENTITY) < 1e-14, "not orthogonal: {r}");
    assert!((r.determinant() - 1.0).abs() < 1e-14, "not proper: {r}");
}

proptest! {
    #[test]
    fn stretches_do_not_turn(
        stretch in prop::array::uniform3(0.05..3.0_f64),
        r in rotations(),
        q in rotations(),
        inverted in any::<bool>(),
    ) {
        let mut stretch = DVec3::from_array(stretch);
        let smallest = stretch.min_element();
        if inverted {
            // The thinnest direction is the one turned inside out.
            let others = stretch.element_sum() - stretch.max_element() - smallest;
            prop_assume!(others > 1.2 * smallest);
            for k in 0..3 {
                if stretch[k] == smallest {
                    stretch[k] = -smallest;
                }
            }
        }
        let f = r * q * DMat3::from_diagonal(stretch) * q.transpose();
        let found = rotation(f);
        assert_rotation(found);
        // What 64 powers leave of the second eigenvalue of K, after a step of third order whose
        // system is nearly singular where two stretches nearly cancel.
        let length = stretch.length();
        let mut sorted = stretch.to_array();
        sorted.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
        let [a, b, c] = sorted;
        let left = ((a - b - c + 0.7 * length) / (a + b + c + 0.7 * length)).powi(3 * 64);
        let bound = 1e-12 + 20.0 * left * length / (b + c);
        let error = norm(found - r);
        prop_assert!(error < bound, "{error} above {bound}, stretch {stretch}");
    }

    #[test]
    fn no_other_rotation_is_nearer(f in matrices(1.0), others in prop::collection::vec(rotations(), 8)) {
        let found = rotation(f);
        assert_rotation(found);
        for other in others {
            prop_assert!(dot(found, f) > dot(other, f) - 1e-6 * norm(f));
        }
    }

    #[test]
    fn scale_does_not_matter(f in matrices(1.0), exponent in -100..100) {
        let scaled = rotation(10.0_f64.powi(exponent) * f);
        prop_assert!(norm(scaled - rotation(f)) < 1e-6);
    }
}

#[test]
fn flat_and_reflected_elements_have_a_rotation() {
    let diagonals = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, -1.0],
        [2.0, 1.0, -1.0],
        [1e-300, 0.0, 0.0],
    ];
    for diagonal in diagonals {
        let d = DVec3::from_array(diagonal);
        let found = rotation(DMat3::from_diagonal(d));
        assert_rotation(found);
        let best = d.abs().element_sum()
            - if d.x * d.y * d.z < 0.0 { 2.0 * d.abs().min_element() } else { 0.0 };
        let reached = dot(found, DMat3::from_diagonal(d));
        assert!((reached - best).abs() <= 1e-9 * best, "{diagonal:?}: {reached} of {best}");
    }
    assert_eq!(rotation(DMat3::ZERO), DMat3::IDENTITY);
}
