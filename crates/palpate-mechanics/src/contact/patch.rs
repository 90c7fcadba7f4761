//! What some surface nodes of a body answer to forces, apart from the body: it stays as it is until
//! somebody writes it anew.

use glam::{DMat3, DVec3, Vec3};

use super::coupling::add_columns;
use super::node_compliance::{LANES, NodeCompliance};
use crate::body::MovingBody;

const NONE: u32 = u32::MAX;

/// Where the products of half solutions are kept from one [`Patch`] of a body to the next.
#[derive(Debug, Default)]
pub struct PatchMemory {
    nodes: NodeCompliance,
    known: Vec<u32>,
}

/// Compliance between some nodes of one body: their displacements under forces on them within a step.
/// Dense, in single precision, in the frame of the body.
#[derive(Clone, Debug, Default)]
pub struct Patch {
    nodes: Vec<u32>,
    /// Node -> slot.
    slot_of: Vec<u32>,
    /// Axes of the body's frame.
    frame: DMat3,
    stride: usize,
    /// Slot k: nine stretches of `stride` entries; entry l of stretch `3 * axis + i` is the displacement
    /// along i of the node in slot l under a unit force along axis on that in slot k.
    values: Vec<f32>,
}

impl Patch {
    /// The nodes that it holds, ascending: those that were asked for and can move.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Displacement of one node under forces on another [m/N], in the axes of space; `None` where the
    /// patch does not hold them.
    pub fn compliance(&self, moved: u32, loaded: u32) -> Option<DMat3> {
        let own = self.entry(self.slot(moved)?, self.slot(loaded)?);
        Some(self.frame * own * self.frame.transpose())
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        for &node in &self.nodes {
            self.slot_of[node as usize] = NONE;
        }
        self.nodes.clear();
    }

    /// Takes in `nodes`, ascending, whose half solutions are prepared.
    pub(crate) fn write(&mut self, body: &MovingBody, nodes: &[u32], memory: &mut PatchMemory) {
        self.clear();
        let Some(elastic) = body.elastic() else { return };
        self.slot_of.resize(body.positions.len(), NONE);
        self.frame = elastic.frame();
        memory.known.clear();
        let known = |node: &&u32| body.compliance.half(**node).is_some();
        memory.known.extend(nodes.iter().filter(known));
        memory.nodes.gather(elastic, &body.compliance, &memory.known);
        self.nodes.extend_from_slice(&memory.known);
        self.stride = self.nodes.len().next_multiple_of(LANES);
        self.values.clear();
        self.values.resize(9 * self.stride * self.nodes.len(), 0.0);
        for (slot, &node) in self.nodes.iter().enumerate() {
            self.slot_of[node as usize] = slot as u32;
        }
        let turning = elastic.turning();
        for (loaded, &load) in self.nodes.iter().enumerate() {
            let column = memory.nodes.column(memory.nodes.slot(load));
            let from = memory.nodes.stride();
            let to = &mut self.values[9 * self.stride * loaded..][..9 * self.stride];
            for (moved, &node) in self.nodes.iter().enumerate() {
                let slot = memory.nodes.slot(node);
                for entry in 0..9 {
                    to[entry * self.stride + moved] = column[entry * from + slot];
                }
            }
            let Some(turning) = turning else { continue };
            let [turn, counter] = turning.coefficients(load, turning.arm(load));
            for (moved, &node) in self.nodes.iter().enumerate() {
                let (arm, response) = (turning.arm(node), turning.response(node));
                for axis in 0..3 {
                    let d = turn.col(axis).cross(arm) - response * counter.col(axis);
                    for (i, d) in d.to_array().into_iter().enumerate() {
                        to[(3 * axis + i) * self.stride + moved] += d as f32;
                    }
                }
            }
        }
    }

    pub(super) fn slot(&self, node: u32) -> Option<usize> {
        let slot = *self.slot_of.get(node as usize)?;
        (slot != NONE).then_some(slot as usize)
    }

    pub(super) fn frame(&self) -> DMat3 {
        self.frame
    }

    /// Response of the node in one slot to forces on that in another, in the frame.
    pub(super) fn entry(&self, moved: usize, loaded: usize) -> DMat3 {
        let column = &self.values[9 * self.stride * loaded..][..9 * self.stride];
        let entries = std::array::from_fn(|e| f64::from(column[e * self.stride + moved]));
        DMat3::from_cols_array(&entries)
    }

    /// Entries of an array of displacements.
    pub(super) fn moved_len(&self) -> usize {
        3 * self.stride
    }

    /// Displacement of the node in a slot, in the frame.
    pub(super) fn moved(&self, slot: usize, moved: &[f32]) -> Vec3 {
        Vec3::new(moved[slot], moved[self.stride + slot], moved[2 * self.stride + slot])
    }

    /// Adds to the displacements what forces on slots do, in the frame.
    pub(super) fn add_forces(&self, forces: &[(usize, DVec3)], moved: &mut [f32]) {
        for &(slot, force) in forces {
            let column = &self.values[9 * self.stride * slot..][..9 * self.stride];
            add_columns(&[(column, force.as_vec3())], moved);
        }
    }
}
