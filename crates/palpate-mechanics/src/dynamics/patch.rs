//! What a loop faster than the steps needs to know of a body.

use super::Dynamics;
use crate::body::BodyKind;
use crate::contact::{Patch, PatchMemory};

impl Dynamics {
    /// Writes how `nodes` of a body (ascending surface nodes) move each other within a step, as of the last
    /// one; nodes that cannot move are left out. Forces of the next steps do not depend on it.
    ///
    /// # Panics
    /// If the body or a node does not exist.
    pub fn write_patch(
        &mut self,
        body: usize,
        nodes: &[u32],
        memory: &mut PatchMemory,
        patch: &mut Patch,
    ) {
        let step = self.step;
        let moving = self.body_mut(body);
        if let BodyKind::Elastic(elastic) = &mut moving.kind {
            moving.compliance.prepare(elastic, nodes, step);
        }
        patch.write(moving, nodes, memory);
    }
}
