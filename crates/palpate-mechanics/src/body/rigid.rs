//! A rigid body: it rests, follows the path of its model, or is put where the user wants it.

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use palpate_model::{Pose, RigidMotion};

pub(crate) struct RigidBody {
    rest: Vec<Point>,
    motion: RigidMotion,
    /// Where it was put, as a map from the placed mesh; `None` while it follows its path.
    pub(crate) pose: Option<Pose>,
}

impl RigidBody {
    pub(super) fn new(nodes: &[Point], motion: &RigidMotion) -> Self {
        Self { rest: nodes.to_vec(), motion: motion.clone(), pose: None }
    }

    fn pose_at(&self, time: f64) -> Pose {
        self.pose.unwrap_or_else(|| self.motion.pose(time))
    }

    /// Writes the positions of the nodes at `time` [s].
    pub(super) fn place(&self, time: f64, positions: &mut [Point]) {
        let pose = self.pose_at(time);
        for (node, &rest) in positions.iter_mut().zip(&self.rest) {
            *node = pose.apply(rest);
        }
    }

    /// Where the origin of the mesh file was placed [m]: the pose is given for it.
    pub(crate) fn origin(&self) -> DVec3 {
        DVec3::from_array(self.motion.pivot)
    }

    /// Rotation from how the model placed it, and where the origin is, at `time` [m].
    pub(crate) fn turned(&self, time: f64) -> (DMat3, DVec3) {
        let pose = self.pose_at(time);
        (pose.linear, DVec3::from_array(pose.apply(self.motion.pivot)))
    }
}
