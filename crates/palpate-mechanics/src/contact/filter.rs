//! From close pairs to contacts: which pairs carry a force, and with what law.
//!
//! Complete proximity has a node near an edge close to both triangles there and to some beyond.
//! Kept are the local minima of the distance between the surfaces, each once; detection may have left
//! out others (`ProximityOptions::local_minima`).

mod closest;
mod edge_edge;
mod own;
mod vertex_triangle;

use glam::DVec3;
use palpate_contact::{LOCAL_MINIMUM_SLACK, PairKind, PenetratingNode, ProximityPair};
use palpate_geometry::Point;
use rayon::prelude::*;

use super::{ContactParameters, Surface, side};
use edge_edge::edge_edge;
use own::is_inside_out;
use vertex_triangle::vertex_triangle;

/// Slack in the tests of direction: a flat surface must not lose its contacts to round-off.
const ANGLE_SLACK: f64 = 1e-6;
const _: () = assert!(ANGLE_SLACK < LOCAL_MINIMUM_SLACK, "what detection leaves out is no contact");
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
            PairKind::VertexTriangle => {
                let key = (pair.bodies[0], pair.nodes[0], pair.bodies[1]);
                let is_inside = self.inside.binary_search(&key).is_ok();
                if is_inside { None } else { vertex_triangle(pair, bodies) }
            }
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
}

/// True when going along `step` does not come closer to a point in direction `normal`.
fn leads_away(step: DVec3, normal: DVec3, slack: f64) -> bool {
    step.dot(normal) <= slack * step.length()
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
