//! What the next step depends on.

use palpate_geometry::Point;
use palpate_model::Pose;

use crate::dynamics::Drive;
use crate::ties::Pull;

/// Everything the next step depends on; restoring it continues bit for bit.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct State {
    /// Simulated time [s].
    pub time: f64,
    /// Steps taken.
    pub step: u64,
    /// Time [s] and step that the clock counts from: time is theirs plus steps times the time step,
    /// so that it does not drift, and a restored simulation goes on with the same bits.
    pub clock_start: (f64, u64),
    /// The bodies, in model order.
    pub bodies: Vec<BodyState>,
    /// Forces of contacts and springs in the last step, where the solver begins.
    pub contacts: Vec<ContactForce>,
    /// Springs that pull nodes.
    pub pulls: Vec<Pull>,
    /// Nodes that are moved along a path.
    pub drives: Vec<Drive>,
}

/// The force of one contact in the last step.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct ContactForce {
    /// Whether two edges touch, or else a node and a triangle.
    pub edges: bool,
    /// Body of side a and of side b.
    pub bodies: [u32; 2],
    /// As in [`crate::Contact`].
    pub nodes: [u32; 4],
    /// As in [`crate::Contact`].
    pub weights: [f64; 4],
    /// On side a [N].
    pub force: Point,
}

impl ContactForce {
    /// Body of the node in place `corner` of `nodes`.
    pub(crate) fn body_of(&self, corner: usize) -> usize {
        self.bodies[usize::from(corner > usize::from(self.edges))] as usize
    }
}

/// State of one body; every array has one entry per node.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct BodyState {
    /// Positions [m].
    pub positions: Vec<Point>,
    /// Velocities [m/s].
    pub velocities: Vec<Point>,
    /// External forces [N].
    pub forces: Vec<Point>,
    /// Where a rigid body was put, instead of on the path that the model gives it.
    pub pose: Option<Pose>,
    /// Shape in the body's frame for which its response to contact was computed last [m]; empty if
    /// it was not.
    pub shape: Vec<Point>,
    /// Shape in the body's frame whose stiffness a body with a nonlinear law is solved with [m]; empty:
    /// the rest shape.
    pub stiff_shape: Vec<Point>,
    /// Order in which the free nodes of a body that was cut are eliminated; empty: what the body finds
    /// itself.
    pub order: Vec<u32>,
}
