//! The compiled part of the Python package `palpate`: converts, checks shapes, maps errors.
//!
//! No algorithm lives here, and users never import it: `palpate` wraps every class.

mod arrays;
mod errors;
mod mesh;
mod model;
mod scene;
mod simulation;

use pyo3::prelude::*;

/// The compiled core of palpate.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::mesh::{PyMesh, read_mesh_file, write_mesh_file};
    #[pymodule_export]
    use crate::model::{PyBody, PyModel, format_model, load_model};
    #[pymodule_export]
    use crate::scene::PyScene;
    #[pymodule_export]
    use crate::simulation::{PySimulation, PySnapshot};
    #[pymodule_export]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    use super::*;

    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        Ok(())
    }
}
