//! A deformable body, one implicit Euler step at a time.
//!
//! The step looks for the correction d of an inertial prediction (x*, v*):
//!
//! `(1/dt² + alpha/dt) M d = f(x* + d)`, `x = x* + d`, `v = v* + d / dt`
//!
//! with f the internal forces, gravity, external and contact forces. With the linear law, which is
//! elastic in the body's own rotating frame, one solve with the matrix
//!
//! `A = (1/dt² + alpha/dt) M + (1 + beta/dt) K`
//!
//! of the rest shape, in that frame, is exact. With any other law A is where a quasi-Newton method
//! begins, and it follows the shape of the body; with the linear law its factor is made once.

mod driven;
mod quasi_newton;
mod spin;
mod step;
mod system;

use std::sync::Arc;

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use palpate_model::{Body, Law};
use palpate_solver::{BlockMatrix, Cholesky, FactorStats, HalfSolution, NodeOrder, Precision};

use super::frame::best_rotation;
use super::inertia::Inertia;
use crate::error::MechanicsError;
use driven::Driven;
use quasi_newton::{QuasiNewton, StiffnessBefore};
use step::Step;
pub(crate) use system::check_fixed_nodes;
use system::{SystemMatrix, check_material, in_body_numbering, linear_stiffness, lumped_masses};

const FIXED: u32 = u32::MAX;
/// Entries of a factor beyond which caches do not hold it: a solve takes as long as reading its bytes does.
const LARGE_FACTOR: u64 = 2_000_000;

pub(crate) struct ElasticBody {
    /// Rest positions relative to their centre of mass [m].
    rest: Vec<DVec3>,
    masses: Vec<f64>,
    /// Sum of the masses [kg].
    mass: f64,
    elasticity: Elasticity,
    factor: Arc<Cholesky>,
    /// Nodes that are not fixed, and where each node is among them.
    free_nodes: Vec<u32>,
    free_index: Arc<Vec<u32>>,
    damping: f64,
    mass_damping: f64,
    gravity: DVec3,
    time_step: f64,
    /// Fixed nodes that are moved, ascending.
    driven: Vec<Driven>,
    step: Step,
}

/// What gives the internal forces.
#[derive(Default)]
enum Elasticity {
    /// Taken out while it works.
    #[default]
    None,
    /// The stiffness of the rest shape, in the body's own rotating frame.
    Linear(BlockMatrix),
    /// Any other law, and the method that solves the step with it.
    Nonlinear(Box<QuasiNewton>),
}

/// What is known of a body's matrix before it is made; nothing by default.
#[derive(Clone, Copy, Default)]
pub(crate) struct Known<'a> {
    /// Order of elimination of the free nodes.
    pub(crate) order: &'a [u32],
    /// Arms [m] of the shape whose stiffness A is to be made of, in its frame; empty: that at rest.
    pub(crate) shape: &'a [Point],
    /// The matrix before a change of the mesh, and for each free node the one that it was, if any.
    pub(crate) before: Option<(&'a MatrixBefore, &'a [Option<u32>])>,
}

/// What a matrix is known by when another one is to be made from it; what it was made of stays as it is.
#[derive(Clone)]
pub(crate) struct MatrixBefore {
    factor: Arc<Cholesky>,
    free_index: Arc<Vec<u32>>,
    /// The stiffness in the shape that A was made of, of nonlinear laws.
    pub(super) stiffness: Option<StiffnessBefore>,
}

impl MatrixBefore {
    /// Where a node is among the free ones; `None` when it is fixed.
    pub(super) fn free_place(&self, node: u32) -> Option<u32> {
        Some(self.free_index[node as usize]).filter(|&place| place != FIXED)
    }
}

impl ElasticBody {
    pub(super) fn new(
        index: usize,
        body: &Body,
        gravity: Point,
        time_step: f64,
        known: Known,
    ) -> Result<Self, MechanicsError> {
        check_material(index, body)?;
        check_fixed_nodes(index, body)?;
        let mesh = &body.mesh;
        let (nodes, tetrahedra) = (mesh.nodes(), mesh.tetrahedra());
        let name = || body.name.clone();
        if tetrahedra.is_empty() {
            return Err(MechanicsError::NoTetrahedra { body: index, name: name() });
        }
        let count = nodes.len();
        let material = &body.material;
        let inertia = inertia(time_step, material.mass_damping);
        let masses = lumped_masses(body);
        if let Some(node) = masses.iter().position(|&mass| mass <= 0.0) {
            return Err(MechanicsError::LooseNode { body: index, name: name(), node });
        }
        let mut free_index = vec![0; count];
        for &node in &body.fixed_nodes {
            free_index[node as usize] = FIXED;
        }
        let free_nodes: Vec<u32> =
            (0..count as u32).filter(|&node| free_index[node as usize] != FIXED).collect();
        for (place, &node) in free_nodes.iter().enumerate() {
            free_index[node as usize] = place as u32;
        }
        let start = Inertia::new(&masses, nodes, &vec![[0.0; 3]; count]);
        let rest: Vec<DVec3> =
            nodes.iter().map(|&node| DVec3::from_array(node) - start.center).collect();
        let factored = |system: &BlockMatrix| {
            let order = match known.order {
                [] => NodeOrder::new(system.pattern()),
                order => NodeOrder::given(system.pattern(), order),
            };
            let is_large = order.factor_entries > LARGE_FACTOR;
            // Iterations put right what fewer bits lose.
            let precision = if is_large && material.law != Law::Linear {
                Precision::BlockFloat
            } else {
                Precision::Single
            };
            let factor = match known.before {
                Some((before, origins)) => before.factor.changed(system, precision, order, origins),
                None => Cholesky::in_order(system, precision, order),
            };
            factor.map_err(|source| {
                let source = in_body_numbering(source, &free_nodes);
                MechanicsError::Factor { body: index, name: name(), source }
            })
        };
        let (elasticity, factor) = if material.law == Law::Linear {
            let stiffness = linear_stiffness(body);
            let mut system = SystemMatrix::new(&stiffness, &free_index);
            system.fill(&stiffness, &masses, inertia, 1.0 + material.damping / time_step);
            (Elasticity::Linear(stiffness), factored(&system.into_matrix())?)
        } else {
            let mut method = QuasiNewton::new(body, &free_index);
            if let Some(stiffness) = known.before.and_then(|(before, _)| before.stiffness.as_ref())
            {
                method.take_over(stiffness);
            }
            let mut at =
                |shape: &[Point]| factored(method.system_at(shape, &masses, inertia, time_step));
            // What fails in a shape does not at rest, but where the fault is not the shape's.
            let factor = at(known.shape).or_else(|_| at(&[]))?;
            (Elasticity::Nonlinear(Box::new(method)), factor)
        };
        let workspace = factor.workspace();
        let step = Step::new(start, count, free_nodes.len(), workspace);
        Ok(Self {
            rest,
            mass: masses.iter().sum(),
            masses,
            elasticity,
            factor: Arc::new(factor),
            free_nodes,
            free_index: Arc::new(free_index),
            damping: material.damping,
            mass_damping: material.mass_damping,
            gravity: DVec3::from_array(gravity),
            time_step,
            driven: Vec::new(),
            step,
        })
    }

    /// What another matrix can be made from.
    pub(super) fn matrix(&self) -> MatrixBefore {
        MatrixBefore {
            factor: Arc::clone(&self.factor),
            free_index: Arc::clone(&self.free_index),
            stiffness: match &self.elasticity {
                Elasticity::Nonlinear(method) => Some(method.stiffness()),
                _ => None,
            },
        }
    }

    /// Goes on in the memory for solves of a body that is gone.
    pub(super) fn take_memory(&mut self, other: Self) {
        self.step.workspace = other.step.workspace;
    }

    pub(crate) fn is_free(&self, node: usize) -> bool {
        self.free_index[node] != FIXED
    }

    /// Whether caches do not hold the factor.
    fn has_large_factor(&self) -> bool {
        self.factor.order().factor_entries > LARGE_FACTOR
    }

    fn is_unattached(&self) -> bool {
        self.free_nodes.len() == self.masses.len()
    }

    pub(crate) fn masses(&self) -> &[f64] {
        &self.masses
    }

    pub(crate) fn gravity(&self) -> DVec3 {
        self.gravity
    }

    /// The frame of the step that has begun.
    pub(crate) fn frame(&self) -> DMat3 {
        self.step.frame
    }

    /// Order in which the free nodes are eliminated.
    pub(crate) fn order(&self) -> &[u32] {
        &self.factor.order().nodes
    }

    /// The free nodes in that order.
    pub(in crate::body) fn order_of_nodes(&self) -> impl Iterator<Item = u32> {
        self.order().iter().map(|&place| self.free_nodes[place as usize])
    }

    pub(crate) fn factor_stats(&self) -> FactorStats {
        self.factor.stats()
    }

    /// Half solutions of `nodes`, which must be free, in the frame: see [`Cholesky::half_solve`].
    pub(crate) fn half_solve(&mut self, nodes: &[u32], halves: &mut [HalfSolution]) {
        let places = &mut self.step.places;
        places.clear();
        places.extend(nodes.iter().map(|&node| self.free_index[node as usize]));
        self.factor.half_solve(places, halves, &mut self.step.workspace);
    }

    /// Place of a node in the order of elimination; fixed nodes come last.
    pub(crate) fn elimination_place(&self, node: u32) -> usize {
        let place = self.free_place(node);
        place.map_or(usize::MAX, |place| self.factor.elimination_place(place))
    }

    /// Bytes of the half solution of a node, which must be free.
    pub(crate) fn half_bytes(&self, node: u32) -> usize {
        self.factor.half_bytes(self.free_index[node as usize] as usize)
    }

    /// See [`Cholesky::common_lengths`].
    pub(crate) fn common_lengths(&self, node: u32, lengths: &mut Vec<u32>) {
        self.factor.common_lengths(self.free_index[node as usize] as usize, lengths);
    }

    /// See [`Cholesky::branch`].
    pub(crate) fn branch(&self, node: u32) -> usize {
        self.factor.branch(self.free_index[node as usize] as usize)
    }

    /// Displacement of every free node under a unit force on a free node along an axis of the frame.
    #[cfg(test)]
    pub(crate) fn column(&mut self, node: u32, axis: usize) -> Vec<[f64; 3]> {
        let mut column = vec![[0.0; 3]; self.free_nodes.len()];
        column[self.free_index[node as usize] as usize][axis] = 1.0;
        self.factor.solve_in_place(&mut column, &mut self.step.workspace);
        column
    }

    /// Where a node is among the free ones; `None` when it is fixed.
    pub(crate) fn free_place(&self, node: u32) -> Option<usize> {
        let place = self.free_index[node as usize];
        (place != FIXED).then_some(place as usize)
    }

    /// Turns loads on the free nodes into displacements, A^-1, for one or two cases. An unattached body
    /// is moved as a whole by what its mass says, in double precision, and only the rest is solved for.
    fn solve(&mut self, first: &mut [[f64; 3]], second: Option<&mut [[f64; 3]]>) {
        let unattached = self.is_unattached();
        let mass = self.mass;
        let gain = self.gain();
        let masses = &self.masses;
        let without_mean = |values: &mut [[f64; 3]]| {
            let load: DVec3 = values.iter().map(|&value| DVec3::from_array(value)).sum();
            let acceleration = load / mass;
            for (&m, value) in masses.iter().zip(values) {
                *value = (DVec3::from_array(*value) - m * acceleration).to_array();
            }
            acceleration
        };
        let with_mean = |values: &mut [[f64; 3]], acceleration: DVec3| {
            let moments = masses.iter().zip(&*values);
            let moment: DVec3 = moments.map(|(&m, &value)| m * DVec3::from_array(value)).sum();
            let shift = gain * acceleration - moment / mass;
            for value in values {
                *value = (DVec3::from_array(*value) + shift).to_array();
            }
        };
        let workspace = &mut self.step.workspace;
        match (second, unattached) {
            (None, false) => self.factor.solve_in_place(first, workspace),
            (None, true) => {
                let mean = without_mean(first);
                self.factor.solve_in_place(first, workspace);
                with_mean(first, mean);
            }
            (Some(second), false) => self.factor.solve_two_in_place(first, second, workspace),
            (Some(second), true) => {
                let means = [without_mean(first), without_mean(second)];
                self.factor.solve_two_in_place(first, second, workspace);
                with_mean(first, means[0]);
                with_mean(second, means[1]);
            }
        }
    }

    fn inertia(&self) -> f64 {
        inertia(self.time_step, self.mass_damping)
    }

    /// Displacement [m] of a step under unit force per unit mass.
    fn gain(&self) -> f64 {
        self.time_step * self.time_step / (1.0 + self.mass_damping * self.time_step)
    }

    /// Cauchy stress of each tetrahedron at positions `x` [Pa]; `None` for the linear law.
    pub(crate) fn cauchy_stress(&mut self, x: &[Point]) -> Option<Vec<[f64; 6]>> {
        match &mut self.elasticity {
            Elasticity::Nonlinear(method) => {
                let mut stress = vec![[0.0; 6]; method.tissue.tetrahedron_count()];
                method.tissue.cauchy_stress(x, &mut stress);
                Some(stress)
            }
            _ => None,
        }
    }

    /// Centre of mass and frame of positions.
    fn place_of(&self, positions: impl Iterator<Item = DVec3> + Clone) -> (DVec3, DMat3) {
        place_of(&self.masses, &self.rest, positions)
    }

    /// Arms of positions `x` about their centre, in their frame [m].
    fn arms_of(&self, x: &[Point]) -> impl Iterator<Item = DVec3> {
        let positions = x.iter().map(|&x| DVec3::from_array(x));
        let (center, frame) = self.place_of(positions.clone());
        let to_frame = frame.transpose();
        positions.map(move |x| to_frame * (x - center))
    }

    /// Elastic energy [J] at positions `x`.
    pub(crate) fn elastic_energy(&mut self, x: &[Point]) -> f64 {
        let strain: Vec<[f64; 3]> =
            self.arms_of(x).zip(&self.rest).map(|(arm, &rest)| (arm - rest).to_array()).collect();
        let stiffness = match &mut self.elasticity {
            Elasticity::Linear(stiffness) => stiffness,
            Elasticity::Nonlinear(method) => return method.tissue.energy(x),
            Elasticity::None => unreachable!("only within a step"),
        };
        let mut product = vec![[0.0; 3]; strain.len()];
        stiffness.multiply(&strain, &mut product);
        let pairs = strain.as_flattened().iter().zip(product.as_flattened());
        0.5 * pairs.map(|(u, f)| u * f).sum::<f64>()
    }
}

/// Centre of mass and frame of positions, `rest` being relative to the centre at rest.
fn place_of(
    masses: &[f64],
    rest: &[DVec3],
    positions: impl Iterator<Item = DVec3> + Clone,
) -> (DVec3, DMat3) {
    let weighted = masses.iter().zip(positions.clone()).map(|(&m, x)| m * x);
    let center = weighted.sum::<DVec3>() / masses.iter().sum::<f64>();
    let mut fit = DMat3::ZERO;
    for ((&m, x), rest) in masses.iter().zip(positions).zip(rest) {
        let r = m * (x - center);
        fit += DMat3::from_cols(rest.x * r, rest.y * r, rest.z * r);
    }
    (center, best_rotation(fit))
}

/// 1/dt² + alpha/dt: force [N] per mass and displacement.
fn inertia(time_step: f64, mass_damping: f64) -> f64 {
    (1.0 / time_step + mass_damping) / time_step
}
