//! From close pairs to contacts: which pairs carry a force, and with what law.
//!
//! Proximity is complete: a node near an edge is close to both triangles there and to some beyond.
//! Kept are the local minima of the distance between the surfaces, each once.

use glam::DVec3;
use palpate_contact::{PairKind, PenetratingNode, ProximityPair};
use palpate_geometry::Point;
use palpate_geometry::tetrahedron::signed_volume;
use rayon::prelude::*;

use super::{ContactParameters, Surface, side};

/// Slack in the tests of direction: a flat surface must not lose its contacts to round-off.
const ANGLE_SLACK: f64 = 1e-6;
/// A node whose own surface faces away from the other body by more than this does not touch it.
const FACING_LIMIT: f64 = 0.2;
/// Edge pairs count only where both edges are sharper than this (sine of the angle between the
/// faces): on smooth surfaces nodes against triangles do, up to a small part of the contact distance.
const SHARP_EDGE: f64 = 0.25;
/// The same for a pair that carried a force in the last step: where pushing and letting go flatten and
/// sharpen an edge across the limit, a pair would come and go for ever and the bodies never rest.
const LOADED_SHARP_EDGE: f64 = 0.05;
/// Slack in the tests of direction of such a pair.
const LOADED_SLACK: f64 = 0.05;
/// Elements of one body closer than this at rest, in contact distances, do not push each other.
const REST_NEIGHBOUR: f64 = 2.0;
/// A node behind its own body's surface has passed through it when the two were this many times
/// farther apart at rest; otherwise there is only a thin wall between them.
const PASSED_THROUGH: f64 = 4.0;
/// Lips of a cut: the normals of a node and a triangle at rest have at most this cosine, and the node is
/// behind the triangle by no more than this part of the mean edge. The nodes at the rim of a lip also have
/// a part of the skin around them.
const LIP_COSINE: f64 = -0.3;
const COINCIDENT: f64 = 1e-6;
/// Time in which the contact distance is recovered where surfaces overlap [s].
const RECOVERY_TIME: f64 = 0.05;
/// The same where they are only closer than it, as a pair may be that has just begun to count because its
/// direction changed: pushed apart at once it would cease to count, and the two would never rest.
const GENTLE_RECOVERY_TIME: f64 = 0.5;
/// Two contacts of a node are one when their directions and gaps (in contact distances) agree so well.
const TWIN_COSINE: f64 = 0.9999;
const TWIN_GAP: f64 = 0.01;

/// Pairs that a thread tests at a time.
const PAIRS_TOGETHER: usize = 256;

/// A possible contact of this step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) kind: PairKind,
    pub(crate) bodies: [u32; 2],
    pub(crate) nodes: [u32; 4],
    pub(crate) weights: [f64; 4],
    pub(crate) normal: DVec3,
    /// Gap at the start of the step [m], negative inside; `offset` more between the lips of a cut.
    pub(crate) gap: f64,
    /// By how much the surfaces may come closer than the contact distance before they push [m].
    pub(crate) offset: f64,
    /// Gap below which the surfaces push [m].
    pub(crate) distance: f64,
    /// Force per overlap [N/m].
    pub(crate) stiffness: f64,
    /// Largest gap at the end of the step that the contact may push to [m].
    pub(crate) recovery: f64,
    pub(crate) friction: f64,
    /// For a tie: from where side a should be to where it is at the start of the step [m]. A tie works
    /// against that in every direction with its stiffness; gap, recovery and friction do not count.
    pub(crate) tied: Option<DVec3>,
}

/// Which gap a contact has, along which normal.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    gap: f64,
    normal: DVec3,
    /// See [`Candidate::offset`].
    offset: f64,
}

/// What detection has found for a step.
#[derive(Clone, Copy)]
pub(crate) struct Detected<'a> {
    pub(crate) proximity: &'a [ProximityPair],
    pub(crate) penetration: &'a [PenetratingNode],
}

/// What the filter sees of one body.
#[derive(Clone, Copy)]
pub(crate) struct BodyView<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) parameters: &'a ContactParameters,
    /// Positions at the start of the step.
    pub(crate) positions: &'a [Point],
}

impl BodyView<'_> {
    fn at(&self, node: u32) -> DVec3 {
        DVec3::from_array(self.positions[node as usize])
    }

    fn rest(&self, node: u32) -> DVec3 {
        DVec3::from_array(self.surface.mesh().nodes()[node as usize])
    }
}

/// Finds the contact candidates of a step. Keeps its memory.
#[derive(Debug, Default)]
pub(crate) struct Filter {
    /// (body, node, other body) of the nodes that are inside another body, sorted.
    inside: Vec<(u32, u32, u32)>,
    /// (body, node, other body) of the nodes that are attached to another body, sorted: they do not
    /// push it.
    attached: Vec<(u32, u32, u32)>,
    /// (body, node, other body, candidate) of the nodes against triangles, sorted.
    by_node: Vec<(u32, u32, u32, u32)>,
    /// Candidates of pairs that were tested together.
    found: Vec<Vec<Candidate>>,
}

impl Filter {
    pub(crate) fn new(attached: Vec<(u32, u32, u32)>) -> Self {
        Self { attached, ..Self::default() }
    }

    /// Adds the contact candidates of this step, in the order of the pairs, then of the penetrations.
    /// `is_loaded` tells which pairs carried a force in the last step.
    pub(crate) fn run<'a>(
        &mut self,
        Detected { proximity, penetration }: Detected<'_>,
        view: impl Fn(u32) -> BodyView<'a> + Sync,
        is_loaded: impl Fn(&ProximityPair) -> bool + Sync,
        time_step: f64,
        pool: Option<&rayon::ThreadPool>,
        candidates: &mut Vec<Candidate>,
    ) {
        self.inside.clear();
        self.inside.extend(penetration.iter().map(|p| (p.body, p.node, p.into_body)));
        self.inside.sort_unstable();
        let mut found = std::mem::take(&mut self.found);
        let count = proximity.len().div_ceil(PAIRS_TOGETHER);
        found.resize_with(count.max(found.len()), Vec::new);
        let test = |(pairs, found): (&[ProximityPair], &mut Vec<Candidate>)| {
            found.clear();
            let candidate = |pair| self.test(pair, &view, &is_loaded, time_step);
            found.extend(pairs.iter().filter_map(candidate));
        };
        let found_by = &mut found[..count];
        match pool {
            Some(pool) => pool.install(|| {
                proximity.par_chunks(PAIRS_TOGETHER).zip(found_by).for_each(test);
            }),
            None => proximity.chunks(PAIRS_TOGETHER).zip(found_by).for_each(test),
        }
        for found in &found[..count] {
            candidates.extend_from_slice(found);
        }
        self.found = found;
        self.drop_twins(candidates);
        for node in penetration {
            let bodies = [view(node.body), view(node.into_body)];
            if bodies[0].parameters.rigid && bodies[1].parameters.rigid {
                continue;
            }
            let [a, b, c] = bodies[1].surface.mesh().triangles()[node.triangle as usize];
            let [wa, wb, wc] = node.weights;
            let pair = ProximityPair {
                kind: PairKind::VertexTriangle,
                bodies: [node.body, node.into_body],
                elements: [node.node, node.triangle],
                nodes: [node.node, a, b, c],
                weights: [1.0, -wa, -wb, -wc],
                normal: node.direction,
                distance: node.depth,
            };
            if self.is_attached(&pair) {
                continue;
            }
            let area = bodies[0].surface.node_area(node.node);
            let normal = DVec3::from_array(node.direction);
            candidates.push(candidate(&pair, -node.depth, normal, area, bodies, time_step));
        }
    }

    /// The contact of a pair, if it is one.
    fn test<'a>(
        &self,
        pair: &ProximityPair,
        view: impl Fn(u32) -> BodyView<'a>,
        is_loaded: impl Fn(&ProximityPair) -> bool,
        time_step: f64,
    ) -> Option<Candidate> {
        let bodies = pair.bodies.map(view);
        if (bodies[0].parameters.rigid && bodies[1].parameters.rigid) || self.is_attached(pair) {
            return None;
        }
        let Meeting { gap, normal, offset } = match pair.kind {
            PairKind::VertexTriangle => self.vertex_triangle(pair, bodies),
            PairKind::EdgeEdge => edge_edge(pair, bodies, is_loaded(pair)),
        }?;
        if pair.bodies[0] == pair.bodies[1] && is_inside_out(pair, &bodies[0]) {
            return None;
        }
        let area = match pair.kind {
            PairKind::VertexTriangle => bodies[0].surface.node_area(pair.nodes[0]),
            PairKind::EdgeEdge => {
                0.5 * (bodies[0].surface.edge_area(pair.elements[0])
                    + bodies[1].surface.edge_area(pair.elements[1]))
            }
        };
        let candidate = candidate(pair, gap + offset, normal, area, bodies, time_step);
        Some(Candidate { offset, ..candidate })
    }

    /// Whether all nodes of one side of a pair are attached to the body of the other.
    fn is_attached(&self, pair: &ProximityPair) -> bool {
        if self.attached.is_empty() || pair.bodies[0] == pair.bodies[1] {
            return false;
        }
        (0..2).any(|own| {
            (0..4).filter(|&corner| side(pair.kind, corner) == own).all(|corner| {
                let key = (pair.bodies[own], pair.nodes[corner], pair.bodies[1 - own]);
                self.attached.binary_search(&key).is_ok()
            })
        })
    }

    /// Keeps one of several contacts of a node with a body in the same direction: straight above an
    /// edge of a flat surface round-off lets both triangles have it.
    fn drop_twins(&mut self, candidates: &mut Vec<Candidate>) {
        self.by_node.clear();
        for (index, c) in candidates.iter().enumerate() {
            if c.kind == PairKind::VertexTriangle && c.tied.is_none() {
                self.by_node.push((c.bodies[0], c.nodes[0], c.bodies[1], index as u32));
            }
        }
        self.by_node.sort_unstable();
        for group in self.by_node.chunk_by(|a, b| (a.0, a.1, a.2) == (b.0, b.1, b.2)) {
            for (place, &(.., later)) in group.iter().enumerate().skip(1) {
                let twin = group[..place].iter().any(|&(.., first)| {
                    let (first, later) = (&candidates[first as usize], &candidates[later as usize]);
                    first.stiffness > 0.0
                        && first.normal.dot(later.normal) > TWIN_COSINE
                        && (first.gap - later.gap).abs() < TWIN_GAP * first.distance
                });
                if twin {
                    candidates[later as usize].stiffness = 0.0;
                }
            }
        }
        candidates.retain(|candidate| candidate.stiffness > 0.0);
    }

    /// Gap and normal of a node against a triangle, if the pair is a contact.
    fn vertex_triangle(
        &self,
        pair: &ProximityPair,
        [own, other]: [BodyView<'_>; 2],
    ) -> Option<Meeting> {
        let key = (pair.bodies[0], pair.nodes[0], pair.bodies[1]);
        if self.inside.binary_search(&key).is_ok() {
            return None;
        }
        let mut normal = DVec3::from_array(pair.normal);
        let mut gap = pair.distance;
        let node = pair.nodes[0];
        let (triangle, corners) = (pair.elements[1], &pair.nodes[1..]);
        let weights = &pair.weights[1..];
        let outward = match weights.iter().filter(|&&weight| weight != 0.0).count() {
            3 => other.surface.triangle_normal(triangle, other.positions),
            2 => {
                let zero = weights.iter().position(|&weight| weight == 0.0)?;
                let edge = other.surface.mesh().triangle_edges()[triangle as usize][(zero + 1) % 3];
                let triangles = other.surface.edge_triangles(edge);
                let from = other.at(corners[(zero + 1) % 3]);
                let away = |&(_, node): &(u32, u32)| {
                    leads_away(other.at(node) - from, normal, ANGLE_SLACK)
                };
                if triangles[0].0 != triangle || (gap > 0.0 && !triangles.iter().all(away)) {
                    return None;
                }
                other.surface.edge_normal(edge, other.positions)
            }
            _ => {
                let corner = corners[weights.iter().position(|&weight| weight != 0.0)?];
                let from = other.at(corner);
                let away = |&node: &u32| leads_away(other.at(node) - from, normal, ANGLE_SLACK);
                if other.surface.node_triangles(corner)[0] != triangle
                    || (gap > 0.0 && !other.surface.node_neighbours(corner).iter().all(away))
                {
                    return None;
                }
                other.surface.node_normal(corner, other.positions)
            }
        };
        let own_surface = pair.bodies[0] == pair.bodies[1];
        let mut behind = other.surface.is_closed() && outward.dot(normal) < 0.0;
        let mut offset = 0.0;
        if own_surface {
            let h = own.parameters.distance(own.parameters);
            let apart = rest_distance(pair, [own, other]);
            let lips = apart < PASSED_THROUGH * h && are_lips(pair, &own);
            if apart < REST_NEIGHBOUR * h && !lips {
                return None;
            }
            if lips {
                offset = h - apart.min(h);
            }
            if behind && (lips || apart > PASSED_THROUGH * gap.max(h)) {
                // Through its own surface: pushed back the way it came.
                (gap, normal, behind) = (-gap, -normal, false);
            }
        }
        if behind {
            return None;
        }
        let faces_away = own.surface.is_closed()
            && own.surface.node_normal(node, own.positions).dot(normal) > FACING_LIMIT;
        if !faces_away {
            return Some(Meeting { gap, normal, offset });
        }
        // The node of a closed body has slipped through an open surface when an edge from it
        // crosses back: it is pulled out again. Otherwise it only sees that surface through its body.
        let through = !other.surface.is_closed()
            && own
                .surface
                .node_neighbours(node)
                .iter()
                .any(|&neighbour| (own.at(neighbour) - own.at(node)).dot(normal) < -gap);
        through.then_some(Meeting { gap: -gap, normal: -normal, offset: 0.0 })
    }
}

/// Whether a node and a triangle of one body face each other at rest, as the two lips of a cut do, where
/// they are closer than any contact distance. On the two sides of a thin wall each is behind the other.
/// Where the node is closest to an edge or a corner, one of the triangles around it is enough: around
/// the rim of a lip is skin as well.
fn are_lips(pair: &ProximityPair, body: &BodyView<'_>) -> bool {
    let mesh = body.surface.mesh();
    let node = pair.nodes[0];
    let normal = body.surface.node_normal(node, mesh.nodes());
    let faces = |triangle: u32| {
        let facing = body.surface.triangle_normal(triangle, mesh.nodes());
        let corner = mesh.triangles()[triangle as usize][0];
        let height = (body.rest(node) - body.rest(corner)).dot(facing);
        height > -COINCIDENT * body.parameters.mean_edge && normal.dot(facing) < LIP_COSINE
    };
    let weights = &pair.weights[1..];
    match weights.iter().filter(|&&weight| weight != 0.0).count() {
        3 => faces(pair.elements[1]),
        2 => {
            let zero = weights.iter().position(|&weight| weight == 0.0).unwrap_or(0);
            let edge = mesh.triangle_edges()[pair.elements[1] as usize][(zero + 1) % 3];
            body.surface.edge_triangles(edge).iter().any(|&(triangle, _)| faces(triangle))
        }
        _ => {
            let corner = weights.iter().position(|&weight| weight != 0.0).unwrap_or(0);
            body.surface.node_triangles(pair.nodes[1 + corner]).iter().any(|&t| faces(t))
        }
    }
}

/// Whether the tissue at a pair of one body is turned inside out: there its surface lies folded over itself
/// on the wrong side, and contacts would hold it so.
fn is_inside_out(pair: &ProximityPair, body: &BodyView<'_>) -> bool {
    let mesh = body.surface.mesh();
    let is_turned = |triangle: u32| {
        let Some(&owner) = mesh.triangle_owners().get(triangle as usize) else { return false };
        let corners = mesh.tetrahedra()[owner as usize];
        signed_volume(&corners.map(|node| body.positions[node as usize])) <= 0.0
    };
    let at_edge = |edge: u32| body.surface.edge_triangles(edge).iter().any(|&(t, _)| is_turned(t));
    let [a, b] = pair.elements;
    match pair.kind {
        PairKind::VertexTriangle => {
            is_turned(b) || body.surface.node_triangles(a).iter().any(|&t| is_turned(t))
        }
        PairKind::EdgeEdge => at_edge(a) || at_edge(b),
    }
}

/// Gap and normal of an edge against an edge, if the pair is a contact.
fn edge_edge(
    pair: &ProximityPair,
    [own, other]: [BodyView<'_>; 2],
    is_loaded: bool,
) -> Option<Meeting> {
    let (slack, sharp_edge) =
        if is_loaded { (LOADED_SLACK, LOADED_SHARP_EDGE) } else { (ANGLE_SLACK, SHARP_EDGE) };
    if pair.weights.contains(&0.0) {
        return None;
    }
    let normal = DVec3::from_array(pair.normal);
    let inside_cone = |body: &BodyView<'_>, edge: u32, from: u32, direction: DVec3| {
        let triangles = body.surface.edge_triangles(edge);
        let from = body.at(from);
        let away = |&(_, node): &(u32, u32)| leads_away(body.at(node) - from, direction, slack);
        let convex = match triangles {
            [(first, _), (second, _)] => {
                let first = body.surface.triangle_normal(*first, body.positions);
                let second = body.surface.triangle_normal(*second, body.positions);
                let sharp = first.cross(second).length() > sharp_edge || first.dot(second) < 0.0;
                // Behind the edge of a closed surface is the inside of the body.
                sharp && (!body.surface.is_closed() || (first + second).dot(direction) > 0.0)
            }
            _ => true,
        };
        convex && triangles.iter().all(away)
    };
    let kept = inside_cone(&own, pair.elements[0], pair.nodes[0], -normal)
        && inside_cone(&other, pair.elements[1], pair.nodes[2], normal);
    let neighbours = pair.bodies[0] == pair.bodies[1]
        && rest_distance(pair, [own, other])
            < REST_NEIGHBOUR * own.parameters.distance(own.parameters);
    (kept && !neighbours).then_some(Meeting { gap: pair.distance, normal, offset: 0.0 })
}

/// True when going along `step` does not come closer to a point in direction `normal`.
fn leads_away(step: DVec3, normal: DVec3, slack: f64) -> bool {
    step.dot(normal) <= slack * step.length()
}

/// Distance between the two contact points when the body is at rest [m].
fn rest_distance(pair: &ProximityPair, bodies: [BodyView<'_>; 2]) -> f64 {
    let mut difference = DVec3::ZERO;
    for (corner, (&node, &weight)) in pair.nodes.iter().zip(&pair.weights).enumerate() {
        difference += weight * bodies[side(pair.kind, corner)].rest(node);
    }
    difference.length()
}

fn candidate(
    pair: &ProximityPair,
    gap: f64,
    normal: DVec3,
    area: f64,
    [own, other]: [BodyView<'_>; 2],
    time_step: f64,
) -> Candidate {
    let (a, b) = (own.parameters, other.parameters);
    let distance = a.distance(b);
    let recovery_time = if gap < 0.0 { RECOVERY_TIME } else { GENTLE_RECOVERY_TIME };
    // Both surfaces of a soft pair bring contacts to the same patch.
    let share = if a.rigid || b.rigid { 1.0 } else { 0.5 };
    let stiffness = share * area * a.stiffness(b);
    Candidate {
        kind: pair.kind,
        bodies: pair.bodies,
        nodes: pair.nodes,
        weights: pair.weights,
        normal,
        gap,
        offset: 0.0,
        distance,
        stiffness,
        recovery: gap + distance * time_step / recovery_time,
        friction: a.friction(b),
        tied: None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use palpate_model::{Body, Mesh, MeshData};

    use super::*;

    /// A tetrahedron with an edge from `a` to `b` whose faces fall off to `c` and `d`.
    fn roof(nodes: [Point; 4]) -> Body {
        let mut data = MeshData { nodes: nodes.to_vec(), ..MeshData::default() };
        let [a, b, c, d] = nodes.map(DVec3::from_array);
        let upright = (b - a).cross(c - a).dot(d - a) > 0.0;
        data.tetrahedra.push(if upright { [0, 1, 2, 3] } else { [0, 1, 3, 2] });
        Body::new("roof", Arc::new(Mesh::new(data).unwrap()))
    }

    /// Whether two roofs with a slope of `slope` touch with their edges, crosswise.
    fn edges_touch(slope: f64, is_loaded: bool) -> bool {
        let below =
            roof([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, -slope], [1.0, 0.0, -slope]]);
        let above = roof([
            [-1.0, 0.0, 0.01],
            [1.0, 0.0, 0.01],
            [0.0, -1.0, 0.01 + slope],
            [0.0, 1.0, 0.01 + slope],
        ]);
        let bodies = [above, below];
        let surfaces = bodies.each_ref().map(|body| Surface::new(&body.mesh));
        let parameters = bodies.each_ref().map(|body| ContactParameters::new(0, body).unwrap());
        let edge = |body: usize| {
            let edges = bodies[body].mesh.surface_edges();
            edges.iter().position(|edge| edge.contains(&0) && edge.contains(&1)).unwrap() as u32
        };
        let pair = ProximityPair {
            kind: PairKind::EdgeEdge,
            bodies: [0, 1],
            elements: [edge(0), edge(1)],
            nodes: [0, 1, 0, 1],
            weights: [0.5, 0.5, -0.5, -0.5],
            normal: [0.0, 0.0, 1.0],
            distance: 0.01,
        };
        let view = |body: u32| BodyView {
            surface: &surfaces[body as usize],
            parameters: &parameters[body as usize],
            positions: bodies[body as usize].mesh.nodes(),
        };
        let mut candidates = Vec::new();
        Filter::default().run(
            Detected { proximity: &[pair], penetration: &[] },
            view,
            |_| is_loaded,
            0.01,
            None,
            &mut candidates,
        );
        !candidates.is_empty()
    }

    #[test]
    fn a_pair_that_bears_a_force_is_not_dropped_at_the_limit_where_it_began() {
        assert!(edges_touch(0.2, false) && edges_touch(0.2, true));
        assert!(!edges_touch(0.1, false) && edges_touch(0.1, true));
        assert!(!edges_touch(0.02, false) && !edges_touch(0.02, true));
    }

    /// How many contacts there are where the tip of one tetrahedron of a body is just above another one,
    /// its other nodes `height` above the tip.
    fn own_contacts(height: f64) -> usize {
        let below = [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]];
        let above = |tip: f64| {
            let top = tip + height;
            [[0.0, 0.0, tip], [1.0, 0.0, top], [-1.0, 1.0, top], [-1.0, -1.0, top]]
        };
        let upright = [[0.0, 0.0, 9.0], [1.0, 0.0, 10.0], [-1.0, 1.0, 10.0], [-1.0, -1.0, 10.0]];
        let data = MeshData {
            nodes: [below, upright].concat(),
            tetrahedra: vec![[0, 1, 2, 3], [4, 5, 6, 7]],
            ..MeshData::default()
        };
        let body = Body::new("two", Arc::new(Mesh::new(data).unwrap()));
        let surface = Surface::new(&body.mesh);
        let parameters = ContactParameters::new(0, &body).unwrap();
        let positions = [below, above(0.01)].concat();
        let facing = |corners: &[u32; 3]| corners.iter().all(|corner| (1..4).contains(corner));
        let triangle = body.mesh.triangles().iter().position(facing).unwrap();
        let [a, b, c] = body.mesh.triangles()[triangle];
        // The tip is above the middle of the triangle's nodes 1, 2 and 3, at (0, 0, 0).
        let weight = |node: u32| if node == 1 { -0.5 } else { -0.25 };
        let pair = ProximityPair {
            kind: PairKind::VertexTriangle,
            bodies: [0, 0],
            elements: [4, triangle as u32],
            nodes: [4, a, b, c],
            weights: [1.0, weight(a), weight(b), weight(c)],
            normal: [0.0, 0.0, 1.0],
            distance: 0.01,
        };
        let view =
            |_| BodyView { surface: &surface, parameters: &parameters, positions: &positions };
        let detected = Detected { proximity: &[pair], penetration: &[] };
        let mut candidates = Vec::new();
        Filter::default().run(detected, view, |_| false, 0.01, None, &mut candidates);
        candidates.len()
    }

    #[test]
    fn a_body_does_not_push_itself_where_it_is_inside_out() {
        assert_eq!(own_contacts(1.0), 1);
        assert_eq!(own_contacts(0.0), 0);
        assert_eq!(own_contacts(-0.005), 0);
    }
}
