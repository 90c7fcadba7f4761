//! What a scene answers, and what the answer cost.

use std::time::Duration;

use crate::frame::SceneBody;
use crate::pairs::{PenetratingNode, ProximityPair, TrianglePair};

/// Surface triangles that meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Intersections {
    /// The pairs, sorted, each once.
    pub pairs: Vec<TrianglePair>,
    /// What finding them cost.
    pub stats: DetectionStats,
}

/// Nodes of surface triangles that meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactNodes {
    /// Per body, its nodes, sorted.
    pub nodes: Vec<Vec<u32>>,
    /// What finding the triangles cost.
    pub stats: DetectionStats,
}

impl ContactNodes {
    pub(crate) fn collect(&mut self, bodies: &[SceneBody], intersections: &Intersections) {
        self.stats = intersections.stats;
        self.nodes.resize(bodies.len(), Vec::new());
        self.nodes.iter_mut().for_each(Vec::clear);
        for pair in &intersections.pairs {
            let sides = [(pair.body_a, pair.triangle_a), (pair.body_b, pair.triangle_b)];
            for (body, triangle) in sides {
                let corners = bodies[body as usize].mesh.triangles()[triangle as usize];
                self.nodes[body as usize].extend(corners);
            }
        }
        for nodes in &mut self.nodes {
            nodes.sort_unstable();
            nodes.dedup();
        }
    }
}

/// Surface elements closer than the asked distance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proximity {
    /// The pairs, sorted by (kind, bodies, elements), each once.
    pub pairs: Vec<ProximityPair>,
    /// What finding them cost.
    pub stats: DetectionStats,
}

/// Surface nodes inside other bodies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Penetration {
    /// The nodes, sorted by (body, node, `into_body`).
    pub nodes: Vec<PenetratingNode>,
    /// What finding them cost.
    pub stats: DetectionStats,
}

/// Cost of one detection, by stage. A stage that the method does not have stays zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DetectionStats {
    /// Wall time of stage 1: which bodies can touch.
    pub object_time: Duration,
    /// Wall time of stage 2: which leaves can touch (hash: filling and reading the cells).
    pub traversal_time: Duration,
    /// Wall time of the tests on surface elements, sorting included.
    pub polygon_time: Duration,
    /// Body pairs that stage 1 passed on, a body with itself included.
    pub object_pairs: u64,
    /// Tree nodes whose box was tested, upper tree included.
    pub nodes_visited: u64,
    /// Pairs of leaves whose boxes meet.
    pub leaf_pairs: u64,
    /// Triangle-cell entries of the hash method.
    pub cell_entries: u64,
    /// Box tests of two triangles.
    pub box_tests: u64,
    /// Intersections: pairs of triangles tested exactly. Proximity: distances computed.
    /// Penetration: both, and points located.
    pub polygon_tests: u64,
    /// Pairs of triangles that the double loop would test.
    pub all_pairs: u64,
}

impl DetectionStats {
    /// Tests on surface elements as a fraction of all pairs of triangles; 0 when there are none.
    pub fn tested_fraction(&self) -> f64 {
        if self.all_pairs == 0 { 0.0 } else { self.polygon_tests as f64 / self.all_pairs as f64 }
    }

    /// Wall time of all stages.
    pub fn total_time(&self) -> Duration {
        self.object_time + self.traversal_time + self.polygon_time
    }
}

/// Cost of one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UpdateStats {
    /// Wall time, checks included.
    pub time: Duration,
    /// Tree nodes refitted.
    pub nodes_refitted: u64,
}
