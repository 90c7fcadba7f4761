//! Pairs of triangles that certainly cross: an edge of one goes through the inside of the other. What
//! this finds needs no exact test.

use super::separation::{Reach, cross, dot, edges, from_corner, sub};
use super::{WIDTH, WideBody};
use crate::simd::{Kernel, Lanes};

/// Parts the candidates into those that certainly cross and those to be tested exactly.
pub(crate) struct CrossTriangles<'a> {
    pub(crate) a: &'a WideBody,
    pub(crate) b: &'a WideBody,
    pub(crate) reach: Reach,
    /// Slots of a and of b, which share no node.
    pub(crate) candidates: &'a [[u32; 2]],
    pub(crate) crossing: &'a mut Vec<[u32; 2]>,
    pub(crate) open: &'a mut Vec<[u32; 2]>,
}

impl Kernel for CrossTriangles<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { a, b, reach, candidates, crossing, open } = self;
        for batch in candidates.chunks(WIDTH) {
            let (of_a, of_b) = from_corner::<L>(a, b, batch);
            let crosses = certainly_cross(reach, of_a, of_b).bits();
            for (i, &candidate) in batch.iter().enumerate() {
                let list = if crosses >> i & 1 == 1 { &mut *crossing } else { &mut *open };
                list.push(candidate);
            }
        }
    }
}

/// Lanes where an edge of one triangle has its ends on two sides of the other, and passes all its edges
/// on one side. Every sign is that of a determinant beyond its error.
#[inline(always)]
fn certainly_cross<L: Lanes>(reach: Reach, of_a: [[L; 3]; 3], of_b: [[L; 3]; 3]) -> L {
    let (edges_a, edges_b) = (edges(of_a), edges(of_b));
    let bound = error(reach, [edges_a, edges_b], [of_a, of_b]);
    let none = L::splat(0.0);
    // Certain signs, + and -, of edge i of a past edge j of b.
    let (mut above, mut below) = ([[none; 3]; 3], [[none; 3]; 3]);
    for i in 0..3 {
        for j in 0..3 {
            let past = dot(cross(edges_a[i], edges_b[j]), sub(of_b[j], of_a[i]));
            [above[i][j], below[i][j]] = signs(past, bound);
        }
    }
    let normal_a = cross(edges_a[0], edges_a[1]);
    let normal_b = cross(edges_b[0], edges_b[1]);
    let (mut sides_a, mut sides_b) = ([[none; 2]; 3], [[none; 2]; 3]);
    for i in 0..3 {
        sides_a[i] = signs(dot(normal_b, sub(of_a[i], of_b[0])), bound);
        sides_b[i] = signs(dot(normal_a, sub(of_b[i], of_a[0])), bound);
    }
    let mut crosses = none;
    for i in 0..3 {
        let next = (i + 1) % 3;
        let through_b = all(above[i]).or(all(below[i]));
        crosses = crosses.or(through_b.and(opposite(sides_a[i], sides_a[next])));
        let through_a = all([above[0][i], above[1][i], above[2][i]]);
        let through_a = through_a.or(all([below[0][i], below[1][i], below[2][i]]));
        crosses = crosses.or(through_a.and(opposite(sides_b[i], sides_b[next])));
    }
    crosses
}

/// At least the error of a determinant of two edges and the offset of two corners.
///
/// A coordinate relative to the common corner is off by at most E = 2⁻²² M, M the largest coordinate: two
/// conversions to `f32` and a difference. Differences of two of those, which edges and offsets are, are
/// off by 3 E. With components of edges up to l and of offsets up to w, 3 E included, the six
/// products are off by 18 E l (l + 2 w) in all, here E l (20 l + 40 w), and rounding adds 30 · 2⁻²⁴ l² w,
/// here 2⁻²² of 8 l² w. No sum of the products exceeds the latter: it is infinite where one could
/// overflow, so that nothing is certain.
#[inline(always)]
fn error<L: Lanes>(reach: Reach, edges: [[[L; 3]; 3]; 2], corners: [[[L; 3]; 3]; 2]) -> L {
    let unit = L::splat(reach.coordinate_error());
    let more = unit.mul(L::splat(3.0));
    let edge = largest(edges[0]).max(largest(edges[1])).add(more);
    let offset = largest(corners[0]).add(largest(corners[1])).add(more);
    let factor = edge.mul(L::splat(20.0)).add(offset.mul(L::splat(40.0)));
    let sums = edge.mul(edge).mul(offset).mul(L::splat(8.0));
    // What underflows in a product of two, times the third, and in the products of three.
    let underflow = offset.add(L::splat(1.0)).mul(L::splat(f32::MIN_POSITIVE));
    let rounding = sums.mul(L::splat(2.0 * f32::EPSILON));
    unit.mul(edge).mul(factor).add(rounding).add(underflow)
}

/// The largest component.
#[inline(always)]
fn largest<L: Lanes>(vectors: [[L; 3]; 3]) -> L {
    let mut largest = L::splat(0.0);
    for vector in vectors {
        for value in vector {
            largest = largest.max(value.abs());
        }
    }
    largest
}

/// Lanes where `value` is certainly positive, and certainly negative.
#[inline(always)]
fn signs<L: Lanes>(value: L, bound: L) -> [L; 2] {
    [value.gt(bound), L::splat(0.0).sub(bound).gt(value)]
}

#[inline(always)]
fn all<L: Lanes>([a, b, c]: [L; 3]) -> L {
    a.and(b).and(c)
}

#[inline(always)]
fn opposite<L: Lanes>([above, below]: [L; 2], [next_above, next_below]: [L; 2]) -> L {
    above.and(next_below).or(below.and(next_above))
}
