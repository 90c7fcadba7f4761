//! One sheet of a blade: which triangles are near, and on which side a point lies.

use palpate_geometry::{Aabb, Point, point_triangle, predicates::orient3d, vec3};

/// Most triangles in a leaf of the tree of boxes.
const LEAF: usize = 1;

/// How far from the smallest squared distance another triangle counts as closest as well: it shares
/// the closest edge or point, and its distance differs by rounding only.
const TIE: f64 = 1e-9;

/// Coherently oriented triangles under a binary tree of boxes.
pub(crate) struct Sheet {
    triangles: Vec<[Point; 3]>,
    /// Of length 1.
    normals: Vec<Point>,
    nodes: Vec<TreeNode>,
}

/// The node's left child follows it.
struct TreeNode {
    bounds: Aabb,
    /// First triangle of a leaf, or the right child.
    first: u32,
    /// Triangles of a leaf, or 0.
    count: u32,
}

/// Where a point lies with respect to a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Side {
    /// The exact side of the plane of the closest triangle: 1, 0 on it, -1.
    pub(crate) sign: i8,
    /// Signed distance [m] from that plane, rounded.
    pub(crate) height: f64,
    /// That triangle.
    pub(crate) triangle: u32,
}

impl Sheet {
    /// `triangles` has at least one; all have an area.
    pub(crate) fn new(mut triangles: Vec<[Point; 3]>) -> Self {
        let mut nodes = Vec::new();
        let count = triangles.len();
        build(&mut triangles, 0, count, &mut nodes);
        let normals = triangles.iter().map(unit_normal).collect();
        Self { triangles, normals, nodes }
    }

    /// The box around all triangles.
    pub(crate) fn bounds(&self) -> &Aabb {
        &self.nodes[0].bounds
    }

    /// The unit normal of a triangle.
    pub(crate) fn normal(&self, triangle: u32) -> Point {
        self.normals[triangle as usize]
    }

    /// The corners of a triangle.
    pub(crate) fn corners(&self, triangle: u32) -> &[Point; 3] {
        &self.triangles[triangle as usize]
    }

    /// Calls `visit` with each triangle whose box meets `bounds` (some whose do not may come as
    /// well).
    pub(crate) fn for_each_near(&self, bounds: &Aabb, mut visit: impl FnMut(u32)) {
        let mut at = 0;
        let mut waiting = Waiting::new();
        loop {
            let node = &self.nodes[at as usize];
            if node.bounds.intersects(bounds) {
                if node.count == 0 {
                    waiting.push(node.first);
                    at += 1;
                    continue;
                }
                (node.first..node.first + node.count).for_each(&mut visit);
            }
            match waiting.pop() {
                Some(next) => at = next,
                None => return,
            }
        }
    }

    /// The side of `point`, beyond the border of the sheet as well.
    ///
    /// Where several triangles are equally close (at a common edge or corner), the one counts whose
    /// plane is furthest away: the others may have the point on their wrong side there.
    pub(crate) fn side(&self, point: Point) -> Side {
        let mut nearest = f64::INFINITY;
        self.for_each_within(point, f64::INFINITY, |_, distance_squared| {
            nearest = nearest.min(distance_squared);
            nearest
        });
        let limit = nearest * (1.0 + TIE);
        let mut best: Option<(f64, u32)> = None;
        self.for_each_within(point, limit, |triangle, distance_squared| {
            let offset = vec3::sub(point, self.corners(triangle)[0]);
            let height = vec3::dot(offset, self.normal(triangle));
            let is_closest = distance_squared <= limit;
            if is_closest && best.is_none_or(|(other, _)| height.abs() > other.abs()) {
                best = Some((height, triangle));
            }
            limit
        });
        // Only a distance that overflows leaves none.
        let (height, triangle) = best.unwrap_or((f64::INFINITY, 0));
        let &[a, b, c] = self.corners(triangle);
        let sign = orient3d(a, b, c, point);
        Side { sign, height: f64::from(sign) * height.abs(), triangle }
    }

    /// Calls `visit` with each triangle that may be within the square root of `limit` of `point`,
    /// and its squared distance; it returns the new limit.
    fn for_each_within(
        &self,
        point: Point,
        mut limit: f64,
        mut visit: impl FnMut(u32, f64) -> f64,
    ) {
        let mut at = 0;
        let mut waiting = Waiting::new();
        loop {
            let node = &self.nodes[at as usize];
            if node.bounds.distance_squared(&point) <= limit {
                if node.count == 0 {
                    let left = self.nodes[at as usize + 1].bounds.distance_squared(&point);
                    let right = self.nodes[node.first as usize].bounds.distance_squared(&point);
                    let (near, far) =
                        if left <= right { (at + 1, node.first) } else { (node.first, at + 1) };
                    waiting.push(far);
                    at = near;
                    continue;
                }
                for triangle in node.first..node.first + node.count {
                    let found = point_triangle(point, self.corners(triangle));
                    limit = visit(triangle, found.distance_squared);
                }
            }
            match waiting.pop() {
                Some(next) => at = next,
                None => return,
            }
        }
    }
}

/// Tree nodes still to visit: one for each level, and halving 2³² triangles takes 32.
struct Waiting {
    nodes: [u32; 40],
    count: usize,
}

impl Waiting {
    fn new() -> Self {
        Self { nodes: [0; 40], count: 0 }
    }

    fn push(&mut self, node: u32) {
        self.nodes[self.count] = node;
        self.count += 1;
    }

    fn pop(&mut self) -> Option<u32> {
        self.count = self.count.checked_sub(1)?;
        Some(self.nodes[self.count])
    }
}

/// Builds the tree over `triangles[first..end]`, halving along the longest axis of their centres.
fn build(triangles: &mut [[Point; 3]], first: usize, end: usize, nodes: &mut Vec<TreeNode>) {
    let part = &mut triangles[first..end];
    let bounds = Aabb::from_points(part.as_flattened());
    let place = nodes.len();
    let count = if part.len() <= LEAF { part.len() as u32 } else { 0 };
    nodes.push(TreeNode { bounds, first: first as u32, count });
    if count > 0 {
        return;
    }
    let center = |triangle: &[Point; 3]| {
        let [a, b, c] = *triangle;
        vec3::add(vec3::add(a, b), c)
    };
    let centers: Vec<Point> = part.iter().map(center).collect();
    let axis = Aabb::from_points(&centers).longest_axis();
    let half = part.len() / 2;
    part.select_nth_unstable_by(half, |left, right| {
        center(left)[axis].total_cmp(&center(right)[axis])
    });
    build(triangles, first, first + half, nodes);
    nodes[place].first = nodes.len() as u32;
    build(triangles, first + half, end, nodes);
}

fn unit_normal(triangle: &[Point; 3]) -> Point {
    let [u, v] = [1, 2].map(|corner| vec3::sub(triangle[corner], triangle[0]));
    let size = vec3::max_abs(u).max(vec3::max_abs(v));
    let normal = vec3::cross(u.map(|value| value / size), v.map(|value| value / size));
    // A sliver whose area underflows: any direction does, its exact plane decides sides.
    vec3::normalized(normal).unwrap_or([0.0, 0.0, 1.0])
}
