//! `NumPy` arrays in and out. What goes out is a copy and read-only, so it never changes later.

use numpy::{Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use palpate::geometry::Point;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A read-only array of shape (rows, N) that takes over `values`.
pub(crate) fn matrix<T: Element, const N: usize>(
    py: Python<'_>,
    values: Vec<[T; N]>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let rows = values.len();
    let array = PyArray1::from_vec(py, values.into_flattened()).reshape([rows, N])?;
    array.readwrite().make_nonwriteable();
    Ok(array)
}

/// A read-only array of shape (n,) that takes over `values`.
pub(crate) fn vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    let array = PyArray1::from_vec(py, values);
    array.readwrite().make_nonwriteable();
    array
}

/// Index rows as the int32 that Python gets; meshes stay below 2^31 nodes.
pub(crate) fn index_matrix<'py, const N: usize>(
    py: Python<'py>,
    rows: &[[u32; N]],
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    matrix(py, rows.iter().map(|row| row.map(|index| index as i32)).collect())
}

/// Indices as the int32 that Python gets.
pub(crate) fn index_vector<'py>(py: Python<'py>, indices: &[u32]) -> Bound<'py, PyArray1<i32>> {
    vector(py, indices.iter().map(|&index| index as i32).collect())
}

/// The points of a C-contiguous float64 array of shape (n, 3), read in place.
pub(crate) fn points<'a>(
    array: &'a PyReadonlyArray2<'_, f64>,
    name: &str,
) -> PyResult<&'a [Point]> {
    rows::<f64, 3>(array, name)
}

/// The rows of a C-contiguous array of shape (n, N), read in place.
pub(crate) fn rows<'a, T: Element, const N: usize>(
    array: &'a PyReadonlyArray2<'_, T>,
    name: &str,
) -> PyResult<&'a [[T; N]]> {
    if array.shape()[1] != N {
        let shape = array.shape();
        let message = format!("{name}: expected shape (n, {N}), got ({}, {})", shape[0], shape[1]);
        return Err(PyValueError::new_err(message));
    }
    let flat = array
        .as_slice()
        .map_err(|_| PyValueError::new_err(format!("{name}: expected a C-contiguous array")))?;
    Ok(flat.as_chunks().0)
}

/// Index rows as the core has them, or an error that names the element.
pub(crate) fn indices<const N: usize>(rows: &[[i64; N]], name: &str) -> PyResult<Vec<[u32; N]>> {
    rows.iter()
        .enumerate()
        .map(|(row, entries)| {
            let mut checked = [0; N];
            for (slot, &entry) in checked.iter_mut().zip(entries) {
                *slot = index(entry, name, row)?;
            }
            Ok(checked)
        })
        .collect()
}

/// One index as the core has it, or an error that names the row.
pub(crate) fn index(entry: i64, name: &str, row: usize) -> PyResult<u32> {
    i32::try_from(entry).ok().and_then(|index| u32::try_from(index).ok()).ok_or_else(|| {
        PyValueError::new_err(format!(
            "{name}: row {row} holds {entry}, expected a node index from 0"
        ))
    })
}
