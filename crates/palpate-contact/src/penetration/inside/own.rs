//! Which surface nodes are inside their own body.
//!
//! A node is where its own tetrahedra meet, and what covers it are others. So two nodes of one triangle
//! may differ although nothing crosses it: where the lips of a cut have passed each other they are
//! covered, its front is not, nor what is beyond. What a triangle that does not cross has in common with
//! those beside it, across their edges, is whether the body is just outside of it. That says which
//! nodes to look at, and each of them is located by itself.

use std::f64::consts::PI;

use palpate_geometry::{Point, vec3};

use super::{Inside, Location, reset};
use crate::frame::SceneBody;

impl Inside {
    /// Locates the nodes of `body` in itself, given its crossing triangles, also those with common nodes,
    /// some of them several times. A node for which `is_covered` does not know is inside when the body is
    /// just outside of a triangle that it has.
    pub(in crate::penetration) fn locate_own(
        &mut self,
        body: &SceneBody,
        crossing: impl Iterator<Item = u32>,
        mut is_covered: impl FnMut(u32) -> Option<bool>,
    ) {
        self.begin(body, crossing);
        for index in 0..self.border.len() {
            let node = self.border[index];
            self.locate_node(node, &mut is_covered);
        }
        let triangle_count = body.mesh.triangles().len();
        reset(&mut self.seen, triangle_count, false);
        for triangle in 0..triangle_count as u32 {
            if self.is_new(triangle) {
                self.collect_part(body, triangle);
                if self.is_part_covered(body, &mut is_covered) {
                    self.locate_part(body, &mut is_covered);
                }
            }
        }
        // Components leave as a whole when all of them is inside.
        for &node in body.mesh.surface_nodes() {
            if self.sides[node as usize] != Location::Inside {
                self.component_crosses[body.surface.components[node as usize] as usize] = true;
            }
        }
        let Self { nodes, swallowed, component_crosses, .. } = self;
        nodes.sort_unstable();
        nodes.retain(|&node| {
            let component = body.surface.components[node as usize];
            let stays = component_crosses[component as usize];
            if !stays {
                swallowed.push((component, node));
            }
            stays
        });
        swallowed.sort_unstable();
    }

    fn locate_node(&mut self, node: u32, is_covered: &mut impl FnMut(u32) -> Option<bool>) {
        match is_covered(node) {
            Some(true) => self.found_inside(node),
            Some(false) => self.sides[node as usize] = Location::Outside,
            None => self.sides[node as usize] = Location::Border,
        }
    }

    fn found_inside(&mut self, node: u32) {
        self.sides[node as usize] = Location::Inside;
        self.nodes.push(node);
    }

    /// Whether a triangle is of a part that was not collected, which it then counts as.
    fn is_new(&mut self, triangle: u32) -> bool {
        !self.crosses[triangle as usize]
            && !std::mem::replace(&mut self.seen[triangle as usize], true)
    }

    /// Collects the triangles that hang together with a new one across edges, none of which crosses.
    fn collect_part(&mut self, body: &SceneBody, first: u32) {
        self.part.clear();
        self.part.push(first);
        let mut next = 0;
        while let Some(&triangle) = self.part.get(next) {
            next += 1;
            let [a, b, c] = body.mesh.triangles()[triangle as usize];
            for edge in [[a, b], [b, c], [c, a]] {
                if let Some(beside) = beside(body, triangle, edge)
                    && self.is_new(beside)
                {
                    self.part.push(beside);
                }
            }
        }
    }

    /// Whether the body is just outside of the collected part.
    fn is_part_covered(
        &mut self,
        body: &SceneBody,
        is_covered: &mut impl FnMut(u32) -> Option<bool>,
    ) -> bool {
        for index in 0..self.part.len() {
            for node in body.mesh.triangles()[self.part[index] as usize] {
                if self.sides[node as usize] == Location::Unknown {
                    self.locate_node(node, is_covered);
                }
                match self.sides[node as usize] {
                    Location::Inside => return true,
                    Location::Outside if self.is_plain(body, node) => return false,
                    _ => {}
                }
            }
        }
        false
    }

    /// Whether the tetrahedra around a node are certainly not just outside of its triangles themselves,
    /// so that a node that no other covers has nothing there: nothing crosses these triangles, they go
    /// round the node once, and the tetrahedra do not fill all that is around it, let alone more.
    fn is_plain(&self, body: &SceneBody, node: u32) -> bool {
        let around = body.surface.triangles_of_nodes.of(node);
        around.iter().all(|&triangle| !self.crosses[triangle as usize])
            && goes_round_once(body, node, around)
            && !is_surrounded(body, node)
    }

    /// Locates the nodes of the collected part, which has the body outside of it.
    fn locate_part(&mut self, body: &SceneBody, is_covered: &mut impl FnMut(u32) -> Option<bool>) {
        for index in 0..self.part.len() {
            for node in body.mesh.triangles()[self.part[index] as usize] {
                if self.sides[node as usize] == Location::Unknown {
                    self.locate_node(node, is_covered);
                }
                if self.sides[node as usize] == Location::Border {
                    self.found_inside(node);
                }
            }
        }
    }
}

/// The triangle across an edge; `None` where there are several.
fn beside(body: &SceneBody, triangle: u32, [from, to]: [u32; 2]) -> Option<u32> {
    let around = body.surface.triangles_of_nodes.of(from).iter().copied();
    let has_edge =
        |&other: &u32| other != triangle && body.mesh.triangles()[other as usize].contains(&to);
    let mut others = around.filter(has_edge);
    others.next().filter(|_| others.next().is_none())
}

/// Whether all the triangles `around` a node follow each other across its edges.
fn goes_round_once(body: &SceneBody, node: u32, around: &[u32]) -> bool {
    let (mut triangle, mut count) = (around[0], 0);
    loop {
        // From the edge before the node to the one behind it: surfaces are oriented.
        let nodes = body.mesh.triangles()[triangle as usize];
        let own = nodes.iter().position(|&corner| corner == node).unwrap_or_default();
        count += 1;
        match beside(body, triangle, [node, nodes[(own + 1) % 3]]) {
            Some(next) if next == around[0] => return count == around.len(),
            Some(next) if count < around.len() => triangle = next,
            _ => return false,
        }
    }
}

/// Whether the tetrahedra around a node may go all round it, or further.
fn is_surrounded(body: &SceneBody, node: u32) -> bool {
    let around = body.surface.tetrahedra_of_nodes(&body.mesh).of(node);
    let angles = around.iter().map(|&tetrahedron| {
        let nodes = body.mesh.tetrahedra()[tetrahedron as usize];
        let own = nodes.iter().position(|&corner| corner == node).unwrap_or_default();
        let at = |turn: usize| body.positions[nodes[(own + turn) % 4] as usize];
        solid_angle(at(0), [at(1), at(2), at(3)])
    });
    angles.sum::<f64>() > 4.0 * PI * (1.0 - 1e-9)
}

/// Of a triangle seen from a point, without sign (Van Oosterom and Strackee 1983).
fn solid_angle(from: Point, triangle: [Point; 3]) -> f64 {
    let [a, b, c] = triangle.map(|corner| vec3::sub(corner, from));
    let [la, lb, lc] = [a, b, c].map(vec3::norm);
    let volume = vec3::dot(a, vec3::cross(b, c)).abs();
    let cosine = la * lb * lc + vec3::dot(a, b) * lc + vec3::dot(b, c) * la + vec3::dot(c, a) * lb;
    2.0 * volume.atan2(cosine)
}
