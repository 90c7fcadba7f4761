//! The matrices of a body, and whether its material makes sense.

use std::sync::Arc;

use palpate_model::Body;
use palpate_solver::{BlockMatrix, BlockPattern, FactorError};

use super::FIXED;
use crate::error::MechanicsError;
use crate::materials::check_supported;

/// A over the free nodes.
pub(super) fn system_matrix(
    stiffness: &BlockMatrix,
    masses: &[f64],
    free_index: &[u32],
    body: &Body,
    time_step: f64,
) -> BlockMatrix {
    let factor = 1.0 + body.material.damping / time_step;
    let mut edges: Vec<[u32; 2]> = Vec::new();
    let pattern = stiffness.pattern();
    let mut kept = Vec::new();
    for col in 0..masses.len() as u32 {
        let first = free_index[col as usize];
        for &row in pattern.column(col as usize) {
            let second = free_index[row as usize];
            if first != FIXED && second != FIXED {
                edges.push([first, second]);
                kept.push((row, col));
            }
        }
    }
    let free_count = free_index.iter().filter(|&&place| place != FIXED).count();
    let mut system = BlockMatrix::zeros(Arc::new(BlockPattern::from_cliques(free_count, &edges)));
    let inertia = 1.0 / (time_step * time_step) + body.material.mass_damping / time_step;
    for ([col, row], (full_row, full_col)) in edges.into_iter().zip(kept) {
        let index = pattern.find(full_row, full_col).expect("taken from the pattern");
        let mut block = stiffness.blocks()[index].map(|line| line.map(|value| factor * value));
        if row == col {
            for (k, line) in block.iter_mut().enumerate() {
                line[k] += inertia * masses[full_row as usize];
            }
        }
        system.add(row, col, &block);
    }
    system
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

pub(super) fn check_material(index: usize, body: &Body) -> Result<(), MechanicsError> {
    check_supported(index, body)?;
    let m = &body.material;
    let finite = |value: f64, ok: bool| value.is_finite() && ok;
    let checks = [
        ("young", m.young, finite(m.young, m.young > 0.0), "a positive number of Pa"),
        ("poisson", m.poisson, m.poisson > -1.0 && m.poisson < 0.5, "-1 < poisson < 0.5"),
        ("density", m.density, finite(m.density, m.density > 0.0), "a positive number of kg/m³"),
        ("damping", m.damping, finite(m.damping, m.damping >= 0.0), "a number of s, not negative"),
        (
            "mass damping",
            m.mass_damping,
            finite(m.mass_damping, m.mass_damping >= 0.0),
            "a number of 1/s, not negative",
        ),
    ];
    for (what, value, ok, expected) in checks {
        if !ok {
            let name = body.name.clone();
            return Err(MechanicsError::BadParameter { body: index, name, what, value, expected });
        }
    }
    let velocity = body.initial_velocity.iter().copied().find(|value| !value.is_finite());
    if let Some(value) = velocity {
        let (name, what, expected) = (body.name.clone(), "initial velocity", "finite numbers");
        return Err(MechanicsError::BadParameter { body: index, name, what, value, expected });
    }
    Ok(())
}
