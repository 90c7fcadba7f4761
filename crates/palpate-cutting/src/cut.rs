//! The cut of one mesh: sheet after sheet.

use palpate_geometry::{Aabb, Point, tetrahedron};
use palpate_model::{DisjointSets, Mesh, MeshChange, MeshError};
use serde::{Deserialize, Serialize};

use crate::blade::{Blade, Sheet};
use crate::crossing::{Crossing, Sides, crossed_edges};
use crate::draft::Draft;
use crate::report::CutReport;
use crate::separate;
use crate::snap;
use crate::split;

/// How a cut treats what the blade nearly meets.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct CutOptions {
    /// A node closer to the blade than this part of a crossed edge counts as on the blade: the cut
    /// passes through it. In [0, 0.5].
    pub snap: f64,
    /// No part of a split tetrahedron has a smaller radius ratio at rest (1 is regular), unless the
    /// whole had: its split is refused instead, and the cut passes through its nodes. In [0, 1].
    pub min_quality: f64,
    /// No part of a split tetrahedron has a shorter edge [m] at rest, unless the whole had. With
    /// it, no number of cuts makes more than a bounded number of tetrahedra. 0 for no bound; `None`:
    /// [`CutOptions::EDGE`] of the mean edge of the mesh's surface.
    pub min_edge: Option<f64>,
    /// No piece comes off that has less volume at rest than this many mean tetrahedra of the mesh:
    /// it stays where it was. 0 for no bound.
    pub min_piece: f64,
}

impl CutOptions {
    /// Usual shortest edge, as a part of the mean edge of a mesh's surface: it costs little accuracy.
    pub const EDGE: f64 = 0.1;

    /// Whether all of them are in their ranges.
    ///
    /// # Errors
    /// If one is not.
    pub fn check(&self) -> Result<(), CutError> {
        let CutOptions { snap, min_quality, min_edge, min_piece } = *self;
        let min_edge = min_edge.unwrap_or(0.0);
        let ranges = [
            ("snap", snap, (0.0..=0.5).contains(&snap), "in [0, 0.5]"),
            ("min_quality", min_quality, (0.0..=1.0).contains(&min_quality), "in [0, 1]"),
            (
                "min_edge",
                min_edge,
                min_edge >= 0.0 && min_edge.is_finite(),
                "a length, or 0 for none",
            ),
            (
                "min_piece",
                min_piece,
                min_piece >= 0.0 && min_piece.is_finite(),
                "finite, or 0 for none",
            ),
        ];
        match ranges.into_iter().find(|(_, _, is_right, _)| !is_right) {
            Some((name, value, _, range)) => Err(CutError::Option { name, value, range }),
            None => Ok(()),
        }
    }
}

impl Default for CutOptions {
    fn default() -> Self {
        Self { snap: 0.15, min_quality: 0.1, min_edge: None, min_piece: 4.0 }
    }
}

/// A mesh after a cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The new mesh, and what in it was what. Old nodes and tetrahedra keep their numbers (a split
    /// one its first part); what is new comes after them.
    pub change: MeshChange,
    /// Present positions [m] of the new mesh's nodes.
    pub positions: Vec<Point>,
    /// What was done.
    pub report: CutReport,
    /// Nodes of the faces of the new mesh that are cut but still hang together by all three nodes,
    /// at the front of a partial cut: for [`cut_on`].
    pub pending: Vec<[u32; 3]>,
}

/// Why a mesh could not be cut. Nothing has changed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CutError {
    /// A mesh without tetrahedra.
    #[error("a mesh of triangles only cannot be cut; it needs tetrahedra")]
    SurfaceOnly,
    /// Not one position for each node.
    #[error("{found} positions for a mesh of {expected} nodes")]
    PositionCount {
        /// How many positions came.
        found: usize,
        /// How many nodes the mesh has.
        expected: usize,
    },
    /// A position that is infinite or not a number.
    #[error("the position {position:?} of node {node} is not finite")]
    NonFinitePosition {
        /// Index of the node.
        node: usize,
        /// Its coordinates.
        position: Point,
    },
    /// An option out of its range.
    #[error("the option {name} is {value}; it must be {range}")]
    Option {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// The parts do not make a mesh: so small that rounding flattens them.
    #[error("the parts are too small for a mesh: {0}; give a longer min_edge")]
    Mesh(#[from] MeshError),
}

/// Cuts `mesh`, whose nodes are at `positions` [m] now, along `blade`, which is in that space.
///
/// The result is a conforming mesh: tetrahedra that the blade passes through are split, and nodes
/// are copied along the cut. A tetrahedron in which the blade ends is cut through, so that the cut
/// ends at most one tetrahedron beyond the blade. `None` when the blade passes the mesh by, or
/// nothing comes apart (it meets only the inside of a tetrahedron, or lies where a cut is already).
///
/// # Errors
/// If the mesh has no tetrahedra, a position is missing or not finite, or an option is out of
/// range.
pub fn cut(
    mesh: &Mesh,
    positions: &[Point],
    blade: &Blade,
    options: &CutOptions,
) -> Result<Option<Cut>, CutError> {
    sheet_by_sheet(mesh, positions, blade, &[], options, false)
}

/// Goes on cutting where an earlier cut ended: as [`cut`], with the `pending` faces that it left.
///
/// A blade that moves in steps shorter than a tetrahedron cuts it through when it first enters,
/// though all of its nodes may still hang together with others; without `pending` this is forgotten
/// when the blade goes on, and bridges stay. In exchange the result may be a mesh that was only
/// split, with pending faces and nothing open (`cut_area` is 0). Pending faces that are no longer
/// faces between two tetrahedra are ignored; after another change of the mesh, give none.
///
/// # Errors
/// As [`cut`].
pub fn cut_on(
    mesh: &Mesh,
    positions: &[Point],
    blade: &Blade,
    pending: &[[u32; 3]],
    options: &CutOptions,
) -> Result<Option<Cut>, CutError> {
    sheet_by_sheet(mesh, positions, blade, pending, options, true)
}

fn sheet_by_sheet(
    mesh: &Mesh,
    positions: &[Point],
    blade: &Blade,
    pending: &[[u32; 3]],
    options: &CutOptions,
    keeps_pending: bool,
) -> Result<Option<Cut>, CutError> {
    check(mesh, positions, options)?;
    let bounds = Aabb::from_points(positions);
    if !bounds.intersects(&blade.bounds()) {
        return Ok(None);
    }
    let volume = mesh.volume();
    let min_volume = options.min_piece * volume / mesh.tetrahedra().len() as f64;
    let CutOptions { snap, min_quality, .. } = *options;
    let min_edge = options.min_edge.unwrap_or_else(|| CutOptions::EDGE * mesh.mean_surface_edge());
    let shape = ShapeLimits { snap, min_quality, min_edge };
    let limits = Limits { shape, min_volume, keeps_pending };
    let mut draft = Draft::new(mesh, positions, pending);
    let mut total: Option<SheetCut> = None;
    for sheet in blade.sheets(&bounds) {
        if let Some((next, done)) = cut_by_sheet(&draft, &sheet, &limits) {
            draft = next;
            total = Some(total.map_or(done, |before| before.then(done)));
        }
    }
    match total {
        Some(total) => finish(mesh, volume, draft, total).map(Some),
        None => Ok(None),
    }
}

/// The options, in the units of a mesh.
struct Limits {
    shape: ShapeLimits,
    /// Smallest volume [m³] of a piece.
    min_volume: f64,
    /// Whether faces that are cut and not opened are of use.
    keeps_pending: bool,
}

/// What decides whether an edge is split; see [`CutOptions`].
pub(crate) struct ShapeLimits {
    pub(crate) snap: f64,
    pub(crate) min_quality: f64,
    pub(crate) min_edge: f64,
}

fn check(mesh: &Mesh, positions: &[Point], options: &CutOptions) -> Result<(), CutError> {
    if mesh.is_surface_only() {
        return Err(CutError::SurfaceOnly);
    }
    if positions.len() != mesh.nodes().len() {
        return Err(CutError::PositionCount {
            found: positions.len(),
            expected: mesh.nodes().len(),
        });
    }
    let is_finite = |point: &Point| point.iter().all(|value| value.is_finite());
    if let Some(node) = positions.iter().position(|point| !is_finite(point)) {
        return Err(CutError::NonFinitePosition { node, position: positions[node] });
    }
    options.check()
}

/// What one sheet did.
#[derive(Clone, Copy, Debug, Default)]
struct SheetCut {
    snapped: usize,
    area: f64,
    deviation: f64,
}

impl SheetCut {
    fn then(self, next: Self) -> Self {
        Self {
            snapped: self.snapped + next.snapped,
            area: self.area + next.area,
            deviation: self.deviation.max(next.deviation),
        }
    }
}

/// The mesh cut by one sheet; `None` when nothing comes apart.
fn cut_by_sheet<'a>(
    draft: &Draft<'a>,
    sheet: &Sheet,
    limits: &Limits,
) -> Option<(Draft<'a>, SheetCut)> {
    let crossing = Crossing::find(draft, sheet);
    if crossing.is_empty() {
        return None;
    }
    let mut sides = Sides::new(sheet, draft.positions.len());
    let edges = crossed_edges(draft, sheet, &crossing, &mut sides);
    let plan = snap::plan(draft, &edges, &mut sides, &limits.shape);

    let mut next = draft.clone();
    let mut is_touched = vec![false; draft.tetrahedra.len()];
    for &tetrahedron in &crossing.touched {
        is_touched[tetrahedron as usize] = true;
    }
    split::apply(&mut next, &plan, &mut is_touched, &mut sides);
    let Limits { min_volume, keeps_pending, .. } = *limits;
    let (next, opened) = separate::open(
        &next,
        &is_touched,
        &crossing.covered,
        &mut sides,
        min_volume,
        keeps_pending,
    )?;
    let done = SheetCut { snapped: plan.snapped, area: opened.area, deviation: opened.deviation };
    Some((next, done))
}

/// `volume` [m³] is that of `mesh`.
fn finish(mesh: &Mesh, volume: f64, draft: Draft, total: SheetCut) -> Result<Cut, CutError> {
    let old = mesh.tetrahedra();
    let mut was_split = vec![false; old.len()];
    for &parent in &draft.parents[old.len()..] {
        was_split[parent as usize] = true;
    }
    let Draft { tetrahedra, parents, origins, rest, positions, pending, .. } = draft;
    let change = MeshChange::new(mesh, rest, tetrahedra, origins, parents)?;
    let new = &change.mesh;
    let (mut smallest_quality, mut gained) = (None, 0.0);
    for (part, &parent) in change.tetrahedra.iter().enumerate() {
        if was_split[parent as usize] {
            let corners = new.tetrahedron_corners(part);
            let quality = tetrahedron::radius_ratio(&corners);
            smallest_quality = Some(smallest_quality.map_or(quality, |least| quality.min(least)));
            gained += tetrahedron::signed_volume(&corners);
        }
    }
    let split = || (0..old.len()).filter(|&parent| was_split[parent]);
    for parent in split() {
        gained -= tetrahedron::signed_volume(&mesh.tetrahedron_corners(parent));
    }
    let report = CutReport {
        new_nodes: new.nodes().len() - mesh.nodes().len(),
        new_tetrahedra: new.tetrahedra().len() - old.len(),
        split_tetrahedra: split().count(),
        snapped_nodes: total.snapped,
        pieces_before: piece_count(mesh),
        pieces: piece_count(new),
        smallest_quality,
        volume_change: gained / volume,
        cut_area: total.area,
        deviation: total.deviation,
    };
    Ok(Cut { change, positions, report, pending })
}

/// How many pieces without a common node there are: `mesh.pieces().len()`, without the lists.
fn piece_count(mesh: &Mesh) -> usize {
    let mut groups = DisjointSets::new(mesh.nodes().len());
    let mut is_used = vec![false; mesh.nodes().len()];
    for &[a, b, c, d] in mesh.tetrahedra() {
        is_used[a as usize] = true;
        for other in [b, c, d] {
            groups.join(a, other);
            is_used[other as usize] = true;
        }
    }
    let nodes = 0..mesh.nodes().len() as u32;
    nodes.filter(|&node| is_used[node as usize] && groups.root(node) == node).count()
}
