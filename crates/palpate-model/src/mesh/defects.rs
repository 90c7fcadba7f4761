//! What a mesh may have, but had better not.

use std::fmt;

use palpate_geometry::{Point, tetrahedron};

use super::adjacency::EdgeUse;
use super::check::used_by_elements;
use super::error::{Indices, counted};
use super::surface::for_each_face;
use super::{Mesh, NONE, QualitySummary};
use crate::disjoint_sets::DisjointSets;

/// Something suspicious in a valid mesh. Its `Display` says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Defect {
    /// What is suspicious.
    pub kind: DefectKind,
    /// The nodes, edges, triangles or tetrahedra that it was found at.
    pub indices: Indices,
}

/// Kinds of [`Defect`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum DefectKind {
    /// Nodes of no element.
    UnusedNodes,
    /// Nodes at exactly the position of an earlier one.
    CoincidentNodes,
    /// Tetrahedra with a face that three or more share.
    CrowdedFaces,
    /// Tetrahedra whose radius ratio is below [`QualitySummary::POOR`].
    PoorQuality,
    /// Surface triangles without area.
    FlatTriangles,
    /// Surface edges of more than two triangles.
    NonManifoldEdges,
    /// Surface nodes where sheets touch without sharing an edge.
    NonManifoldNodes,
    /// Edges of one triangle, in a surface-only mesh.
    OpenEdges,
    /// Edges that two triangles run through in the same direction, in a surface-only mesh.
    InconsistentEdges,
    /// The mesh falls into several parts; the indices are the first node of each.
    SeparateParts,
}

impl fmt::Display for Defect {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.indices.count;
        let (found, advice) = match self.kind {
            DefectKind::UnusedNodes => {
                (counted(count, "node of no element", "nodes of no element"), "repair drops them")
            }
            DefectKind::CoincidentNodes => (
                counted(count, "node lies on another one", "nodes lie on earlier ones"),
                "merge them if the parts are meant to hang together",
            ),
            DefectKind::CrowdedFaces => (
                counted(count, "tetrahedron shares", "tetrahedra share")
                    + " a face with two others",
                "tetrahedra overlap there: mesh it anew",
            ),
            DefectKind::PoorQuality => (
                counted(count, "nearly flat tetrahedron", "nearly flat tetrahedra"),
                "they stiffen the body and slow the solver: improve the mesh",
            ),
            DefectKind::FlatTriangles => (
                counted(count, "surface triangle without area", "surface triangles without area"),
                "they have no normal: collapse them",
            ),
            DefectKind::NonManifoldEdges => (
                counted(count, "edge of more than two", "edges of more than two")
                    + " surface triangles",
                "parts hang together by an edge only: separate or fill them",
            ),
            DefectKind::NonManifoldNodes => (
                counted(count, "node", "nodes") + " where surfaces meet in a point",
                "parts hang together by a point only: separate or fill them",
            ),
            DefectKind::OpenEdges => (
                counted(count, "open edge", "open edges"),
                "a membrane may have them; a body with an inside must be closed",
            ),
            DefectKind::InconsistentEdges => (
                counted(count, "edge", "edges") + " between triangles that face opposite ways",
                "orient the surface: its outside is where triangles are seen counter-clockwise",
            ),
            DefectKind::SeparateParts => (
                format!("the mesh falls into {count} parts"),
                "make each a body of its own if they should move on their own",
            ),
        };
        let what = match self.kind {
            DefectKind::SeparateParts => "first nodes: ",
            DefectKind::NonManifoldEdges
            | DefectKind::OpenEdges
            | DefectKind::InconsistentEdges => "surface edges: ",
            _ => "",
        };
        write!(out, "{found} ({what}{}); {advice}", self.indices)
    }
}

impl Mesh {
    /// Everything suspicious about this mesh, at most one [`Defect`] of a kind, in the order of
    /// [`DefectKind`]. Empty for a sound mesh.
    pub fn validate(&self) -> Vec<Defect> {
        let mut defects = Vec::new();
        let mut report = |kind, indices: Indices| {
            if !indices.is_empty() {
                defects.push(Defect { kind, indices });
            }
        };
        report(DefectKind::UnusedNodes, unused_nodes(self));
        report(DefectKind::CoincidentNodes, coincident_nodes(self.nodes()));
        report(DefectKind::CrowdedFaces, crowded_tetrahedra(self));
        let poor = |&index: &u32| {
            let corners = self.tetrahedron_corners(index as usize);
            tetrahedron::quality(&corners).radius_ratio < QualitySummary::POOR
        };
        report(DefectKind::PoorQuality, (0..self.tetrahedra().len() as u32).filter(poor).collect());
        let flat = |&index: &u32| {
            is_flat(self.triangles()[index as usize].map(|node| self.nodes()[node as usize]))
        };
        report(
            DefectKind::FlatTriangles,
            (0..self.triangles().len() as u32).filter(flat).collect(),
        );

        let edges = self.edge_uses();
        let with = |wrong: fn(&EdgeUse) -> bool| -> Indices {
            (0..edges.len() as u32).filter(|&edge| wrong(&edges[edge as usize])).collect()
        };
        report(DefectKind::NonManifoldEdges, with(|edge| edge.forward + edge.backward > 2));
        report(DefectKind::NonManifoldNodes, pinched_nodes(self));
        if self.is_surface_only() {
            report(DefectKind::OpenEdges, with(|edge| edge.forward + edge.backward == 1));
            report(
                DefectKind::InconsistentEdges,
                with(|edge| edge.forward + edge.backward == 2 && edge.forward != edge.backward),
            );
        }
        let parts = first_node_of_each_part(self);
        if parts.count > 1 {
            report(DefectKind::SeparateParts, parts);
        }
        defects
    }
}

fn unused_nodes(mesh: &Mesh) -> Indices {
    let used = used_by_elements(&mesh.data);
    (0..used.len() as u32).filter(|&node| !used[node as usize]).collect()
}

fn coincident_nodes(nodes: &[Point]) -> Indices {
    // `+ 0.0` makes -0 and 0 the same.
    let key = |node: u32| nodes[node as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..nodes.len() as u32).collect();
    order.sort_unstable_by_key(|&node| (key(node), node));
    let mut repeated: Vec<u32> = order
        .chunk_by(|&left, &right| key(left) == key(right))
        .flat_map(|run| run[1..].iter().copied())
        .collect();
    repeated.sort_unstable();
    repeated.into_iter().collect()
}

fn crowded_tetrahedra(mesh: &Mesh) -> Indices {
    let mut crowded = Vec::new();
    for_each_face(mesh.tetrahedra(), mesh.nodes().len(), |occurrences| {
        if occurrences.len() > 2 {
            crowded.extend(occurrences.iter().map(|face| face / 4));
        }
    });
    crowded.sort_unstable();
    crowded.dedup();
    crowded.into_iter().collect()
}

fn is_flat([a, b, c]: [Point; 3]) -> bool {
    let [u, v] = [b, c].map(|end| std::array::from_fn::<f64, 3, _>(|axis| end[axis] - a[axis]));
    (0..3).all(|axis| {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        u[next] * v[last] == u[last] * v[next]
    })
}

/// Surface nodes whose triangles form more than one fan joined by edges.
fn pinched_nodes(mesh: &Mesh) -> Indices {
    // Corners (3 * triangle + position) of one node are joined across the edges that they share.
    let mut corners = DisjointSets::new(3 * mesh.triangles().len());
    let mut corners_at_edge = vec![[NONE; 2]; mesh.surface_edges().len()];
    for (triangle, (nodes, edges)) in mesh.triangles().iter().zip(mesh.triangle_edges()).enumerate()
    {
        for (side, &edge) in edges.iter().enumerate() {
            for position in [side, (side + 1) % 3] {
                let corner = (3 * triangle + position) as u32;
                let end = mesh.surface_edges()[edge as usize][1] == nodes[position];
                let first = &mut corners_at_edge[edge as usize][usize::from(end)];
                if *first == NONE {
                    *first = corner;
                } else {
                    corners.join(*first, corner);
                }
            }
        }
    }
    let mut fan = vec![NONE; mesh.nodes().len()];
    let mut pinched = Vec::new();
    for (corner, &node) in mesh.triangles().as_flattened().iter().enumerate() {
        let root = corners.root(corner as u32);
        if fan[node as usize] == NONE {
            fan[node as usize] = root;
        } else if fan[node as usize] != root {
            pinched.push(node);
        }
    }
    pinched.sort_unstable();
    pinched.dedup();
    pinched.into_iter().collect()
}

/// The smallest node of every part that hangs together by shared nodes.
fn first_node_of_each_part(mesh: &Mesh) -> Indices {
    let mut parts = DisjointSets::new(mesh.nodes().len());
    let mut join_all = |nodes: &[u32]| nodes[1..].iter().for_each(|&n| parts.join(nodes[0], n));
    mesh.tetrahedra().iter().for_each(|nodes| join_all(nodes));
    mesh.triangles().iter().for_each(|nodes| join_all(nodes));
    let used = used_by_elements(&mesh.data);
    (0..mesh.nodes().len() as u32)
        .filter(|&node| used[node as usize] && parts.root(node) == node)
        .collect()
}
