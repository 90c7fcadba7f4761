//! What a user's hands do: pull nodes by springs, move rigid tools.

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;
use palpate_model::Pose;

use super::Dynamics;
use crate::body::{BodyKind, RigidBody};
use crate::error::MechanicsError;
use crate::ties::Pull;

impl Dynamics {
    /// Pulls a node towards `target` [m] with a spring of `stiffness` [N/m], from the next step on
    /// until it is released. The spring is part of the implicit step, so that it may be as stiff as
    /// wanted. Returns what it is called by.
    ///
    /// # Errors
    /// If the body or node does not exist or cannot move, or a number is not finite or not positive.
    pub fn pull(
        &mut self,
        body: usize,
        node: usize,
        target: Point,
        stiffness: f64,
    ) -> Result<u64, MechanicsError> {
        self.check_pull(body, node, target, stiffness)?;
        if !self.body(body).elastic().is_some_and(|elastic| elastic.is_free(node)) {
            return Err(MechanicsError::CannotMove { body, node });
        }
        let position = self.positions(body)[node];
        Ok(self.ties.pull((body as u32, node as u32), position, target, stiffness))
    }

    /// Whether a spring can be in a state. Its node need not be free: it may be driven meanwhile.
    pub(super) fn check_pull(
        &self,
        body: usize,
        node: usize,
        target: Point,
        stiffness: f64,
    ) -> Result<(), MechanicsError> {
        self.check_body(body)?;
        self.check_node(body, node)?;
        if self.body(body).elastic().is_none() {
            return Err(MechanicsError::CannotMove { body, node });
        }
        check_target(target)?;
        if !(stiffness.is_finite() && stiffness > 0.0) {
            return Err(MechanicsError::Stiffness(stiffness));
        }
        Ok(())
    }

    /// Moves the end of a spring [m].
    ///
    /// # Errors
    /// If there is no such spring any more, or the target is not finite.
    pub fn set_pull_target(&mut self, id: u64, target: Point) -> Result<(), MechanicsError> {
        check_target(target)?;
        if self.ties.set_target(id, target) { Ok(()) } else { Err(MechanicsError::Released) }
    }

    /// Lets go of a node.
    ///
    /// # Errors
    /// If there is no such spring any more.
    pub fn release(&mut self, id: u64) -> Result<(), MechanicsError> {
        if self.ties.release(id) { Ok(()) } else { Err(MechanicsError::Released) }
    }

    /// All springs, in the order in which they were made.
    pub fn pulls(&self) -> &[Pull] {
        self.ties.pulls()
    }

    /// Puts a rigid body where the user wants it instead of on the path that the model gives it: it
    /// moves there during the next step. `translation` [m] is where the origin of its mesh file goes,
    /// `rotation` (made a unit) turns it about that from how the model placed it.
    ///
    /// # Errors
    /// If the body does not exist or is not rigid, or a number is not finite.
    pub fn set_pose(
        &mut self,
        body: usize,
        rotation: DQuat,
        translation: Point,
    ) -> Result<(), MechanicsError> {
        let unit = rotation.normalize();
        if !unit.is_finite() {
            return Err(MechanicsError::Rotation);
        }
        check_target(translation)?;
        let rigid = self.rigid_mut(body)?;
        let moved = DVec3::from_array(translation) - unit * rigid.origin();
        rigid.pose = Some(Pose::from_rotation_translation(unit, moved));
        Ok(())
    }

    /// How a rigid body is turned from how the model placed it, and where the origin of its mesh file
    /// is [m].
    ///
    /// # Errors
    /// If the body does not exist or is not rigid.
    pub fn tool_pose(&self, body: usize) -> Result<(DMat3, DVec3), MechanicsError> {
        Ok(self.rigid(body)?.turned(self.time()))
    }

    /// Force [N] of all contacts on a rigid body in the last step, and their torque [N m] about where
    /// the origin of its mesh file is.
    ///
    /// # Errors
    /// If the body does not exist or is not rigid.
    pub fn tool_force(&self, body: usize) -> Result<[Point; 2], MechanicsError> {
        let (_, origin) = self.tool_pose(body)?;
        let moving = self.body(body);
        let (mut force, mut torque) = (DVec3::ZERO, DVec3::ZERO);
        if moving.touched {
            for (&f, &x) in moving.contact_forces.iter().zip(&moving.positions) {
                let f = DVec3::from_array(f);
                force += f;
                torque += (DVec3::from_array(x) - origin).cross(f);
            }
        }
        Ok([force.to_array(), torque.to_array()])
    }

    pub(super) fn check_body(&self, index: usize) -> Result<(), MechanicsError> {
        let count = self.body_count();
        if index < count { Ok(()) } else { Err(MechanicsError::NoSuchBody { index, count }) }
    }

    pub(super) fn check_node(&self, body: usize, node: usize) -> Result<(), MechanicsError> {
        let nodes = self.positions(body).len();
        if node < nodes { Ok(()) } else { Err(MechanicsError::NoSuchNode { body, node, nodes }) }
    }

    fn rigid(&self, body: usize) -> Result<&RigidBody, MechanicsError> {
        self.check_body(body)?;
        self.body(body).rigid().ok_or(MechanicsError::NotRigid(body))
    }

    fn rigid_mut(&mut self, body: usize) -> Result<&mut RigidBody, MechanicsError> {
        self.rigid(body)?;
        match &mut self.body_mut(body).kind {
            BodyKind::Rigid(rigid) => Ok(rigid),
            BodyKind::Elastic(_) => Err(MechanicsError::NotRigid(body)),
        }
    }
}

fn check_target(target: Point) -> Result<(), MechanicsError> {
    if target.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(MechanicsError::Target) }
}
