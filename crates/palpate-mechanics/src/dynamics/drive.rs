//! Nodes that are moved along a path.

use std::collections::HashSet;

use glam::DVec3;
use palpate_geometry::Point;

use super::Dynamics;
use crate::body::{BodyKind, first_not_finite};
use crate::error::MechanicsError;

/// Nodes of one body that go where they are told.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize, serde::Serialize)]
pub struct Drive {
    /// Tells it from all other drives of the simulation.
    pub id: u64,
    /// The body.
    pub body: u32,
    /// The nodes, ascending; their model holds them fixed.
    pub nodes: Vec<u32>,
    /// Those of them that stay fixed when they are let go.
    pub held: Vec<u32>,
    /// Where they are at the end of the next step [m], one per node.
    pub targets: Vec<Point>,
    /// Force that moved them in the last step [N], one per node.
    pub forces: Vec<Point>,
}

/// All drives, in the order in which they were made.
#[derive(Debug, Default)]
pub(super) struct Drives {
    all: Vec<Drive>,
    next_id: u64,
}

impl Drives {
    pub(super) fn all(&self) -> &[Drive] {
        &self.all
    }

    /// Goes back to other drives; new ones will not have an identity that was used before.
    pub(super) fn restore(&mut self, drives: &[Drive]) {
        self.all.clear();
        self.all.extend_from_slice(drives);
        let used = drives.iter().map(|drive| drive.id.saturating_add(1)).max().unwrap_or(0);
        self.next_id = self.next_id.max(used);
    }

    fn find(&mut self, id: u64) -> Result<&mut Drive, MechanicsError> {
        self.all.iter_mut().find(|drive| drive.id == id).ok_or(MechanicsError::Released)
    }

    /// Follows the nodes of a body whose mesh has changed, by what `moved` says became of them.
    pub(super) fn change_body(&mut self, body: u32, moved: impl Fn(u32) -> Option<u32>) {
        for drive in self.all.iter_mut().filter(|drive| drive.body == body) {
            drive.follow(&moved);
        }
        self.all.retain(|drive| !drive.nodes.is_empty());
    }
}

impl Drive {
    /// Keeps the nodes that are left, under their new numbers.
    pub(super) fn follow(&mut self, moved: impl Fn(u32) -> Option<u32>) {
        self.held = self.held.iter().filter_map(|&node| moved(node)).collect();
        self.held.sort_unstable();
        let all = self.nodes.iter().zip(&self.targets).zip(&self.forces);
        let mut left: Vec<(u32, Point, Point)> =
            all.filter_map(|((&node, &x), &f)| Some((moved(node)?, x, f))).collect();
        left.sort_unstable_by_key(|&(node, ..)| node);
        self.nodes = left.iter().map(|&(node, ..)| node).collect();
        self.targets = left.iter().map(|&(_, target, _)| target).collect();
        self.forces = left.iter().map(|&(.., force)| force).collect();
    }
}

impl Dynamics {
    /// Drives `nodes` (ascending) of a body, which its model holds fixed: they stay where they are until
    /// [`Dynamics::set_drive_targets`]. `held` are those that stay fixed afterwards. Returns what the
    /// drive is called by.
    ///
    /// # Errors
    /// If there are no nodes, or one of them does not exist, is free, or is driven already.
    pub fn drive(
        &mut self,
        body: usize,
        nodes: &[u32],
        held: &[u32],
    ) -> Result<u64, MechanicsError> {
        self.check_drive(body, nodes)?;
        let elastic = self.body(body).elastic();
        let free = |node: &&u32| elastic.is_some_and(|elastic| elastic.is_free(**node as usize));
        if let Some(&node) = nodes.iter().find(free) {
            return Err(MechanicsError::NotFixed { body, node: node as usize });
        }
        let positions = self.positions(body);
        let targets: Vec<Point> = nodes.iter().map(|&node| positions[node as usize]).collect();
        let id = self.drives.next_id;
        self.drives.next_id += 1;
        self.drives.all.push(Drive {
            id,
            body: body as u32,
            nodes: nodes.to_vec(),
            held: held.to_vec(),
            forces: vec![[0.0; 3]; targets.len()],
            targets,
        });
        self.apply_drives(body);
        Ok(id)
    }

    /// Whether nodes of a body could be driven if its model held them fixed.
    ///
    /// # Errors
    /// If there are no nodes, or one of them does not exist or is driven already.
    pub fn check_drive(&self, body: usize, nodes: &[u32]) -> Result<(), MechanicsError> {
        self.check_body(body)?;
        if self.body(body).elastic().is_none() {
            return Err(MechanicsError::RigidDriven(body));
        }
        for &node in nodes {
            let node = node as usize;
            self.check_node(body, node)?;
            let driven = self.drives.all.iter().filter(|drive| drive.body as usize == body);
            if driven.flat_map(|drive| &drive.nodes).any(|&other| other as usize == node) {
                return Err(MechanicsError::DrivenTwice { body, node });
            }
        }
        if nodes.is_empty() { Err(MechanicsError::NoNodes) } else { Ok(()) }
    }

    /// Says where the nodes of a drive are at the end of the next step [m].
    ///
    /// # Errors
    /// If there is no such drive any more, or there is not one finite position per node.
    pub fn set_drive_targets(&mut self, id: u64, targets: &[Point]) -> Result<(), MechanicsError> {
        let drive = self.drives.find(id)?;
        let (body, expected, found) = (drive.body as usize, drive.nodes.len(), targets.len());
        if expected != found {
            return Err(MechanicsError::WrongCount { body, expected, found });
        }
        if let Some(place) = first_not_finite(targets) {
            let node = drive.nodes[place] as usize;
            return Err(MechanicsError::NotFinite { body, node, what: "the target" });
        }
        drive.targets.copy_from_slice(targets);
        self.apply_drives(body);
        Ok(())
    }

    /// Gives up a drive: its nodes stay where they are. Returns it.
    ///
    /// # Errors
    /// If there is no such drive any more.
    pub fn release_drive(&mut self, id: u64) -> Result<Drive, MechanicsError> {
        let place = self.drives.all.iter().position(|drive| drive.id == id);
        let drive = self.drives.all.remove(place.ok_or(MechanicsError::Released)?);
        self.apply_drives(drive.body as usize);
        Ok(drive)
    }

    /// All drives, in the order in which they were made.
    pub fn drives(&self) -> &[Drive] {
        self.drives.all()
    }

    /// Tells a body where its driven nodes go.
    pub(super) fn apply_drives(&mut self, body: usize) {
        let drives = std::mem::take(&mut self.drives);
        let own = drives.all.iter().filter(|drive| drive.body as usize == body);
        let targets =
            own.flat_map(|drive| drive.nodes.iter().copied().zip(drive.targets.iter().copied()));
        if let BodyKind::Elastic(elastic) = &mut self.body_mut(body).kind {
            elastic.set_driven(targets);
        }
        self.drives = drives;
    }

    /// Checks the drives of a state.
    pub(super) fn check_drives(&self, drives: &[Drive]) -> Result<(), MechanicsError> {
        let mut driven = HashSet::new();
        for drive in drives {
            let body = drive.body as usize;
            self.check_body(body)?;
            if drive.nodes.is_empty() {
                return Err(MechanicsError::NoNodes);
            }
            let (expected, found) = (drive.nodes.len(), drive.targets.len());
            if expected != found || expected != drive.forces.len() {
                return Err(MechanicsError::WrongCount { body, expected, found });
            }
            for &node in &drive.nodes {
                let node = node as usize;
                self.check_node(body, node)?;
                if self.body(body).elastic().is_none_or(|elastic| elastic.is_free(node)) {
                    return Err(MechanicsError::NotFixed { body, node });
                }
                if !driven.insert((body, node)) {
                    return Err(MechanicsError::DrivenTwice { body, node });
                }
            }
            if let Some(place) = first_not_finite(&drive.targets) {
                let node = drive.nodes[place] as usize;
                return Err(MechanicsError::NotFinite { body, node, what: "the target" });
            }
        }
        Ok(())
    }

    /// Keeps the forces that the driven nodes took in the step that ends.
    pub(super) fn finish_drives(&mut self) {
        let mut drives = std::mem::take(&mut self.drives);
        for drive in &mut drives.all {
            let Some(elastic) = self.body(drive.body as usize).elastic() else { continue };
            for (force, &node) in drive.forces.iter_mut().zip(&drive.nodes) {
                *force = elastic.driven_force(node).unwrap_or(DVec3::ZERO).to_array();
            }
        }
        self.drives = drives;
    }
}
