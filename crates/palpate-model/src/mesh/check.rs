//! Which arrays make a mesh, and how to repair those that nearly do.

use std::fmt;

use palpate_geometry::{Point, tetrahedron};

use super::MeshData;
use super::error::{ElementKind, Indices, MeshError, counted};
use crate::lists::Lists;

/// Faces are numbered `4 * tetrahedron + face` in 32 bits.
const MAX_TETRAHEDRA: usize = (u32::MAX / 4) as usize;

/// What [`super::Mesh::repaired`] changed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RepairReport {
    /// Inverted tetrahedra that were re-oriented, by their index in the input.
    pub reoriented: Indices,
    /// Flat tetrahedra that were dropped, by their index in the input.
    pub degenerate: Indices,
    /// Repeated tetrahedra or triangles that were dropped, by their index in the input.
    pub duplicates: Indices,
    /// Nodes of no element that were dropped, by their index in the input.
    pub unused_nodes: Indices,
}

impl RepairReport {
    /// True when the input needed no repair.
    pub fn is_empty(&self) -> bool {
        self.lines().is_empty()
    }

    /// One sentence for each kind of repair that was done.
    pub fn lines(&self) -> Vec<String> {
        [
            ("re-oriented", &self.reoriented, "inverted tetrahedron", "inverted tetrahedra"),
            ("dropped", &self.degenerate, "flat tetrahedron", "flat tetrahedra"),
            ("dropped", &self.duplicates, "repeated element", "repeated elements"),
            ("dropped", &self.unused_nodes, "unused node", "unused nodes"),
        ]
        .into_iter()
        .filter(|(_, indices, ..)| !indices.is_empty())
        .map(|(verb, indices, one, many)| {
            format!("{verb} {}: {indices}", counted(indices.count, one, many))
        })
        .collect()
    }
}

impl fmt::Display for RepairReport {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return out.write_str("nothing to repair");
        }
        out.write_str(&self.lines().join("; "))
    }
}

/// Exact sign of the volume of a tetrahedron.
pub(super) fn orientation(nodes: &[Point], tetrahedron: &[u32; 4]) -> i8 {
    tetrahedron::orientation(&tetrahedron.map(|node| nodes[node as usize]))
}

/// Refuses what no repair can mend; sorts the node sets.
pub(super) fn check_arrays(data: &mut MeshData) -> Result<(), MeshError> {
    let node_count = data.nodes.len();
    if data.tetrahedra.is_empty() && data.triangles.is_empty() {
        return Err(MeshError::Empty);
    }
    if !data.tetrahedra.is_empty() && !data.triangles.is_empty() {
        return Err(MeshError::TrianglesBesideTetrahedra);
    }
    check_count("nodes", node_count, u32::MAX as usize)?;
    check_count("tetrahedra", data.tetrahedra.len(), MAX_TETRAHEDRA)?;
    check_count("triangles", data.triangles.len(), MAX_TETRAHEDRA)?;
    check_finite(&data.nodes)?;
    check_elements(ElementKind::Tetrahedron, &data.tetrahedra, node_count)?;
    check_elements(ElementKind::Triangle, &data.triangles, node_count)?;
    if !data.regions.is_empty() && data.regions.len() != data.tetrahedra.len() {
        return Err(MeshError::RegionCount {
            regions: data.regions.len(),
            tetrahedra: data.tetrahedra.len(),
        });
    }
    for fibres in data.fibres.iter().filter(|fibres| !fibres.is_empty()) {
        if fibres.len() != data.tetrahedra.len() {
            let (fibres, tetrahedra) = (fibres.len(), data.tetrahedra.len());
            return Err(MeshError::FibreCount { fibres, tetrahedra });
        }
        let odd = fibres.iter().position(|fibre| fibre.iter().any(|x| !x.is_finite()));
        if let Some(tetrahedron) = odd {
            let tetrahedron = tetrahedron as u32;
            return Err(MeshError::NonFiniteFibre { tetrahedron });
        }
    }
    for (set, nodes) in &mut data.node_sets {
        nodes.sort_unstable();
        nodes.dedup();
        if let Some(&node) = nodes.last().filter(|&&node| node as usize >= node_count) {
            return Err(MeshError::NodeSetOutOfRange { set: set.clone(), node, node_count });
        }
    }
    Ok(())
}

fn check_count(what: &'static str, count: usize, limit: usize) -> Result<(), MeshError> {
    if count > limit { Err(MeshError::TooMany { what, count, limit }) } else { Ok(()) }
}

pub(super) fn check_finite(nodes: &[Point]) -> Result<(), MeshError> {
    match nodes.iter().position(|point| point.iter().any(|x| !x.is_finite())) {
        Some(node) => Err(MeshError::NonFiniteNode { node: node as u32, position: nodes[node] }),
        None => Ok(()),
    }
}

fn check_elements<const N: usize>(
    kind: ElementKind,
    elements: &[[u32; N]],
    node_count: usize,
) -> Result<(), MeshError> {
    for (index, nodes) in elements.iter().enumerate() {
        let element = index as u32;
        for (position, &node) in nodes.iter().enumerate() {
            if node as usize >= node_count {
                return Err(MeshError::NodeOutOfRange { kind, element, node, node_count });
            }
            if nodes[..position].contains(&node) {
                return Err(MeshError::RepeatedNode { kind, element, node });
            }
        }
    }
    Ok(())
}

/// Refuses inverted and flat tetrahedra.
pub(super) fn check_orientations(
    nodes: &[Point],
    tetrahedra: &[[u32; 4]],
) -> Result<(), MeshError> {
    let mut inverted = Indices::default();
    let mut degenerate = Indices::default();
    for (index, tetrahedron) in tetrahedra.iter().enumerate() {
        match orientation(nodes, tetrahedron) {
            1.. => {}
            0 => degenerate.push(index as u32),
            _ => inverted.push(index as u32),
        }
    }
    if !inverted.is_empty() {
        return Err(MeshError::Inverted(inverted));
    }
    if !degenerate.is_empty() {
        return Err(MeshError::Degenerate(degenerate));
    }
    Ok(())
}

/// Refuses what is wrong with changed tetrahedra; the others are known to be right.
pub(super) fn check_changed(data: &MeshData, is_changed: &[bool]) -> Result<(), MeshError> {
    let changed = || (0..data.tetrahedra.len()).filter(|&index| is_changed[index]);
    let is_right = |index| orientation(&data.nodes, &data.tetrahedra[index]) > 0;
    if !changed().all(is_right) {
        // For the whole list of those that are wrong.
        check_orientations(&data.nodes, &data.tetrahedra)?;
    }
    let mut is_near = vec![false; data.nodes.len()];
    for node in changed().flat_map(|index| data.tetrahedra[index]) {
        is_near[node as usize] = true;
    }
    let is_near = |nodes: &&[u32; 4]| nodes.iter().all(|&node| is_near[node as usize]);
    let near: Vec<[u32; 4]> = data.tetrahedra.iter().filter(is_near).copied().collect();
    if duplicates(&near, data.nodes.len()).is_empty() { Ok(()) } else { check_duplicates(data) }
}

/// Refuses elements with the same nodes as an earlier one.
pub(super) fn check_duplicates(data: &MeshData) -> Result<(), MeshError> {
    let tetrahedra = duplicates(&data.tetrahedra, data.nodes.len());
    if !tetrahedra.is_empty() {
        return Err(MeshError::DuplicateTetrahedra(tetrahedra.into_iter().collect()));
    }
    let triangles = duplicates(&data.triangles, data.nodes.len());
    if !triangles.is_empty() {
        return Err(MeshError::DuplicateTriangles(triangles.into_iter().collect()));
    }
    Ok(())
}

/// Elements with the same nodes as an earlier one, in rising order.
fn duplicates<const N: usize>(elements: &[[u32; N]], node_count: usize) -> Vec<u32> {
    let smallest = |element: &[u32; N]| element.iter().copied().min().unwrap_or(0);
    let entries = elements.iter().map(smallest).zip(0_u32..);
    let by_smallest = Lists::new(node_count, entries);
    let mut repeated = Vec::new();
    let mut keyed: Vec<([u32; N], u32)> = Vec::new();
    for elements_of in by_smallest.iter() {
        keyed.clear();
        keyed.extend(elements_of.iter().map(|&element| {
            let mut key = elements[element as usize];
            key.sort_unstable();
            (key, element)
        }));
        keyed.sort_unstable();
        for run in keyed.chunk_by(|left, right| left.0 == right.0) {
            repeated.extend(run[1..].iter().map(|&(_, element)| element));
        }
    }
    repeated.sort_unstable();
    repeated
}

/// Re-orients inverted tetrahedra and drops flat and repeated elements and unused nodes.
pub(super) fn repair(data: &mut MeshData) -> Result<RepairReport, MeshError> {
    let mut report = RepairReport::default();
    let element_count = data.tetrahedra.len();
    let mut keep = vec![true; element_count];
    for (index, tetrahedron) in data.tetrahedra.iter_mut().enumerate() {
        match orientation(&data.nodes, tetrahedron) {
            1.. => {}
            0 => {
                report.degenerate.push(index as u32);
                keep[index] = false;
            }
            _ => {
                report.reoriented.push(index as u32);
                tetrahedron.swap(2, 3);
            }
        }
    }
    for index in duplicates(&data.tetrahedra, data.nodes.len()) {
        // A flat one that is repeated was counted already.
        if std::mem::replace(&mut keep[index as usize], false) {
            report.duplicates.push(index);
        }
    }
    retain(&mut data.tetrahedra, &keep);
    if !data.regions.is_empty() {
        retain(&mut data.regions, &keep);
    }
    for fibres in data.fibres.iter_mut().filter(|fibres| !fibres.is_empty()) {
        retain(fibres, &keep);
    }
    if element_count > 0 && data.tetrahedra.is_empty() {
        return Err(MeshError::NothingLeft { dropped: element_count });
    }

    let repeated_triangles = duplicates(&data.triangles, data.nodes.len());
    let mut keep = vec![true; data.triangles.len()];
    for &index in &repeated_triangles {
        keep[index as usize] = false;
        report.duplicates.push(index);
    }
    retain(&mut data.triangles, &keep);

    report.unused_nodes = drop_unused_nodes(data);
    Ok(report)
}

fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
    let mut flags = keep.iter();
    values.retain(|_| *flags.next().expect("one flag for each value"));
}

/// Nodes that some element uses, shape (n,).
pub(super) fn used_by_elements(data: &MeshData) -> Vec<bool> {
    let mut used = vec![false; data.nodes.len()];
    for &node in data.tetrahedra.as_flattened().iter().chain(data.triangles.as_flattened()) {
        used[node as usize] = true;
    }
    used
}

/// Removes nodes that no element uses; elements and node sets follow the new numbers.
///
/// Returns what was removed, by index before. All element indices must be in range.
pub(crate) fn drop_unused_nodes(data: &mut MeshData) -> Indices {
    let used = used_by_elements(data);
    let unused: Indices =
        used.iter().enumerate().filter(|(_, used)| !**used).map(|(node, _)| node as u32).collect();
    if unused.is_empty() {
        return unused;
    }
    let mut new_index = vec![super::NONE; used.len()];
    for (new, (old, _)) in used.iter().enumerate().filter(|(_, used)| **used).enumerate() {
        new_index[old] = new as u32;
    }
    retain(&mut data.nodes, &used);
    let elements = data.tetrahedra.as_flattened_mut().iter_mut();
    for node in elements.chain(data.triangles.as_flattened_mut()) {
        *node = new_index[*node as usize];
    }
    for set in data.node_sets.values_mut() {
        set.retain(|&node| used.get(node as usize).is_some_and(|used| *used));
        for node in set {
            *node = new_index[*node as usize];
        }
    }
    unused
}
