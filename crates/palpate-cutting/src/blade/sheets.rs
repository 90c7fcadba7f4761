//! A surface taken apart into sheets whose triangles agree on which side is which.

use std::collections::BTreeMap;

use palpate_geometry::{Point, vec3};

use super::BladeError;

/// Neighbours whose normals are further apart than this cosine (135°) are folded back: each part is
/// a sheet of its own, as "which side" means nothing close to such a fold.
const FOLD: f64 = -0.7;

/// Points at the same place made one, with the triangles that use them.
pub(super) fn merged(points: &[Point], triangles: &[[u32; 3]]) -> (Vec<Point>, Vec<[u32; 3]>) {
    let mut index: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    let mut unique = Vec::new();
    let mut new_index = |point: u32| {
        // Adding zero makes -0 and 0 the same bits.
        let position = points[point as usize].map(|value| value + 0.0);
        *index.entry(position.map(f64::to_bits)).or_insert_with(|| {
            unique.push(position);
            unique.len() as u32 - 1
        })
    };
    let triangles = triangles.iter().map(|corners| corners.map(&mut new_index)).collect();
    (unique, triangles)
}

/// The sheets, each with its triangles turned to agree.
pub(super) fn oriented(
    points: &[Point],
    triangles: &[[u32; 3]],
) -> Result<Vec<Vec<[u32; 3]>>, BladeError> {
    // Each edge with its triangles, and whether they pass it from the smaller to the larger point.
    let mut users: BTreeMap<[u32; 2], Vec<(usize, bool)>> = BTreeMap::new();
    for (triangle, &[a, b, c]) in triangles.iter().enumerate() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let users = users.entry([from.min(to), from.max(to)]).or_default();
            users.push((triangle, from < to));
        }
    }
    let normal = |triangle: usize| {
        let [a, b, c] = triangles[triangle].map(|point| points[point as usize]);
        let [u, v] = [vec3::sub(b, a), vec3::sub(c, a)];
        let size = vec3::max_abs(u).max(vec3::max_abs(v));
        let normal = vec3::cross(u.map(|value| value / size), v.map(|value| value / size));
        vec3::normalized(normal).unwrap_or([0.0; 3])
    };
    // For each triangle its neighbours, and whether they must be turned over to agree.
    let mut neighbors: Vec<Vec<(usize, bool)>> = vec![Vec::new(); triangles.len()];
    for pair in users.values() {
        let &[(left, left_way), (right, right_way)] = pair.as_slice() else {
            continue;
        };
        let turned = left_way == right_way;
        let cosine = vec3::dot(normal(left), normal(right)) * if turned { -1.0 } else { 1.0 };
        if cosine >= FOLD {
            neighbors[left].push((right, turned));
            neighbors[right].push((left, turned));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut sheets = Vec::new();
    for first in 0..triangles.len() {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some(false);
        let mut sheet = vec![first];
        let mut next = 0;
        while let Some(&triangle) = sheet.get(next) {
            next += 1;
            for &(neighbor, differs) in &neighbors[triangle] {
                let wanted = turned[triangle] == Some(!differs);
                match turned[neighbor] {
                    None => {
                        turned[neighbor] = Some(wanted);
                        sheet.push(neighbor);
                    }
                    Some(found) if found != wanted => {
                        return Err(BladeError::OneSided { triangle: neighbor });
                    }
                    Some(_) => {}
                }
            }
        }
        sheet.sort_unstable();
        let corners = |&triangle: &usize| {
            let [a, b, c] = triangles[triangle];
            if turned[triangle] == Some(true) { [a, c, b] } else { [a, b, c] }
        };
        sheets.push(sheet.iter().map(corners).collect());
    }
    Ok(sheets)
}
