//! Why a scene refuses an argument; it then stays as it was.

/// A wrong argument to a [`crate::Scene`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// No meshes at all.
    #[error("meshes: got none, expected at least one")]
    NoMeshes,
    /// `leaf_size` is zero.
    #[error("leaf_size: got 0, expected at least 1")]
    LeafSize,
    /// `threads` is zero.
    #[error("threads: got 0, expected at least 1")]
    Threads,
    /// The operating system gave no threads.
    #[error("threads: {threads} threads could not be started: {reason}")]
    ThreadPool {
        /// Threads asked for.
        threads: usize,
        /// The system's answer.
        reason: String,
    },
    /// A body index that does not exist.
    #[error("body: got {body}, expected an index below the number of bodies, {count}")]
    BodyOutOfRange {
        /// The index.
        body: usize,
        /// Bodies in the scene.
        count: usize,
    },
    /// Positions for another number of bodies.
    #[error("positions: got {given} arrays, expected {expected}, one for each body")]
    BodyCount {
        /// Arrays given.
        given: usize,
        /// Bodies in the scene.
        expected: usize,
    },
    /// Positions for another number of nodes.
    #[error("positions[{body}]: got {given} nodes, expected {expected}, the nodes of its mesh")]
    NodeCount {
        /// The body.
        body: usize,
        /// Nodes given.
        given: usize,
        /// Nodes of the body's mesh.
        expected: usize,
    },
    /// A change of another mesh than the body's.
    #[error("change: it is not one of the mesh of body {body}: {reason}")]
    OtherMesh {
        /// The body.
        body: usize,
        /// What does not fit.
        reason: &'static str,
    },
    /// Groups for another number of triangles.
    #[error(
        "groups: got {given}, expected {expected}, one for each surface triangle of body {body}"
    )]
    GroupCount {
        /// The body.
        body: usize,
        /// Groups given.
        given: usize,
        /// Surface triangles of the body's mesh.
        expected: usize,
    },
    /// A position that is NaN or infinite.
    #[error("positions[{body}][{node}]: got {position:?}, expected finite numbers")]
    NotFinite {
        /// The body.
        body: usize,
        /// The node.
        node: usize,
        /// What came.
        position: [f64; 3],
    },
    /// The structure names a body that does not exist.
    #[error("structure: names body {body}, expected an index below the number of meshes, {count}")]
    StructureBody {
        /// The index.
        body: usize,
        /// Meshes given.
        count: usize,
    },
    /// The structure names a body twice.
    #[error("structure: names body {body} twice, expected each body once")]
    StructureRepeats {
        /// The body.
        body: usize,
    },
    /// The structure leaves a body out.
    #[error("structure: does not name body {body}, expected each body once")]
    StructureMisses {
        /// The body.
        body: usize,
    },
    /// A point or direction that is NaN or infinite.
    #[error("{array}[{row}]: got {values:?}, expected finite numbers")]
    RowNotFinite {
        /// Which argument.
        array: &'static str,
        /// The row.
        row: usize,
        /// What came.
        values: [f64; 3],
    },
    /// Directions for another number of rays.
    #[error("directions: got {given} rows, expected {expected}, one for each origin")]
    DirectionCount {
        /// Directions given.
        given: usize,
        /// Origins given.
        expected: usize,
    },
    /// A ray without a direction.
    #[error("directions[{row}]: got a zero vector, expected one with a direction")]
    ZeroDirection {
        /// The ray.
        row: usize,
    },
    /// A distance that is negative or NaN.
    #[error("max_distance: got {distance}, expected a number of at least 0")]
    MaxDistance {
        /// What came.
        distance: f64,
    },
}
