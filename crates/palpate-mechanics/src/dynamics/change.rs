//! Cuts, removal and separation while the bodies move, and a process that forks.

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_model::{MeshChange, Model};

use super::states::check_orders;
use super::{Dynamics, attach};
use crate::body::{BodyBasis, Known, MovingBody};
use crate::contact::node_compliance::NodeCompliance;
use crate::contact::{ContactParameters, Surface};
use crate::error::MechanicsError;
use crate::state::{BodyState, ContactForce, State};

/// A body after a change of its mesh, made from what no step changes: it may be made while steps are taken.
pub struct ChangedBody {
    body: MovingBody,
    parameters: ContactParameters,
    surface: Surface,
    compliance: NodeCompliance,
}

impl ChangedBody {
    /// Makes what becomes of body `index` by `change`, in steps of `time_step` [s]: `model` is the model after the
    /// change, `basis` what the body was.
    ///
    /// # Errors
    /// If the body cannot be simulated.
    pub fn new(
        model: &Model,
        index: usize,
        change: &MeshChange,
        basis: &BodyBasis,
        time_step: f64,
    ) -> Result<Self, MechanicsError> {
        let body = &model.bodies[index];
        let parameters = ContactParameters::new(index, body)?;
        let gravity = model.gravity;
        Ok(Self {
            body: MovingBody::after(index, body, change, gravity, time_step, basis)?,
            parameters,
            surface: Surface::new(&body.mesh),
            compliance: NodeCompliance::default(),
        })
    }

    /// With its responses to contact solved for, where it was touched and where `change` opened it: the next
    /// step would do so otherwise, to the same bits.
    #[must_use]
    pub fn prepared(mut self, basis: &BodyBasis, change: &MeshChange) -> Self {
        let nodes = self.body.prepare_as_before(basis, change);
        if let Some(elastic) = self.body.elastic() {
            self.compliance.gather(elastic, &self.body.compliance, &nodes);
        }
        self
    }
}

impl Dynamics {
    /// Goes on with a body whose mesh was changed: `model` is the model after the change, `change` what
    /// became of the mesh of body `index`. Only that body's matrix is made anew, where the change reaches.
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
        let (basis, time_step) = (self.basis(index), self.options.time_step);
        let changed = ChangedBody::new(model, index, change, &basis, time_step)?;
        let (released, before) = self.replace_body(changed, model, change);
        self.body_mut(index).take_memory(before);
        Ok(released)
    }

    /// What body `index` after a change can be made from; see [`ChangedBody::new`].
    pub fn basis(&self, index: usize) -> BodyBasis {
        self.body(index).basis(self.response.problem().nodes(index))
    }

    /// The shape of body `index`, in its frame [m], whose stiffness its next matrix should be made of; empty: that
    /// at rest. Near what it is made of now that one is kept, so that the factor can be.
    pub fn next_stiff_shape(&self, index: usize) -> Vec<Point> {
        let body = self.body(index);
        body.elastic().map_or_else(Vec::new, |elastic| elastic.next_stiff_shape(&body.positions))
    }

    /// Whether another matrix of body `index` is being made: until then a step that takes many iterations
    /// makes none, which would not serve for long.
    pub fn await_matrix(&mut self, index: usize, awaited: bool) {
        self.body_mut(index).waits_for_matrix = awaited;
    }

    /// Goes on with a body that was made for `change`, as [`Self::change_body`]: all but the time that the
    /// matrix and the responses take. The step that has to begin now leaves what one pass does not settle, up to
    /// half an edge, to the next one.
    ///
    /// # Panics
    /// If the model has another number of bodies, or the change is not one of the body's mesh.
    pub fn go_on_with(
        &mut self,
        changed: ChangedBody,
        model: &Model,
        change: &MeshChange,
    ) -> Vec<u64> {
        self.is_changing = true;
        self.replace_body(changed, model, change).0
    }

    /// Also returns what was there before.
    fn replace_body(
        &mut self,
        changed: ChangedBody,
        model: &Model,
        change: &MeshChange,
    ) -> (Vec<u64>, MovingBody) {
        assert_eq!(model.bodies.len(), self.body_count(), "the same bodies");
        let ChangedBody { mut body, parameters, surface, compliance } = changed;
        let index = body.index;
        body.move_as(self.body(index), change);
        let likely = body.likely_nodes(self.response.problem().nodes(index), change);
        self.response.change_body(index, compliance, likely);
        let copies = first_copies(self.positions(index).len(), change);
        let contacts: Vec<ContactForce> = self.response.last().forces().to_vec();
        let contacts: Vec<ContactForce> =
            contacts.into_iter().filter_map(|contact| moved(contact, index, &copies)).collect();
        let released = self.ties.change_body(index as u32, |node| copies[node as usize]);
        let before = std::mem::replace(self.body_mut(index), body);
        self.drives.change_body(index as u32, |node| copies[node as usize]);
        self.apply_drives(index);
        self.surfaces[index] = surface;
        self.parameters[index] = parameters;
        self.ties.detach();
        attach(&mut self.ties, model, &self.parameters, &self.surfaces);
        self.response.set_attached(self.ties.attached_nodes());
        self.set_contact_forces(&contacts);
        self.response.restore(&contacts);
        (released, before)
    }

    /// Goes on in a state of another model: bodies with the very mesh (the same `Arc`) of the body with
    /// their index here, with its fixed nodes and its order of elimination, must be that body and keep its
    /// matrix; those of the others are made.
    ///
    /// # Errors
    /// As [`Dynamics::with_state`]; nothing has changed then.
    ///
    /// # Panics
    /// Never: what could fail is tried before anything is given up.
    pub fn exchange(&mut self, model: &Model, state: &State) -> Result<(), MechanicsError> {
        check_orders(model, state)?;
        let mut made: Vec<Option<MovingBody>> = Vec::with_capacity(model.bodies.len());
        for (index, body) in model.bodies.iter().enumerate() {
            ContactParameters::new(index, body)?;
            let saved = &state.bodies[index];
            let known = Known { order: &saved.order, shape: &saved.stiff_shape, before: None };
            let new = || MovingBody::new(index, body, model.gravity, self.options.time_step, known);
            made.push(if self.keeps(model, state, index) { None } else { Some(new()?) });
        }
        let kept: Vec<bool> = made.iter().map(Option::is_none).collect();
        let mut before: Vec<Option<MovingBody>> =
            self.take_bodies().into_iter().map(Some).collect();
        let threads = self.threads.clone();
        let mut next = Self::with_bodies(model, self.options, threads, |index| {
            let body = made[index].take().or_else(|| before[index].take());
            Ok(body.expect("made, or there before"))
        })
        .expect("every body has been checked");
        if let Err(error) = next.set_state(state) {
            for (index, body) in next.take_bodies().into_iter().enumerate() {
                if kept[index] {
                    before[index] = Some(body);
                }
            }
            self.put_bodies(before.into_iter().flatten());
            return Err(error);
        }
        *self = next;
        Ok(())
    }

    /// Whether a body of another model can keep what it has here.
    fn keeps(&self, model: &Model, state: &State, index: usize) -> bool {
        let body = &model.bodies[index];
        let same_mesh = |surface: &Surface| Arc::ptr_eq(surface.mesh(), &body.mesh);
        if !self.surfaces.get(index).is_some_and(same_mesh) {
            return false;
        }
        let same_fixed = self.body(index).elastic().is_none_or(|elastic| {
            let fixed = |node: &u32| !elastic.is_free(*node as usize);
            (0..body.mesh.nodes().len() as u32).filter(fixed).eq(body.fixed_nodes.iter().copied())
        });
        same_fixed && self.body(index).order() == state.bodies[index].order
    }
}

impl State {
    /// The state of bodies that are parts of others: for each of them the body before, and what became
    /// of that one's mesh. Nothing is made of a node that came from between others.
    ///
    /// # Panics
    /// If the parts are not those of the bodies in this state.
    #[must_use]
    pub fn of_parts(&self, parts: &[(usize, MeshChange)]) -> Self {
        let copies: Vec<_> = (parts.iter())
            .map(|(old, change)| first_copies(self.bodies[*old].positions.len(), change))
            .collect();
        let place = |body: u32, node: u32| {
            let of_body = parts.iter().zip(&copies).enumerate();
            let mut found = of_body.filter(|(_, ((old, _), _))| *old == body as usize);
            found.find_map(|(new, (_, copies))| Some((new as u32, copies[node as usize]?)))
        };
        let bodies = parts.iter().map(|(old, change)| {
            let saved = &self.bodies[*old];
            if change.nodes.len() == saved.positions.len() {
                return saved.clone();
            }
            BodyState {
                positions: change.positions(&saved.positions),
                velocities: change.positions(&saved.velocities),
                forces: change.positions(&saved.forces),
                ..BodyState::default()
            }
        });
        let mut state = Self { bodies: bodies.collect(), ..self.clone() };
        state.contacts.retain_mut(|contact| {
            let sides = [0, if contact.edges { 2 } else { 1 }];
            let mut here = contact.bodies;
            for corner in 0..4 {
                let side = usize::from(corner >= sides[1]);
                let Some((body, node)) = place(contact.bodies[side], contact.nodes[corner]) else {
                    return false;
                };
                if corner != sides[side] && body != here[side] {
                    return false;
                }
                here[side] = body;
                contact.nodes[corner] = node;
            }
            contact.bodies = here;
            true
        });
        for drive in &mut state.drives {
            // The part that the first of them went to; the rest is let go.
            let found = drive.nodes.iter().find_map(|&node| place(drive.body, node));
            let Some((body, _)) = found else { continue };
            let before = std::mem::replace(&mut drive.body, body);
            drive.follow(|node| place(before, node).filter(|new| new.0 == body).map(|new| new.1));
        }
        state.drives.retain(|drive| !drive.nodes.is_empty());
        state.pulls.retain_mut(|pull| {
            let found = place(pull.body, pull.node);
            (pull.body, pull.node) = found.unwrap_or((pull.body, pull.node));
            found.is_some()
        });
        state
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
