//! What ties nodes: springs to a place in space, which a mouse or a haptic device pulls with, and
//! attachments to other bodies.

use glam::DVec3;
use palpate_contact::PairKind;
use palpate_geometry::Point;
use palpate_model::{AttachedNode, Attachment, triangle_axes};

use crate::contact::filter::Candidate;

/// A spring from a node to a target.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct Pull {
    /// Tells it from all other pulls of the simulation.
    pub id: u64,
    /// The body, and the node of it, that is pulled.
    pub body: u32,
    /// The node.
    pub node: u32,
    /// Where the spring ends [m].
    pub target: Point,
    /// Force per distance [N/m].
    pub stiffness: f64,
    /// Force on the node in the last step [N].
    pub force: Point,
    /// How far the target has moved since the last step [m]: contacts are looked for as far ahead.
    pub moved: f64,
}

/// A node of one body that is tied to the surface of another.
#[derive(Clone, Copy, Debug)]
struct TiedNode {
    bodies: [u32; 2],
    place: AttachedNode,
    stiffness: f64,
}

/// All springs of a simulation, in the order in which they were made, and then the attachments of its
/// model.
#[derive(Debug, Default)]
pub(crate) struct Ties {
    pulls: Vec<Pull>,
    next_id: u64,
    attached: Vec<TiedNode>,
}

impl Ties {
    /// Ties what `attachment` names; `stiffness` gives that of a node of the first body [N/m].
    pub(crate) fn attach(&mut self, attachment: &Attachment, stiffness: impl Fn(u32) -> f64) {
        let bodies = attachment.bodies.map(|body| body as u32);
        self.attached.extend(attachment.ties.iter().map(|&place| {
            let stiffness = stiffness(place.node);
            TiedNode { bodies, place, stiffness }
        }));
    }

    /// Unties what is attached.
    pub(crate) fn detach(&mut self) {
        self.attached.clear();
    }

    pub(crate) fn pulls(&self) -> &[Pull] {
        &self.pulls
    }

    /// Adds a spring to a node that is at `position`; returns its identity.
    pub(crate) fn pull(
        &mut self,
        (body, node): (u32, u32),
        position: Point,
        target: Point,
        stiffness: f64,
    ) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        let moved = distance(position, target);
        self.pulls.push(Pull { id, body, node, target, stiffness, force: [0.0; 3], moved });
        id
    }

    pub(crate) fn find(&mut self, id: u64) -> Option<&mut Pull> {
        self.pulls.iter_mut().find(|pull| pull.id == id)
    }

    pub(crate) fn set_target(&mut self, id: u64, target: Point) -> bool {
        let Some(pull) = self.find(id) else { return false };
        pull.moved += distance(pull.target, target);
        pull.target = target;
        true
    }

    pub(crate) fn release(&mut self, id: u64) -> bool {
        let count = self.pulls.len();
        self.pulls.retain(|pull| pull.id != id);
        self.pulls.len() < count
    }

    /// Gives the springs of a body other nodes; those whose node has gone are released and returned.
    pub(crate) fn change_body(
        &mut self,
        body: u32,
        node_after: impl Fn(u32) -> Option<u32>,
    ) -> Vec<u64> {
        let mut released = Vec::new();
        self.pulls.retain_mut(|pull| {
            if pull.body != body {
                return true;
            }
            match node_after(pull.node) {
                Some(node) => pull.node = node,
                None => released.push(pull.id),
            }
            released.last() != Some(&pull.id)
        });
        released
    }

    /// Goes back to other springs; new ones will not have an identity that was used before.
    pub(crate) fn restore(&mut self, pulls: &[Pull]) {
        self.pulls.clear();
        self.pulls.extend_from_slice(pulls);
        let used = pulls.iter().map(|pull| pull.id.saturating_add(1)).max().unwrap_or(0);
        self.next_id = self.next_id.max(used);
    }

    /// How far targets of a body's springs have moved since the last step, at most [m].
    pub(crate) fn moved(&self, body: usize) -> f64 {
        let pulls = self.pulls.iter().filter(|pull| pull.body as usize == body);
        pulls.map(|pull| pull.moved).fold(0.0, f64::max)
    }

    /// How much closer to each other two nodes of a body are pulled by that, at most [m].
    pub(crate) fn drawn(&self, body: usize) -> f64 {
        let pulls = self.pulls.iter().filter(|pull| pull.body as usize == body);
        let two = pulls.fold([0.0_f64; 2], |[first, second], pull| {
            [first.max(pull.moved), second.max(first.min(pull.moved))]
        });
        two.iter().sum()
    }

    /// Adds all ties to the candidates of a step, the springs first; `place` gives the position of a node and the
    /// contact distance of its body. Springs' ends go a `part` of their way from where they were.
    pub(crate) fn add_candidates(
        &self,
        place: impl Fn(u32, u32) -> (Point, f64),
        part: f64,
        candidates: &mut Vec<Candidate>,
    ) {
        candidates.extend(self.pulls.iter().map(|pull| {
            let (position, distance) = place(pull.body, pull.node);
            let mut offset = DVec3::from_array(position) - DVec3::from_array(pull.target);
            if part < 1.0 {
                let before = DVec3::from_array(pull.force) / -pull.stiffness;
                offset = before + part * (offset - before);
            }
            Candidate {
                bodies: [pull.body; 2],
                nodes: [pull.node; 4],
                weights: [1.0, 0.0, 0.0, 0.0],
                stiffness: pull.stiffness,
                ..tie(offset, distance)
            }
        }));
        candidates.extend(self.attached.iter().map(|tied| {
            let AttachedNode { node, corners, weights, offset } = tied.place;
            let (position, distance) = place(tied.bodies[0], node);
            let at = corners.map(|corner| DVec3::from_array(place(tied.bodies[1], corner).0));
            let foot: DVec3 = at.iter().zip(weights).map(|(&x, w)| w * x).sum();
            let goal = foot + triangle_axes(at) * DVec3::from_array(offset);
            let offset = DVec3::from_array(position) - goal;
            let [wa, wb, wc] = weights;
            Candidate {
                bodies: tied.bodies,
                nodes: [node, corners[0], corners[1], corners[2]],
                weights: [1.0, -wa, -wb, -wc],
                stiffness: tied.stiffness,
                ..tie(offset, distance)
            }
        }));
    }

    /// (body, node, other body) of everything that is attached, sorted.
    pub(crate) fn attached_nodes(&self) -> Vec<(u32, u32, u32)> {
        let key = |tied: &TiedNode| (tied.bodies[0], tied.place.node, tied.bodies[1]);
        let mut keys: Vec<_> = self.attached.iter().map(key).collect();
        keys.sort_unstable();
        keys
    }

    /// Keeps the forces of the step that ends, in which springs' ends went a `part` of their way: those of
    /// the springs come first [N].
    pub(crate) fn finish(&mut self, forces: impl Iterator<Item = DVec3>, part: f64) {
        for (pull, force) in self.pulls.iter_mut().zip(forces) {
            pull.force = force.to_array();
            pull.moved *= 1.0 - part;
        }
    }
}

/// A tie that nothing is known of but its offset [m].
fn tie(offset: DVec3, distance: f64) -> Candidate {
    Candidate {
        kind: PairKind::VertexTriangle,
        bodies: [0; 2],
        nodes: [0; 4],
        weights: [0.0; 4],
        normal: offset.try_normalize().unwrap_or(DVec3::X),
        gap: 0.0,
        offset: 0.0,
        distance,
        stiffness: 0.0,
        recovery: 0.0,
        friction: 0.0,
        tied: Some(offset),
    }
}

fn distance(a: Point, b: Point) -> f64 {
    DVec3::from_array(a).distance(DVec3::from_array(b))
}
