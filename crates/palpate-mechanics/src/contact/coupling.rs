//! How the contacts of one body move each other.
//!
//! A force on a contact is shared by its nodes by scalar weights, and a contact moves as the weighted
//! mean of its nodes, so the compliance between the contact nodes is all there is to know; to what the
//! body's rotation adds (see [`crate::body::turning`]) the same weights apply. All of it is in the
//! body's frame and in single precision: it shapes the contact forces, whose response is solved in
//! double precision.

use glam::{DMat3, DVec3, Mat3, Vec3};
use pulp::Simd;

use super::node_compliance::NodeCompliance;
use crate::body::MovingBody;
use crate::body::turning::Turning;

/// Entries behind the displacements of the nodes: how far the body turns, and counter-turns.
const TURN_LEN: usize = 6;

/// The nodes of one body that a contact holds, with their weights, and how it turns the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corners {
    nodes: [u32; 4],
    slots: [u32; 4],
    weights: [f32; 4],
    count: u32,
    turns: bool,
    /// Turn and counter-turn per force on the contact.
    turn: [Mat3; 2],
    /// Arm of the contact, and its displacement per counter-turn.
    arm: Vec3,
    loaded: Mat3,
}

impl Corners {
    pub(super) fn push(&mut self, node: u32, weight: f64) {
        let place = self.count as usize;
        self.nodes[place] = node;
        self.weights[place] = weight as f32;
        self.count += 1;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn nodes(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        let weights = self.weights.iter().map(|&weight| f64::from(weight));
        self.nodes.iter().copied().zip(weights).take(self.count as usize)
    }

    fn slots(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        let slots = self.slots.iter().map(|&slot| slot as usize);
        slots.zip(self.weights).take(self.count as usize)
    }

    fn set_turning(&mut self, turning: &Turning) {
        let (mut arm, mut loaded) = (DVec3::ZERO, DMat3::ZERO);
        for (node, weight) in self.nodes() {
            arm += weight * turning.arm(node);
            loaded += weight * turning.response(node);
        }
        let coefficients = [DVec3::X, DVec3::Y, DVec3::Z]
            .map(|axis| turning.coefficients(self.nodes().map(|(node, w)| (node, w * axis))));
        let [x, y, z] = coefficients.map(|[turn, _]| turn.as_vec3());
        let [counter_x, counter_y, counter_z] = coefficients.map(|[_, turn]| turn.as_vec3());
        self.turn = [Mat3::from_cols(x, y, z), Mat3::from_cols(counter_x, counter_y, counter_z)];
        self.arm = arm.as_vec3();
        self.loaded = loaded.as_mat3();
        self.turns = true;
    }

    fn turned(&self, turn: Vec3, counter: Vec3) -> Vec3 {
        turn.cross(self.arm) - self.loaded * counter
    }
}

/// The compliance between one body's contacts. Keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Coupling {
    nodes: NodeCompliance,
    contacts: Vec<Corners>,
    /// Force on each slot [N] and what it does.
    loads: Vec<Vec3>,
    loaded: Vec<f32>,
}

impl Coupling {
    pub(super) fn clear(&mut self) {
        self.contacts.clear();
    }

    /// Adds a contact; returns its place.
    pub(super) fn push(&mut self, corners: Corners) -> u32 {
        self.contacts.push(corners);
        self.contacts.len() as u32 - 1
    }

    /// Contacts of one node each with given responses to each other.
    #[cfg(test)]
    pub(super) fn with_nodes(nodes: NodeCompliance, count: usize) -> Self {
        let corners = |slot| Corners {
            slots: [slot, 0, 0, 0],
            weights: [1.0, 0.0, 0.0, 0.0],
            count: 1,
            ..Corners::default()
        };
        Self { nodes, contacts: (0..count as u32).map(corners).collect(), ..Self::default() }
    }

    /// Takes in the compliance of `nodes`, which must be prepared, and the `forces` on some of
    /// them, in the frame, for [`Coupling::displacement`].
    pub(super) fn assemble(
        &mut self,
        body: &MovingBody,
        nodes: &[u32],
        forces: impl Iterator<Item = (u32, DVec3)>,
    ) {
        let turning = body.elastic().and_then(|elastic| {
            self.nodes.gather(elastic, &body.compliance, nodes);
            elastic.turning()
        });
        for corners in &mut self.contacts {
            for place in 0..corners.count as usize {
                corners.slots[place] = self.nodes.slot(corners.nodes[place]) as u32;
            }
            if let Some(turning) = turning {
                corners.set_turning(turning);
            }
        }
        self.load(turning, nodes, forces);
    }

    fn load(
        &mut self,
        turning: Option<&Turning>,
        nodes: &[u32],
        forces: impl Iterator<Item = (u32, DVec3)>,
    ) {
        self.loads.clear();
        self.loads.resize(self.nodes.stride(), Vec3::ZERO);
        for (node, force) in forces {
            self.loads[self.nodes.slot(node)] += force.as_vec3();
        }
        self.loaded.clear();
        self.loaded.resize(self.moved_len(), 0.0);
        let (moved, turn) = self.loaded.split_at_mut(3 * self.nodes.stride());
        let loads = nodes.iter().map(|&node| (node, self.loads[self.nodes.slot(node)]));
        for (node, load) in loads.clone().filter(|&(_, load)| load != Vec3::ZERO) {
            let column = self.nodes.column(self.nodes.slot(node));
            add_columns(&[(column, load)], moved);
        }
        if let Some(turning) = turning {
            let loads = loads.map(|(node, load)| (node, load.as_dvec3()));
            let [by, counter] = turning.coefficients(loads).map(|turn| turn.as_vec3().to_array());
            turn[..3].copy_from_slice(&by);
            turn[3..].copy_from_slice(&counter);
        }
    }

    /// Displacement of a contact, in the frame, by the forces that were taken.
    pub(super) fn displacement(&self, place: u32) -> DVec3 {
        self.moved(place, &self.loaded).as_dvec3()
    }

    /// Response of a contact to itself, in the frame.
    pub(super) fn own(&self, place: u32) -> DMat3 {
        let corners = &self.contacts[place as usize];
        let mut sum = DMat3::ZERO;
        for (slot, weight) in corners.slots() {
            for (other, other_weight) in corners.slots() {
                let entries = self.nodes.entry(slot, other).map(f64::from);
                sum += f64::from(weight * other_weight) * DMat3::from_cols_array(&entries);
            }
        }
        if corners.turns {
            let [turn, counter] = corners.turn;
            let turned = [0, 1, 2].map(|k| corners.turned(turn.col(k), counter.col(k)).as_dvec3());
            sum += DMat3::from_cols(turned[0], turned[1], turned[2]);
        }
        sum
    }

    /// Entries of an array of displacements.
    pub(super) fn moved_len(&self) -> usize {
        3 * self.nodes.stride() + TURN_LEN
    }

    /// Displacement of a contact, in the frame.
    pub(super) fn moved(&self, place: u32, moved: &[f32]) -> Vec3 {
        let corners = &self.contacts[place as usize];
        let stride = self.nodes.stride();
        let mut sum = Vec3::ZERO;
        for (slot, weight) in corners.slots() {
            let node = Vec3::new(moved[slot], moved[stride + slot], moved[2 * stride + slot]);
            sum += weight * node;
        }
        if corners.turns {
            let turn = &moved[3 * stride..][..TURN_LEN];
            sum += corners.turned(Vec3::from_slice(turn), Vec3::from_slice(&turn[3..]));
        }
        sum
    }

    /// Adds to the displacements what `force` on a contact does.
    pub(super) fn add_force(&self, place: u32, force: Vec3, moved: &mut [f32]) {
        let corners = &self.contacts[place as usize];
        let (moved, turn) = moved.split_at_mut(3 * self.nodes.stride());
        let mut columns = [(&[][..], Vec3::ZERO); 4];
        for (column, (slot, weight)) in columns.iter_mut().zip(corners.slots()) {
            *column = (self.nodes.column(slot), weight * force);
        }
        add_columns(&columns[..corners.count as usize], moved);
        if corners.turns {
            let [by, counter] = corners.turn.map(|turn| (turn * force).to_array());
            for (sum, value) in turn.iter_mut().zip(by.into_iter().chain(counter)) {
                *sum += value;
            }
        }
    }
}

/// Adds the nine stretches of each column, weighted by its force, to three.
struct AddColumns<'a> {
    columns: &'a [(&'a [f32], Vec3)],
    sums: &'a mut [f32],
}

impl pulp::WithSimd for AddColumns<'_> {
    type Output = ();

    #[allow(clippy::inline_always)] // compiled for the vector unit that the machine has
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let stride = self.sums.len() / 3;
        for &(column, force) in self.columns {
            let [fx, fy, fz] = force.to_array().map(|f| simd.splat_f32s(f));
            for (k, sums) in self.sums.chunks_exact_mut(stride).enumerate() {
                let [x, y, z] = [0, 1, 2]
                    .map(|axis| S::as_simd_f32s(&column[(3 * axis + k) * stride..][..stride]).0);
                let sums = S::as_mut_simd_f32s(sums).0;
                for (((sum, &x), &y), &z) in sums.iter_mut().zip(x).zip(y).zip(z) {
                    let some = simd.mul_add_f32s(y, fy, simd.mul_add_f32s(x, fx, *sum));
                    *sum = simd.mul_add_f32s(z, fz, some);
                }
            }
        }
    }
}

fn add_columns(columns: &[(&[f32], Vec3)], sums: &mut [f32]) {
    pulp::Arch::new().dispatch(AddColumns { columns, sums });
}
