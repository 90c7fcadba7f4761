//! The contact problem of a step in the space of contact forces.
//!
//! With implicit penalty the step minimises `|x - x_free|²_A / 2 + sum of penalty energies`. Its
//! dual has one unknown force per contact: `(D + W) lambda = s` over the contacts that push, with
//! `W = J A^-1 J^T` from compliance columns. It is small and well conditioned however stiff the
//! penalty is, and forces J^T lambda are equal and opposite exactly, converged or not.

use glam::{DMat3, DVec3};
use palpate_geometry::Point;

use super::filter::Candidate;
use super::side;
use crate::body::MovingBody;

const NONE: u32 = u32::MAX;

/// One equation: a candidate's normal or one of its two tangents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) candidate: u32,
    pub(crate) direction: DVec3,
    /// Relative displacement of the step along the direction without contact forces [m].
    pub(crate) free: f64,
    /// Places of the four nodes among all contact nodes; the last place belongs to nodes that
    /// do not give way (fixed or rigid).
    places: [u32; 4],
    /// Weight times direction in each node's body frame.
    loads: [DVec3; 4],
}

/// Nodes of one body that candidates name.
#[derive(Debug, Default)]
struct BodyNodes {
    nodes: Vec<u32>,
    /// Node -> place among all contact nodes.
    places: Vec<u32>,
    first: u32,
    frame: Option<DMat3>,
}

/// Rows and compliance of the contact problem. Keeps its memory.
#[derive(Debug, Default)]
pub(crate) struct Problem {
    bodies: Vec<BodyNodes>,
    place_count: usize,
    rows: Vec<Row>,
    /// W, n x n, symmetric, all of it stored.
    compliance: Vec<f64>,
    displacements: Vec<DVec3>,
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
            part.frame = body(index).elastic().map(crate::body::ElasticBody::frame);
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

    pub(crate) fn clear_rows(&mut self) {
        self.rows.clear();
    }

    /// Adds the equation of `candidate` along `direction`.
    pub(crate) fn push_row<'a>(
        &mut self,
        index: usize,
        candidate: &Candidate,
        direction: DVec3,
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        let mut row = Row {
            candidate: index as u32,
            direction,
            free: 0.0,
            places: [self.place_count as u32; 4],
            loads: [DVec3::ZERO; 4],
        };
        row.free = direction.dot(free_displacement(candidate, &body));
        for corner in 0..4 {
            let part = &self.bodies[candidate.bodies[side(candidate.kind, corner)] as usize];
            let place = part.places[candidate.nodes[corner] as usize];
            if let (Some(frame), true) = (part.frame, place != NONE) {
                row.places[corner] = place;
                row.loads[corner] = candidate.weights[corner] * (frame.transpose() * direction);
            }
        }
        self.rows.push(row);
    }

    pub(crate) fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Fills W for all rows.
    pub(crate) fn assemble<'a>(
        &mut self,
        candidates: &[Candidate],
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        let count = self.rows.len();
        self.compliance.resize(count * count, 0.0);
        self.displacements.clear();
        self.displacements.resize(self.place_count + 1, DVec3::ZERO);
        for col in 0..count {
            let row = self.rows[col];
            let candidate = &candidates[row.candidate as usize];
            for corner in 0..4 {
                if row.places[corner] as usize == self.place_count {
                    continue;
                }
                let index = candidate.bodies[side(candidate.kind, corner)] as usize;
                let cache = &body(index).compliance;
                let column = cache.column(candidate.nodes[corner]).expect("prepared column");
                let part = &self.bodies[index];
                let [x, y, z] = row.loads[corner].to_array();
                let moved = &mut self.displacements[part.first as usize..];
                for (moved, &node) in moved.iter_mut().zip(&part.nodes) {
                    let c = column[cache.place(node) as usize].map(f64::from);
                    *moved += DVec3::new(
                        c[0] * x + c[3] * y + c[6] * z,
                        c[1] * x + c[4] * y + c[7] * z,
                        c[2] * x + c[5] * y + c[8] * z,
                    );
                }
            }
            let [first, second] = candidate.bodies;
            self.turn(&row, candidate, first, &body);
            if second != first {
                self.turn(&row, candidate, second, &body);
            }
            for (other, row) in self.rows.iter().enumerate().skip(col) {
                let value: f64 = row
                    .places
                    .iter()
                    .zip(row.loads)
                    .map(|(&place, load)| load.dot(self.displacements[place as usize]))
                    .sum();
                self.compliance[col * count + other] = value;
                self.compliance[other * count + col] = value;
            }
            for body in candidate.bodies {
                let part = &self.bodies[body as usize];
                let first = part.first as usize;
                self.displacements[first..first + part.nodes.len()].fill(DVec3::ZERO);
            }
        }
    }

    /// Adds the part of a body's displacements under `row` that the columns do not hold.
    fn turn<'a>(
        &mut self,
        row: &Row,
        candidate: &Candidate,
        index: u32,
        body: impl Fn(usize) -> &'a MovingBody,
    ) {
        let elastic = body(index as usize).elastic();
        let Some(turning) = elastic.and_then(crate::body::ElasticBody::turning) else {
            return;
        };
        let corners = (0..4).filter(|&corner| {
            candidate.bodies[side(candidate.kind, corner)] == index
                && row.places[corner] as usize != self.place_count
        });
        let loads = corners.map(|corner| (candidate.nodes[corner], row.loads[corner]));
        let coefficients = turning.coefficients(loads);
        let part = &self.bodies[index as usize];
        let moved = &mut self.displacements[part.first as usize..];
        for (moved, &node) in moved.iter_mut().zip(&part.nodes) {
            *moved += turning.displacement(node, coefficients);
        }
    }

    /// Row `row` of W.
    pub(crate) fn compliance_row(&self, row: usize) -> &[f64] {
        let count = self.rows.len();
        &self.compliance[row * count..(row + 1) * count]
    }
}

/// Relative displacement of the two sides in the step if nothing touched [m].
pub(crate) fn free_displacement<'a>(
    candidate: &Candidate,
    body: impl Fn(usize) -> &'a MovingBody,
) -> DVec3 {
    displacement_to(candidate, body, |body| &body.free_positions)
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
