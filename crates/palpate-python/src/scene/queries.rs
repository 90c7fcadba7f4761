//! What a scene's queries find, as columns for Python.

use numpy::{PyArray1, PyArray2};
use palpate::contact::{
    DetectionStats, IntersectionOptions, Intersections, PairKind, ProximityOptions, ProximityPair,
    TrianglePair,
};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::PyScene;
use crate::arrays::{index_matrix, index_vector, matrix, vector};

/// Times [s] and counts of a query, in the order of `palpate.DetectionStats`.
pub(crate) type StatsRow = (f64, f64, f64, u64, u64, u64, u64, u64, u64);

/// The columns of `palpate.Proximity`, and what they cost.
pub(super) type ProximityColumns<'py> = (
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray2<i32>>,
    Bound<'py, PyArray2<i32>>,
    Bound<'py, PyArray2<i32>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    StatsRow,
);

/// The pairs of `palpate.Intersections`, and what they cost.
pub(super) type IntersectionColumns<'py> = (Bound<'py, PyArray2<i32>>, StatsRow);

impl PyScene {
    pub(super) fn find_intersections<'py>(
        &self,
        py: Python<'py>,
        options: IntersectionOptions,
    ) -> PyResult<IntersectionColumns<'py>> {
        let (rows, stats) =
            py.detach(|| intersection_rows(self.inside.lock().scene.intersections(&options)));
        Ok((index_matrix(py, &rows)?, stats))
    }

    pub(super) fn find_proximity<'py>(
        &self,
        py: Python<'py>,
        distance: f64,
        self_contact: bool,
        options: ProximityOptions,
    ) -> PyResult<ProximityColumns<'py>> {
        let distance = |a: usize, b: usize| (self_contact || a != b).then_some(distance);
        let (pairs, stats) = py.detach(|| {
            let mut guard = self.inside.lock();
            let found = guard.scene.proximity_with(&distance, &options);
            (found.pairs.clone(), stats_row(&found.stats))
        });
        let kind = |pair: &ProximityPair| match pair.kind {
            PairKind::VertexTriangle => 0,
            PairKind::EdgeEdge => 1,
        };
        Ok((
            vector(py, pairs.iter().map(kind).collect()),
            matrix(py, pairs.iter().map(|pair| pair.bodies.map(index)).collect())?,
            matrix(py, pairs.iter().map(|pair| pair.elements.map(index)).collect())?,
            matrix(py, pairs.iter().map(|pair| pair.nodes.map(index)).collect())?,
            matrix(py, pairs.iter().map(|pair| pair.weights).collect())?,
            matrix(py, pairs.iter().map(|pair| pair.normal).collect())?,
            vector(py, pairs.iter().map(|pair| pair.distance).collect()),
            stats,
        ))
    }

    pub(super) fn find_contact_nodes<'py>(
        &self,
        py: Python<'py>,
        options: IntersectionOptions,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let nodes = py.detach(|| self.inside.lock().scene.contact_nodes(&options).nodes.clone());
        PyTuple::new(py, nodes.iter().map(|nodes| index_vector(py, nodes)))
    }
}

/// An index as the int32 that Python gets.
fn index(index: u32) -> i32 {
    index as i32
}

/// The pairs as rows for Python, and what they cost.
pub(crate) fn intersection_rows(found: &Intersections) -> (Vec<[u32; 4]>, StatsRow) {
    let row = |pair: &TrianglePair| [pair.body_a, pair.triangle_a, pair.body_b, pair.triangle_b];
    (found.pairs.iter().map(row).collect(), stats_row(&found.stats))
}

/// The statistics as a row for Python.
pub(super) fn stats_row(stats: &DetectionStats) -> StatsRow {
    (
        stats.object_time.as_secs_f64(),
        stats.traversal_time.as_secs_f64(),
        stats.polygon_time.as_secs_f64(),
        stats.object_pairs,
        stats.nodes_visited,
        stats.leaf_pairs,
        stats.box_tests,
        stats.polygon_tests,
        stats.all_pairs,
    )
}
