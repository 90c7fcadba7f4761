//! Loops around tools: what the simulation tells them, and where they have their tools.

use std::sync::{Arc, Weak};

use palpate_contact::PairKind;
use palpate_mechanics::PatchMemory;

use super::{CONTACT_PAIRS, Simulation, SimulationError};
use crate::tool_loop::ToolLoop;
use crate::tool_loop::exchange::{Exchange, Organ, Publication};

/// How far ahead of a tool tissue gives way, in mean edges of its surface, beside how far the tool moves.
const MARGIN: f64 = 1.5;
/// How far a tool may move before the next publication, in times of its last step.
const STEPS_AHEAD: f64 = 2.0;
/// Most nodes of a body that give way to a tool, those nearest to it.
const MOST_NODES: usize = 96;

/// The simulation's end of a loop.
pub(super) struct Link {
    tool: usize,
    margin: Option<f64>,
    exchange: Weak<Exchange>,
    /// One for each body; and the mean edge of its surface [m].
    memory: Vec<PatchMemory>,
    edges: Vec<f64>,
    /// Distance and node of what is close to the tool, and the nodes that are chosen.
    close: Vec<(f64, u32)>,
    nodes: Vec<u32>,
}

impl Simulation {
    /// A loop for a thread of its own in which a tool feels tissue between steps: see [`ToolLoop`]. While it
    /// exists, every step moves the tool to the newest pose of its ticks, and a loop of the same tool that
    /// was made before gets no news.
    ///
    /// `margin` [m]: tissue within that distance of the tool gives way, beside that which it can reach until the
    /// next step; 1.5 mean edges of the body unless given.
    ///
    /// # Errors
    /// If the body does not exist or is not rigid, or the margin is not a positive number.
    pub fn tool_loop(
        &mut self,
        tool: usize,
        margin: Option<f64>,
    ) -> Result<ToolLoop, SimulationError> {
        self.dynamics.tool_pose(tool)?;
        if let Some(margin) = margin.filter(|margin| !(margin.is_finite() && *margin > 0.0)) {
            return Err(SimulationError::Margin(margin));
        }
        let exchange = Arc::new(Exchange::default());
        let model = Arc::clone(&self.model);
        let result = ToolLoop::new(model, tool, self.options.time_step, Arc::clone(&exchange))?;
        self.loops.retain(|link| link.tool != tool);
        self.loops.push(Link {
            tool,
            margin,
            exchange: Arc::downgrade(&exchange),
            memory: Vec::new(),
            edges: Vec::new(),
            close: Vec::new(),
            nodes: Vec::new(),
        });
        self.publish()?;
        Ok(result)
    }

    /// Takes the newest poses of the loops; forgets those that are gone.
    pub(super) fn follow_loops(&mut self) -> Result<(), SimulationError> {
        let mut loops = std::mem::take(&mut self.loops);
        let mut followed = Ok(());
        loops.retain(|link| {
            let Some(exchange) = link.exchange.upgrade() else { return false };
            if let Some((rotation, translation)) = exchange.pose() {
                let set = self.dynamics.set_pose(link.tool, rotation, translation);
                followed = std::mem::replace(&mut followed, Ok(())).and(set);
            }
            true
        });
        self.loops = loops;
        Ok(followed?)
    }

    /// Tells the loops what the step has left.
    pub(super) fn publish(&mut self) -> Result<(), SimulationError> {
        if self.loops.is_empty() {
            return Ok(());
        }
        self.scene()?;
        let mut loops = std::mem::take(&mut self.loops);
        for link in &mut loops {
            if let Some(exchange) = link.exchange.upgrade() {
                let mut publication = exchange.blank();
                self.write(link, &mut publication);
                exchange.publish(publication);
            }
        }
        self.loops = loops;
        Ok(())
    }

    fn write(&mut self, link: &mut Link, to: &mut Publication) {
        let tool = link.tool;
        to.model = Some(Arc::clone(&self.model));
        to.step = self.dynamics.step_count();
        to.tool.clear();
        to.tool.extend_from_slice(self.dynamics.positions(tool));
        to.contacts.clear();
        let touching = self.dynamics.contacts().iter();
        to.contacts.extend(touching.filter(|contact| contact.bodies.contains(&(tool as u32))));
        let speeds = self.dynamics.velocities(tool).iter();
        let fastest = speeds.map(|&v| glam::DVec3::from_array(v).length()).fold(0.0, f64::max);
        let ahead = STEPS_AHEAD * fastest * self.options.time_step;

        let model = Arc::clone(&self.model);
        if link.edges.len() != model.bodies.len() {
            link.memory.resize_with(model.bodies.len(), PatchMemory::default);
            link.edges = model.bodies.iter().map(|body| body.mesh.mean_surface_edge()).collect();
        }
        let soft = (0..model.bodies.len()).filter(|&body| model.bodies[body].rigid.is_none());
        to.organs.resize_with(soft.clone().count(), Organ::default);
        for (organ, body) in to.organs.iter_mut().zip(soft) {
            organ.body = body;
            let edge = link.edges[body];
            // Far away it may be from one step to the next, but not farther than it is long.
            let margin = link.margin.unwrap_or(MARGIN * edge) + ahead.min(10.0 * edge);
            self.find_close(tool, body, margin, link);
            organ.is_near = !link.close.is_empty();
            if organ.is_near {
                organ.positions.clear();
                organ.positions.extend_from_slice(self.dynamics.positions(body));
                let memory = &mut link.memory[body];
                self.dynamics.write_patch(body, &link.nodes, memory, &mut organ.patch);
            }
        }
    }

    /// Finds the nodes of a body within `margin` of a tool, at most so many.
    fn find_close(&mut self, tool: usize, body: usize, margin: f64, link: &mut Link) {
        let distance =
            |a: usize, b: usize| ((a, b) == (tool.min(body), tool.max(body))).then_some(margin);
        let found = self.scene.proximity_with(&distance, &CONTACT_PAIRS);
        let Link { close, nodes, .. } = link;
        close.clear();
        for pair in &found.pairs {
            for (corner, &node) in pair.nodes.iter().enumerate() {
                let side = match pair.kind {
                    PairKind::VertexTriangle => usize::from(corner > 0),
                    PairKind::EdgeEdge => usize::from(corner > 1),
                };
                if pair.bodies[side] as usize == body {
                    close.push((pair.distance, node));
                }
            }
        }
        close.sort_unstable_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)));
        close.dedup_by_key(|entry| entry.1);
        close.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        close.truncate(MOST_NODES);
        nodes.clear();
        nodes.extend(close.iter().map(|&(_, node)| node));
        nodes.sort_unstable();
    }
}
