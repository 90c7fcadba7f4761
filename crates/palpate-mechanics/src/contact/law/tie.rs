//! A tie: a spring that pulls a point of a body to its place, in every direction.

use glam::{DMat3, DVec3};

use super::super::filter::Candidate;
use super::super::problem::Block;
use super::SOFTNESS_FLOOR;

/// `softness * force = -(offset at the end of the step)`, along the axes of the block.
#[derive(Clone, Copy, Debug)]
pub(in crate::contact) struct TieLaw {
    /// Offset at the end of the step without the forces that are solved for [m].
    free: DVec3,
    softness: f64,
    own: DMat3,
    /// Inverse of softness and own response [N/m].
    stiffness: DMat3,
    distance: f64,
}

impl TieLaw {
    pub(super) fn new(offset: DVec3, candidate: &Candidate, block: &Block) -> Self {
        let own = block.own;
        let response = (own.x_axis.x + own.y_axis.y + own.z_axis.z) / 3.0;
        let softness = candidate.stiffness.recip().max(SOFTNESS_FLOOR * response);
        Self {
            free: block.axes.transpose() * offset + block.free,
            softness,
            own,
            stiffness: (own + DMat3::from_diagonal(DVec3::splat(softness))).inverse(),
            distance: candidate.distance,
        }
    }

    pub(super) fn answer(&self, force: DVec3, moved: DVec3) -> DVec3 {
        let others = moved - self.own * force;
        self.stiffness * -(self.free + others)
    }

    pub(super) fn violation(&self, force: DVec3, moved: DVec3) -> f64 {
        (self.free + moved + self.softness * force).length() / self.distance
    }
}
