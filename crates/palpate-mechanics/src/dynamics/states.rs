//! The state of the bodies: taken, and gone back to.

use palpate_model::Model;

use super::{Dynamics, check_array};
use crate::body::check_fixed_nodes;
use crate::error::MechanicsError;
use crate::state::{BodyState, ContactForce, State};

impl Dynamics {
    /// Everything the next step depends on.
    pub fn state(&self) -> State {
        let bodies = (0..self.body_count()).map(|index| {
            let body = self.body(index);
            BodyState {
                positions: body.positions.clone(),
                velocities: body.velocities.clone(),
                forces: body.forces.clone(),
                pose: body.rigid().and_then(|rigid| rigid.pose),
                shape: body.shape(),
                stiff_shape: body.stiff_shape().to_vec(),
                order: body.order().to_vec(),
            }
        });
        State {
            time: self.time(),
            step: self.step,
            clock_start: (self.start_time, self.start_step),
            bodies: bodies.collect(),
            contacts: self.response.last().forces().to_vec(),
            pulls: self.ties.pulls().to_vec(),
            drives: self.drives.all().to_vec(),
        }
    }

    /// Goes back to `state`; [`Dynamics::contacts`] is empty until the next step.
    ///
    /// # Errors
    /// If the state belongs to other bodies or is not finite; nothing has changed then.
    pub fn set_state(&mut self, state: &State) -> Result<(), MechanicsError> {
        let (expected, found) = (self.body_count(), state.bodies.len());
        if expected != found {
            return Err(MechanicsError::WrongBodyCount { expected, found });
        }
        for (body, saved) in state.bodies.iter().enumerate() {
            let count = self.positions(body).len();
            check_array(body, count, &saved.positions, "the position")?;
            check_array(body, count, &saved.velocities, "the velocity")?;
            check_array(body, count, &saved.forces, "the force")?;
            if saved.order != self.body(body).order() {
                return Err(MechanicsError::OtherOrder { body });
            }
            for shape in [&saved.shape, &saved.stiff_shape] {
                if !shape.is_empty() {
                    check_array(body, count, shape, "the shape")?;
                }
            }
            if saved
                .pose
                .is_some_and(|pose| !pose.linear.is_finite() || !pose.translation.is_finite())
            {
                return Err(MechanicsError::Rotation);
            }
        }
        let fits = |contact: &ContactForce| {
            let corners = (0..4).all(|corner| {
                let body = contact.body_of(corner);
                body < expected && (contact.nodes[corner] as usize) < self.positions(body).len()
            });
            corners && contact.force.iter().chain(&contact.weights).all(|x| x.is_finite())
        };
        if let Some(index) = state.contacts.iter().position(|contact| !fits(contact)) {
            return Err(MechanicsError::BadContact(index));
        }
        self.check_drives(&state.drives)?;
        for pull in &state.pulls {
            self.check_pull(pull.body as usize, pull.node as usize, pull.target, pull.stiffness)?;
        }
        for (index, saved) in state.bodies.iter().enumerate() {
            let body = self.body_mut(index);
            body.positions.copy_from_slice(&saved.positions);
            body.velocities.copy_from_slice(&saved.velocities);
            body.forces.copy_from_slice(&saved.forces);
            body.set_pose(saved.pose);
            body.set_shape(saved);
        }
        self.ties.restore(&state.pulls);
        self.drives.restore(&state.drives);
        for body in 0..self.body_count() {
            self.apply_drives(body);
        }
        self.set_contact_forces(&state.contacts);
        self.response.restore(&state.contacts);
        (self.start_time, self.start_step) = state.clock_start;
        self.step = state.step;
        if state.step < self.start_step || self.time() != state.time {
            // Of another time step: this one counts from here.
            (self.start_time, self.start_step) = (state.time, state.step);
        }
        Ok(())
    }
}

/// Whether the orders of a state are orders of the model's free nodes, and its shapes of its nodes.
pub(super) fn check_orders(model: &Model, state: &State) -> Result<(), MechanicsError> {
    let (expected, found) = (model.bodies.len(), state.bodies.len());
    if expected != found {
        return Err(MechanicsError::WrongBodyCount { expected, found });
    }
    for (index, (body, saved)) in model.bodies.iter().zip(&state.bodies).enumerate() {
        check_fixed_nodes(index, body)?;
        let count = body.mesh.nodes().len();
        if !saved.stiff_shape.is_empty() {
            check_array(index, count, &saved.stiff_shape, "the shape")?;
        }
        let mut sorted = saved.order.clone();
        sorted.sort_unstable();
        let free = count - body.fixed_nodes.len();
        if !sorted.is_empty() && !sorted.into_iter().eq(0..free as u32) {
            return Err(MechanicsError::OtherOrder { body: index });
        }
    }
    Ok(())
}
