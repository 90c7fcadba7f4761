//! Nodes that are moved along a path.

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_mechanics::Drive;
use palpate_model::MeshChange;

use super::{Simulation, SimulationError};

impl Simulation {
    /// Drives nodes of a body: they stay where they are until [`Simulation::set_drive_targets`], whatever
    /// pulls at them, and are fixed nodes of the model as long. Returns what the drive is called by.
    ///
    /// The body's matrix is made anew.
    ///
    /// # Errors
    /// If there are no nodes, one of them does not exist or is driven already, or the body is rigid.
    pub fn drive(&mut self, body: usize, nodes: &[u32]) -> Result<u64, SimulationError> {
        let mut nodes = nodes.to_vec();
        nodes.sort_unstable();
        nodes.dedup();
        self.dynamics.check_drive(body, &nodes)?;
        let fixed = &self.model.bodies[body].fixed_nodes;
        let held: Vec<u32> =
            nodes.iter().copied().filter(|node| fixed.binary_search(node).is_ok()).collect();
        let mut all = [&fixed[..], &nodes].concat();
        all.sort_unstable();
        all.dedup();
        self.hold(body, all)?;
        Ok(self.dynamics.drive(body, &nodes, &held)?)
    }

    /// Says where the nodes of a drive, ascending, are at the end of the next step [m].
    ///
    /// # Errors
    /// If there is no such drive any more, or there is not one finite position per node.
    pub fn set_drive_targets(&mut self, id: u64, targets: &[Point]) -> Result<(), SimulationError> {
        Ok(self.dynamics.set_drive_targets(id, targets)?)
    }

    /// Lets the nodes of a drive go; those that the model held before stay fixed.
    ///
    /// # Errors
    /// If there is no such drive any more.
    pub fn release_drive(&mut self, id: u64) -> Result<(), SimulationError> {
        let Drive { body, nodes, held, .. } = self.dynamics.release_drive(id)?;
        let body = body as usize;
        let free =
            |node: &u32| nodes.binary_search(node).is_ok() && held.binary_search(node).is_err();
        let fixed = &self.model.bodies[body].fixed_nodes;
        let left = fixed.iter().copied().filter(|node| !free(node)).collect();
        self.hold(body, left)
    }

    /// All drives, in the order in which they were made.
    pub fn drives(&self) -> &[Drive] {
        self.dynamics.drives()
    }

    /// Goes on with other fixed nodes of a body.
    fn hold(&mut self, body: usize, nodes: Vec<u32>) -> Result<(), SimulationError> {
        if self.model.bodies[body].fixed_nodes == nodes {
            return Ok(());
        }
        let mut model = self.model.as_ref().clone();
        model.bodies[body].fixed_nodes = nodes;
        let change = MeshChange::identity(&model.bodies[body].mesh);
        self.dynamics.change_body(&model, body, &change)?;
        self.set_model(Arc::new(model));
        self.begin_live_cuts_anew();
        Ok(())
    }
}
