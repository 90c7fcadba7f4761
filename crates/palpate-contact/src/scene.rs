//! The scene: bodies whose nodes move, and what touches what among them.

mod change;
mod options;
mod points;

use std::sync::Arc;
use std::time::Instant;

use palpate_geometry::{Aabb, Point};
use palpate_model::{Mesh, Structure};
use rayon::prelude::*;

use crate::bounding_tree::BoundingTree;
use crate::error::SceneError;
use crate::frame::{Frame, SceneBody};
use crate::left_out::LeftOut;
use crate::memory::DetectionMemory;
use crate::method::Detector;
use crate::options::{IntersectionOptions, ProximityOptions};
use crate::penetration::PenetrationSearch;
use crate::points::SurfacePoint;
use crate::proximity::Limit;
use crate::results::{
    ContactNodes, DetectionStats, Intersections, Penetration, Proximity, UpdateStats,
};
use crate::threads::Threads;
use crate::upper_tree::UpperTree;

pub use change::{ChangedSurface, SurfaceBasis};
pub use options::SceneOptions;

/// Bodies in one space, their bounding trees, and the search for what touches.
///
/// Bodies are named by index. Results are borrowed from the scene, which reuses their memory: at
/// steady state no call allocates when `threads` is 1.
#[derive(Debug)]
pub struct Scene {
    bodies: Vec<SceneBody>,
    upper: UpperTree,
    pub(crate) left_out: LeftOut,
    options: SceneOptions,
    threads: Threads,
    detector: Box<dyn Detector>,
    penetration_search: PenetrationSearch,
    intersections: Intersections,
    proximity: Proximity,
    penetration: Penetration,
    contact_nodes: ContactNodes,
    surface_points: Vec<Option<SurfacePoint>>,
    inside: Vec<bool>,
}

impl Scene {
    /// A scene of `meshes` at their own positions.
    ///
    /// `structure` is the upper tree that a model's text describes; without one it is made from where
    /// the bodies are. It changes the cost of finding body pairs, never the result.
    ///
    /// # Errors
    /// If there are no meshes, an option is zero, the structure does not name each body once, or the
    /// threads could not be started.
    pub fn new(
        meshes: Vec<Arc<Mesh>>,
        structure: Option<&Structure>,
        options: SceneOptions,
    ) -> Result<Self, SceneError> {
        if meshes.is_empty() {
            return Err(SceneError::NoMeshes);
        }
        if options.leaf_size == 0 {
            return Err(SceneError::LeafSize);
        }
        let threads = Threads::new(options.threads)?;
        let upper = if let Some(structure) = structure {
            UpperTree::from_structure(structure, meshes.len())?
        } else {
            let bounds: Vec<Aabb> = meshes.iter().map(|mesh| mesh.bounds()).collect();
            UpperTree::from_bounds(&bounds)
        };
        let bodies = meshes.into_iter().map(|mesh| new_body(mesh, &options)).collect();
        let mut scene = Self {
            bodies,
            upper,
            left_out: LeftOut::default(),
            options,
            threads,
            detector: options.method.detector(),
            penetration_search: PenetrationSearch::default(),
            intersections: Intersections::default(),
            proximity: Proximity::default(),
            penetration: Penetration::default(),
            contact_nodes: ContactNodes::default(),
            surface_points: Vec::new(),
            inside: Vec::new(),
        };
        scene.bodies_changed();
        Ok(scene)
    }

    /// Adds a body at its mesh's positions and returns its index, the last. In the upper tree a new
    /// root joins it with all others.
    pub fn add(&mut self, mesh: Arc<Mesh>) -> usize {
        self.bodies.push(new_body(mesh, &self.options));
        self.upper.add();
        self.bodies_changed();
        self.bodies.len() - 1
    }

    /// Takes a body out and returns its mesh; the bodies after it move down by one index.
    ///
    /// # Errors
    /// If there is no such body.
    pub fn remove(&mut self, body: usize) -> Result<Arc<Mesh>, SceneError> {
        self.check_body(body)?;
        let removed = self.bodies.remove(body);
        self.upper.remove(body);
        self.left_out.remove(body as u32);
        self.bodies_changed();
        Ok(removed.mesh)
    }

    /// Gives a body another mesh, at that mesh's positions, and returns the former one. Its pairs with
    /// other bodies stay ignored, its triangles are without groups.
    ///
    /// # Errors
    /// If there is no such body.
    pub fn replace(&mut self, body: usize, mesh: Arc<Mesh>) -> Result<Arc<Mesh>, SceneError> {
        self.check_body(body)?;
        let new = new_body(mesh, &self.options);
        let former = std::mem::replace(&mut self.bodies[body], new);
        self.left_out.replace(body as u32);
        self.bodies_changed();
        Ok(former.mesh)
    }

    /// Number of bodies.
    pub fn body_count(&self) -> usize {
        self.bodies.len()
    }

    /// A body's mesh.
    ///
    /// # Panics
    /// If there is no such body; so do `positions` and `tree`.
    pub fn mesh(&self, body: usize) -> &Arc<Mesh> {
        &self.bodies[body].mesh
    }

    /// A body's node positions \[m\] of the last update, shape (n, 3).
    pub fn positions(&self, body: usize) -> &[Point] {
        &self.bodies[body].positions
    }

    /// What the method keeps in memory; all zero for methods without a layout.
    pub fn memory(&self) -> DetectionMemory {
        let triangle_count = self.bodies.iter().map(|body| body.mesh.triangles().len()).sum();
        DetectionMemory { triangle_count, ..self.detector.memory() }
    }

    /// A body's bounding tree, refitted to its positions.
    pub fn tree(&self, body: usize) -> &BoundingTree {
        self.bodies[body].tree()
    }

    /// Starts the threads anew: a process that was forked has none of its parent's.
    ///
    /// # Errors
    /// If they could not be started.
    pub fn restart_threads(&mut self) -> Result<(), SceneError> {
        let gone = std::mem::replace(&mut self.threads, Threads::new(self.options.threads)?);
        // Its end would be waited for in vain.
        std::mem::forget(gone);
        Ok(())
    }

    /// Its threads, for others that work on the same step.
    pub fn threads(&self) -> &Threads {
        &self.threads
    }

    /// How the scene was built.
    pub fn options(&self) -> &SceneOptions {
        &self.options
    }

    /// Moves the bodies: refits what the method searches bottom-up, then the upper tree.
    ///
    /// `positions` \[m\]: for each body one entry per node.
    ///
    /// # Errors
    /// If counts do not fit or a number is not finite; the scene is then unchanged.
    pub fn update(&mut self, positions: &[&[Point]]) -> Result<UpdateStats, SceneError> {
        let expected = self.bodies.len();
        if positions.len() != expected {
            return Err(SceneError::BodyCount { given: positions.len(), expected });
        }
        self.update_from(|body| positions[body])
    }

    /// [`Self::update`] with the positions of each body, by its index, from a function: for callers
    /// that keep them apart and want no list of them.
    ///
    /// # Errors
    /// As [`Self::update`].
    pub fn update_from<'a>(
        &mut self,
        positions: impl Fn(usize) -> &'a [Point] + Sync,
    ) -> Result<UpdateStats, SceneError> {
        let start = Instant::now();
        self.check_positions(&positions)?;
        let uses_trees = self.detector.uses_trees();
        let move_body = |(index, body): (usize, &mut SceneBody)| {
            body.move_to(positions(index));
            if uses_trees {
                body.tree();
            }
        };
        if let Some(pool) = self.threads.pool() {
            pool.install(|| self.bodies.par_iter_mut().enumerate().for_each(move_body));
        } else {
            self.bodies.iter_mut().enumerate().for_each(move_body);
        }
        let nodes_refitted = self.bodies_moved();
        Ok(UpdateStats { time: start.elapsed(), nodes_refitted })
    }

    /// All pairs of surface triangles that meet (closed: touching counts), decided exactly. Triangles
    /// of one body that share a node are left out, unless `options` say otherwise.
    pub fn intersections(&mut self, options: &IntersectionOptions) -> &Intersections {
        let frame = Frame::new(&self.bodies, &self.upper, &self.left_out, &self.threads);
        self.intersections.pairs.clear();
        self.intersections.stats = DetectionStats::default();
        self.detector.intersections(&frame, *options, &mut self.intersections);
        &self.intersections
    }

    /// The nodes of all triangles that [`Self::intersections`] finds: the paper's own output.
    pub fn contact_nodes(&mut self, options: &IntersectionOptions) -> &ContactNodes {
        self.intersections(options);
        self.contact_nodes.collect(&self.bodies, &self.intersections);
        &self.contact_nodes
    }

    /// All vertex-triangle and edge-edge pairs that share no node and are closer than the distance of
    /// their bodies, strictly.
    ///
    /// `distance` is called once per body pair a <= b, a == b being self-contact, and gives metres;
    /// `None` leaves the pair out. Vertex-triangle pairs come in both directions between two bodies.
    pub fn proximity(
        &mut self,
        distance: &(dyn Fn(usize, usize) -> Option<f64> + Sync),
    ) -> &Proximity {
        self.proximity_with(distance, &ProximityOptions::default())
    }

    /// [`Self::proximity`] with a choice of what counts.
    pub fn proximity_with(
        &mut self,
        distance: &(dyn Fn(usize, usize) -> Option<f64> + Sync),
        options: &ProximityOptions,
    ) -> &Proximity {
        let frame = Frame::new(&self.bodies, &self.upper, &self.left_out, &self.threads);
        self.proximity.pairs.clear();
        self.proximity.stats = DetectionStats::default();
        let limit_of = |a: usize, b: usize| {
            if frame.left_out.has_bodies(a as u32, b as u32) {
                return None;
            }
            let distance = distance(a, b).filter(|&distance| distance > 0.0)?;
            Some(Limit { distance, options: *options })
        };
        self.detector.proximity(&frame, &limit_of, &mut self.proximity);
        &self.proximity
    }

    /// Every surface node that is strictly inside another body with a closed surface, or inside its own
    /// body of tetrahedra after folding, and its way out.
    ///
    /// `include(body, into_body)` is asked for ordered pairs, a body with itself included. Inside another
    /// body is where its surface's winding number is not zero; inside its own, where tetrahedra that do
    /// not have the node cover it (counted with their orientation). Both are decided exactly, node by node;
    /// the second only in a body where two surface triangles without a common node meet, or whose surface
    /// is in several parts. A node of a tetrahedron that is turned over goes with those around it. What is
    /// found of two bodies does not depend on others.
    ///
    /// A node leaves through the closest point of the contact patch: the triangles of `into_body` that
    /// cross `body` or have a node inside it, and that face the node. Where there is no such patch (open
    /// surfaces have no inside), the closest point of the whole surface. A component that is inside as a
    /// whole leaves in one direction, that of its node nearest to the surface.
    ///
    /// Direction and depth follow the positions continuously, except where a triangle begins or ends to
    /// cross, where two exits are equally near, and where a component goes under as a whole. A node that
    /// came out on the far side of a thin body is outside.
    pub fn penetration(&mut self, include: &(dyn Fn(usize, usize) -> bool + Sync)) -> &Penetration {
        // A node inside is inside, whatever its pairs.
        let frame = Frame::new(&self.bodies, &self.upper, &self.left_out, &self.threads)
            .with_all_elements();
        self.penetration.nodes.clear();
        self.penetration.stats = DetectionStats::default();
        let detector = &mut *self.detector;
        self.penetration_search.run(&frame, detector, include, &mut self.penetration);
        &self.penetration
    }

    fn bodies_changed(&mut self) {
        self.detector.bodies_changed(&self.bodies);
        self.bodies_moved();
    }

    /// Refits what the method searches and the upper tree; returns the number of tree nodes.
    fn bodies_moved(&mut self) -> u64 {
        let Self { bodies, detector, upper, threads, .. } = self;
        let blocks_refitted = detector.bodies_moved(bodies, threads.pool());
        upper.refit(|body| {
            let bounds = detector.bounds(body);
            bounds.unwrap_or_else(|| bodies[body].tree().bounds())
        });
        if !detector.uses_trees() {
            return blocks_refitted;
        }
        bodies.iter().map(|body| body.tree().nodes().len() as u64).sum()
    }

    pub(crate) fn check_body(&self, body: usize) -> Result<(), SceneError> {
        let count = self.bodies.len();
        if body < count { Ok(()) } else { Err(SceneError::BodyOutOfRange { body, count }) }
    }

    fn check_positions<'a>(
        &self,
        positions: impl Fn(usize) -> &'a [Point] + Sync,
    ) -> Result<(), SceneError> {
        for (index, body) in self.bodies.iter().enumerate() {
            let (given, expected) = (positions(index).len(), body.positions.len());
            if given != expected {
                return Err(SceneError::NodeCount { body: index, given, expected });
            }
        }
        let broken = |body: usize| {
            let given = positions(body);
            let finite = |position: &Point| position.iter().all(|value| value.is_finite());
            let node = given.iter().position(|position| !finite(position))?;
            Some(SceneError::NotFinite { body, node, position: given[node] })
        };
        let bodies = 0..self.bodies.len();
        let first = match self.threads.pool() {
            Some(pool) => pool.install(|| bodies.into_par_iter().find_map_first(broken)),
            None => bodies.into_iter().find_map(broken),
        };
        first.map_or(Ok(()), Err)
    }
}

fn new_body(mesh: Arc<Mesh>, options: &SceneOptions) -> SceneBody {
    SceneBody::new(mesh, options.leaf_size, options.split)
}
