//! Cuts and removal while the bodies move.

use palpate_model::{MeshChange, Model};

use super::{Dynamics, attach};
use crate::contact::{ContactParameters, Surface};
use crate::error::MechanicsError;
use crate::state::ContactForce;

impl Dynamics {
    /// Goes on with a body whose mesh was changed: `model` is the model after the change, `change` what
    /// became of the mesh of body `index`. Only that body's matrix is made anew.
    ///
    /// Contact forces of the last step, with which the next one begins, stay at the nodes that are
    /// left; [`Dynamics::contacts`] is empty until then. Springs go on pulling the copy of their node
    /// with the lowest number. Returns the springs that were released because their node has gone.
    ///
    /// # Errors
    /// If the body cannot be simulated; nothing has changed then.
    ///
    /// # Panics
    /// If the model has another number of bodies, or the change is not one of the body's mesh.
    pub fn change_body(
        &mut self,
        model: &Model,
        index: usize,
        change: &MeshChange,
    ) -> Result<Vec<u64>, MechanicsError> {
        assert_eq!(model.bodies.len(), self.body_count(), "the same bodies");
        let body = &model.bodies[index];
        let parameters = ContactParameters::new(index, body)?;
        let time_step = self.options.time_step;
        let changed = self.body(index).changed(body, change, model.gravity, time_step)?;
        let copies = first_copies(self.positions(index).len(), change);

        let contacts: Vec<ContactForce> = self.response.last().forces().to_vec();
        let contacts: Vec<ContactForce> =
            contacts.into_iter().filter_map(|contact| moved(contact, index, &copies)).collect();
        let released = self.ties.change_body(index as u32, |node| copies[node as usize]);
        *self.body_mut(index) = changed;
        self.surfaces[index] = Surface::new(&body.mesh);
        self.parameters[index] = parameters;
        self.response.forget_body(index);
        self.ties.detach();
        attach(&mut self.ties, model, &self.parameters, &self.surfaces);
        self.response.set_attached(self.ties.attached_nodes());
        self.set_contact_forces(&contacts);
        self.response.restore(&contacts);
        Ok(released)
    }
}

/// For each node before, the first one now that is it or a copy of it.
fn first_copies(count: usize, change: &MeshChange) -> Vec<Option<u32>> {
    let mut copies = vec![None; count];
    for (node, origin) in change.nodes.iter().enumerate().rev() {
        if let Some(old) = origin.kept_node() {
            copies[old as usize] = Some(node as u32);
        }
    }
    copies
}

/// A contact of the last step between the nodes that there are now.
fn moved(mut contact: ContactForce, body: usize, copies: &[Option<u32>]) -> Option<ContactForce> {
    for corner in 0..4 {
        if contact.body_of(corner) == body {
            contact.nodes[corner] = copies[contact.nodes[corner] as usize]?;
        }
    }
    Some(contact)
}
