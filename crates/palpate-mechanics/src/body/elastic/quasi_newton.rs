//! The step with a nonlinear law: a quasi-Newton method around the matrix of a recent shape.
//!
//! Limited-memory BFGS (Nocedal 1980) around a factored matrix, as Liu, Bouaziz and Kavan (2017) do for
//! hyperelastic bodies: an iteration costs the internal forces once and a solve. The matrix is made
//! anew at the end of a step that took many iterations or deformed the body much.

use std::sync::Arc;

use glam::DVec3;
use palpate_geometry::Point;
use palpate_model::{Body, Mesh};
use palpate_solver::{BlockMatrix, Cholesky};

use super::system::SystemMatrix;
use super::{ElasticBody, Elasticity, FIXED};
use crate::body::turning::largest_change;
use crate::materials::tissue_of;
use crate::tissue::{Tissue, VolumeAveraging};

/// Steps whose change of the forces is remembered.
const MEMORY: usize = 5;
/// A step ends when no node moves by more than this part of the mean edge in an iteration.
const TOLERANCE: f64 = 3e-4;
/// Most iterations of a step.
const MAX_ITERATIONS: usize = 10;
/// The same while contact forces are held: a compressed body that is held by forces instead of by what it
/// touches, which gives way otherwise, is unstable.
const MAX_HELD_ITERATIONS: usize = 1;
/// Moves smaller than this, in mean edges, are not worth another solve for the contact forces.
const SETTLED: f64 = 0.1;
/// The same while a cut changes the body, or a matrix that it brings is being made. The lips jump apart, and with a
/// matrix that says too little of this shape passes go too far one after the other: the next steps do as well.
const SETTLED_IN_CHANGE: f64 = 0.5;
/// Iterations of a step, or solves for its contact forces, after which A is made anew; so it is after a move
/// that went too far, where the factor is not large.
const SLOW: u32 = 6;
/// The same when a node has moved by more than this part of the body's radius since, apart from the
/// body's motion as a whole: slow processes need few iterations in each of very many steps.
const DEFORMED: f64 = 0.1;
/// Part of that below which many iterations are no reason to make A anew: an A of nearly the shape that it is of
/// says nothing new. Where its factor is large a new one costs as much as ten frames at rest.
const SAME_SHAPE: f64 = 1e-3;
const SAME_LARGE_SHAPE: f64 = 0.3;
/// Part of that from which on an A that is made for another reason takes the present shape; what is made of a
/// shape near it can be taken over otherwise.
const SOON: f64 = 0.2;
/// A move went too far when the residual along it has turned round and is more than this part of what it was;
/// it is shortened so many times at most, and not below this part of it at a time.
const OVERSHOT: f64 = 0.5;
const MAX_SHORTENED: usize = 6;
const SHORTEST: f64 = 0.1;
/// Farthest that a node goes by deformation before the first iteration, in mean edges.
const FARTHEST_START: f64 = 0.5;
/// Farthest that a node moves in an iteration, in mean edges.
const LONGEST_MOVE: f64 = 1.0;

/// A law and what the method remembers within a step.
pub(super) struct QuasiNewton {
    pub(super) tissue: Tissue,
    mean_edge: f64,
    /// Trial positions and the internal forces there.
    x: Vec<Point>,
    forces: Vec<Point>,
    /// Forces left over on the free nodes, in the frame.
    residual: Vec<[f64; 3]>,
    /// The same before the last move; then the next move.
    scratch: Vec<[f64; 3]>,
    pairs: Vec<Pair>,
    /// How many of the pairs are known, the first ones.
    known: usize,
    /// Stiffness, and A made of it, when the shape has changed.
    stiffness: Arc<BlockMatrix>,
    system: SystemMatrix,
    /// Nodes between which the stiffness is not known although it is elsewhere; empty: nothing is known.
    unknown: Vec<bool>,
    /// Arms of the shape whose stiffness was taken, in its frame [m]; empty: at rest.
    stiff_shape: Vec<Point>,
    mesh: Arc<Mesh>,
    /// Iterations of the last step.
    iterations: u32,
    /// Solves for the contact forces in the last step, and the larger of that and the iterations of
    /// any of them.
    passes: u32,
    effort: u32,
    /// Whether a move of the last step went too far: A says too little about this shape.
    overshot: bool,
    /// Longest move of the last iteration [m], and what was left of it where it went too far.
    longest: f64,
    left: f64,
}

/// A stiffness, and the mesh that it is of.
#[derive(Clone, Debug)]
pub(in crate::body) struct StiffnessBefore {
    mesh: Arc<Mesh>,
    stiffness: Arc<BlockMatrix>,
}

/// A move s of the free nodes and the change y of the residual, its sign turned.
#[derive(Default)]
struct Pair {
    s: Vec<[f64; 3]>,
    y: Vec<[f64; 3]>,
    /// 1 / (s . y)
    rho: f64,
    alpha: f64,
}

impl QuasiNewton {
    pub(super) fn new(body: &Body, free_index: &[u32]) -> Self {
        let tissue = tissue_of(body, VolumeAveraging::Automatic);
        let stiffness = Arc::new(BlockMatrix::zeros(Arc::clone(tissue.pattern())));
        let system = SystemMatrix::new(&stiffness, free_index);
        let node_count = free_index.len();
        let free_count = free_index.iter().filter(|&&place| place != FIXED).count();
        let zero = || vec![[0.0; 3]; free_count];
        let pair = |_| Pair { s: zero(), y: zero(), rho: 0.0, alpha: 0.0 };
        Self {
            tissue,
            mean_edge: body.mesh.mean_surface_edge(),
            x: vec![[0.0; 3]; node_count],
            forces: vec![[0.0; 3]; node_count],
            residual: zero(),
            scratch: zero(),
            pairs: (0..MEMORY).map(pair).collect(),
            known: 0,
            stiffness,
            system,
            unknown: Vec::new(),
            stiff_shape: Vec::with_capacity(node_count),
            mesh: Arc::clone(&body.mesh),
            iterations: 0,
            passes: 0,
            effort: 0,
            overshot: false,
            longest: 0.0,
            left: 0.0,
        }
    }

    /// A of a shape, given by the arms of its nodes in its frame [m]; empty: of the rest shape.
    ///
    /// A cut leaves A as it was but where the mesh has changed, to the last bit, so that what is known of
    /// its factor can be kept: the arms are never made anew for another mesh, nor are those at rest centred.
    pub(super) fn system_at(
        &mut self,
        shape: &[Point],
        masses: &[f64],
        inertia: f64,
        time_step: f64,
    ) -> &BlockMatrix {
        self.stiff_shape.clear();
        self.stiff_shape.extend_from_slice(shape);
        let x = if shape.is_empty() { self.mesh.nodes() } else { shape };
        self.tissue.begin_step(x, time_step);
        let unknown = std::mem::take(&mut self.unknown);
        let stiffness = Arc::make_mut(&mut self.stiffness);
        if unknown.is_empty() {
            stiffness.blocks_mut().fill([[0.0; 3]; 3]);
            self.tissue.add_stiffness(x, stiffness);
        } else {
            self.tissue.add_stiffness_between(&unknown, x, stiffness);
        }
        self.system.fill(&self.stiffness, masses, inertia, 1.0)
    }

    /// The stiffness that A is made of, for a body with another mesh.
    pub(super) fn stiffness(&self) -> StiffnessBefore {
        StiffnessBefore { mesh: Arc::clone(&self.mesh), stiffness: Arc::clone(&self.stiffness) }
    }

    /// Takes over what is known of the stiffness from before a change of the mesh. The next A must be of
    /// the shape that the last one was before.
    pub(super) fn take_over(&mut self, before: &StiffnessBefore) {
        if self.tissue.averages() {
            return;
        }
        let Some(changed) = changed_nodes(&before.mesh, &self.mesh) else { return };
        let (old, new) = (&before.stiffness, Arc::clone(self.stiffness.pattern()));
        let blocks = Arc::make_mut(&mut self.stiffness).blocks_mut();
        for (col, &col_changed) in changed.iter().enumerate() {
            for (index, &row) in new.range(col).zip(new.column(col)) {
                if !(col_changed && changed[row as usize]) {
                    let same = old.pattern().find(row, col as u32).expect("joined before as well");
                    blocks[index] = old.blocks()[same];
                }
            }
        }
        self.unknown = changed;
    }

    /// Remembers how the residual, before in the scratch memory, has changed by the last move, where
    /// it has turned against it. Contact forces are the same before and after.
    fn remember_move(&mut self) {
        let pair = &mut self.pairs[self.known];
        for ((y, r), before) in pair.y.iter_mut().zip(&self.residual).zip(&self.scratch) {
            *y = std::array::from_fn(|k| before[k] - r[k]);
        }
        let product = dot(&pair.s, &pair.y);
        if product <= 0.0 {
            return;
        }
        pair.rho = product.recip();
        self.known += 1;
        if self.known == MEMORY {
            self.pairs.rotate_left(1);
            self.known -= 1;
        }
    }

    /// Finds the internal forces at the end of the step that has begun.
    pub(super) fn forces_at(&mut self, x: &[Point]) {
        self.tissue.forces(x, &mut self.forces);
    }

    /// Internal force on a node where they were found last [N].
    pub(super) fn force(&self, node: usize) -> DVec3 {
        DVec3::from_array(self.forces[node])
    }
}

/// Which nodes are new or have other tetrahedra than before; `None` where old ones are not the first ones
/// of now.
fn changed_nodes(old: &Mesh, new: &Mesh) -> Option<Vec<bool>> {
    let (before, now) = (old.tetrahedra(), new.tetrahedra());
    if new.nodes().get(..old.nodes().len()) != Some(old.nodes()) || now.len() < before.len() {
        return None;
    }
    let mut changed = vec![false; new.nodes().len()];
    changed[old.nodes().len()..].fill(true);
    for (index, corners) in now.iter().enumerate() {
        let old_corners = before.get(index);
        if old_corners != Some(corners) {
            for &node in corners.iter().chain(old_corners.into_iter().flatten()) {
                changed[node as usize] = true;
            }
        }
    }
    Some(changed)
}

impl ElasticBody {
    /// The shape whose stiffness A is made of, as arms in its frame [m]; empty for the rest shape.
    pub(in crate::body) fn stiff_shape(&self) -> &[Point] {
        match &self.elasticity {
            Elasticity::Nonlinear(method) => &method.stiff_shape,
            _ => &[],
        }
    }

    /// Iterations of the step; 0 with the linear law.
    pub(in crate::body) fn newton_iterations(&self) -> u32 {
        match &self.elasticity {
            Elasticity::Nonlinear(method) => method.iterations,
            _ => 0,
        }
    }

    /// Makes A of the stiffness at positions `x` if the step that ends there took many iterations or the
    /// shape has changed much: with the stiffness of a very different shape the contact forces, which A
    /// alone tells how to choose, would be wrong as well. True if A has changed.
    ///
    /// Where another matrix `is_coming`, only a shape that has changed much is worth one until then.
    pub(in crate::body) fn refresh_if_slow(&mut self, x: &[Point], is_coming: bool) -> bool {
        match std::mem::take(&mut self.elasticity) {
            Elasticity::Nonlinear(mut method) => {
                let large = self.has_large_factor();
                // Shortening moves costs little beside a large factor.
                let slow = method.effort >= SLOW || (method.overshot && !large);
                let part = match (slow && !is_coming, large) {
                    (true, true) => SAME_LARGE_SHAPE,
                    (true, false) => SAME_SHAPE,
                    (false, _) => 1.0,
                };
                let changed = self.change_of_shape(&method, x) > part * DEFORMED && {
                    method.x.clear();
                    method.x.extend(self.arms_of(x).map(|arm| arm.to_array()));
                    let shape = std::mem::take(&mut method.x);
                    let changed = self.take_stiffness(&mut method, &shape);
                    method.x = shape;
                    changed
                };
                self.elasticity = Elasticity::Nonlinear(method);
                changed
            }
            other => {
                self.elasticity = other;
                false
            }
        }
    }

    /// The shape that an A which is made anew in any case should be of: the one that it is of, or that of
    /// positions `x` where the body is on the way to need it.
    pub(crate) fn next_stiff_shape(&self, x: &[Point]) -> Vec<Point> {
        match &self.elasticity {
            Elasticity::Nonlinear(method) if self.change_of_shape(method, x) > SOON * DEFORMED => {
                self.arms_of(x).map(|arm| arm.to_array()).collect()
            }
            Elasticity::Nonlinear(method) => method.stiff_shape.clone(),
            _ => Vec::new(),
        }
    }

    /// How much positions `x` differ in shape from those that A is made of.
    fn change_of_shape(&self, method: &QuasiNewton, x: &[Point]) -> f64 {
        if method.stiff_shape.is_empty() {
            largest_change(self.arms_of(x), self.rest.iter().copied())
        } else {
            let shape = method.stiff_shape.iter().map(|&arm| DVec3::from_array(arm));
            largest_change(self.arms_of(x), shape)
        }
    }

    /// Makes A of the stiffness of a shape ([`QuasiNewton::system_at`]); true if A has changed.
    /// Where the matrix cannot be factored, as when a body is about to be lost, that at rest is taken.
    pub(super) fn take_stiffness(&mut self, method: &mut QuasiNewton, shape: &[Point]) -> bool {
        if method.stiff_shape == shape {
            return false;
        }
        self.step.turning_known = false;
        let (inertia, time_step) = (self.inertia(), self.time_step);
        let mut factored = |shape: &[Point]| {
            let system = method.system_at(shape, &self.masses, inertia, time_step);
            if let Some(factor) = Arc::get_mut(&mut self.factor) {
                return factor.refactor(system).is_ok();
            }
            // What a cut that is on its way is made from stays as it is.
            let order = self.factor.order().clone();
            let made = Cholesky::in_order(system, self.factor.precision(), order);
            made.map(|factor| self.factor = Arc::new(factor)).is_ok()
        };
        let factored = factored(shape) || factored(&[]);
        debug_assert!(factored, "that at rest was factored when the body was made");
        true
    }

    /// Finds the correction of the prediction under all forces.
    pub(super) fn correct(
        &mut self,
        method: &mut QuasiNewton,
        x: &[Point],
        forces: &[Point],
        contact: Option<&[Point]>,
    ) {
        method.tissue.begin_step(x, self.time_step);
        self.begin_correction(method.mean_edge);
        (method.iterations, method.known) = (0, 0);
        (method.effort, method.passes, method.overshot) = (0, 1, false);
        self.step.expected.fill([0.0; 3]);
        let apart = self.step.turns;
        if let Some(contact) = contact.filter(|_| apart) {
            self.expect_motion(contact);
        }
        self.relax(method, forces, contact);
        if self.is_unattached() {
            self.put_momentum_right(x, forces, contact.filter(|_| !apart));
        }
    }

    /// Keeps what the expected contact forces do to an unattached body as a whole apart from the correction.
    ///
    /// What is squeezed between a tool and the ground bears forces that would turn it by radians, since
    /// it has moved by a part of an edge from where they were in balance. Their change turns it back, but no tissue
    /// would come back from having been there.
    fn expect_motion(&mut self, contact: &[Point]) {
        let gain = self.gain();
        let Self { step, mass, .. } = self;
        let to_frame = step.frame.transpose();
        let in_frame = contact.iter().map(|&f| to_frame * DVec3::from_array(f));
        let [load, torque] = step.levers.load_and_torque(in_frame);
        for (e, turned) in step.expected.iter_mut().zip(step.rotations.turned_by(torque)) {
            *e = (gain * (load / *mass + turned)).to_array();
        }
    }

    /// Begins where the body would be if it went on with its deformation, or only with a part of it where
    /// that is large: far beyond its shape a stiff body has forces from which iterations do not come back.
    fn begin_correction(&mut self, mean_edge: f64) {
        let way = self.time_step * self.step.fastest_deformation();
        let less = (1.0 - FARTHEST_START * mean_edge / way).max(0.0) * self.time_step;
        self.step.begin_correction(less, &self.free_nodes);
    }

    /// Iterates from the present correction, with care while contact forces are held. What was learned of
    /// the tissue under other contact forces of this step still holds: where it is stiffer than A says, each pass
    /// would go too far anew.
    fn relax(&mut self, method: &mut QuasiNewton, forces: &[Point], contact: Option<&[Point]>) {
        let most = if contact.is_some() { MAX_HELD_ITERATIONS } else { MAX_ITERATIONS };
        self.find_residual(method, forces, contact);
        for iteration in 0..most {
            let longest = self.next_move(method);
            method.iterations += 1;
            method.effort = method.effort.max(iteration as u32 + 1);
            (method.longest, method.left) = (longest, longest);
            self.make_move(method, longest);
            if longest <= TOLERANCE * method.mean_edge {
                break;
            }
            std::mem::swap(&mut method.scratch, &mut method.residual);
            self.find_residual(method, forces, contact);
            self.shorten_move(method, forces, contact);
            method.remember_move();
        }
    }

    /// Takes back what of the last move went too far, by the residuals before it, in the scratch memory,
    /// and after it: those of a body that is stiffer by now than A says would grow without end.
    fn shorten_move(
        &mut self,
        method: &mut QuasiNewton,
        forces: &[Point],
        contact: Option<&[Point]>,
    ) {
        let known = method.known;
        for _ in 0..MAX_SHORTENED {
            let s = &method.pairs[known].s;
            let (before, after) = (dot(s, &method.scratch), dot(s, &method.residual));
            if after >= -OVERSHOT * before {
                return;
            }
            method.overshot = true;
            // Where the residual along the move vanishes if it changes in proportion.
            let part = (before / (before - after)).max(SHORTEST);
            method.left *= part;
            for (d, s) in self.step.correction.iter_mut().zip(&mut method.pairs[known].s) {
                *d = std::array::from_fn(|k| d[k] - (1.0 - part) * s[k]);
                *s = s.map(|s| part * s);
            }
            self.find_residual(method, forces, contact);
        }
    }

    /// Adds the next move, shortened where it is too long.
    fn make_move(&mut self, method: &mut QuasiNewton, longest: f64) {
        let s = &mut method.pairs[method.known].s;
        let limit = LONGEST_MOVE * method.mean_edge;
        let scale = if longest > limit { limit / longest } else { 1.0 };
        for ((d, s), z) in self.step.correction.iter_mut().zip(s).zip(&method.scratch) {
            *s = z.map(|z| scale * z);
            *d = std::array::from_fn(|k| d[k] + s[k]);
        }
    }

    /// Some more iterations, now that the response to other contact forces is known: false if there is
    /// nothing to gain, or too little while the body `is_changing`. The contact forces are expected from now on, and the response is zero.
    pub(super) fn iterate(
        &mut self,
        method: &mut QuasiNewton,
        x: &[Point],
        forces: &[Point],
        contact: &[Point],
        is_changing: bool,
    ) -> bool {
        let (settled, last) =
            if is_changing { (SETTLED_IN_CHANGE, method.left) } else { (SETTLED, method.longest) };
        let enough = settled * method.mean_edge;
        let moved = last.max(self.step.farthest_response(&self.masses));
        if moved <= enough {
            return false;
        }
        self.step.take_response();
        method.passes += 1;
        method.effort = method.effort.max(method.passes);
        self.relax(method, forces, Some(contact));
        if self.is_unattached() {
            self.put_momentum_right(x, forces, Some(contact));
        }
        true
    }

    /// Moves and turns the body as a whole so that only external and contact forces have changed its
    /// momenta: the remembered moves would leave an error as large as that of the iteration.
    fn put_momentum_right(&mut self, x: &[Point], forces: &[Point], contact: Option<&[Point]>) {
        let (mut load, mut moment) = (DVec3::ZERO, DVec3::ZERO);
        for (node, &d) in self.step.correction.iter().enumerate() {
            load += self.external(forces, node);
            if let Some(contact) = contact {
                load += DVec3::from_array(contact[node]);
            }
            moment += self.masses[node] * DVec3::from_array(d);
        }
        let shift = (self.gain() * (self.step.frame.transpose() * load) - moment) / self.mass;
        for d in &mut self.step.correction {
            *d = (DVec3::from_array(*d) + shift).to_array();
        }
        self.remove_torque(self.next_spin(x, forces, contact.unwrap_or(&[])));
    }

    /// Writes the forces that the correction so far leaves over, of an unattached body without those that move it
    /// as a whole: its momenta tell how it moves, and iterations on that would undo it, since the forces
    /// have other levers by then.
    fn find_residual(&self, method: &mut QuasiNewton, forces: &[Point], contact: Option<&[Point]>) {
        let step = &self.step;
        let (frame, to_frame) = (step.frame, step.frame.transpose());
        for (x, predicted) in method.x.iter_mut().zip(&step.positions) {
            *x = predicted.to_array();
        }
        for (&node, &d) in self.free_nodes.iter().zip(&step.correction) {
            let node = node as usize;
            method.x[node] = (step.positions[node] + frame * DVec3::from_array(d)).to_array();
        }
        method.tissue.forces(&method.x, &mut method.forces);
        let inertia = self.inertia();
        for ((residual, &d), &node) in
            method.residual.iter_mut().zip(&step.correction).zip(&self.free_nodes)
        {
            let node = node as usize;
            let mut force = DVec3::from_array(method.forces[node]) + self.external(forces, node);
            if let Some(contact) = contact {
                force += DVec3::from_array(contact[node]);
            }
            let left = to_frame * force - inertia * self.masses[node] * DVec3::from_array(d);
            *residual = left.to_array();
        }
        if step.turns {
            step.rotations.take_whole(&self.masses, self.mass, &mut method.residual);
        }
    }

    /// Writes the next move to `scratch`; returns its longest part [m].
    fn next_move(&mut self, method: &mut QuasiNewton) -> f64 {
        let QuasiNewton { residual, scratch, pairs, known, .. } = method;
        let known = *known;
        scratch.copy_from_slice(residual);
        for pair in pairs[..known].iter_mut().rev() {
            pair.alpha = pair.rho * dot(&pair.s, scratch);
            add_scaled(scratch, -pair.alpha, &pair.y);
        }
        // Elements of these laws turn by themselves.
        self.solve(scratch, None);
        self.turn(DVec3::ZERO, scratch);
        for pair in &pairs[..known] {
            let beta = pair.rho * dot(&pair.y, scratch);
            add_scaled(scratch, pair.alpha - beta, &pair.s);
        }
        let lengths = scratch.iter().map(|&z| DVec3::from_array(z).length_squared());
        lengths.fold(0.0, f64::max).sqrt()
    }
}

fn dot(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    // Several sums at once: one would wait for every addition.
    let mut sums = [0.0; 8];
    let (a, a_rest) = a.as_flattened().as_chunks::<8>();
    let (b, b_rest) = b.as_flattened().as_chunks::<8>();
    for (a, b) in a.iter().zip(b) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

fn add_scaled(to: &mut [[f64; 3]], factor: f64, from: &[[f64; 3]]) {
    for (to, from) in to.as_flattened_mut().iter_mut().zip(from.as_flattened()) {
        *to += factor * from;
    }
}
