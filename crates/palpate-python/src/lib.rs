//! The compiled part of the Python package `palpate`: converts, checks shapes, maps errors.
//!
//! No algorithm lives here, and users never import it: `palpate` wraps every class.

// PyO3 hands arguments over by value.
#![allow(clippy::needless_pass_by_value)]

mod arrays;
mod cutting;
mod errors;
mod held;
mod mesh;
mod model;
mod scene;
mod simulation;
mod tool_loop;

/// The compiled core of palpate.
#[pyo3::pymodule]
mod _core {
    use palpate::contact::Method;
    use palpate::model::MESH_EXTENSIONS;
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    #[pymodule_export]
    use crate::cutting::{PyBlade, read_blades};
    #[pymodule_export]
    use crate::mesh::{PyMesh, read_mesh_file, write_mesh_file};
    #[pymodule_export]
    use crate::model::{PyBody, PyModel, format_model, load_model};
    #[pymodule_export]
    use crate::scene::PyScene;
    #[pymodule_export]
    use crate::simulation::{PySimulation, PySnapshot, von_mises};
    #[pymodule_export]
    use crate::tool_loop::PyToolLoop;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("MESH_EXTENSIONS", PyTuple::new(module.py(), MESH_EXTENSIONS)?)?;
        module.add("METHODS", PyTuple::new(module.py(), Method::NAMES)?)
    }
}
