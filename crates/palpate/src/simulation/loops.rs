//! Loops around tools: what the simulation tells them, and where they have their tools.

use std::sync::{Arc, Weak};

use glam::DVec3;
use palpate_geometry::Point;
use palpate_mechanics::PatchMemory;

use super::{Simulation, SimulationError};
use crate::tool_loop::ToolLoop;
use crate::tool_loop::exchange::{Exchange, Organ, Publication};

/// How far ahead of a tool tissue gives way, in mean edges of its surface, beside how far the tool moves.
const MARGIN: f64 = 1.0;
/// How far around that its nodes are, in mean edges.
const AROUND: f64 = 1.5;
/// How far a tool may move before the next publication, in times of its last step; at most so many mean
/// edges, since it must not move farther in a step.
const STEPS_AHEAD: f64 = 2.0;
const MOST_AHEAD: f64 = 3.0;
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
    points: Vec<Point>,
}

impl Simulation {
    /// A loop for a thread of its own in which a tool feels tissue between steps: see [`ToolLoop`]. While it
    /// exists, every step moves the tool to the newest pose of its ticks, and a loop of the same tool that
    /// was made before gets no news.
    ///
    /// `margin` [m]: tissue within that distance of the tool gives way, beside that which it can reach until the
    /// next step; a mean edge of the body unless given.
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
            points: Vec::new(),
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
        let mut written = Ok(());
        for link in &mut loops {
            if let Some(exchange) = link.exchange.upgrade() {
                let mut publication = exchange.blank();
                written = written.and(self.write(link, &mut publication));
                exchange.publish(publication);
            }
        }
        self.loops = loops;
        written
    }

    fn write(&mut self, link: &mut Link, to: &mut Publication) -> Result<(), SimulationError> {
        let tool = link.tool;
        to.model = Some(Arc::clone(&self.model));
        to.step = self.dynamics.step_count();
        to.tool.clear();
        to.tool.extend_from_slice(self.dynamics.positions(tool));
        to.contacts.clear();
        let touching = self.dynamics.contacts().iter();
        to.contacts.extend(touching.filter(|contact| contact.bodies.contains(&(tool as u32))));
        let speeds = self.dynamics.velocities(tool).iter();
        let fastest = speeds.map(|&v| DVec3::from_array(v).length()).fold(0.0, f64::max);
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
            let margin = link.margin.unwrap_or(MARGIN * edge);
            let reach = margin + ahead.min(MOST_AHEAD * edge) + AROUND * edge;
            self.find_close(tool, body, reach, link)?;
            organ.is_near = !link.close.is_empty();
            if organ.is_near {
                organ.positions.clear();
                organ.positions.extend_from_slice(self.dynamics.positions(body));
                let memory = &mut link.memory[body];
                self.dynamics.write_patch(body, &link.nodes, memory, &mut organ.patch);
            }
        }
        Ok(())
    }

    /// Finds the nodes of a body within `reach` [m] of a tool, at most so many.
    fn find_close(
        &mut self,
        tool: usize,
        body: usize,
        reach: f64,
        link: &mut Link,
    ) -> Result<(), SimulationError> {
        let Link { points, close, nodes, .. } = link;
        let corners = self.dynamics.positions(tool).iter().map(|&x| DVec3::from_array(x));
        let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let (low, high) = (low - reach, high + reach);
        let positions = self.dynamics.positions(body);
        nodes.clear();
        points.clear();
        for &node in self.model.bodies[body].mesh.surface_nodes() {
            let x = DVec3::from_array(positions[node as usize]);
            if x.cmpge(low).all() && x.cmple(high).all() {
                nodes.push(node);
                points.push(positions[node as usize]);
            }
        }
        close.clear();
        if !points.is_empty() {
            let found = self.scene.closest(points, Some(tool), reach)?;
            let within = found.iter().zip(&*nodes);
            close.extend(within.filter_map(|(at, &node)| Some((at.as_ref()?.distance, node))));
        }
        close.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        close.truncate(MOST_NODES);
        nodes.clear();
        nodes.extend(close.iter().map(|&(_, node)| node));
        nodes.sort_unstable();
        Ok(())
    }
}
