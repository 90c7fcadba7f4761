//! What a scene's queries find, as columns for Python.

use numpy::PyArray2;
use palpate::contact::{DetectionStats, IntersectionOptions, Intersections, TrianglePair};
use pyo3::prelude::*;

use super::PyScene;
use crate::arrays::index_matrix;

/// Times [s] and counts of a query, in the order of `palpate.DetectionStats`.
pub(crate) type StatsRow = (f64, f64, f64, u64, u64, u64, u64, u64, u64);

/// The pairs of `palpate.Intersections`, and what they cost.
pub(super) type IntersectionColumns<'py> = (Bound<'py, PyArray2<i32>>, StatsRow);

impl PyScene {
    pub(super) fn find_intersections<'py>(
        &self,
        py: Python<'py>,
        options: IntersectionOptions,
    ) -> PyResult<IntersectionColumns<'py>> {
        let (rows, stats) = py.detach(|| intersection_rows(self.lock().0.intersections(&options)));
        Ok((index_matrix(py, &rows)?, stats))
    }
}

/// The pairs as rows for Python, and what they cost.
pub(crate) fn intersection_rows(found: &Intersections) -> (Vec<[u32; 4]>, StatsRow) {
    let row = |pair: &TrianglePair| [pair.body_a, pair.triangle_a, pair.body_b, pair.triangle_b];
    (found.pairs.iter().map(row).collect(), stats_row(&found.stats))
}

/// The statistics as a row for Python.
fn stats_row(stats: &DetectionStats) -> StatsRow {
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
