//! Which tetrahedra a sheet passes through, on which side their nodes are, which edges it crosses.

use palpate_geometry::{
    Aabb, Point, intersection::segment_triangle_intersect, predicates::orient2d,
    predicates::orient3d, predicates::orient3d_each, vec3,
};
use palpate_model::TETRAHEDRON_FACES;

use crate::blade::{Sheet, Side};
use crate::draft::Draft;

/// Where a sheet meets a mesh.
pub(crate) struct Crossing {
    /// Tetrahedra with a point of the sheet strictly inside, in rising order.
    pub(crate) touched: Vec<u32>,
    /// Faces that lie in the sheet, at least in part: sorted nodes, sorted, each once.
    pub(crate) covered: Vec<[u32; 3]>,
}

impl Crossing {
    /// Finds them among all tetrahedra of `draft`.
    pub(crate) fn find(draft: &Draft, sheet: &Sheet) -> Self {
        let (mut touched, mut covered) = (Vec::new(), Vec::new());
        for tetrahedron in 0..draft.tetrahedra.len() as u32 {
            let corners = draft.corners(tetrahedron);
            let bounds = Aabb::from_points(&corners);
            if !bounds.intersects(sheet.bounds()) {
                continue;
            }
            let mut is_touched = false;
            sheet.for_each_near(&bounds, |triangle| {
                if is_touched {
                    return;
                }
                match meeting(&corners, sheet.corners(triangle), sheet.normal(triangle)) {
                    Meeting::None => {}
                    Meeting::Inside => is_touched = true,
                    Meeting::Face(face) => {
                        let nodes = draft.tetrahedra[tetrahedron as usize];
                        let mut key = TETRAHEDRON_FACES[face].map(|corner| nodes[corner]);
                        key.sort_unstable();
                        covered.push(key);
                    }
                }
            });
            if is_touched {
                touched.push(tetrahedron);
            }
        }
        covered.sort_unstable();
        covered.dedup();
        Self { touched, covered }
    }

    /// True when the sheet passes the mesh by.
    pub(crate) fn is_empty(&self) -> bool {
        self.touched.is_empty() && self.covered.is_empty()
    }
}

/// How a triangle of a sheet meets a tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meeting {
    /// Not at all, or in a part of its surface without an area.
    None,
    /// In a part of this face of [`TETRAHEDRON_FACES`], with an area.
    Face(usize),
    /// In a point strictly inside.
    Inside,
}

fn meeting(corners: &[Point; 4], triangle: &[Point; 3], normal: Point) -> Meeting {
    let signs = orient3d_each(triangle, corners);
    let (mut least, mut most, mut on) = (0, 0, 0);
    for sign in signs {
        least = sign.min(least);
        most = sign.max(most);
        on += u8::from(sign == 0);
    }
    if least < 0 && most > 0 {
        let meets = !is_beside(corners, triangle, normal) && passes_inside(corners, triangle);
        return if meets { Meeting::Inside } else { Meeting::None };
    }
    if on < 3 {
        return Meeting::None;
    }
    for (face, nodes) in TETRAHEDRON_FACES.iter().enumerate() {
        if nodes.iter().all(|&corner| signs[corner] == 0)
            && overlap(&nodes.map(|corner| corners[corner]), triangle, normal)
        {
            return Meeting::Face(face);
        }
    }
    Meeting::None
}

/// Whether the tetrahedron lies beside the triangle, outside of one of its edges as seen along its
/// normal: most of those near a long thin triangle do.
fn is_beside(corners: &[Point; 4], triangle: &[Point; 3], normal: Point) -> bool {
    (0..3).any(|side| {
        let [from, to] = [triangle[side], triangle[(side + 1) % 3]];
        let outward = vec3::cross(vec3::sub(to, from), normal);
        corners.iter().all(|&corner| vec3::dot(outward, vec3::sub(corner, from)) > 0.0)
    })
}

/// Whether a point of the triangle is strictly inside: the middle of what clipping leaves of it,
/// tested exactly. Overlaps as thin as rounding may be missed, which leaves one tetrahedron uncut
/// at the sheet's border.
fn passes_inside(corners: &[Point; 4], triangle: &[Point; 3]) -> bool {
    let [a, b, c, d] = *corners;
    let orientation = orient3d(a, b, c, d);
    // Clipping a triangle at four planes leaves seven corners at most.
    let mut polygon = [[0.0; 3]; 8];
    let mut count = 3;
    // Near the origin differences cancel less.
    for corner in 0..3 {
        polygon[corner] = vec3::sub(triangle[corner], a);
    }
    for face in TETRAHEDRON_FACES {
        let [p, q, r] = face.map(|corner| vec3::sub(corners[corner], a));
        let normal = vec3::cross(vec3::sub(q, p), vec3::sub(r, p));
        // Positive inside.
        let depth = |point: Point| f64::from(-orientation) * vec3::dot(normal, vec3::sub(point, p));
        let (before, before_count) = (polygon, count);
        count = 0;
        for place in 0..before_count {
            let [from, to] = [before[place], before[(place + 1) % before_count]];
            let [from_depth, to_depth] = [depth(from), depth(to)];
            if from_depth >= 0.0 && count < 8 {
                polygon[count] = from;
                count += 1;
            }
            if (from_depth > 0.0 && to_depth < 0.0) || (from_depth < 0.0 && to_depth > 0.0) {
                let t = from_depth / (from_depth - to_depth);
                if count < 8 {
                    polygon[count] = vec3::lerp(from, to, t);
                    count += 1;
                }
            }
        }
        if count == 0 {
            return false;
        }
    }
    let sum = polygon[..count].iter().copied().fold([0.0; 3], vec3::add);
    let middle = vec3::add_scaled(a, sum, 1.0 / count as f64);
    TETRAHEDRON_FACES.iter().all(|face| {
        let [p, q, r] = face.map(|corner| corners[corner]);
        orient3d(p, q, r, middle) == -orientation && orientation != 0
    })
}

/// Whether two triangles of one plane have an area in common, exactly (as seen along an axis).
fn overlap(left: &[Point; 3], right: &[Point; 3], normal: Point) -> bool {
    let largest = vec3::max_abs(normal);
    let axis = (0..3).find(|&axis| normal[axis].abs() == largest).unwrap_or(0);
    let flat = |point: Point| [point[(axis + 1) % 3], point[(axis + 2) % 3]];
    let [left, right] = [left.map(flat), right.map(flat)];
    let turns = [left, right].map(|[a, b, c]| orient2d(a, b, c));
    let separates = |triangle: &[[f64; 2]; 3], turn: i8, other: &[[f64; 2]; 3]| {
        (0..3).any(|side| {
            let [from, to] = [triangle[side], triangle[(side + 1) % 3]];
            other.iter().all(|&point| orient2d(from, to, point) != turn)
        })
    };
    turns[0] != 0
        && turns[1] != 0
        && !separates(&left, turns[0], &right)
        && !separates(&right, turns[1], &left)
}

/// The sides of nodes, found when first asked for.
pub(crate) struct Sides<'a> {
    sheet: &'a Sheet,
    /// By node; what snapping has put on the sheet keeps its height.
    found: Vec<Option<Side>>,
}

impl<'a> Sides<'a> {
    pub(crate) fn new(sheet: &'a Sheet, node_count: usize) -> Self {
        Self { sheet, found: vec![None; node_count] }
    }

    /// The side of a node at `positions[node]`.
    pub(crate) fn of(&mut self, node: u32, positions: &[Point]) -> Side {
        let sheet = self.sheet;
        *self.found[node as usize].get_or_insert_with(|| sheet.side(positions[node as usize]))
    }

    /// The sign of a node that was asked for before.
    ///
    /// # Panics
    /// If it was not.
    pub(crate) fn sign(&self, node: u32) -> i8 {
        self.side(node).sign
    }

    /// The side of a node that was asked for before.
    ///
    /// # Panics
    /// If it was not.
    pub(crate) fn side(&self, node: u32) -> Side {
        self.found[node as usize].expect("asked for before")
    }

    /// The unit normal of the sheet where it is closest to a node that was asked for before.
    ///
    /// # Panics
    /// If it was not.
    pub(crate) fn normal(&self, node: u32) -> Point {
        self.sheet.normal(self.side(node).triangle)
    }

    /// Takes a node to lie on the sheet.
    pub(crate) fn put_on(&mut self, node: u32) {
        if let Some(side) = &mut self.found[node as usize] {
            side.sign = 0;
        }
    }

    /// Adds the next node, which lies on the sheet.
    pub(crate) fn push_on(&mut self) {
        self.found.push(Some(Side { sign: 0, height: 0.0, triangle: 0 }));
    }

    /// Whether a node was found, or taken, to lie on the sheet.
    pub(crate) fn is_on(&self, node: u32) -> bool {
        self.found[node as usize].is_some_and(|side| side.sign == 0)
    }
}

/// An edge between the two sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CrossedEdge {
    /// Its nodes, the smaller first.
    pub(crate) nodes: [u32; 2],
    /// Where the sheet crosses it, from the first node.
    pub(crate) t: f64,
    /// A tetrahedron that has it.
    pub(crate) tetrahedron: u32,
}

/// The crossed edges of the touched tetrahedra, sorted by nodes; fills in the sides.
pub(crate) fn crossed_edges(
    draft: &Draft,
    sheet: &Sheet,
    crossing: &Crossing,
    sides: &mut Sides,
) -> Vec<CrossedEdge> {
    for &node in crossing.covered.as_flattened() {
        sides.of(node, &draft.positions);
    }
    let mut found: Vec<([u32; 2], u32)> = Vec::new();
    for &tetrahedron in &crossing.touched {
        let nodes = draft.tetrahedra[tetrahedron as usize];
        let signs = nodes.map(|node| sides.of(node, &draft.positions).sign);
        for (first, second) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            if signs[first] * signs[second] < 0 {
                let [a, b] = [nodes[first], nodes[second]];
                found.push(([a.min(b), a.max(b)], tetrahedron));
            }
        }
    }
    found.sort_unstable();
    found.dedup_by_key(|(nodes, _)| *nodes);
    let edge = |(nodes, tetrahedron): ([u32; 2], u32)| {
        let ends = nodes.map(|node| draft.positions[node as usize]);
        let heights = nodes.map(|node| sides.side(node).height);
        let t = hit(sheet, &ends).unwrap_or_else(|| beyond(sheet, &ends, heights));
        CrossedEdge { nodes, t, tetrahedron }
    };
    found.into_iter().map(edge).collect()
}

/// Where the sheet itself crosses a segment: its parameter, of several the middle one. Beyond the
/// border there is none.
fn hit(sheet: &Sheet, ends: &[Point; 2]) -> Option<f64> {
    let mut hits = Vec::new();
    sheet.for_each_near(&Aabb::from_points(ends), |triangle| {
        let corners = sheet.corners(triangle);
        if segment_triangle_intersect(ends, corners) {
            let normal = sheet.normal(triangle);
            let heights = ends.map(|end| vec3::dot(vec3::sub(end, corners[0]), normal).abs());
            let sum = heights[0] + heights[1];
            if sum > 0.0 {
                hits.push(heights[0] / sum);
            }
        }
    });
    hits.sort_unstable_by(f64::total_cmp);
    hits.get(hits.len() / 2).copied()
}

/// Where a segment passes from side to side beyond the border: its parameter. Its ends have heights
/// of different signs.
///
/// The plane that goes on there is that of the closest triangle, which changes along the segment
/// where the blade is bent.
fn beyond(sheet: &Sheet, ends: &[Point; 2], heights: [f64; 2]) -> f64 {
    const STEPS: usize = 20;
    const CLOSE: f64 = 1e-6;
    let close = CLOSE * (heights[0].abs() + heights[1].abs());
    let (mut t_low, mut t_high) = (0.0, 1.0);
    let [mut low, mut high] = heights;
    let mut t = 0.5;
    for step in 0..STEPS {
        // False position, halving now and then: the height may jump.
        let part = if step % 3 == 2 { 0.5 } else { low / (low - high) };
        let part = if part.is_finite() { part } else { 0.5 };
        t = t_low + part * (t_high - t_low);
        let height = sheet.side(vec3::lerp(ends[0], ends[1], t)).height;
        if height.abs() <= close {
            break;
        }
        if (height < 0.0) == (heights[0] < 0.0) {
            (t_low, low) = (t, height);
        } else {
            (t_high, high) = (t, height);
        }
    }
    t
}
