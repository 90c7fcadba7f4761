//! The contact problem of a step in the space of contact forces.
//!
//! With implicit penalty the step minimises `|x - x_free|²_A / 2 + sum of penalty energies`. Its
//! dual has one unknown force per contact and direction: `(D + W) lambda = s` over the contacts that
//! push, with `W = J P J^T` from compliance columns. It is small and well conditioned however stiff
//! the penalty is, and forces J^T lambda are equal and opposite exactly, converged or not.

use glam::{DMat3, DVec3};
use palpate_geometry::Point;

use super::filter::Candidate;
use super::side;
use crate::body::MovingBody;

const NONE: u32 = u32::MAX;

/// The equations of one candidate: along its normal and, with friction, along two tangents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// First row.
    pub(crate) first: u32,
    /// Rows: 1 or 3.
    pub(crate) rows: u32,
    /// Normal and two tangents.
    pub(crate) axes: DMat3,
    /// Relative displacement of the step along the axes without contact forces [m].
    pub(crate) free: DVec3,
    /// Places of the four nodes among all contact nodes; the last place belongs to nodes that
    /// do not give way (fixed or rigid).
    places: [u32; 4],
}

/// Nodes of one body that candidates name.
#[derive(Debug, Default)]
struct BodyNodes {
    nodes: Vec<u32>,
    /// Node -> place among all contact nodes.
    places: Vec<u32>,
    first: u32,
}

/// Equations and compliance of the contact problem. Keeps its memory.
#[derive(Debug, Default)]
pub(crate) struct Problem {
    bodies: Vec<BodyNodes>,
    place_count: usize,
    blocks: Vec<Block>,
    row_count: usize,
    /// W, n x n, symmetric, all of it stored.
    compliance: Vec<f64>,
    /// Displacement of every contact node under unit forces along the axes of one candidate.
    displacements: Vec<DMat3>,
    /// Displacement of every contact node by the forces that were expected.
    expected: Vec<DVec3>,
}

impl Problem {
    /// Collects the nodes of the candidates, body by body.
    pub(crate) fn collect<'a>(
        &mut self,
        candidates: &[Candidate],
        body_count: usize,
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        self.bodies.resize_with(body_count, BodyNodes::default);
        for (index, part) in self.bodies.iter_mut().enumerate() {
            for &node in &part.nodes {
                part.places[node as usize] = NONE;
            }
            part.nodes.clear();
            part.places.resize(body(index).positions.len(), NONE);
        }
        for candidate in candidates {
            for corner in 0..4 {
                let index = candidate.bodies[side(candidate.kind, corner)] as usize;
                let node = candidate.nodes[corner];
                let can_move = body(index).elastic().is_some_and(|b| b.is_free(node as usize));
                let part = &mut self.bodies[index];
                if can_move
                    && candidate.weights[corner] != 0.0
                    && part.places[node as usize] == NONE
                {
                    part.places[node as usize] = 0;
                    part.nodes.push(node);
                }
            }
        }
        let mut place = 0;
        for part in &mut self.bodies {
            part.nodes.sort_unstable();
            part.first = place;
            for &node in &part.nodes {
                part.places[node as usize] = place;
                place += 1;
            }
        }
        self.place_count = place as usize;
    }

    /// Nodes of a body that contacts of this step can move, ascending.
    pub(crate) fn nodes(&self, body: usize) -> &[u32] {
        &self.bodies[body].nodes
    }

    /// Writes the equations of the candidates and fills W.
    pub(crate) fn assemble<'a>(
        &mut self,
        candidates: &[Candidate],
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        self.blocks.clear();
        self.row_count = 0;
        self.displace_as_expected(&body);
        for candidate in candidates {
            let (first, second) = candidate.normal.any_orthonormal_pair();
            let axes = DMat3::from_cols(candidate.normal, first, second);
            let rows = if candidate.friction > 0.0 { 3 } else { 1 };
            let mut places = [self.place_count as u32; 4];
            for (corner, own_place) in places.iter_mut().enumerate() {
                let part = &self.bodies[candidate.bodies[side(candidate.kind, corner)] as usize];
                let place = part.places[candidate.nodes[corner] as usize];
                if place != NONE && candidate.weights[corner] != 0.0 {
                    *own_place = place;
                }
            }
            let mut free = expected_displacement(candidate, &body);
            for (&place, weight) in places.iter().zip(candidate.weights) {
                free -= weight * self.expected[place as usize];
            }
            self.blocks.push(Block {
                first: self.row_count as u32,
                rows,
                axes,
                free: axes.transpose() * free,
                places,
            });
            self.row_count += rows as usize;
        }
        let count = self.row_count;
        self.compliance.resize(count * count, 0.0);
        self.displacements.clear();
        self.displacements.resize(self.place_count + 1, DMat3::ZERO);
        for (col, candidate) in candidates.iter().enumerate() {
            let block = self.blocks[col];
            let [first, second] = candidate.bodies;
            self.displace(&block, candidate, first, &body);
            if second != first {
                self.displace(&block, candidate, second, &body);
            }
            for (other, row_block) in self.blocks.iter().enumerate().skip(col) {
                let mut moved = DMat3::ZERO;
                for (&place, weight) in row_block.places.iter().zip(candidates[other].weights) {
                    if place as usize != self.place_count {
                        moved += weight * self.displacements[place as usize];
                    }
                }
                let values = row_block.axes.transpose() * moved;
                let (from, to) = (block.first as usize, row_block.first as usize);
                for k in 0..block.rows as usize {
                    for l in 0..row_block.rows as usize {
                        let value = values.col(k)[l];
                        self.compliance[(from + k) * count + to + l] = value;
                        self.compliance[(to + l) * count + from + k] = value;
                    }
                }
            }
            for body in candidate.bodies {
                let part = &self.bodies[body as usize];
                let first = part.first as usize;
                self.displacements[first..first + part.nodes.len()].fill(DMat3::ZERO);
            }
        }
    }

    /// Finds the displacements by the expected forces, which the expected positions contain.
    fn displace_as_expected<'a>(&mut self, body: impl Fn(usize) -> &'a MovingBody) {
        self.expected.clear();
        self.expected.resize(self.place_count + 1, DVec3::ZERO);
        for (index, part) in self.bodies.iter().enumerate() {
            let moving = body(index);
            let Some(elastic) = moving.elastic() else { continue };
            if part.nodes.is_empty() {
                continue;
            }
            let frame = elastic.frame();
            let loads = || moving.expected_forces().map(|(node, f)| (node, frame.transpose() * f));
            let moved = &mut self.expected[part.first as usize..][..part.nodes.len()];
            for (node, load) in loads() {
                let Some(column) = moving.compliance.column(node) else { continue };
                for (moved, &node) in moved.iter_mut().zip(&part.nodes) {
                    let entries = column[moving.compliance.place(node) as usize].map(f64::from);
                    *moved += DMat3::from_cols_array(&entries) * load;
                }
            }
            if let Some(turning) = elastic.turning() {
                let coefficients = turning.coefficients(loads());
                for (moved, &node) in moved.iter_mut().zip(&part.nodes) {
                    *moved += turning.displacement(node, coefficients);
                }
            }
            for moved in moved {
                *moved = frame * *moved;
            }
        }
    }

    /// Displacements of a body's contact nodes under unit forces along the axes of a candidate.
    fn displace<'a>(
        &mut self,
        block: &Block,
        candidate: &Candidate,
        index: u32,
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        let moving = body(index as usize);
        let Some(elastic) = moving.elastic() else { return };
        let frame = elastic.frame();
        let loads = frame.transpose() * block.axes;
        let part = &self.bodies[index as usize];
        let moved = &mut self.displacements[part.first as usize..][..part.nodes.len()];
        let corners = (0..4).filter(|&corner| {
            candidate.bodies[side(candidate.kind, corner)] == index
                && block.places[corner] as usize != self.place_count
        });
        for corner in corners.clone() {
            let cache = &moving.compliance;
            let column = cache.column(candidate.nodes[corner]).expect("prepared column");
            let loads = candidate.weights[corner] * loads;
            for (moved, &node) in moved.iter_mut().zip(&part.nodes) {
                let entries = column[cache.place(node) as usize].map(f64::from);
                *moved += DMat3::from_cols_array(&entries) * loads;
            }
        }
        if let Some(turning) = elastic.turning() {
            let coefficients = loads.to_cols_array_2d().map(|load| {
                let load = DVec3::from_array(load);
                let loaded =
                    corners.clone().map(|c| (candidate.nodes[c], candidate.weights[c] * load));
                turning.coefficients(loaded)
            });
            for (moved, &node) in moved.iter_mut().zip(&part.nodes) {
                let [x, y, z] = coefficients.map(|pair| turning.displacement(node, pair));
                *moved += DMat3::from_cols(x, y, z);
            }
        }
        for moved in moved {
            *moved = frame * *moved;
        }
    }

    pub(crate) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    pub(crate) fn row_count(&self) -> usize {
        self.row_count
    }

    /// W, row after row.
    pub(crate) fn compliance(&self) -> &[f64] {
        &self.compliance[..self.row_count * self.row_count]
    }

    /// A problem of given W and free displacements along the axes; every block has one row or three.
    #[cfg(test)]
    pub(super) fn with_compliance(compliance: Vec<f64>, free: &[DVec3], rows: u32) -> Self {
        let block = |(index, &free): (usize, &DVec3)| Block {
            first: index as u32 * rows,
            rows,
            axes: DMat3::IDENTITY,
            free,
            places: [0; 4],
        };
        let blocks = free.iter().enumerate().map(block).collect();
        Self { blocks, row_count: free.len() * rows as usize, compliance, ..Self::default() }
    }

    /// Row `row` of W.
    pub(crate) fn compliance_row(&self, row: usize) -> &[f64] {
        &self.compliance[row * self.row_count..][..self.row_count]
    }
}

/// Relative displacement of the two sides in the step if contact forces stayed as they were [m].
pub(crate) fn expected_displacement<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
) -> DVec3 {
    displacement_to(candidate, body, |body| &body.expected_positions)
}

/// Relative displacement of the two sides in the step as it was computed last [m].
pub(crate) fn step_displacement<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
) -> DVec3 {
    displacement_to(candidate, body, |body| &body.next_positions)
}

fn displacement_to<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
    end: impl Fn(&'a MovingBody) -> &'a [Point],
) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for corner in 0..4 {
        let moving = body(candidate.bodies[side(candidate.kind, corner)] as usize);
        let node = candidate.nodes[corner] as usize;
        let moved =
            DVec3::from_array(end(moving)[node]) - DVec3::from_array(moving.positions[node]);
        sum += candidate.weights[corner] * moved;
    }
    sum
}
