//! The one place where the core's errors become Python exceptions (classes of `palpate.errors`).

use palpate::model::{FileError, FileErrorCause, MeshError, ModelError};
use palpate::{CheckpointError, SceneError, SimulationError};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// A Rust error of the core on its way to Python.
pub(crate) trait ToPython {
    /// The exception to raise.
    fn to_python(self, py: Python<'_>) -> PyErr;
}

/// Raises the exception that a core error stands for.
pub(crate) fn raise<T, E: ToPython>(py: Python<'_>, result: Result<T, E>) -> PyResult<T> {
    result.map_err(|error| error.to_python(py))
}

fn exception<'py, A>(py: Python<'py>, class: &str, arguments: A) -> PyErr
where
    A: pyo3::call::PyCallArgs<'py>,
{
    let make = || {
        let module = py.import("palpate.errors")?;
        module.getattr(class)?.call1(arguments)
    };
    match make() {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

impl ToPython for MeshError {
    fn to_python(self, py: Python<'_>) -> PyErr {
        exception(py, "MeshError", (self.to_string(),))
    }
}

/// An `OSError` of the right subclass, with errno and file name as Python gives them.
pub(crate) fn io_error(error: &std::io::Error, path: &std::path::Path) -> PyErr {
    match error.raw_os_error() {
        Some(number) => {
            let text = error.to_string();
            let reason = text.split(" (os error").next().unwrap_or(&text).to_owned();
            PyOSError::new_err((number, reason, path.display().to_string()))
        }
        None => PyOSError::new_err(format!("{}: {error}", path.display())),
    }
}

impl ToPython for FileError {
    fn to_python(self, py: Python<'_>) -> PyErr {
        if let FileErrorCause::Io(error) = self.cause() {
            return io_error(error, self.path());
        }
        let path = self.path().display().to_string();
        exception(py, "MeshError", (self.to_string(), path, self.line()))
    }
}

impl ToPython for ModelError {
    fn to_python(self, py: Python<'_>) -> PyErr {
        let diagnostics = self.diagnostics.iter().map(|each| {
            let path = each.path.display().to_string();
            let fields = (path, each.line, each.column, each.message.clone(), each.hint.clone());
            py.import("palpate.errors")?.getattr("Diagnostic")?.call1(fields)
        });
        let made = diagnostics.collect::<PyResult<Vec<_>>>().and_then(|all| PyTuple::new(py, all));
        match made {
            Ok(tuple) => exception(py, "ModelError", (self.to_string(), tuple)),
            Err(error) => error,
        }
    }
}

impl ToPython for SceneError {
    fn to_python(self, _py: Python<'_>) -> PyErr {
        PyValueError::new_err(self.to_string())
    }
}

impl ToPython for SimulationError {
    fn to_python(self, py: Python<'_>) -> PyErr {
        let text = self.to_string();
        match self {
            Self::Step { failure, .. } => {
                let place = (failure.body, failure.node, failure.tetrahedron);
                exception(py, "SimulationError", (text, place.0, place.1, place.2))
            }
            _ => exception(py, "SimulationError", (text,)),
        }
    }
}

impl ToPython for CheckpointError {
    fn to_python(self, py: Python<'_>) -> PyErr {
        if let Self::Io { path, source } = &self {
            return io_error(source, path);
        }
        exception(py, "CheckpointError", (self.to_string(),))
    }
}
