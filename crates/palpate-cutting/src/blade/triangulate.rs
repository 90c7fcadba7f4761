//! The triangles that a closed line spans.

use palpate_geometry::{Point, predicates::orient2d, vec3};

use super::BladeError;

/// Exactly whether the corners lie on a line.
pub(super) fn is_flat(corners: &[Point; 3]) -> bool {
    (0..3).all(|axis| {
        let [a, b, c] = corners.map(|point| flattened(point, axis));
        orient2d(a, b, c) == 0
    })
}

/// A point without its coordinate `axis`, seen so that right-handed stays right-handed.
pub(super) fn flattened(point: Point, axis: usize) -> [f64; 2] {
    [point[(axis + 1) % 3], point[(axis + 2) % 3]]
}

/// Triangles of the polygon `corners` (indices of `points`), by cutting off ears: what an axis
/// along which the polygon is seen largest makes of it must be simple.
pub(super) fn polygon(
    points: &[Point],
    mut corners: Vec<u32>,
    what: &'static str,
) -> Result<Vec<[u32; 3]>, BladeError> {
    // Newell's normal: twice the signed areas of the three projections.
    let first = points[corners[0] as usize];
    let mut normal = [0.0; 3];
    for (place, &corner) in corners.iter().enumerate() {
        let next = corners[(place + 1) % corners.len()];
        let [a, b] = [corner, next].map(|point| vec3::sub(points[point as usize], first));
        normal = vec3::add(normal, vec3::cross(a, b));
    }
    let largest = vec3::max_abs(normal);
    let axis = (0..3).find(|&axis| normal[axis].abs() == largest).unwrap_or(0);
    if largest <= 0.0 {
        return Err(BladeError::NoArea { what });
    }
    let flat = |corner: u32| flattened(points[corner as usize], axis);
    let turn = if normal[axis] > 0.0 { 1 } else { -1 };

    let mut triangles = Vec::with_capacity(corners.len() - 2);
    let mut start = 0;
    while corners.len() > 3 {
        let count = corners.len();
        // Going round from the last ear: the triangles of a fan would all be thin.
        let ear = (0..count).map(|step| (start + step) % count).find(|&place| {
            let [a, b, c] = [place + count - 1, place, place + 1].map(|at| corners[at % count]);
            let triangle = [flat(a), flat(b), flat(c)];
            orient2d(triangle[0], triangle[1], triangle[2]) == turn
                && corners.iter().all(|&corner| {
                    [a, b, c].contains(&corner) || !holds(&triangle, turn, flat(corner))
                })
        });
        let Some(ear) = ear else {
            // What is left has no area, or crosses itself.
            let point = corners[start % count] as usize;
            return Err(BladeError::CrossedLoop { point });
        };
        triangles.push([ear + count - 1, ear, ear + 1].map(|at| corners[at % count]));
        corners.remove(ear);
        start = ear;
    }
    let last = [corners[0], corners[1], corners[2]];
    let [a, b, c] = last.map(flat);
    if orient2d(a, b, c) == -turn {
        return Err(BladeError::CrossedLoop { point: corners[0] as usize });
    }
    triangles.push(last);
    triangles.retain(|corners| !is_flat(&corners.map(|point| points[point as usize])));
    Ok(triangles)
}

/// Whether a closed triangle of this turn holds a point.
fn holds(triangle: &[[f64; 2]; 3], turn: i8, point: [f64; 2]) -> bool {
    (0..3).all(|side| orient2d(triangle[side], triangle[(side + 1) % 3], point) != -turn)
}
