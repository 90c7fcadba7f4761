//! The factor of a body's matrix: made once, solved every step.

mod assembly;
mod block_float;
mod changes;
mod elimination;
mod finish;
mod front;
mod half;
mod memory;
mod multifrontal;
mod packed;
mod pages;
mod probe;
mod real;
mod stored;
mod supernodes;
mod tiles;

use crate::ordering::{NONE, NodeOrder, OrderingMethod};
use crate::{BlockMatrix, BlockPattern};
use block_float::BlockFloat;
use changes::{Contribution, Kept, Older, Plan};
pub use half::{HalfSolution, half_products, half_products_between};
use half::{HalfWorkspace, NODES, Paths};
use memory::{Memory, SharedMemory};
use packed::{PackedFactor, PackedWorkspace, Panel};
use probe::Probe;
use stored::Stored;
use supernodes::Supernodes;

/// Columns of its nodes must have 32-bit numbers.
const MOST_NODES: usize = u32::MAX as usize / 3;

/// The precision that a factor is kept and solved in. It is always computed in double precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Solutions to about 14 digits less those of the condition number.
    Double,
    /// Half the bytes, and half the time of a solve, where the matrix is well enough conditioned
    /// for solutions to five digits; double precision where not.
    Single,
    /// Sixteen bits per entry with a scale for 32 of them: half the bytes and the time of `Single`. For
    /// solutions to four digits where all is smooth, and to two or three of what is stiffest in them
    /// (in the norm of the matrix); single precision where that would be worse. Products with the
    /// inverse stay symmetric and positive.
    BlockFloat,
}

impl Precision {
    /// The next one, for matrices that this one is not enough for.
    fn finer(self) -> Option<Self> {
        match self {
            Self::BlockFloat => Some(Self::Single),
            Self::Single => Some(Self::Double),
            Self::Double => None,
        }
    }
}

/// Why a matrix has no usable factor.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FactorError {
    /// A pivot was zero, negative or not a number.
    #[error(
        "the matrix is not positive definite at node {node} (column {column}): a part of the body \
         without mass or stiffness, or an element turned inside out"
    )]
    NotPositiveDefinite {
        /// Node of the pivot, in the caller's numbering.
        node: usize,
        /// Row and column of the pivot, in the caller's numbering.
        column: usize,
    },
    /// The factor exists, but solving with it is not accurate.
    #[error(
        "the factor is not accurate (relative residual {residual:.1e}): the stiffnesses in the \
         body differ too much"
    )]
    Inaccurate {
        /// Residual of a solve with a known right-hand side, relative to it.
        residual: f64,
    },
    /// The matrix has another pattern than the one that was analysed.
    #[error("the matrix has another pattern than the factor; make a new factor")]
    PatternChanged,
    /// The factor would not fit into memory or 32-bit indices.
    #[error("the factor of {nodes} nodes is too large")]
    TooLarge {
        /// Nodes of the matrix.
        nodes: usize,
    },
}

/// Size and cost of a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorStats {
    /// Method of the order that was taken.
    pub ordering: OrderingMethod,
    /// Entries of the factor, without the zeros that merging supernodes adds.
    pub entries: u64,
    /// Multiplications and additions of one factorisation.
    pub flops: f64,
    /// Bytes of the factor as it is read by a solve.
    pub bytes: usize,
    /// Number of supernodes.
    pub supernodes: usize,
    /// Supernodes that the last factorisation computed; those that it took over are not among them.
    pub computed: usize,
    /// Bytes that are kept for the next change.
    pub kept_bytes: usize,
}

/// A factored symmetric positive definite block matrix.
pub struct Cholesky {
    pattern: std::sync::Arc<BlockPattern>,
    order: NodeOrder,
    /// Place of each node in the order.
    places: Vec<u32>,
    paths: Paths,
    supernodes: Supernodes,
    precision: Precision,
    packed: Packed,
    memory: SharedMemory,
    /// From the first change on.
    kept: Option<Kept>,
    computed: usize,
}

/// A change of another factor's matrix.
struct Change<'a> {
    older: &'a Cholesky,
    /// Its supernode that each one is the same as; [`NONE`] where it is none.
    twins: Vec<u32>,
}

/// The factor in the precision that it is solved in.
enum Packed {
    BlockFloat(PackedFactor<BlockFloat>),
    Single(PackedFactor<Panel<f32>>),
    Double(PackedFactor<Panel<f64>>),
}

/// What the numbers of a factor are kept as.
trait Kind: Stored {
    fn of(packed: &Packed) -> Option<&PackedFactor<Self>>;
    fn packed(factor: PackedFactor<Self>) -> Packed;
}

macro_rules! kind {
    ($stored:ty, $variant:ident) => {
        impl Kind for $stored {
            fn of(packed: &Packed) -> Option<&PackedFactor<Self>> {
                if let Packed::$variant(factor) = packed { Some(factor) } else { None }
            }

            fn packed(factor: PackedFactor<Self>) -> Packed {
                Packed::$variant(factor)
            }
        }
    };
}

kind!(BlockFloat, BlockFloat);
kind!(Panel<f32>, Single);
kind!(Panel<f64>, Double);

impl Default for Packed {
    fn default() -> Self {
        Self::Double(PackedFactor::default())
    }
}

/// Memory for solves with one factor, for one thread.
#[derive(Debug, Default)]
pub struct SolveWorkspace {
    single: PackedWorkspace<f32>,
    double: PackedWorkspace<f64>,
    half_single: HalfWorkspace<f32>,
    half_double: HalfWorkspace<f64>,
}

/// Calls a method of the packed factor with the workspace of its precision.
macro_rules! solve {
    ($self:ident, $work:ident, $method:ident, $($argument:expr),*) => {
        match &$self.packed {
            Packed::BlockFloat(packed) => {
                packed.$method(&$self.order.nodes, $($argument,)* &mut $work.single);
            }
            Packed::Single(packed) => {
                packed.$method(&$self.order.nodes, $($argument,)* &mut $work.single);
            }
            Packed::Double(packed) => {
                packed.$method(&$self.order.nodes, $($argument,)* &mut $work.double);
            }
        }
    };
}

impl Drop for Cholesky {
    fn drop(&mut self) {
        if self.memory.is_shared() {
            self.give_memory();
        }
    }
}

impl Cholesky {
    /// Orders, analyses and factors `matrix`, on the calling thread, and keeps it in double precision.
    ///
    /// # Errors
    /// If the matrix is not positive definite or too ill-conditioned for a direct solve.
    pub fn new(matrix: &BlockMatrix) -> Result<Self, FactorError> {
        Self::with_precision(matrix, Precision::Double)
    }

    /// [`Cholesky::new`], kept in the given precision.
    ///
    /// # Errors
    /// As [`Cholesky::new`].
    pub fn with_precision(matrix: &BlockMatrix, precision: Precision) -> Result<Self, FactorError> {
        Self::in_order(matrix, precision, NodeOrder::new(matrix.pattern()))
    }

    /// [`Cholesky::with_precision`] in an order that is known: finding one can take as long as all the
    /// rest.
    ///
    /// # Errors
    /// As [`Cholesky::new`].
    ///
    /// # Panics
    /// If the order is one of another pattern.
    pub fn in_order(
        matrix: &BlockMatrix,
        precision: Precision,
        order: NodeOrder,
    ) -> Result<Self, FactorError> {
        let mut result = Self::analysed(matrix, precision, order, SharedMemory::default())?;
        result.compute(matrix, None)?;
        Ok(result)
    }

    /// The factor of a matrix that differs from the one of this factor in some places: what they have in
    /// common is taken over, if it is kept in the same precision. It has the same bits as
    /// [`Cholesky::in_order`] gives it.
    ///
    /// `origins[node]` is the node of this factor's matrix that a node was, `None` if it is new. What
    /// is taken over are the supernodes below and in which nothing differs, neither nodes nor their order
    /// nor the bits of the blocks: `order` should be the one here with new nodes next to those they
    /// come from. The first change of a factor computes all and begins to keep what the next
    /// changes need, [`FactorStats::kept_bytes`]; so does one after a [`Cholesky::refactor`] that failed.
    ///
    /// # Errors
    /// As [`Cholesky::new`]; this factor is as before.
    ///
    /// # Panics
    /// If the order is one of another pattern, there is not one origin per node, or one does not exist.
    pub fn changed(
        &self,
        matrix: &BlockMatrix,
        precision: Precision,
        order: NodeOrder,
        origins: &[Option<u32>],
    ) -> Result<Self, FactorError> {
        assert_eq!(origins.len(), matrix.pattern().node_count(), "one origin per node");
        let mut result = Self::analysed(matrix, precision, order, self.memory.clone())?;
        let twins = match &self.kept {
            None => vec![NONE; result.supernodes.count()],
            Some(kept) => {
                let place = |&node: &u32| {
                    origins[node as usize].map_or(NONE, |old| self.places[old as usize])
                };
                let before: Vec<u32> = result.order.nodes.iter().map(place).collect();
                let older = Older { supernodes: &self.supernodes, kept };
                older.twins(&result.supernodes, matrix, &before)
            }
        };
        result.compute(matrix, Some(&Change { older: self, twins }))?;
        Ok(result)
    }

    /// Without the numbers.
    fn analysed(
        matrix: &BlockMatrix,
        precision: Precision,
        order: NodeOrder,
        memory: SharedMemory,
    ) -> Result<Self, FactorError> {
        let pattern = std::sync::Arc::clone(matrix.pattern());
        assert_eq!(order.nodes.len(), pattern.node_count(), "an order of this pattern");
        if pattern.node_count() > MOST_NODES || order.factor_entries > u64::from(u32::MAX) {
            return Err(FactorError::TooLarge { nodes: pattern.node_count() });
        }
        let mut places = vec![0; order.nodes.len()];
        for (place, &node) in order.nodes.iter().enumerate() {
            places[node as usize] = place as u32;
        }
        let supernodes = Supernodes::new(&pattern, &order, &places);
        Ok(Self {
            paths: Paths::new(&supernodes, places.len()),
            pattern,
            order,
            places,
            supernodes,
            precision,
            packed: Packed::default(),
            memory,
            kept: None,
            computed: 0,
        })
    }

    /// Factors a matrix with the pattern of the first one. After an error the factor must not be
    /// used until a later call succeeds.
    ///
    /// # Errors
    /// As [`Cholesky::new`], and if the pattern differs.
    pub fn refactor(&mut self, matrix: &BlockMatrix) -> Result<(), FactorError> {
        if **matrix.pattern() != *self.pattern {
            return Err(FactorError::PatternChanged);
        }
        self.compute(matrix, None)
    }

    fn compute(
        &mut self,
        matrix: &BlockMatrix,
        change: Option<&Change>,
    ) -> Result<(), FactorError> {
        if self.pattern.node_count() == 0 {
            return Ok(());
        }
        let keeps = change.is_some() || self.kept.is_some();
        if self.memory.try_lock().is_none() {
            self.memory = SharedMemory::default();
        }
        self.give_memory();
        let memory = self.memory.clone();
        let memory = &mut *memory.lock();
        let mut precision = self.precision;
        let contributions = loop {
            let kept;
            (self.packed, kept) = match precision {
                Precision::BlockFloat => {
                    self.factored::<BlockFloat>(matrix, change, keeps, memory)?
                }
                Precision::Single => self.factored::<Panel<f32>>(matrix, change, keeps, memory)?,
                Precision::Double => self.factored::<Panel<f64>>(matrix, change, keeps, memory)?,
            };
            let probe = Probe::new(self, matrix, &mut memory.probe);
            if probe.is_accurate(precision) {
                break kept;
            }
            let residual = probe.residual;
            precision = precision.finer().ok_or(FactorError::Inaccurate { residual })?;
        };
        memory.trim();
        self.kept = keeps.then(|| Kept { matrix: matrix.clone(), contributions });
        Ok(())
    }

    /// Computes what the older factor has not, if it is of this kind; and what is kept for the next change.
    fn factored<K: Kind>(
        &mut self,
        matrix: &BlockMatrix,
        change: Option<&Change>,
        keeps: bool,
        memory: &mut Memory,
    ) -> Result<(Packed, Vec<Option<Contribution>>), FactorError> {
        let known = change.and_then(|change| Some((change, K::of(&change.older.packed)?)));
        let mut plan = self.plan(known, keeps);
        self.computed = plan.computed_count();
        let Memory { fronts, contributions, panels, .. } = memory;
        let packed = fronts
            .factor(&self.supernodes, matrix, &mut plan, panels, contributions)
            .map_err(|place| self.not_positive(place))?;
        Ok((K::packed(packed), plan.into_kept()))
    }

    /// What to compute where the columns of the changed factor are `known`.
    fn plan<'a, P: Stored>(
        &self,
        known: Option<(&Change<'a>, &'a PackedFactor<P>)>,
        keeps: bool,
    ) -> Plan<'a, P> {
        if let Some((change, packed)) = known
            && let Some(kept) = &change.older.kept
        {
            let older = Older { supernodes: &change.older.supernodes, kept };
            return Plan::changing(&self.supernodes, &change.twins, &older, packed);
        }
        if keeps { Plan::keeping(&self.supernodes) } else { Plan::whole(&self.supernodes) }
    }

    /// Leaves the numbers to the next factorisation as memory.
    fn give_memory(&mut self) {
        let shared = self.memory.clone();
        let Some(mut memory) = shared.try_lock() else { return };
        let memory = &mut *memory;
        memory.give_panels(match std::mem::take(&mut self.packed) {
            Packed::BlockFloat(packed) => packed.into_pages(),
            Packed::Single(packed) => packed.into_pages(),
            Packed::Double(packed) => packed.into_pages(),
        });
        if let Some(kept) = self.kept.take() {
            for contribution in kept.contributions.into_iter().flatten() {
                memory.contributions.give(contribution);
            }
        }
    }

    fn not_positive(&self, place: usize) -> FactorError {
        let place = place.min(3 * self.order.nodes.len() - 1);
        let node = self.order.nodes[place / 3] as usize;
        FactorError::NotPositiveDefinite { node, column: 3 * node + place % 3 }
    }

    /// The order of elimination.
    pub fn order(&self) -> &NodeOrder {
        &self.order
    }

    /// The precision that was asked for.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.pattern.node_count()
    }

    /// Memory for solves with this factor, for one thread.
    pub fn workspace(&self) -> SolveWorkspace {
        let mut workspace = SolveWorkspace::default();
        match &self.packed {
            Packed::BlockFloat(packed) => packed.fit(&mut workspace.single),
            Packed::Single(packed) => packed.fit(&mut workspace.single),
            Packed::Double(packed) => packed.fit(&mut workspace.double),
        }
        workspace
    }

    /// Solves `A x = rhs` in place. No allocation.
    ///
    /// # Panics
    /// If `rhs` has not one entry per node.
    pub fn solve_in_place(&self, rhs: &mut [[f64; 3]], workspace: &mut SolveWorkspace) {
        solve!(self, workspace, solve_in_place, rhs);
    }

    /// Solves for two right-hand sides in place; reads the factor once for both. No allocation.
    ///
    /// # Panics
    /// As [`Cholesky::solve_in_place`].
    pub fn solve_two_in_place(
        &self,
        first: &mut [[f64; 3]],
        second: &mut [[f64; 3]],
        workspace: &mut SolveWorkspace,
    ) {
        solve!(self, workspace, solve_two_in_place, first, second);
    }

    /// Solves for three right-hand sides in place, entry `3 * side + k` of each node being
    /// component k of one; reads the factor once for all. No allocation.
    ///
    /// # Panics
    /// As [`Cholesky::solve_in_place`].
    pub fn solve_three_in_place(&self, sides: &mut [[f64; 9]], workspace: &mut SolveWorkspace) {
        solve!(self, workspace, solve_three_in_place, sides);
    }

    /// Half solutions of `nodes`, one each in `halves`, for [`half_products`]. Nodes next to each other
    /// in the order of elimination are cheaper together. Allocates where a half solution has to grow.
    ///
    /// # Panics
    /// If a node does not exist, or there is not one half solution per node.
    pub fn half_solve(
        &self,
        nodes: &[u32],
        halves: &mut [HalfSolution],
        workspace: &mut SolveWorkspace,
    ) {
        assert_eq!(nodes.len(), halves.len(), "one half solution per node");
        for (nodes, halves) in nodes.chunks(NODES).zip(halves.chunks_mut(NODES)) {
            let mut places = [0; NODES];
            for (place, &node) in places.iter_mut().zip(nodes) {
                *place = self.places[node as usize];
            }
            let places = &places[..nodes.len()];
            match &self.packed {
                Packed::BlockFloat(packed) => {
                    packed.half_solve(&self.paths, places, halves, &mut workspace.half_single);
                }
                Packed::Single(packed) => {
                    packed.half_solve(&self.paths, places, halves, &mut workspace.half_single);
                }
                Packed::Double(packed) => {
                    packed.half_solve(&self.paths, places, halves, &mut workspace.half_double);
                }
            }
        }
    }

    /// Bytes of the half solution of a node.
    ///
    /// # Panics
    /// If the node does not exist.
    pub fn half_bytes(&self, node: usize) -> usize {
        self.paths.half_bytes(self.places[node] as usize)
    }

    /// Place of a node in the order of elimination.
    ///
    /// # Panics
    /// If the node does not exist.
    pub fn elimination_place(&self, node: usize) -> usize {
        self.places[node] as usize
    }

    /// Writes the length that half solutions have in common with that of `node`, by the branch
    /// ([`Cholesky::branch`]) of the other node.
    ///
    /// # Panics
    /// If the node does not exist.
    pub fn common_lengths(&self, node: usize, lengths: &mut Vec<u32>) {
        self.paths.common_lengths(self.places[node] as usize, lengths);
    }

    /// The branch of the elimination tree that a node is on.
    ///
    /// # Panics
    /// If the node does not exist.
    pub fn branch(&self, node: usize) -> usize {
        self.paths.branch(self.places[node] as usize)
    }

    /// Size and cost.
    pub fn stats(&self) -> FactorStats {
        FactorStats {
            ordering: self.order.method,
            entries: self.order.factor_entries,
            flops: self.order.flops,
            bytes: match &self.packed {
                Packed::BlockFloat(packed) => packed.bytes(),
                Packed::Single(packed) => packed.bytes(),
                Packed::Double(packed) => packed.bytes(),
            },
            supernodes: self.supernodes.count(),
            computed: self.computed,
            kept_bytes: self.kept.as_ref().map_or(0, Kept::bytes),
        }
    }
}
