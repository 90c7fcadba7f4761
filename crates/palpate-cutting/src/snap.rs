//! Which nodes are taken to lie on the sheet, so that no part of a split tetrahedron is a sliver.
//!
//! A node that is taken to lie on the sheet stays where it is: the cut passes through it, off the
//! blade by its distance. In exchange nothing moves: material volume, each tetrahedron's strain and
//! the shape of what is not cut are kept, and because taking more nodes always ends in no split at
//! all, the bound on shape holds whatever the blade does.

use std::collections::VecDeque;

use palpate_geometry::{Point, tetrahedron, vec3};

use crate::crossing::{CrossedEdge, Sides};
use crate::cut::ShapeLimits;
use crate::draft::Draft;
use crate::split::{EdgeSplit, Parts};

/// A crossed edge that is to be split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Split {
    pub(crate) edge: CrossedEdge,
    /// Rest position [m] of the point.
    pub(crate) rest: Point,
    /// Square of the rest length [m²]: the longest edges are split first.
    length_squared: f64,
}

impl Split {
    /// Parameter of the point from the nearer end, and that end.
    fn nearer(&self) -> (f64, u32) {
        let CrossedEdge { nodes: [a, b], t, .. } = self.edge;
        if t <= 1.0 - t { (t, a) } else { (1.0 - t, b) }
    }
}

/// A tetrahedron with crossed edges.
struct Star {
    tetrahedron: u32,
    /// Its crossed edges, as indices of the list, in the order in which they are split.
    edges: [u32; 6],
    count: usize,
}

impl Star {
    fn edges(&self) -> &[u32] {
        &self.edges[..self.count]
    }
}

/// What is to be split.
pub(crate) struct Plan {
    /// In the order in which edges are split.
    pub(crate) splits: Vec<Split>,
    /// Tetrahedra with such edges, each with their indices.
    pub(crate) tetrahedra: Vec<(u32, Vec<u32>)>,
    /// How many nodes were taken to lie on the sheet.
    pub(crate) snapped: usize,
}

/// Takes nodes to lie on the sheet until all parts are well shaped; returns the edges that are then
/// left crossed.
pub(crate) fn plan(
    draft: &Draft,
    edges: &[CrossedEdge],
    sides: &mut Sides,
    options: &ShapeLimits,
) -> Plan {
    let mut splits: Vec<Split> = edges.iter().map(|&edge| split_at(draft, edge)).collect();
    let mut snapped = snap_close(draft, &mut splits, sides, options);
    let is_live =
        |split: &Split, sides: &Sides| split.edge.nodes.iter().all(|&node| sides.sign(node) != 0);
    splits.retain(|split| is_live(split, sides));
    splits.sort_unstable_by(|left, right| {
        let longer_first = right.length_squared.total_cmp(&left.length_squared);
        longer_first.then(left.edge.nodes.cmp(&right.edge.nodes))
    });
    let stars = stars(draft, &splits);
    snapped += snap_slivers(draft, &splits, &stars, sides, options);

    let mut new_index = vec![u32::MAX; splits.len()];
    let mut kept = 0;
    for (index, split) in splits.iter().enumerate() {
        if is_live(split, sides) {
            new_index[index] = kept;
            kept += 1;
        }
    }
    let live_edges = |star: &Star| -> Vec<u32> {
        let indices = star.edges().iter().map(|&edge| new_index[edge as usize]);
        indices.filter(|&index| index != u32::MAX).collect()
    };
    let tetrahedra = stars.iter().map(|star| (star.tetrahedron, live_edges(star)));
    let tetrahedra = tetrahedra.filter(|(_, edges)| !edges.is_empty()).collect();
    splits.retain(|split| is_live(split, sides));
    Plan { splits, tetrahedra, snapped }
}

fn split_at(draft: &Draft, edge: CrossedEdge) -> Split {
    let [a, b] = edge.nodes.map(|node| draft.rest[node as usize]);
    let parent = draft.parents[edge.tetrahedron as usize];
    let rest = draft.rest_of(&draft.between(edge.nodes, edge.t, parent));
    Split { edge, rest, length_squared: vec3::distance_squared(a, b) }
}

/// Takes the nodes close to the sheet, the closest first; returns how many.
///
/// Along the lips of an earlier cut the nearer end counts wherever it is: where that cut ended this
/// one goes on from there, else they would pass each other and leave a bridge; and a blade that
/// goes through a wound again shaves nothing off its lips.
fn snap_close(
    draft: &Draft,
    splits: &mut [Split],
    sides: &mut Sides,
    options: &ShapeLimits,
) -> usize {
    splits.sort_unstable_by(|left, right| {
        let closer_first = left.nearer().0.total_cmp(&right.nearer().0);
        closer_first.then(left.edge.nodes.cmp(&right.edge.nodes))
    });
    let wounds = draft.wounds();
    let mut snapped = 0;
    for split in splits {
        let (t, node) = split.nearer();
        let is_close = t < options.snap
            || wounds.is_along(node, sides.normal(node))
            || t * split.length_squared.sqrt() < options.min_edge;
        if is_close && split.edge.nodes.iter().all(|&node| sides.sign(node) != 0) {
            sides.put_on(node);
            snapped += 1;
        }
    }
    snapped
}

/// All tetrahedra with crossed edges.
fn stars(draft: &Draft, splits: &[Split]) -> Vec<Star> {
    let mut is_end = vec![false; draft.positions.len()];
    let mut by_nodes: Vec<([u32; 2], u32)> = Vec::with_capacity(splits.len());
    for (index, split) in splits.iter().enumerate() {
        by_nodes.push((split.edge.nodes, index as u32));
        split.edge.nodes.iter().for_each(|&node| is_end[node as usize] = true);
    }
    by_nodes.sort_unstable();
    let mut stars = Vec::new();
    for (tetrahedron, nodes) in draft.tetrahedra.iter().enumerate() {
        let ends = nodes.map(|node| is_end[node as usize]);
        let mut star = Star { tetrahedron: tetrahedron as u32, edges: [0; 6], count: 0 };
        for (first, second) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            if !(ends[first] && ends[second]) {
                continue;
            }
            let [a, b] = [nodes[first], nodes[second]];
            let key = [a.min(b), a.max(b)];
            if let Ok(place) = by_nodes.binary_search_by_key(&key, |(nodes, _)| *nodes) {
                star.edges[star.count] = by_nodes[place].1;
                star.count += 1;
            }
        }
        if star.count > 0 {
            star.edges[..star.count].sort_unstable();
            stars.push(star);
        }
    }
    stars
}

/// Takes more nodes wherever a tetrahedron would have too flat a part, until none has; returns how
/// many.
fn snap_slivers(
    draft: &Draft,
    splits: &[Split],
    stars: &[Star],
    sides: &mut Sides,
    options: &ShapeLimits,
) -> usize {
    let mut around: Vec<(u32, u32)> = Vec::new();
    for (index, star) in stars.iter().enumerate() {
        let nodes = draft.tetrahedra[star.tetrahedron as usize];
        around.extend(nodes.map(|node| (node, index as u32)));
    }
    around.sort_unstable();
    let mut snapped = 0;
    let mut queue: VecDeque<u32> = (0..stars.len() as u32).collect();
    let mut is_waiting = vec![true; stars.len()];
    while let Some(index) = queue.pop_front() {
        is_waiting[index as usize] = false;
        let Some(node) = node_to_snap(draft, splits, &stars[index as usize], sides, options) else {
            continue;
        };
        sides.put_on(node);
        snapped += 1;
        let first = around.partition_point(|&(other, _)| other < node);
        for &(_, star) in around[first..].iter().take_while(|&&(other, _)| other == node) {
            if !std::mem::replace(&mut is_waiting[star as usize], true) {
                queue.push_back(star);
            }
        }
    }
    snapped
}

/// The node to take so that a tetrahedron has no sliver among its parts; `None` when it has none.
///
/// The end closest to the sheet (as a part of its edge) whose taking leaves only well-shaped parts;
/// when there is none, the closest of all.
fn node_to_snap(
    draft: &Draft,
    splits: &[Split],
    star: &Star,
    sides: &Sides,
    options: &ShapeLimits,
) -> Option<u32> {
    let shape = Shape::new(draft, splits, star, options);
    let is_live = |split: &Split| split.edge.nodes.iter().all(|&node| sides.sign(node) != 0);
    if shape.is_good(&is_live) {
        return None;
    }
    // Each live edge can be lost at either end, at the price of its part of the edge.
    let mut ends: Vec<(f64, u32)> = Vec::new();
    for &edge in star.edges() {
        let split = &splits[edge as usize];
        if is_live(split) {
            let CrossedEdge { nodes: [a, b], t, .. } = split.edge;
            ends.extend([(t, a), (1.0 - t, b)]);
        }
    }
    ends.sort_unstable_by(|left, right| left.0.total_cmp(&right.0).then(left.1.cmp(&right.1)));
    let mends = |node: u32| {
        shape.is_good(&|split: &Split| is_live(split) && !split.edge.nodes.contains(&node))
    };
    let best = ends.iter().find(|&&(t, node)| t <= 0.5 && mends(node)).or(ends.first());
    best.map(|&(_, node)| node)
}

/// The parts of one tetrahedron for any choice of its edges.
struct Shape<'a> {
    splits: &'a [Split],
    star: &'a Star,
    nodes: [u32; 4],
    /// Rest positions of the corners, then of the points of the edges.
    points: [Point; 10],
    /// Parts below this quality are slivers: the bound, or the whole's own where that is lower.
    min_quality: f64,
    /// Parts have no shorter edges: the square of the bound, or the whole's own where that is
    /// smaller.
    min_edge_squared: f64,
}

impl<'a> Shape<'a> {
    fn new(draft: &Draft, splits: &'a [Split], star: &'a Star, options: &ShapeLimits) -> Self {
        let nodes = draft.tetrahedra[star.tetrahedron as usize];
        let mut points = [[0.0; 3]; 10];
        for (corner, node) in nodes.into_iter().enumerate() {
            points[corner] = draft.rest[node as usize];
        }
        for (place, &edge) in star.edges().iter().enumerate() {
            points[4 + place] = splits[edge as usize].rest;
        }
        let whole = [points[0], points[1], points[2], points[3]];
        Self {
            splits,
            star,
            nodes,
            points,
            min_quality: options.min_quality.min(tetrahedron::radius_ratio(&whole)),
            min_edge_squared: options.min_edge.powi(2).min(shortest_edge_squared(&whole)),
        }
    }

    /// Whether all parts that the edges accepted by `is_live` make are positive, no slivers and not
    /// too small.
    fn is_good(&self, is_live: &impl Fn(&Split) -> bool) -> bool {
        let corner = |node: u32| {
            self.nodes.iter().position(|&other| other == node).expect("an edge of it") as u8
        };
        let mut live = [EdgeSplit { corners: [0; 2], point: 0 }; 6];
        let mut count = 0;
        for (place, &edge) in self.star.edges().iter().enumerate() {
            let split = &self.splits[edge as usize];
            if is_live(split) {
                live[count] =
                    EdgeSplit { corners: split.edge.nodes.map(corner), point: 4 + place as u8 };
                count += 1;
            }
        }
        if count == 0 {
            return true;
        }
        Parts::new(&live[..count]).as_slice().iter().all(|part| {
            let corners = part.map(|corner| self.points[corner as usize]);
            tetrahedron::radius_ratio(&corners) >= self.min_quality
                && shortest_edge_squared(&corners) >= self.min_edge_squared
                && tetrahedron::orientation(&corners) > 0
        })
    }
}

fn shortest_edge_squared(&[a, b, c, d]: &[Point; 4]) -> f64 {
    let edges = [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)];
    edges.iter().map(|&(from, to)| vec3::distance_squared(from, to)).fold(f64::INFINITY, f64::min)
}
