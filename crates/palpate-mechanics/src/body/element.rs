//! The linear tetrahedron: volume, shape gradients, stiffness.

use glam::{DMat3, DVec3};
use palpate_model::Material;

/// A tetrahedron's volume [m³] and the gradients of its four shape functions [1/m].
pub(super) fn shape_gradients(corners: [DVec3; 4]) -> (f64, [DVec3; 4]) {
    let [a, b, c, d] = corners;
    let edges = DMat3::from_cols(b - a, c - a, d - a);
    let determinant = edges.determinant();
    let inverse = edges.inverse().transpose();
    let (gb, gc, gd) = (inverse.x_axis, inverse.y_axis, inverse.z_axis);
    (determinant / 6.0, [-(gb + gc + gd), gb, gc, gd])
}

/// Lamé's parameters lambda and mu [Pa].
pub(super) fn lame_parameters(material: &Material) -> (f64, f64) {
    let (young, poisson) = (material.young, material.poisson);
    let mu = young / (2.0 * (1.0 + poisson));
    (young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), mu)
}

/// Stiffness [N/m] between the nodes with shape gradients `gi` and `gj`:
/// V (lambda gi gj^T + mu gj gi^T + mu (gi . gj) I), row by row.
pub(super) fn stiffness_block(
    volume: f64,
    (lambda, mu): (f64, f64),
    gi: DVec3,
    gj: DVec3,
) -> [[f64; 3]; 3] {
    let (gi, gj, dot) = (gi.to_array(), gj.to_array(), gi.dot(gj));
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let diagonal = if r == c { mu * dot } else { 0.0 };
            volume * (lambda * gi[r] * gj[c] + mu * gj[r] * gi[c] + diagonal)
        })
    })
}
