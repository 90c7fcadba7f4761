//! What the next step depends on.

use palpate_geometry::Point;

/// Everything the next step depends on; restoring it continues bit for bit.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct State {
    /// Simulated time [s].
    pub time: f64,
    /// Steps taken.
    pub step: u64,
    /// The bodies, in model order.
    pub bodies: Vec<BodyState>,
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
}
