//! Pairs of features that an axis proves to be far apart: a one-sided filter before the distances.
//!
//! The closest points are found approximately and give the axis; the proof is the projection on it
//! (`Reach::separated`), so that nothing depends on how good the approximation is.

use super::boxes::{corners, gather};
use super::regions::{closest_beyond_ends, closest_features};
use super::separation::{Reach, cross, dot, keep, sub};
use super::{WIDTH, WideBody};
use crate::simd::{Kernel, Lanes};

/// Passes on the pairs of a node and a triangle that may be close.
pub(crate) struct VertexPairs<'a> {
    pub(crate) from: &'a WideBody,
    pub(crate) to: &'a WideBody,
    pub(crate) reach: Reach,
    /// Whether a pair is of no use whose closest feature certainly is that of an earlier triangle as well.
    pub(crate) local: bool,
    /// Slot of the points of `from`, of the triangles of `to`.
    pub(crate) candidates: &'a [[u32; 2]],
    pub(crate) kept: &'a mut Vec<[u32; 2]>,
}

impl Kernel for VertexPairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { from, to, reach, local, candidates, kept } = self;
        for batch in candidates.chunks(WIDTH) {
            let lane = |i: usize| batch.get(i).unwrap_or(&batch[0]);
            let nodes = std::array::from_fn(|i| &from.nodes[lane(i)[0] as usize]);
            let slots = std::array::from_fn(|i| to.triangles.corners[lane(i)[1] as usize]);
            let point = L::gather(nodes);
            let [a, b, c] = corners::<L>(&to.nodes, &slots);
            let triangle = [sub(a, point), sub(b, point), sub(c, point)];
            let axis = towards_triangle(triangle);
            let apart = reach.separated(axis, [[L::splat(0.0); 3]], triangle);
            if local && apart.bits() != 0xff {
                let closest = closest_features(reach, triangle);
                for (i, &[point, slot]) in batch.iter().enumerate() {
                    let certain = (0..6).map(|k| (closest[k] >> i & 1) << k).sum::<u32>();
                    let owned = u32::from(to.owned[slot as usize]);
                    if apart.bits() >> i & 1 == 0 && certain & !owned == 0 {
                        kept.push([point, slot]);
                    }
                }
            } else {
                keep(batch, apart, kept);
            }
        }
    }
}

/// Passes on the pairs of edges that may be close.
pub(crate) struct EdgePairs<'a> {
    pub(crate) a: &'a WideBody,
    pub(crate) b: &'a WideBody,
    pub(crate) reach: Reach,
    /// Whether a pair is of no use whose closest points certainly do not lie between the ends.
    pub(crate) local: bool,
    /// Slots of the edges of a and of b.
    pub(crate) candidates: &'a [[u32; 2]],
    pub(crate) kept: &'a mut Vec<[u32; 2]>,
}

impl Kernel for EdgePairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { a, b, reach, local, candidates, kept } = self;
        for batch in candidates.chunks(WIDTH) {
            let lane = |i: usize| batch.get(i).unwrap_or(&batch[0]);
            let edges_a = std::array::from_fn(|i| a.edges.corners[lane(i)[0] as usize]);
            let edges_b = std::array::from_fn(|i| b.edges.corners[lane(i)[1] as usize]);
            let start = gather(&a.nodes, &edges_a, 0);
            let along_a = sub(gather(&a.nodes, &edges_a, 1), start);
            let ends_b: [[L; 3]; 2] = [
                sub(gather(&b.nodes, &edges_b, 0), start),
                sub(gather(&b.nodes, &edges_b, 1), start),
            ];
            let axis = between_edges(along_a, ends_b);
            let mut apart = reach.separated(axis, [[L::splat(0.0); 3], along_a], ends_b);
            if local && apart.bits() != 0xff {
                apart = apart.or(closest_beyond_ends(reach, along_a, ends_b));
            }
            keep(batch, apart, kept);
        }
    }
}

/// About from the origin to the closest point of a triangle; above its inside along its normal.
#[inline(always)]
fn towards_triangle<L: Lanes>([a, b, c]: [[L; 3]; 3]) -> [L; 3] {
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let normal = cross(edges[0], edges[1]);
    let zero = L::splat(0.0);
    let mut best = [zero; 3];
    let mut best_square = L::splat(f32::INFINITY);
    let mut outside = zero;
    let corners = [a, b, c];
    for i in 0..3 {
        let (corner, edge) = (corners[i], edges[i]);
        let t = clamp01(zero.sub(dot(corner, edge)).div(dot(edge, edge)));
        let closest = add_scaled(corner, edge, t);
        let square = dot(closest, closest);
        best = blend(best, closest, best_square.gt(square));
        best_square = best_square.min(square);
        // The inner side of the edge is along normal x edge.
        outside = outside.or(dot(cross(normal, edge), corner).gt(zero));
    }
    blend(normal, best, outside)
}

/// About between the closest points of the edge from the origin along `u` and the edge `b`.
#[inline(always)]
fn between_edges<L: Lanes>(u: [L; 3], b: [[L; 3]; 2]) -> [L; 3] {
    let v = sub(b[1], b[0]);
    let (uu, vv, uv) = (dot(u, u), dot(v, v), dot(u, v));
    let (u_offset, v_offset) = (dot(u, b[0]), dot(v, b[0]));
    let determinant = uu.mul(vv).sub(uv.mul(uv));
    let s = clamp01(u_offset.mul(vv).sub(uv.mul(v_offset)).div(determinant));
    let t = clamp01(uv.mul(s).sub(v_offset).div(vv));
    let s = clamp01(uv.mul(t).add(u_offset).div(uu));
    sub(add_scaled(b[0], v, t), [s.mul(u[0]), s.mul(u[1]), s.mul(u[2])])
}

#[inline(always)]
fn add_scaled<L: Lanes>(a: [L; 3], b: [L; 3], factor: L) -> [L; 3] {
    [a[0].add(factor.mul(b[0])), a[1].add(factor.mul(b[1])), a[2].add(factor.mul(b[2]))]
}

#[inline(always)]
fn blend<L: Lanes>(a: [L; 3], b: [L; 3], mask: L) -> [L; 3] {
    [a[0].blend(b[0], mask), a[1].blend(b[1], mask), a[2].blend(b[2], mask)]
}

/// Into [0, 1]; NaN becomes 0.
#[inline(always)]
fn clamp01<L: Lanes>(value: L) -> L {
    value.max(L::splat(0.0)).min(L::splat(1.0))
}
