//! Why bodies cannot be simulated.

use palpate_model::Body;
use palpate_solver::FactorError;

use crate::dynamics::Failure;

/// Why a model, a state or a step was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MechanicsError {
    /// A surface-only mesh that is not rigid.
    #[error(
        "body {body} '{name}' has no tetrahedra, so it cannot deform: make it rigid or give it a \
         tetrahedral mesh"
    )]
    NoTetrahedra {
        /// Index of the body.
        body: usize,
        /// Its name.
        name: String,
    },
    /// A node of a deformable body without mass.
    #[error("node {node} of body {body} '{name}' belongs to no tetrahedron: remove it")]
    LooseNode {
        /// Index of the body.
        body: usize,
        /// Its name.
        name: String,
        /// The first such node.
        node: usize,
    },
    /// A parameter outside its range.
    #[error("{what} of body {body} '{name}' is {value}; expected {expected}")]
    BadParameter {
        /// Index of the body.
        body: usize,
        /// Its name.
        name: String,
        /// Name of the parameter.
        what: &'static str,
        /// What was given.
        value: f64,
        /// The valid range.
        expected: &'static str,
    },
    /// The linear law beside another one in one body.
    #[error(
        "body {body} '{name}' has regions of law {} and of law {}: linear regions cannot be mixed \
         with others; use corotated", laws[0], laws[1]
    )]
    MixedLaws {
        /// Index of the body.
        body: usize,
        /// Its name.
        name: String,
        /// The body's law, and one of a region.
        laws: [palpate_model::Law; 2],
    },
    /// The stiffness matrix of a body could not be factored.
    #[error("body {body} '{name}': {source}")]
    Factor {
        /// Index of the body.
        body: usize,
        /// Its name.
        name: String,
        /// What went wrong.
        source: FactorError,
    },
    /// A time step that is not positive and finite.
    #[error("the time step is {0} s; expected a positive number")]
    TimeStep(f64),
    /// The worker threads could not be started.
    #[error("cannot start the worker threads: {0}")]
    Threads(String),
    /// Gravity with an infinite or undefined component.
    #[error("gravity must be finite")]
    Gravity,
    /// An array whose length is not the body's number of nodes.
    #[error("body {body} has {expected} nodes, but {found} entries were given")]
    WrongCount {
        /// Index of the body.
        body: usize,
        /// Nodes of the body.
        expected: usize,
        /// Entries given.
        found: usize,
    },
    /// A state with another number of bodies.
    #[error("the state holds {found} bodies, the model has {expected}")]
    WrongBodyCount {
        /// Bodies of the model.
        expected: usize,
        /// Bodies of the state.
        found: usize,
    },
    /// A state of a body that was cut, for one that was not cut in the same way.
    #[error(
        "the state of body {body} is one after other cuts; go on from it with Dynamics::with_state"
    )]
    OtherOrder {
        /// Index of the body.
        body: usize,
    },
    /// A step that failed.
    #[error("body {}, {}", .0.body, .0)]
    Step(Failure),
    /// NaN or infinity in what was given.
    #[error("{what} of node {node} of body {body} is not finite")]
    NotFinite {
        /// Index of the body.
        body: usize,
        /// The first such node.
        node: usize,
        /// Positions, velocities or forces.
        what: &'static str,
    },
    /// A body that does not exist.
    #[error("body {index} does not exist: there are {count} bodies, numbered from 0")]
    NoSuchBody {
        /// The index that was asked for.
        index: usize,
        /// Number of bodies.
        count: usize,
    },
    /// A node that does not exist.
    #[error("node {node} does not exist: body {body} has {nodes} nodes, numbered from 0")]
    NoSuchNode {
        /// Index of the body.
        body: usize,
        /// The index that was asked for.
        node: usize,
        /// Nodes of the body.
        nodes: usize,
    },
    /// Fixed nodes that are not in ascending order, each once.
    #[error(
        "fixed_nodes of body {body}: {node} comes after {before}; give them in ascending order, \
         each once"
    )]
    FixedOrder {
        /// Index of the body.
        body: usize,
        /// The first node that is not greater than the one before it.
        node: u32,
        /// That one.
        before: u32,
    },
    /// A spring on a node that nothing moves.
    #[error("node {node} of body {body} is fixed or rigid: it cannot be pulled")]
    CannotMove {
        /// Index of the body.
        body: usize,
        /// The node.
        node: usize,
    },
    /// A spring that is not stiff.
    #[error("the stiffness is {0} N/m; expected a positive number")]
    Stiffness(f64),
    /// A target or translation with an infinite or undefined component.
    #[error("a target or translation must be finite")]
    Target,
    /// A rotation that turns nothing, not even by nothing.
    #[error("a rotation must be finite and not zero")]
    Rotation,
    /// Nothing to drive.
    #[error("expected at least one node, got none")]
    NoNodes,
    /// Nodes of a rigid body.
    #[error("body {0} is rigid: move it as a tool")]
    RigidDriven(usize),
    /// A node that two drives would move.
    #[error("node {node} of body {body} is driven already: release that first")]
    DrivenTwice {
        /// Index of the body.
        body: usize,
        /// The node.
        node: usize,
    },
    /// A driven node that its model does not hold.
    #[error("node {node} of body {body} is not fixed, so that it cannot be driven")]
    NotFixed {
        /// Index of the body.
        body: usize,
        /// The node.
        node: usize,
    },
    /// A spring that is gone.
    #[error("this was released before, or belongs to another state")]
    Released,
    /// A pose for a body that deforms.
    #[error("body {0} is not rigid, so it cannot be a tool: give it RG fixed in the model")]
    NotRigid(usize),
    /// A contact of a state that names a body or node that does not exist, or is not finite.
    #[error("contact {0} of the state does not fit the bodies; is it a state of this model?")]
    BadContact(usize),
}

impl From<Failure> for MechanicsError {
    fn from(failure: Failure) -> Self {
        Self::Step(failure)
    }
}

/// A parameter of a body: name, value, whether it is valid, what would be.
pub(crate) type ParameterCheck = (&'static str, f64, bool, &'static str);

/// The error of the first parameter that is not valid.
pub(crate) fn check_parameters(
    index: usize,
    body: &Body,
    checks: &[ParameterCheck],
) -> Result<(), MechanicsError> {
    match checks.iter().find(|(_, _, valid, _)| !valid) {
        Some(&(what, value, _, expected)) => Err(MechanicsError::BadParameter {
            body: index,
            name: body.name.clone(),
            what,
            value,
            expected,
        }),
        None => Ok(()),
    }
}
