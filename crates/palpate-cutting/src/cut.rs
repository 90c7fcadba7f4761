//! The cut of one mesh: sheet after sheet.

use palpate_geometry::{Aabb, Point, tetrahedron};
use palpate_model::{Mesh, MeshChange, MeshError};

use crate::blade::{Blade, Sheet};
use crate::crossing::{Crossing, Sides, crossed_edges};
use crate::draft::Draft;
use crate::groups::Groups;
use crate::report::CutReport;
use crate::separate;
use crate::snap;
use crate::split::{EdgeSplit, Parts};

/// How a cut treats what the blade nearly meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOptions {
    /// A node closer to the blade than this part of a crossed edge counts as on the blade: the cut passes through it. In
    /// [0, 0.5].
    pub snap: f64,
    /// No part of a split tetrahedron has a smaller radius ratio at rest (1 is regular), unless the whole had: its
    /// split is refused instead, and the cut passes through its nodes. In [0, 1].
    pub min_quality: f64,
    /// No part of a split tetrahedron has a shorter edge [m] at rest, unless the whole had. With it, no number of cuts makes
    /// more than a bounded number of tetrahedra. 0 for no bound; a tenth of a mesh's mean edge costs little accuracy.
    pub min_edge: f64,
    /// No piece comes off that has less volume at rest than this many mean tetrahedra of the mesh: it stays where it was. 0
    /// for no bound.
    pub min_piece: f64,
}

impl Default for CutOptions {
    fn default() -> Self {
        Self { snap: 0.15, min_quality: 0.1, min_edge: 0.0, min_piece: 4.0 }
    }
}

/// A mesh after a cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The new mesh, and what in it was what. Old nodes and tetrahedra keep their numbers (a split one its first
    /// part); what is new comes after them.
    pub change: MeshChange,
    /// Present positions [m] of the new mesh's nodes.
    pub positions: Vec<Point>,
    /// What was done.
    pub report: CutReport,
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
/// The result is a conforming mesh: tetrahedra that the blade passes through are split, and nodes are copied along the cut. A tetrahedron in which
/// the blade ends is cut through, so that the cut ends at most one tetrahedron beyond the blade. `None` when the blade passes the mesh by, or nothing comes
/// apart (it meets only the inside of a tetrahedron, or lies where a cut is already).
///
/// # Errors
/// If the mesh has no tetrahedra, a position is missing or not finite, or an option is out of range.
pub fn cut(
    mesh: &Mesh,
    positions: &[Point],
    blade: &Blade,
    options: &CutOptions,
) -> Result<Option<Cut>, CutError> {
    check(mesh, positions, options)?;
    let bounds = Aabb::from_points(positions);
    if !bounds.intersects(&blade.bounds()) {
        return Ok(None);
    }
    let min_volume = options.min_piece * mesh.volume() / mesh.tetrahedra().len() as f64;
    let mut draft = Draft::new(mesh, positions);
    let mut total: Option<SheetCut> = None;
    for sheet in blade.sheets(&bounds) {
        if let Some((next, done)) = cut_by_sheet(&draft, &sheet, options, min_volume) {
            draft = next;
            total = Some(total.map_or(done, |before| before.then(done)));
        }
    }
    match total {
        Some(total) => finish(mesh, draft, total).map(Some),
        None => Ok(None),
    }
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
    let CutOptions { snap, min_quality, min_edge, min_piece } = *options;
    let ranges = [
        ("snap", snap, (0.0..=0.5).contains(&snap), "in [0, 0.5]"),
        ("min_quality", min_quality, (0.0..=1.0).contains(&min_quality), "in [0, 1]"),
        ("min_edge", min_edge, min_edge >= 0.0 && min_edge.is_finite(), "a length, or 0 for none"),
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
    options: &CutOptions,
    min_volume: f64,
) -> Option<(Draft<'a>, SheetCut)> {
    let crossing = Crossing::find(draft, sheet);
    if crossing.is_empty() {
        return None;
    }
    let mut sides = Sides::new(sheet, draft.positions.len());
    let edges = crossed_edges(draft, sheet, &crossing, &mut sides);
    let plan = snap::plan(draft, &edges, &mut sides, options);

    let mut next = draft.clone();
    let mut is_touched = vec![false; draft.tetrahedra.len()];
    for &tetrahedron in &crossing.touched {
        is_touched[tetrahedron as usize] = true;
    }
    let first_point = next.origins.len() as u32;
    for split in &plan.splits {
        let parent = draft.parents[split.edge.tetrahedron as usize];
        next.add_node(draft.between(split.edge.nodes, split.edge.t, parent));
        sides.push_on();
    }
    for (tetrahedron, edges) in &plan.tetrahedra {
        split(&mut next, &mut is_touched, &plan, *tetrahedron, edges, first_point);
    }
    let (next, opened) =
        separate::open(&next, &is_touched, &crossing.covered, &mut sides, min_volume)?;
    let done = SheetCut { snapped: plan.snapped, area: opened.area, deviation: opened.deviation };
    Some((next, done))
}

/// Splits one tetrahedron; its first part takes its place.
fn split(
    draft: &mut Draft,
    is_touched: &mut Vec<bool>,
    plan: &snap::Plan,
    tetrahedron: u32,
    edges: &[u32],
    first_point: u32,
) {
    let corners = draft.tetrahedra[tetrahedron as usize];
    let corner =
        |node: u32| corners.iter().position(|&other| other == node).expect("an edge of it") as u8;
    let mut splits = [EdgeSplit { corners: [0; 2], point: 0 }; 6];
    for (place, &edge) in edges.iter().enumerate() {
        let nodes = plan.splits[edge as usize].edge.nodes;
        splits[place] = EdgeSplit { corners: nodes.map(corner), point: 4 + place as u8 };
    }
    let node = |number: u8| match number {
        0..4 => corners[number as usize],
        _ => first_point + edges[number as usize - 4],
    };
    let parts = Parts::new(&splits[..edges.len()]);
    let (first, others) = parts.as_slice().split_first().expect("at least the whole");
    draft.tetrahedra[tetrahedron as usize] = first.map(node);
    for part in others {
        draft.tetrahedra.push(part.map(node));
        draft.parents.push(draft.parents[tetrahedron as usize]);
        is_touched.push(is_touched[tetrahedron as usize]);
    }
}

fn finish(mesh: &Mesh, draft: Draft, total: SheetCut) -> Result<Cut, CutError> {
    let old = mesh.tetrahedra();
    let mut was_split = vec![false; old.len()];
    for &parent in &draft.parents[old.len()..] {
        was_split[parent as usize] = true;
    }
    let Draft { tetrahedra, parents, origins, rest, positions, .. } = draft;
    let change = MeshChange::new(mesh, rest, tetrahedra, origins, parents)?;
    let new = &change.mesh;
    let parts = (0..change.tetrahedra.len())
        .filter(|&part| was_split[change.tetrahedra[part] as usize])
        .map(|part| tetrahedron::radius_ratio(&new.tetrahedron_corners(part)));
    let report = CutReport {
        new_nodes: new.nodes().len() - mesh.nodes().len(),
        new_tetrahedra: new.tetrahedra().len() - old.len(),
        split_tetrahedra: was_split.iter().filter(|&&split| split).count(),
        snapped_nodes: total.snapped,
        pieces_before: piece_count(mesh),
        pieces: piece_count(new),
        smallest_quality: parts.min_by(f64::total_cmp),
        volume_change: new.volume() / mesh.volume() - 1.0,
        cut_area: total.area,
        deviation: total.deviation,
    };
    Ok(Cut { change, positions, report })
}

/// How many pieces without a common node there are: `mesh.pieces().len()`, without the lists.
fn piece_count(mesh: &Mesh) -> usize {
    let mut groups = Groups::new(mesh.nodes().len());
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
