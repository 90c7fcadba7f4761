//! What a user's hands do; see the functions of the same names of [`Dynamics`].
//!
//! [`Dynamics`]: palpate_mechanics::Dynamics

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;
use palpate_mechanics::Pull;

use super::{Simulation, SimulationError};

impl Simulation {
    /// Pulls a node towards `target` [m] with a spring of `stiffness` [N/m] until it is released;
    /// returns what the spring is called by.
    ///
    /// # Errors
    /// If the node does not exist or cannot move, or a number is not finite or not positive.
    pub fn pull(
        &mut self,
        body: usize,
        node: usize,
        target: Point,
        stiffness: f64,
    ) -> Result<u64, SimulationError> {
        Ok(self.dynamics.pull(body, node, target, stiffness)?)
    }

    /// Moves the end of a spring [m].
    ///
    /// # Errors
    /// If there is no such spring any more, or the target is not finite.
    pub fn set_pull_target(&mut self, id: u64, target: Point) -> Result<(), SimulationError> {
        Ok(self.dynamics.set_pull_target(id, target)?)
    }

    /// Lets go of a node.
    ///
    /// # Errors
    /// If there is no such spring any more.
    pub fn release(&mut self, id: u64) -> Result<(), SimulationError> {
        Ok(self.dynamics.release(id)?)
    }

    /// All springs, in the order in which they were made.
    pub fn pulls(&self) -> &[Pull] {
        self.dynamics.pulls()
    }

    /// Puts a rigid body where the user wants it: it moves there during the next step.
    ///
    /// # Errors
    /// If the body does not exist or is not rigid, or a number is not finite.
    pub fn set_pose(
        &mut self,
        body: usize,
        rotation: DQuat,
        translation: Point,
    ) -> Result<(), SimulationError> {
        Ok(self.dynamics.set_pose(body, rotation, translation)?)
    }

    /// How a rigid body is turned from how the model placed it, and where the origin of its mesh file
    /// is [m].
    ///
    /// # Errors
    /// If the body does not exist or is not rigid.
    pub fn tool_pose(&self, body: usize) -> Result<(DMat3, DVec3), SimulationError> {
        Ok(self.dynamics.tool_pose(body)?)
    }

    /// Force [N] of all contacts on a rigid body in the last step, and their torque [N m] about where
    /// the origin of its mesh file is.
    ///
    /// # Errors
    /// If the body does not exist or is not rigid.
    pub fn tool_force(&self, body: usize) -> Result<[Point; 2], SimulationError> {
        Ok(self.dynamics.tool_force(body)?)
    }
}
