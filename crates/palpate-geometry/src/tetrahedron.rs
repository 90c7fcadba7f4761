//! Volume, orientation and shape of a tetrahedron.

use crate::{Point, predicates::orient3d, vec3};

/// The six edges, each followed by the two corners off it.
const EDGES: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]];

/// The four faces.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Volume [m³]: positive where corner 3 sees corners 0, 1, 2 counter-clockwise.
///
/// Rounded; the exact sign is [`orientation`].
#[inline]
pub fn signed_volume(t: &[Point; 4]) -> f64 {
    let [u, v, w] = edges_from_first(t);
    vec3::dot(vec3::cross(u, v), w) / 6.0
}

/// The exact sign of the volume: +1, 0 (coplanar corners) or -1 (inverted).
#[inline]
pub fn orientation(t: &[Point; 4]) -> i8 {
    orient3d(t[0], t[1], t[2], t[3])
}

/// Weights of the corners that sum to 1 and whose mean is `point`; negative outside.
///
/// Not finite where the volume is zero.
pub fn barycentric(point: Point, t: &[Point; 4]) -> [f64; 4] {
    let [u, v, w] = edges_from_first(t);
    let offset = vec3::sub(point, t[0]);
    let inverse = 1.0 / vec3::dot(vec3::cross(u, v), w);
    let b = vec3::dot(vec3::cross(v, w), offset) * inverse;
    let c = vec3::dot(vec3::cross(w, u), offset) * inverse;
    let d = vec3::dot(vec3::cross(u, v), offset) * inverse;
    [1.0 - b - c - d, b, c, d]
}

/// How well-shaped a tetrahedron is; its orientation does not matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TetrahedronQuality {
    /// Smallest angle between two faces [degrees]; 70.53 is regular, 0 flat.
    pub min_dihedral: f64,
    /// Largest angle between two faces [degrees]; 70.53 is regular, 180 flat.
    pub max_dihedral: f64,
    /// `3 r_in / r_out` of the inscribed and circumscribed spheres: 1 is regular, 0 flat.
    pub radius_ratio: f64,
}

/// The quality measures of a tetrahedron. All are finite; a flat one has radius ratio 0.
pub fn quality(t: &[Point; 4]) -> TetrahedronQuality {
    // Shape has no size: at unit scale, powers of the lengths neither overflow nor underflow.
    let edges = edges_from_first(t);
    let size = edges.iter().map(|&edge| vec3::max_abs(edge)).fold(0.0, f64::max);
    let factor = if size > 0.0 { size } else { 1.0 };
    let [u, v, w] = edges.map(|edge| edge.map(|value| value / factor));
    let corners = [[0.0; 3], u, v, w];
    let determinant = vec3::dot(vec3::cross(u, v), w).abs();

    let (mut min_dihedral, mut max_dihedral) = (180.0_f64, 0.0_f64);
    for [i, j, k, l] in EDGES {
        let edge = vec3::sub(corners[j], corners[i]);
        let first = vec3::cross(edge, vec3::sub(corners[k], corners[i]));
        let second = vec3::cross(edge, vec3::sub(corners[l], corners[i]));
        // |first × second| = |edge| |determinant|
        let sine = vec3::norm(edge) * determinant;
        let angle = sine.atan2(vec3::dot(first, second)).to_degrees();
        min_dihedral = min_dihedral.min(angle);
        max_dihedral = max_dihedral.max(angle);
    }
    let radius_ratio = radius_ratio_of([u, v, w]);
    TetrahedronQuality { min_dihedral, max_dihedral, radius_ratio }
}

/// `3 r_in / r_out` of the inscribed and circumscribed spheres, as [`quality`] has it.
pub fn radius_ratio(t: &[Point; 4]) -> f64 {
    let edges = edges_from_first(t);
    let size = edges.iter().map(|&edge| vec3::max_abs(edge)).fold(0.0, f64::max);
    let factor = if size > 0.0 { size } else { 1.0 };
    radius_ratio_of(edges.map(|edge| edge.map(|value| value / factor)))
}

/// The radius ratio, from edges at unit scale.
fn radius_ratio_of([u, v, w]: [Point; 3]) -> f64 {
    let determinant = vec3::dot(vec3::cross(u, v), w).abs();
    let corners = [[0.0; 3], u, v, w];
    // r_in = |det| / (2 area) and r_out = |numerator| / (2 |det|), area over all four faces.
    let mut area = 0.0;
    for [i, j, k] in FACES {
        let (e, f) = (vec3::sub(corners[j], corners[i]), vec3::sub(corners[k], corners[i]));
        area += 0.5 * vec3::norm(vec3::cross(e, f));
    }
    let numerator = [(u, v, w), (v, w, u), (w, u, v)]
        .into_iter()
        .map(|(p, q, r)| vec3::scale(vec3::cross(q, r), vec3::norm_squared(p)))
        .fold([0.0; 3], vec3::add);
    let denominator = area * vec3::norm(numerator);
    if determinant > 0.0 && denominator > 0.0 {
        (3.0 * determinant * determinant / denominator).min(1.0)
    } else {
        0.0
    }
}

fn edges_from_first(t: &[Point; 4]) -> [Point; 3] {
    [1, 2, 3].map(|corner| vec3::sub(t[corner], t[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [Point; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const REGULAR: [Point; 4] =
        [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];

    fn close(value: f64, expected: f64) -> bool {
        (value - expected).abs() <= 1e-12 * expected.abs().max(1.0)
    }

    #[test]
    fn volume_and_orientation_change_sign_together() {
        assert_eq!(signed_volume(&CORNER), 1.0 / 6.0);
        assert_eq!(orientation(&CORNER), 1);
        let [a, b, c, d] = CORNER;
        assert_eq!(signed_volume(&[b, a, c, d]), -1.0 / 6.0);
        assert_eq!(orientation(&[b, a, c, d]), -1);
        assert_eq!(orientation(&[a, b, c, [0.3, 0.3, 0.0]]), 0);
    }

    #[test]
    fn the_regular_tetrahedron_is_best_at_every_scale() {
        for factor in [1e-300, 1e-100, 1.0, 1e100, 1e300] {
            let found = quality(&REGULAR.map(|corner| vec3::scale(corner, factor)));
            let dihedral = (1.0_f64 / 3.0).acos().to_degrees();
            assert!(close(found.min_dihedral, dihedral), "{found:?}");
            assert!(close(found.max_dihedral, dihedral), "{found:?}");
            assert!(close(found.radius_ratio, 1.0), "{found:?}");
        }
    }

    #[test]
    fn the_corner_of_a_cube_has_known_angles_and_radii() {
        let found = quality(&CORNER);
        assert!(close(found.max_dihedral, 90.0));
        assert!(close(found.min_dihedral, (1.0 / 3.0_f64.sqrt()).acos().to_degrees()));
        let r_in = 1.0 / (3.0 + 3.0_f64.sqrt());
        assert!(close(found.radius_ratio, 3.0 * r_in / (0.5 * 3.0_f64.sqrt())));
    }

    #[test]
    fn flat_and_collapsed_tetrahedra_have_no_quality() {
        let flat = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let found = quality(&flat);
        assert_eq!((found.min_dihedral, found.radius_ratio), (0.0, 0.0));
        assert_eq!(found.max_dihedral, 180.0);
        assert_eq!(quality(&[[2.0; 3]; 4]).radius_ratio, 0.0);
    }

    #[test]
    fn barycentric_weights_give_the_point_back() {
        let tetrahedron = [[0.1, 0.2, 0.0], [1.3, 0.1, 0.2], [0.0, 2.0, 0.1], [0.3, 0.2, 1.7]];
        for point in [[0.3, 0.4, 0.5], [5.0, -2.0, 1.0], tetrahedron[2]] {
            let weights = barycentric(point, &tetrahedron);
            assert!(close(weights.iter().sum(), 1.0));
            for axis in 0..3 {
                let mean: f64 = (0..4).map(|i| weights[i] * tetrahedron[i][axis]).sum();
                assert!(close(mean, point[axis]), "{weights:?}");
            }
        }
    }
}
