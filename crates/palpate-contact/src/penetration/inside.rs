//! Which surface nodes are inside another body (`own.rs`: their own).
//!
//! Only crossing triangles change the side: what the others connect is inside as a whole, or outside. So
//! one point decides for each connected part next to crossing triangles, and for each component of the
//! surface that has none.

mod own;

use crate::frame::SceneBody;

/// What is known of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Location {
    /// Not located, and no matter unless its neighbours turn out to be inside.
    Unknown,
    /// Of a crossing triangle, not located yet; in its own body, a node that cannot be located.
    Border,
    Inside,
    Outside,
}

/// The nodes of a body that are inside. Keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Inside {
    sides: Vec<Location>,
    /// By triangle.
    crosses: Vec<bool>,
    /// By the smallest node of a component.
    component_crosses: Vec<bool>,
    border: Vec<u32>,
    pending: Vec<u32>,
    /// Nodes inside, of components that cross, or of which only a part is inside; sorted.
    pub(super) nodes: Vec<u32>,
    /// (component, node) of those that do not cross, all inside; sorted.
    pub(super) swallowed: Vec<(u32, u32)>,
    patch: Vec<bool>,
    /// By triangle, whether its part of the surface was collected; for nodes inside their own body.
    seen: Vec<bool>,
    part: Vec<u32>,
}

impl Inside {
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty() && self.swallowed.is_empty()
    }

    /// Whether a triangle crosses or has a node inside, after `make_patch`.
    pub(super) fn is_in_patch(&self, triangle: u32) -> bool {
        self.patch[triangle as usize]
    }

    /// Locates the nodes of `body` in another, given its crossing triangles, some of them several times.
    pub(super) fn locate(
        &mut self,
        body: &SceneBody,
        crossing: impl Iterator<Item = u32>,
        mut is_inside: impl FnMut(u32) -> bool,
    ) {
        self.begin(body, crossing);
        for index in 0..self.border.len() {
            let node = self.border[index];
            if self.sides[node as usize] == Location::Border {
                let side = if is_inside(node) { Location::Inside } else { Location::Outside };
                self.spread(body, node, side);
            }
        }
        for &node in &body.surface.component_nodes {
            if !self.component_crosses[node as usize] && is_inside(node) {
                let before = self.nodes.len();
                self.spread(body, node, Location::Inside);
                self.swallowed.extend(self.nodes.drain(before..).map(|inside| (node, inside)));
            }
        }
        self.nodes.sort_unstable();
        self.swallowed.sort_unstable();
    }

    /// Forgets everything and takes in the crossing triangles.
    fn begin(&mut self, body: &SceneBody, crossing: impl Iterator<Item = u32>) {
        let (triangles, surface) = (body.mesh.triangles(), &body.surface);
        let node_count = body.mesh.nodes().len();
        reset(&mut self.sides, node_count, Location::Unknown);
        reset(&mut self.crosses, triangles.len(), false);
        reset(&mut self.component_crosses, node_count, false);
        self.border.clear();
        self.nodes.clear();
        self.swallowed.clear();
        for triangle in crossing {
            if std::mem::replace(&mut self.crosses[triangle as usize], true) {
                continue;
            }
            let nodes = triangles[triangle as usize];
            self.component_crosses[surface.components[nodes[0] as usize] as usize] = true;
            for node in nodes {
                if std::mem::replace(&mut self.sides[node as usize], Location::Border)
                    == Location::Unknown
                {
                    self.border.push(node);
                }
            }
        }
    }

    /// Gives `side` to all that triangles which do not cross connect with `start`; outside no further
    /// than from border to border.
    fn spread(&mut self, body: &SceneBody, start: u32, side: Location) {
        self.sides[start as usize] = side;
        self.pending.push(start);
        while let Some(node) = self.pending.pop() {
            if side == Location::Inside {
                self.nodes.push(node);
            }
            for &triangle in body.surface.triangles_of_nodes.of(node) {
                if self.crosses[triangle as usize] {
                    continue;
                }
                for other in body.mesh.triangles()[triangle as usize] {
                    let former = &mut self.sides[other as usize];
                    if *former == Location::Border
                        || (*former == Location::Unknown && side == Location::Inside)
                    {
                        *former = side;
                        self.pending.push(other);
                    }
                }
            }
        }
    }

    /// Marks the triangles that cross or have a node inside.
    pub(super) fn make_patch(&mut self, body: &SceneBody) {
        self.patch.clear();
        self.patch.extend_from_slice(&self.crosses);
        let swallowed = self.swallowed.iter().map(|&(_, node)| node);
        for node in self.nodes.iter().copied().chain(swallowed) {
            for &triangle in body.surface.triangles_of_nodes.of(node) {
                self.patch[triangle as usize] = true;
            }
        }
    }
}

fn reset<T: Clone>(values: &mut Vec<T>, count: usize, value: T) {
    values.clear();
    values.resize(count, value);
}
