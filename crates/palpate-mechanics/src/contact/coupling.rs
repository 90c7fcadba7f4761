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
/// Part of the largest force on a node that round-off leaves of forces that have not changed.
const NEGLIGIBLE: f64 = 1e-9;

/// The nodes of one body that a contact holds, with their weights, and how it turns the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corners {
    nodes: [u32; 4],
    slots: [u32; 4],
    weights: [f64; 4],
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
        self.weights[place] = weight;
        self.count += 1;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    fn nodes(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.nodes.iter().copied().zip(self.weights).take(self.count as usize)
    }

    fn slots(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let slots = self.slots.iter().map(|&slot| slot as usize);
        slots.zip(self.weights).take(self.count as usize)
    }

    fn set_turning(&mut self, turning: &Turning, turns: &[[DMat3; 2]]) {
        let (mut arm, mut loaded, mut turn) = (DVec3::ZERO, DMat3::ZERO, [DMat3::ZERO; 2]);
        for (slot, (node, weight)) in self.slots.iter().zip(self.nodes()) {
            arm += weight * turning.arm(node);
            loaded += weight * turning.response(node);
            for (sum, node) in turn.iter_mut().zip(turns[*slot as usize]) {
                *sum += weight * node;
            }
        }
        self.turn = turn.map(|turn| turn.as_mat3());
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
    /// Expected force on each slot [N].
    expected: Vec<DVec3>,
    /// Turn and counter-turn per force on each slot; empty when forces do not turn the body.
    turns: Vec<[DMat3; 2]>,
}

impl Coupling {
    pub(super) fn clear(&mut self) {
        self.contacts.clear();
    }

    /// Goes on with another body, between some nodes of which the compliance is known.
    pub(super) fn change_body(&mut self, compliance: NodeCompliance) {
        self.contacts.clear();
        self.nodes.change_body(compliance);
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
        let contacts = (0..count as u32).map(corners).collect();
        let expected = vec![DVec3::ZERO; nodes.stride()];
        Self { nodes, contacts, expected, ..Self::default() }
    }

    /// Takes in the compliance of `nodes`, which must be prepared, and the expected `forces` on some of
    /// them, in the frame.
    pub(super) fn assemble(
        &mut self,
        body: &MovingBody,
        nodes: &[u32],
        forces: impl Iterator<Item = (u32, DVec3)>,
    ) {
        let turning = body.elastic().and_then(|elastic| {
            self.nodes.gather(elastic, &body.compliance, nodes);
            elastic.turning().zip(Some(elastic.levers()))
        });
        self.expected.clear();
        self.expected.resize(self.nodes.stride(), DVec3::ZERO);
        for (node, force) in forces {
            self.expected[self.nodes.slot(node)] += force;
        }
        self.turns.clear();
        if let Some((turning, levers)) = turning {
            self.turns.resize(self.nodes.stride(), [DMat3::ZERO; 2]);
            for &node in nodes {
                self.turns[self.nodes.slot(node)] = turning.coefficients(node, levers.of(node));
            }
        }
        for corners in &mut self.contacts {
            for place in 0..corners.count as usize {
                corners.slots[place] = self.nodes.slot(corners.nodes[place]) as u32;
            }
            if let Some((turning, _)) = turning {
                corners.set_turning(turning, &self.turns);
            }
        }
    }

    /// Response of a contact to itself, in the frame.
    pub(super) fn own(&self, place: u32) -> DMat3 {
        let corners = &self.contacts[place as usize];
        let mut sum = DMat3::ZERO;
        for (slot, weight) in corners.slots() {
            for (other, other_weight) in corners.slots() {
                let entries = self.nodes.entry(slot, other).map(f64::from);
                sum += weight * other_weight * DMat3::from_cols_array(&entries);
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
            sum += weight as f32 * node;
        }
        if corners.turns {
            let turn = &moved[3 * stride..][..TURN_LEN];
            sum += corners.turned(Vec3::from_slice(turn), Vec3::from_slice(&turn[3..]));
        }
        sum
    }

    /// Writes what the expected forces are beyond none at all, with the sign turned.
    pub(super) fn begin_loads(&self, loads: &mut [DVec3]) {
        for (load, expected) in loads.iter_mut().zip(&self.expected) {
            *load = -*expected;
        }
    }

    /// Adds a force on a contact to those on the slots.
    pub(super) fn add_load(&self, place: u32, force: DVec3, loads: &mut [DVec3]) {
        for (slot, weight) in self.contacts[place as usize].slots() {
            loads[slot] += weight * force;
        }
    }

    /// Adds to the displacements what the forces on the slots of `nodes` do, where they are not negligible.
    /// The order of the nodes is that of the sums: slots have no order.
    pub(super) fn add_loads(&self, nodes: &[u32], loads: &[DVec3], moved: &mut [f32]) {
        let (moved, turn) = moved.split_at_mut(3 * self.nodes.stride());
        let squares = self.expected.iter().chain(loads).map(|load| load.length_squared());
        let limit = NEGLIGIBLE * NEGLIGIBLE * squares.fold(0.0, f64::max);
        let mut turned = [DVec3::ZERO; 2];
        for slot in nodes.iter().map(|&node| self.nodes.slot(node)) {
            let load = loads[slot];
            if load.length_squared() <= limit {
                continue;
            }
            add_columns(&[(self.nodes.column(slot), load.as_vec3())], moved);
            for (sum, turn) in turned.iter_mut().zip(self.turns.get(slot).into_iter().flatten()) {
                *sum += *turn * load;
            }
        }
        let turned = turned.into_iter().flat_map(|turn| turn.as_vec3().to_array());
        for (sum, value) in turn.iter_mut().zip(turned) {
            *sum += value;
        }
    }

    /// Adds to the displacements what `force` on a contact does.
    pub(super) fn add_force(&self, place: u32, force: Vec3, moved: &mut [f32]) {
        let corners = &self.contacts[place as usize];
        let (moved, turn) = moved.split_at_mut(3 * self.nodes.stride());
        let mut columns = [(&[][..], Vec3::ZERO); 4];
        for (column, (slot, weight)) in columns.iter_mut().zip(corners.slots()) {
            *column = (self.nodes.column(slot), weight as f32 * force);
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

pub(super) fn add_columns(columns: &[(&[f32], Vec3)], sums: &mut [f32]) {
    pulp::Arch::new().dispatch(AddColumns { columns, sums });
}
