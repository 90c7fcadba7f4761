//! Elastic and viscous forces of tetrahedra under a nonlinear law.
//!
//! [`Tissue`] turns positions into forces, energy and stiffness; it knows nothing of mass, time
//! integration or contact. Tetrahedra are computed eight at a time into a buffer of corner forces, and
//! every node then sums its corners in a fixed order: the bits depend neither on the vector unit nor
//! on how the work may be cut.
//!
//! Volumetric locking: where lambda is more than [`STIFF_RATIO`] times mu (nu > 0.45) the resistance
//! to change of volume acts on nodal means (see `averaging`); only [`ELEMENT_RATIO`] times mu of it stays
//! in the single elements, which keeps elements from changing volume against each other. The
//! stiffness matrix cannot hold the means (they couple neighbours of neighbours); it has all of lambda in the
//! elements, which is stiffer (a mean has at most the square of what it is of), and is to be used as a
//! preconditioner there.

// Numeric code is inlined into what was compiled for the vector unit that `dispatch` found, and walks
// through small arrays by index: closures and iterators may stay outside.
#![allow(clippy::inline_always, clippy::needless_range_loop)]

mod averaging;
mod corners;
mod dual;
mod group;
mod kernel;
pub(crate) mod law;
mod matrix;
mod polar;
mod principal;
mod projection;
mod real;
mod stiffness;
mod wide;

#[cfg(test)]
mod tests;

use std::sync::Arc;

use palpate_geometry::Point;
use palpate_solver::{BlockMatrix, BlockPattern};

use averaging::Averaging;
use corners::NodeCorners;
use group::{Batch, Group, Layout, PADDING};
use kernel::{
    BatchInput, Corners, Energies, Forces, Pass, Product, Strains, Stresses, Task, VolumeSlopes,
    Volumes,
};
use law::viscosity::Viscosity;
use law::{Lame, Law, MAX_FAMILIES, with_law};
use stiffness::{Places, Stiffness};
use wide::{Eight, LANES};

/// Lambda over mu above which volumes are averaged: that of nu = 0.45.
const STIFF_RATIO: f64 = 9.0;
/// Lambda over mu that stays in the single elements where volumes are averaged.
const ELEMENT_RATIO: f64 = 1.0;

/// Whether the resistance to change of volume acts on nodal means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum VolumeAveraging {
    /// In regions with nu > 0.45.
    #[default]
    Automatic,
    #[allow(dead_code, reason = "tests compare with it")]
    /// In no region: exact element stiffness, but it locks as nu goes to 0.5.
    Never,
}

/// What a [`Tissue`] is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TissueInput<'a> {
    /// Node positions at rest [m].
    pub(crate) rest: &'a [Point],
    pub(crate) tetrahedra: &'a [[u32; 4]],
    /// One law per region.
    pub(crate) laws: &'a [Law],
    /// Index of the law of each tetrahedron; empty: the first law for all.
    pub(crate) regions: &'a [u32],
    /// Unit fibre directions of each tetrahedron in rest space; empty if no law has fibres.
    pub(crate) fibres: &'a [[Point; MAX_FAMILIES]],
    /// Time beta of the Kelvin-Voigt viscosity [s]; 0: none.
    pub(crate) viscosity: f64,
    pub(crate) averaging: VolumeAveraging,
}

/// Elastic and viscous forces of a body's tetrahedra under nonlinear laws.
#[derive(Debug)]
pub(crate) struct Tissue {
    elements: ElementSet,
    averaging: Averaging,
    pattern: Arc<BlockPattern>,
    places: Vec<Places>,
    corners: NodeCorners,
    corner_forces: Vec<Corners>,
    energies: Vec<Eight>,
}

/// What does not change between evaluations of one step.
#[derive(Debug)]
struct ElementSet {
    layout: Layout,
    /// Batches that average come first.
    batches: Vec<Batch>,
    viscosity: f64,
    /// Length of the step that has begun [s].
    time_step: Option<f64>,
    /// Green's strain where the step began.
    starts: Vec<[Eight; 6]>,
}

/// Tetrahedra turned inside out, or flat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Inverted {
    pub(crate) count: usize,
    /// The one with the lowest index.
    pub(crate) first: Option<usize>,
}

impl ElementSet {
    /// Runs a task that needs the law over one batch.
    fn run<T: Task>(&self, batch: &Batch, x: &[Point], pressures: &[Eight], task: &mut T) {
        let input = self.batch_input(batch, x, pressures);
        with_law!(batch.law, law => pulp::Arch::new().dispatch(Pass { law, input, task }));
    }

    fn batch_input<'a>(
        &'a self,
        batch: &Batch,
        x: &'a [Point],
        pressures: &'a [Eight],
    ) -> BatchInput<'a> {
        let range = batch.groups.clone();
        let directions = &self.layout.directions;
        let viscosity = self.time_step.filter(|_| self.viscosity > 0.0).map(|time_step| {
            let viscosity = Viscosity::new(batch.viscous, self.viscosity, time_step);
            (viscosity, &self.starts[range.clone()])
        });
        BatchInput {
            groups: &self.layout.groups[range.clone()],
            directions: if batch.law.families() > 0 { &directions[range.clone()] } else { &[] },
            viscosity,
            pressures: if batch.averaged_lambda > 0.0 { &pressures[range] } else { &[] },
            positions: x,
        }
    }

    /// Runs a task that needs no law over groups.
    fn run_geometric<T: Task>(groups: &[Group], x: &[Point], task: &mut T) {
        let input =
            BatchInput { groups, directions: &[], viscosity: None, pressures: &[], positions: x };
        let law = law::neo_hookean::NeoHookean::from_lame(Lame { mu: 1.0, lambda: 0.0 });
        pulp::Arch::new().dispatch(Pass { law, input, task });
    }
}

impl Tissue {
    /// Groups the tetrahedra.
    ///
    /// # Panics
    /// If a tetrahedron has no positive rest volume or names a node that is not there, if a region has
    /// no law, or if a law has more fibre families than there are or no directions.
    pub(crate) fn new(input: &TissueInput<'_>) -> Self {
        let TissueInput { rest, tetrahedra, laws, regions, fibres, .. } = *input;
        assert!(
            regions.is_empty() || regions.len() == tetrahedra.len(),
            "a region per tetrahedron"
        );
        assert!(fibres.is_empty() || fibres.len() == tetrahedra.len(), "fibres per tetrahedron");
        let mut members = vec![Vec::new(); laws.len()];
        for index in 0..tetrahedra.len() {
            let region = regions.get(index).map_or(0, |&region| region as usize);
            members[region].push(index as u32);
        }
        let averages = |law: &Law| {
            let Lame { mu, lambda } = law.lame();
            // Rounding must not decide for nu = 0.45 itself.
            let limit = (1.0 + 1e-9) * STIFF_RATIO * mu;
            input.averaging == VolumeAveraging::Automatic && lambda > limit
        };
        let mut layout = Layout::default();
        let mut batches = Vec::new();
        for averaged in [true, false] {
            for (law, members) in laws.iter().zip(&members) {
                if averages(law) != averaged || members.is_empty() {
                    continue;
                }
                let families = law.families();
                assert!(families <= MAX_FAMILIES, "at most {MAX_FAMILIES} fibre families");
                assert!(families == 0 || !fibres.is_empty(), "the law needs fibre directions");
                let groups = layout.append(rest, tetrahedra, members, fibres);
                batches.push(batch(*law, averaged, groups));
            }
        }
        let averaging = Averaging::new(&batches, &layout.groups, &layout.members);
        let pattern = Arc::new(BlockPattern::from_cliques(rest.len(), tetrahedra));
        let corners = NodeCorners::new(&layout, rest.len());
        let places = stiffness::places(&pattern, &layout, &corners);
        let count = layout.groups.len();
        Self {
            averaging,
            pattern,
            places,
            corners,
            corner_forces: vec![[[[0.0; LANES]; 3]; 4]; count],
            energies: vec![[0.0; LANES]; count],
            elements: ElementSet {
                layout,
                batches,
                viscosity: input.viscosity,
                time_step: None,
                starts: vec![[[0.0; LANES]; 6]; if input.viscosity > 0.0 { count } else { 0 }],
            },
        }
    }

    /// Where [`Tissue::add_stiffness`] adds: the pattern of the tetrahedra.
    pub(crate) fn pattern(&self) -> &Arc<BlockPattern> {
        &self.pattern
    }

    /// Begins a step of `time_step` [s] at positions `start` [m]: from now on forces, energy and
    /// stiffness have their viscous part, for motion from `start`.
    pub(crate) fn begin_step(&mut self, start: &[Point], time_step: f64) {
        self.elements.time_step = Some(time_step);
        if self.elements.viscosity > 0.0 {
            let mut task = Strains { strains: &mut self.elements.starts };
            ElementSet::run_geometric(&self.elements.layout.groups, start, &mut task);
        }
    }

    /// Number of tetrahedra.
    pub(crate) fn tetrahedron_count(&self) -> usize {
        let members = self.elements.layout.members.as_flattened();
        members.iter().filter(|&&member| member != PADDING).count()
    }

    /// Internal forces [N] of all nodes at positions `x` [m].
    pub(crate) fn forces(&mut self, x: &[Point], forces: &mut [Point]) {
        self.find_pressures(x);
        for batch in &self.elements.batches {
            let mut task = Forces { forces: &mut self.corner_forces[batch.groups.clone()] };
            self.elements.run(batch, x, &self.averaging.pressures, &mut task);
        }
        self.gather(forces);
    }

    /// Elastic energy, and the incremental potential of the viscosity, [J] at positions `x` [m]. Its
    /// gradient is minus the forces.
    pub(crate) fn energy(&mut self, x: &[Point]) -> f64 {
        self.find_pressures(x);
        for batch in &self.elements.batches {
            let mut task = Energies { energies: &mut self.energies[batch.groups.clone()] };
            self.elements.run(batch, x, &self.averaging.pressures, &mut task);
        }
        self.energies.as_flattened().iter().sum::<f64>() + self.averaging.energy()
    }

    #[allow(dead_code, reason = "the exact tangent, which tests check with")]
    /// `product = -(d forces / dx) vector` at positions `x` [m]: the exact tangent, averaged volumes
    /// included, not made positive.
    pub(crate) fn multiply(&mut self, x: &[Point], vector: &[Point], product: &mut [Point]) {
        self.find_pressures(x);
        let averaging = &mut self.averaging;
        let averaged = averaging.group_count();
        if averaged > 0 {
            let corners = [[[0.0; LANES]; 3]; 4];
            let volumes = &mut averaging.element_volumes;
            let mut task = VolumeSlopes { vector, corners, volumes };
            ElementSet::run_geometric(&self.elements.layout.groups[..averaged], x, &mut task);
            averaging.find_pressure_slopes();
        }
        for batch in &self.elements.batches {
            let range = batch.groups.clone();
            let mut task = Product {
                vector,
                corners: [[[0.0; LANES]; 3]; 4],
                pressure_slopes: if batch.averaged_lambda > 0.0 {
                    &averaging.pressure_slopes[range.clone()]
                } else {
                    &[]
                },
                forces: &mut self.corner_forces[range],
            };
            self.elements.run(batch, x, &averaging.pressures, &mut task);
        }
        self.gather(product);
    }

    /// Adds the stiffness at positions `x` [m], that of each element made positive semi-definite, with
    /// the viscosity of a step that begins there.
    ///
    /// # Panics
    /// If the matrix has another pattern than [`Tissue::pattern`].
    pub(crate) fn add_stiffness(&mut self, x: &[Point], stiffness: &mut BlockMatrix) {
        self.find_pressures(x);
        for batch in &self.elements.batches {
            self.add_batch(batch, x, stiffness, &[]);
        }
    }

    /// Writes the stiffness ([`Tissue::add_stiffness`]) between the nodes that `is_wanted` says, and nothing
    /// else. Where volumes are averaged ([`Tissue::averages`]) that would depend on other nodes as well.
    ///
    /// # Panics
    /// As [`Tissue::add_stiffness`].
    pub(crate) fn add_stiffness_between(
        &mut self,
        is_wanted: &[bool],
        x: &[Point],
        stiffness: &mut BlockMatrix,
    ) {
        let pattern = Arc::clone(stiffness.pattern());
        for col in (0..pattern.node_count()).filter(|&col| is_wanted[col]) {
            for (index, &row) in pattern.range(col).zip(pattern.column(col)) {
                if is_wanted[row as usize] {
                    stiffness.blocks_mut()[index] = [[0.0; 3]; 3];
                }
            }
        }
        let groups = &self.elements.layout.groups;
        let has_wanted = |group: &Group| {
            group.corners.as_flattened().iter().any(|&node| is_wanted[node as usize])
        };
        for batch in &self.elements.batches {
            let mut first = batch.groups.start;
            for run in groups[batch.groups.clone()].chunk_by(|a, b| has_wanted(a) == has_wanted(b))
            {
                let range = first..first + run.len();
                first = range.end;
                if has_wanted(&run[0]) {
                    let batch = Batch { groups: range, ..batch.clone() };
                    self.add_batch(&batch, x, stiffness, is_wanted);
                }
            }
        }
    }

    /// Adds the stiffness of groups, between the nodes that `is_wanted` says if it is not empty.
    fn add_batch(
        &self,
        batch: &Batch,
        x: &[Point],
        stiffness: &mut BlockMatrix,
        is_wanted: &[bool],
    ) {
        assert!(
            Arc::ptr_eq(stiffness.pattern(), &self.pattern) || *stiffness.pattern() == self.pattern,
            "pattern of the tetrahedra"
        );
        let mut task = Stiffness {
            lambda: batch.averaged_lambda,
            places: &self.places[batch.groups.clone()],
            is_wanted,
            blocks: stiffness.blocks_mut(),
            values: [[[[0.0; LANES]; 3]; 3]; 10],
            group: 0,
        };
        self.elements.run(batch, x, &self.averaging.pressures, &mut task);
    }

    /// Whether the resistance to change of volume acts on nodal means anywhere.
    pub(crate) fn averages(&self) -> bool {
        self.averaging.group_count() > 0
    }

    /// Tetrahedra that are flat or turned inside out at positions `x` [m].
    #[allow(dead_code, reason = "callers measure volumes themselves")]
    pub(crate) fn inverted(&mut self, x: &[Point]) -> Inverted {
        let mut task = Volumes { volumes: &mut self.energies };
        ElementSet::run_geometric(&self.elements.layout.groups, x, &mut task);
        let mut result = Inverted::default();
        for (volumes, members) in self.energies.iter().zip(&self.elements.layout.members) {
            for (&volume, &member) in volumes.iter().zip(members) {
                // Not a number counts as inverted.
                let upright = volume > 0.0;
                if !upright && member != PADDING {
                    result.count += 1;
                    let first = result.first.map_or(member as usize, |f| f.min(member as usize));
                    result.first = Some(first);
                }
            }
        }
        result
    }

    /// Cauchy stress [Pa] of each tetrahedron at positions `x` [m]: xx, yy, zz, xy, yz, xz. Allocates.
    pub(crate) fn cauchy_stress(&mut self, x: &[Point], stress: &mut [[f64; 6]]) {
        self.find_pressures(x);
        let mut grouped = vec![[[0.0; LANES]; 6]; self.elements.layout.groups.len()];
        for batch in &self.elements.batches {
            let mut task = Stresses { stresses: &mut grouped[batch.groups.clone()] };
            self.elements.run(batch, x, &self.averaging.pressures, &mut task);
        }
        for (group, members) in grouped.iter().zip(&self.elements.layout.members) {
            for (lane, &member) in members.iter().enumerate() {
                if member != PADDING {
                    stress[member as usize] = group.map(|entry| entry[lane]);
                }
            }
        }
    }

    fn find_pressures(&mut self, x: &[Point]) {
        let averaged = self.averaging.group_count();
        if averaged > 0 {
            let mut task = Volumes { volumes: &mut self.averaging.element_volumes };
            ElementSet::run_geometric(&self.elements.layout.groups[..averaged], x, &mut task);
            self.averaging.find_pressures();
        }
    }

    /// Sums the corner forces of each node.
    fn gather(&self, forces: &mut [Point]) {
        let flat = self.corner_forces.as_flattened().as_flattened().as_flattened();
        for (node, force) in forces.iter_mut().enumerate() {
            let mut sum = [0.0; 3];
            for &corner in self.corners.of(node) {
                let corner = &flat[corner as usize..][..=2 * LANES];
                sum[0] += corner[0];
                sum[1] += corner[LANES];
                sum[2] += corner[2 * LANES];
            }
            *force = sum;
        }
    }
}

/// Von Mises stress [Pa] of a Cauchy stress xx, yy, zz, xy, yz, xz [Pa].
pub fn von_mises(stress: &[f64; 6]) -> f64 {
    let [xx, yy, zz, xy, yz, xz] = *stress;
    let axial = (xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2);
    (0.5 * axial + 3.0 * (xy * xy + yz * yz + xz * xz)).sqrt()
}

fn batch(law: Law, averaged: bool, groups: std::ops::Range<usize>) -> Batch {
    let Lame { mu, lambda } = law.lame();
    if averaged {
        let element_lambda = ELEMENT_RATIO * mu;
        Batch {
            law: law.with_lambda(element_lambda),
            viscous: Lame { mu, lambda: element_lambda },
            averaged_lambda: lambda - element_lambda,
            groups,
        }
    } else {
        let viscous = Lame { mu, lambda };
        Batch { law, viscous, averaged_lambda: 0.0, groups }
    }
}
