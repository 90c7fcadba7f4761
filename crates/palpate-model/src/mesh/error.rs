//! Why arrays do not make a mesh.

use std::fmt;

use palpate_geometry::Point;

/// How many indices an error or a defect lists.
const LISTED: usize = 8;

/// Some of the elements or nodes that share a fault: how many there are, and the first few.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Indices {
    /// How many there are.
    pub count: usize,
    /// The first few of them, in rising order.
    pub first: Vec<u32>,
}

impl Indices {
    /// Counts one more; keeps its index while the list is short.
    pub(crate) fn push(&mut self, index: u32) {
        self.count += 1;
        if self.first.len() < LISTED {
            self.first.push(index);
        }
    }

    /// True when nothing was counted.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

impl FromIterator<u32> for Indices {
    fn from_iter<I: IntoIterator<Item = u32>>(indices: I) -> Self {
        let mut result = Self::default();
        indices.into_iter().for_each(|index| result.push(index));
        result
    }
}

impl fmt::Display for Indices {
    /// `3, 7, 9`, or `3, 7, 9, ...` when there are more than the list holds.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, index) in self.first.iter().enumerate() {
            write!(out, "{}{index}", if position == 0 { "" } else { ", " })?;
        }
        if self.count > self.first.len() {
            out.write_str(", ...")?;
        }
        Ok(())
    }
}

/// The two kinds of element that a mesh can be made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementKind {
    /// Four nodes.
    Tetrahedron,
    /// Three nodes, in a surface-only mesh.
    Triangle,
}

impl fmt::Display for ElementKind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Tetrahedron => "tetrahedron",
            Self::Triangle => "triangle",
        })
    }
}

/// Why arrays do not make a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A mesh without elements.
    #[error("the mesh has neither tetrahedra nor triangles; give one of them")]
    Empty,
    /// Repair left nothing.
    #[error("no tetrahedron is left after repair: all {dropped} were flat or repeated")]
    NothingLeft {
        /// Tetrahedra that were dropped.
        dropped: usize,
    },
    /// Both kinds of element.
    #[error(
        "the mesh has both tetrahedra and triangles; leave the triangles out, the surface of the \
         tetrahedra is found from them"
    )]
    TrianglesBesideTetrahedra,
    /// Indices are 32 bits wide.
    #[error("{count} {what} are more than the {limit} that a mesh can have")]
    TooMany {
        /// `nodes`, `tetrahedra` or `triangles`.
        what: &'static str,
        /// How many came.
        count: usize,
        /// How many are possible.
        limit: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node}: position ({}, {}, {}) is not finite; give coordinates in metres", .position[0], .position[1], .position[2])]
    NonFiniteNode {
        /// Index of the node.
        node: u32,
        /// Its coordinates.
        position: Point,
    },
    /// An element names a node that does not exist.
    #[error(
        "{kind} {element}: node index {node} is out of range (the mesh has {node_count} nodes{})",
        if *.node as usize == *.node_count { ", counted from 0" } else { "" }
    )]
    NodeOutOfRange {
        /// Kind of the element.
        kind: ElementKind,
        /// Index of the element.
        element: u32,
        /// The index that it names.
        node: u32,
        /// How many nodes there are.
        node_count: usize,
    },
    /// An element names a node twice.
    #[error("{kind} {element}: node {node} is named twice; name different nodes")]
    RepeatedNode {
        /// Kind of the element.
        kind: ElementKind,
        /// Index of the element.
        element: u32,
        /// The node that it names twice.
        node: u32,
    },
    /// A node set names a node that does not exist.
    #[error("set `{set}`: node index {node} is out of range (the mesh has {node_count} nodes)")]
    NodeSetOutOfRange {
        /// Name of the set.
        set: String,
        /// The index that it names.
        node: u32,
        /// How many nodes there are.
        node_count: usize,
    },
    /// `regions` is neither empty nor one number per tetrahedron.
    #[error("{regions} region numbers for {tetrahedra} tetrahedra; give one for each, or none")]
    RegionCount {
        /// How many region numbers came.
        regions: usize,
        /// How many tetrahedra there are.
        tetrahedra: usize,
    },
    /// A family of `fibres` is neither empty nor one direction per tetrahedron.
    #[error("{fibres} fibre directions for {tetrahedra} tetrahedra; give one for each, or none")]
    FibreCount {
        /// How many directions came.
        fibres: usize,
        /// How many tetrahedra there are.
        tetrahedra: usize,
    },
    /// A fibre direction that is infinite or not a number.
    #[error("the fibre direction of tetrahedron {tetrahedron} is not finite; 0,0,0 is for none")]
    NonFiniteFibre {
        /// The first such tetrahedron.
        tetrahedron: u32,
    },
    /// Tetrahedra with negative volume.
    #[error(
        "{} inverted (negative volume): {}; repair re-orients them",
        counted(.0.count, "tetrahedron is", "tetrahedra are"), .0
    )]
    Inverted(Indices),
    /// Tetrahedra with exactly zero volume.
    #[error(
        "{} flat (zero volume): {}; repair drops them",
        counted(.0.count, "tetrahedron is", "tetrahedra are"), .0
    )]
    Degenerate(Indices),
    /// Tetrahedra with the same four nodes as an earlier one.
    #[error(
        "{} the same four nodes as an earlier one: {}; repair drops them",
        counted(.0.count, "tetrahedron has", "tetrahedra have"), .0
    )]
    DuplicateTetrahedra(Indices),
    /// Triangles of a surface-only mesh with the same three nodes as an earlier one.
    #[error(
        "{} the same three nodes as an earlier one: {}; repair drops them",
        counted(.0.count, "triangle has", "triangles have"), .0
    )]
    DuplicateTriangles(Indices),
    /// A tetrahedron to be removed that the mesh does not have.
    #[error("tetrahedron {tetrahedron} cannot be removed: the mesh has {count} tetrahedra")]
    RemovedOutOfRange {
        /// The index.
        tetrahedron: u32,
        /// How many tetrahedra there are.
        count: usize,
    },
    /// A tetrahedron that is to be removed twice.
    #[error("tetrahedron {tetrahedron} is to be removed twice; name each one once")]
    RemovedTwice {
        /// The index.
        tetrahedron: u32,
    },
    /// All tetrahedra are to be removed.
    #[error("removing all {removed} tetrahedra would leave nothing; leave at least one")]
    NothingRemains {
        /// How many tetrahedra there are.
        removed: usize,
    },
    /// New positions for a mesh with another number of nodes.
    #[error("{found} positions for a mesh of {expected} nodes")]
    NodeCount {
        /// How many positions came.
        found: usize,
        /// How many nodes the mesh has.
        expected: usize,
    },
}

/// What an error points at, for readers that know where in their file it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Node(usize),
    Element(ElementKind, usize),
}

impl MeshError {
    /// The first node or element that the error is about.
    pub(crate) fn place(&self) -> Option<Place> {
        let first = |kind, indices: &Indices| {
            indices.first.first().map(|&index| Place::Element(kind, index as usize))
        };
        match self {
            Self::NonFiniteNode { node, .. } => Some(Place::Node(*node as usize)),
            Self::NodeOutOfRange { kind, element, .. }
            | Self::RepeatedNode { kind, element, .. } => {
                Some(Place::Element(*kind, *element as usize))
            }
            Self::Inverted(indices)
            | Self::Degenerate(indices)
            | Self::DuplicateTetrahedra(indices) => first(ElementKind::Tetrahedron, indices),
            Self::DuplicateTriangles(indices) => first(ElementKind::Triangle, indices),
            _ => None,
        }
    }
}

/// `1 tetrahedron is` or `3 tetrahedra are`.
pub(crate) fn counted(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}
