//! The matrices of a body, and whether its material makes sense.

use std::sync::Arc;

use glam::DVec3;
use palpate_geometry::Point;
use palpate_model::Body;
use palpate_solver::{BlockMatrix, BlockPattern, FactorError};

use super::FIXED;
use crate::body::element::{lame_parameters, shape_gradients, stiffness_block};
use crate::error::{MechanicsError, check_parameters};
use crate::materials::check_laws;

/// A quarter of the mass of each tetrahedron at its nodes [kg].
pub(super) fn lumped_masses(body: &Body) -> Vec<f64> {
    let (nodes, tetrahedra) = (body.mesh.nodes(), body.mesh.tetrahedra());
    let mut masses = vec![0.0; nodes.len()];
    for (corners, material) in tetrahedra.iter().zip(body.materials()) {
        let (volume, _) = shape_gradients(corners.map(|node| at(nodes, node)));
        for &node in corners {
            masses[node as usize] += 0.25 * material.density * volume;
        }
    }
    masses
}

/// K of linear elasticity over all nodes.
pub(super) fn linear_stiffness(body: &Body) -> BlockMatrix {
    let (nodes, tetrahedra) = (body.mesh.nodes(), body.mesh.tetrahedra());
    let pattern = Arc::new(BlockPattern::from_cliques(nodes.len(), tetrahedra));
    let mut stiffness = BlockMatrix::zeros(pattern);
    for (corners, material) in tetrahedra.iter().zip(body.materials()) {
        let lame = lame_parameters(material);
        let (volume, gradients) = shape_gradients(corners.map(|node| at(nodes, node)));
        for (&row, gi) in corners.iter().zip(gradients) {
            for (&col, gj) in corners.iter().zip(gradients) {
                if col <= row {
                    stiffness.add(row, col, &stiffness_block(volume, lame, gi, gj));
                }
            }
        }
    }
    stiffness
}

fn at(nodes: &[Point], node: u32) -> DVec3 {
    DVec3::from_array(nodes[node as usize])
}

/// The matrix `inertia M + factor K` over the free nodes.
pub(super) struct SystemMatrix {
    matrix: BlockMatrix,
    /// For each block of the matrix: the block of K, and the node of a diagonal one.
    sources: Vec<(u32, Option<u32>)>,
}

impl SystemMatrix {
    pub(super) fn new(stiffness: &BlockMatrix, free_index: &[u32]) -> Self {
        let pattern = stiffness.pattern();
        let nodes: Vec<u32> = (0..)
            .zip(free_index)
            .filter(|(_, place)| **place != FIXED)
            .map(|(node, _)| node)
            .collect();
        let (free, blocks) = if nodes.len() == free_index.len() {
            (Arc::clone(pattern), (0..pattern.block_count() as u32).collect())
        } else {
            let (free, blocks) = pattern.restricted(free_index);
            (Arc::new(free), blocks)
        };
        let mut sources: Vec<(u32, Option<u32>)> =
            blocks.into_iter().map(|block| (block, None)).collect();
        for (col, &node) in nodes.iter().enumerate() {
            let diagonal = free.find(col as u32, col as u32).expect("every node has one");
            sources[diagonal].1 = Some(node);
        }
        Self { matrix: BlockMatrix::zeros(free), sources }
    }

    pub(super) fn into_matrix(self) -> BlockMatrix {
        self.matrix
    }

    /// Fills the matrix.
    pub(super) fn fill(
        &mut self,
        stiffness: &BlockMatrix,
        masses: &[f64],
        inertia: f64,
        factor: f64,
    ) -> &BlockMatrix {
        for (block, &(source, node)) in self.matrix.blocks_mut().iter_mut().zip(&self.sources) {
            *block = stiffness.blocks()[source as usize].map(|row| row.map(|value| factor * value));
            if let Some(node) = node {
                for (k, row) in block.iter_mut().enumerate() {
                    row[k] += inertia * masses[node as usize];
                }
            }
        }
        &self.matrix
    }
}

pub(super) fn in_body_numbering(error: FactorError, free_nodes: &[u32]) -> FactorError {
    match error {
        FactorError::NotPositiveDefinite { node, column } => {
            let node = free_nodes[node] as usize;
            FactorError::NotPositiveDefinite { node, column: 3 * node + column % 3 }
        }
        other => other,
    }
}

/// Whether the fixed nodes exist and ascend.
pub(crate) fn check_fixed_nodes(index: usize, body: &Body) -> Result<(), MechanicsError> {
    let nodes = body.mesh.nodes().len();
    if let Some(pair) = body.fixed_nodes.windows(2).find(|pair| pair[0] >= pair[1]) {
        return Err(MechanicsError::FixedOrder { body: index, node: pair[1], before: pair[0] });
    }
    match body.fixed_nodes.last() {
        Some(&last) if last as usize >= nodes => {
            Err(MechanicsError::NoSuchNode { body: index, node: last as usize, nodes })
        }
        _ => Ok(()),
    }
}

pub(super) fn check_material(index: usize, body: &Body) -> Result<(), MechanicsError> {
    check_laws(index, body)?;
    for m in std::iter::once(&body.material).chain(body.regions.iter().map(|(_, m)| m)) {
        let finite = |value: f64, ok: bool| value.is_finite() && ok;
        let checks = [
            ("young", m.young, finite(m.young, m.young > 0.0), "a positive number of Pa"),
            ("poisson", m.poisson, m.poisson > -1.0 && m.poisson < 0.5, "-1 < poisson < 0.5"),
            (
                "density",
                m.density,
                finite(m.density, m.density > 0.0),
                "a positive number of kg/m³",
            ),
            (
                "damping",
                m.damping,
                finite(m.damping, m.damping >= 0.0),
                "a number of s, not negative",
            ),
            (
                "mass damping",
                m.mass_damping,
                finite(m.mass_damping, m.mass_damping >= 0.0),
                "a number of 1/s, not negative",
            ),
        ];
        check_parameters(index, body, &checks)?;
    }
    let velocity = body.initial_velocity.iter().copied().find(|value| !value.is_finite());
    let value = velocity.unwrap_or_default();
    let check = ("initial velocity", value, value.is_finite(), "finite numbers");
    check_parameters(index, body, &[check])
}
