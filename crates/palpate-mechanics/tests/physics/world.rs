//! Meshes, models and the step loop that the tests share.

use std::sync::Arc;

use palpate_contact::{IntersectionOptions, PenetratingNode, ProximityPair, Scene, SceneOptions};
use palpate_geometry::Point;
use palpate_mechanics::{ChangedBody, Dynamics, DynamicsOptions, State, StepStats};
use palpate_model::{Body, Material, Mesh, MeshChange, MeshData, Model, RigidMotion};
use palpate_testing::{Fastest, box_of_cells, rectangle};

pub(crate) const GRAVITY: f64 = 9.81;

/// A box of cells with one corner at the origin; `map` places the nodes.
pub(crate) fn box_mesh(cells: [usize; 3], size: Point, map: impl Fn(Point) -> Point) -> Arc<Mesh> {
    let place = |at: Point| map(std::array::from_fn(|d| size[d] * at[d] / cells[d] as f64));
    let (nodes, tetrahedra) = box_of_cells(cells, Fastest::First, place);
    Arc::new(Mesh::new(MeshData { nodes, tetrahedra, ..MeshData::default() }).expect("a valid box"))
}

/// A rectangle of two triangles at height `z`, facing up.
pub(crate) fn floor(half: f64, z: f64, map: impl Fn(Point) -> Point) -> Arc<Mesh> {
    let (nodes, triangles) = rectangle([-half; 2], [half; 2], z);
    let nodes = nodes.into_iter().map(map).collect();
    let data = MeshData { nodes, triangles, ..MeshData::default() };
    Arc::new(Mesh::new(data).expect("a valid floor"))
}

pub(crate) fn soft(name: &str, mesh: &Arc<Mesh>, young: f64, damping: f64) -> Body {
    let material = Material { young, poisson: 0.3, damping, ..Material::default() };
    Body { material, ..Body::new(name, Arc::clone(mesh)) }
}

pub(crate) fn rigid(name: &str, mesh: &Arc<Mesh>) -> Body {
    Body { rigid: Some(RigidMotion::default()), ..Body::new(name, Arc::clone(mesh)) }
}

pub(crate) fn model(bodies: Vec<Body>, gravity: f64) -> Model {
    Model { gravity: [0.0, 0.0, -gravity], ..Model::from_bodies(bodies) }
}

/// Dynamics with the contact detection that feeds them.
pub(crate) struct World {
    pub(crate) dynamics: Dynamics,
    scene: Scene,
}

impl World {
    pub(crate) fn new(model: &Model, time_step: f64, threads: usize) -> Self {
        let dynamics = Dynamics::new(model, DynamicsOptions { time_step, threads }).unwrap();
        let meshes = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
        let scene = Scene::new(meshes, Some(&model.structure), SceneOptions::default()).unwrap();
        Self { dynamics, scene }
    }

    /// Goes on with a body whose mesh was changed; returns the model after it.
    pub(crate) fn change(&mut self, model: &Model, index: usize, change: &MeshChange) -> Model {
        let after = model.changed(index, change);
        self.dynamics.change_body(&after, index, change).unwrap();
        self.scene.change_body(index, change).unwrap();
        after
    }

    /// The same with what takes the time made before.
    pub(crate) fn change_prepared(&mut self, model: &Model, index: usize, change: &MeshChange) {
        let after = model.changed(index, change);
        let basis = self.dynamics.basis(index);
        let time_step = self.dynamics.options().time_step;
        let made = ChangedBody::new(&after, index, change, &basis, time_step).unwrap();
        self.dynamics.go_on_with(made.prepared(&basis, change), &after, change);
        self.scene.change_body(index, change).unwrap();
    }

    /// A world of the model after cuts, in a state of another one.
    pub(crate) fn in_state(model: &Model, time_step: f64, state: &State) -> Self {
        let options = DynamicsOptions { time_step, threads: 1 };
        let dynamics = Dynamics::with_state(model, options, state).unwrap();
        let meshes = model.bodies.iter().map(|body| Arc::clone(&body.mesh)).collect();
        let scene = Scene::new(meshes, Some(&model.structure), SceneOptions::default()).unwrap();
        Self { dynamics, scene }
    }

    /// Detects the contacts of the step that has begun.
    pub(crate) fn detect(&mut self) -> (Vec<ProximityPair>, Vec<PenetratingNode>) {
        let positions: Vec<&[Point]> =
            (0..self.dynamics.body_count()).map(|body| self.dynamics.positions(body)).collect();
        self.scene.update(&positions).unwrap();
        let dynamics = &self.dynamics;
        let include = |a: usize, b: usize| a != b && dynamics.search_distance(a, b).is_some();
        let penetration = self.scene.penetration(&include).nodes.clone();
        let pairs = self.scene.proximity(&|a, b| dynamics.search_distance(a, b)).pairs.clone();
        (pairs, penetration)
    }

    pub(crate) fn step(&mut self) -> StepStats {
        self.dynamics.begin_step();
        let (pairs, penetration) = self.detect();
        self.dynamics.finish_step(&pairs, &penetration).unwrap()
    }

    pub(crate) fn run(&mut self, steps: usize) {
        for _ in 0..steps {
            self.step();
        }
    }

    /// Number of pairs of surface triangles that intersect.
    pub(crate) fn intersections(&mut self) -> usize {
        let positions: Vec<&[Point]> =
            (0..self.dynamics.body_count()).map(|body| self.dynamics.positions(body)).collect();
        self.scene.update(&positions).unwrap();
        self.scene.intersections(&IntersectionOptions::default()).pairs.len()
    }

    /// Sum of the contact forces on a body [N].
    pub(crate) fn contact_sum(&self, body: usize) -> Point {
        sum(self.dynamics.contact_force(body))
    }

    pub(crate) fn mass(&self, body: usize) -> f64 {
        self.dynamics.masses(body).unwrap().iter().sum()
    }

    /// Centre of mass of a body [m].
    pub(crate) fn center(&self, body: usize) -> Point {
        let masses = self.dynamics.masses(body).unwrap();
        let weighted = masses.iter().zip(self.dynamics.positions(body));
        let moments: Vec<Point> = weighted.map(|(m, x)| x.map(|x| m * x)).collect();
        sum(&moments).map(|x| x / self.mass(body))
    }
}

pub(crate) fn sum(vectors: &[Point]) -> Point {
    vectors.iter().fold([0.0; 3], |s, v| std::array::from_fn(|k| s[k] + v[k]))
}

pub(crate) fn length(v: Point) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub(crate) fn difference(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| a[k] - b[k])
}

pub(crate) fn largest_distance(a: &[Point], b: &[Point]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| length(difference(a, b))).fold(0.0, f64::max)
}

/// Volume of a mesh at other positions [m³].
pub(crate) fn volume(mesh: &Mesh, positions: &[Point]) -> f64 {
    let six: f64 = mesh
        .tetrahedra()
        .iter()
        .map(|t| {
            let [a, b, c, d] = t.map(|node| positions[node as usize]);
            let (u, v, w) = (difference(b, a), difference(c, a), difference(d, a));
            u[0] * (v[1] * w[2] - v[2] * w[1])
                + u[1] * (v[2] * w[0] - v[0] * w[2])
                + u[2] * (v[0] * w[1] - v[1] * w[0])
        })
        .sum();
    six / 6.0
}
