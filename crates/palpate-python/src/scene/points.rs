//! Rows for Python of what the scene answers about points and nodes inside bodies.

use numpy::{PyArray1, PyArray2};
use palpate::contact::{PenetratingNode, SurfacePoint};
use pyo3::prelude::*;

use crate::arrays::{index_matrix, index_vector, matrix, vector};

/// bodies, triangles, weights, positions, distances.
pub(crate) type SurfacePointArrays<'py> = (
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// bodies, nodes, triangles, weights, directions, depths.
pub(crate) type PenetrationArrays<'py> = (
    Bound<'py, PyArray2<i32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// One row per query; without an answer -1, NaN and an infinite distance.
pub(crate) fn surface_point_arrays<'py>(
    py: Python<'py>,
    found: &[Option<SurfacePoint>],
) -> PyResult<SurfacePointArrays<'py>> {
    let index = |of: fn(&SurfacePoint) -> u32| {
        let row = |point: &Option<SurfacePoint>| point.as_ref().map_or(-1, |p| of(p) as i32);
        vector(py, found.iter().map(row).collect())
    };
    let triple = |of: fn(&SurfacePoint) -> [f64; 3]| {
        let row = |point: &Option<SurfacePoint>| point.as_ref().map_or([f64::NAN; 3], of);
        matrix(py, found.iter().map(row).collect())
    };
    let distance = |point: &Option<SurfacePoint>| point.map_or(f64::INFINITY, |p| p.distance);
    Ok((
        index(|point| point.body),
        index(|point| point.triangle),
        triple(|point| point.weights)?,
        triple(|point| point.position)?,
        vector(py, found.iter().map(distance).collect()),
    ))
}

/// One row per node inside a body.
pub(crate) fn penetration_arrays<'py>(
    py: Python<'py>,
    nodes: &[PenetratingNode],
) -> PyResult<PenetrationArrays<'py>> {
    let indices = |of: fn(&PenetratingNode) -> u32| {
        index_vector(py, &nodes.iter().map(of).collect::<Vec<_>>())
    };
    let bodies: Vec<_> = nodes.iter().map(|node| [node.body, node.into_body]).collect();
    Ok((
        index_matrix(py, &bodies)?,
        indices(|node| node.node),
        indices(|node| node.triangle),
        matrix(py, nodes.iter().map(|node| node.weights).collect())?,
        matrix(py, nodes.iter().map(|node| node.direction).collect())?,
        vector(py, nodes.iter().map(|node| node.depth).collect()),
    ))
}
