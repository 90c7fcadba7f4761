//! `palpate._core.ToolLoop`: what a tool feels between steps.

use std::sync::{Mutex, PoisonError};

use glam::{DMat3, DQuat};
use palpate::ToolLoop;
use pyo3::prelude::*;

use crate::errors::raise;

/// The loop of one tool; the lock is its own, not that of the simulation.
#[pyclass(frozen, name = "ToolLoop", module = "palpate._core")]
pub(crate) struct PyToolLoop {
    pub(crate) tool_loop: Mutex<ToolLoop>,
}

/// Force, torque, number of contacts and step.
type Felt = ((f64, f64, f64), (f64, f64, f64), usize, u64);

#[pymethods]
impl PyToolLoop {
    /// The tool's nodes are turned by the rows of a rotation matrix and moved by a translation.
    fn tick(
        &self,
        py: Python<'_>,
        rotation: [[f64; 3]; 3],
        translation: (f64, f64, f64),
    ) -> PyResult<Felt> {
        let rotation = DQuat::from_mat3(&DMat3::from_cols_array_2d(&rotation).transpose());
        let felt = py.detach(|| {
            let mut guard = self.tool_loop.lock().unwrap_or_else(PoisonError::into_inner);
            guard.tick(rotation, translation.into())
        });
        let felt = raise(py, felt)?;
        Ok((felt.force.into(), felt.torque.into(), felt.contacts, felt.step))
    }
}
