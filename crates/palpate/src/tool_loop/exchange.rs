//! What a simulation and a tool's loop hand each other: no lock is held for longer than a swap.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use glam::DQuat;
use palpate_geometry::Point;
use palpate_mechanics::{Contact, Patch};
use palpate_model::Model;

/// What a step has left near a tool.
#[derive(Default)]
pub(crate) struct Publication {
    /// The model that was stepped.
    pub(crate) model: Option<Arc<Model>>,
    pub(crate) step: u64,
    /// Nodes of the tool [m].
    pub(crate) tool: Vec<Point>,
    /// Contacts of the tool.
    pub(crate) contacts: Vec<Contact>,
    /// One for each deformable body, in the order of the model.
    pub(crate) organs: Vec<Organ>,
}

/// One deformable body.
#[derive(Default)]
pub(crate) struct Organ {
    pub(crate) body: usize,
    /// Whether the tool can touch it before the next publication; nothing else is written otherwise.
    pub(crate) is_near: bool,
    /// All its nodes [m].
    pub(crate) positions: Vec<Point>,
    pub(crate) patch: Patch,
}

#[derive(Default)]
struct Slots {
    fresh: Option<Publication>,
    /// Memory for the next one.
    spare: Option<Publication>,
    pose: Option<(DQuat, Point)>,
}

/// The meeting point of one loop and its simulation.
#[derive(Default)]
pub(crate) struct Exchange {
    slots: Mutex<Slots>,
}

impl Exchange {
    fn lock(&self) -> MutexGuard<'_, Slots> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A publication to write to, with memory of an earlier one.
    pub(crate) fn blank(&self) -> Publication {
        self.lock().spare.take().unwrap_or_default()
    }

    pub(crate) fn publish(&self, publication: Publication) {
        let mut slots = self.lock();
        if let Some(unread) = slots.fresh.replace(publication) {
            slots.spare = Some(unread);
        }
    }

    /// The newest pose of the tool.
    pub(crate) fn pose(&self) -> Option<(DQuat, Point)> {
        self.lock().pose
    }

    /// Says where the tool is and takes what was published since; true if anything was.
    pub(crate) fn meet(&self, pose: (DQuat, Point), current: &mut Option<Publication>) -> bool {
        let mut slots = self.lock();
        slots.pose = Some(pose);
        let Some(fresh) = slots.fresh.take() else { return false };
        if let Some(old) = current.replace(fresh) {
            slots.spare = Some(old);
        }
        true
    }
}
