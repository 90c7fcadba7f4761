//! The loop over the groups of a batch, compiled for the vector unit, and what can be done in it.

use palpate_geometry::Point;
use pulp::{Simd, WithSimd};

use super::dual::{self, Dual};
use super::group::Group;
use super::law::viscosity::{SYMMETRIC, Viscosity, packed_strain};
use super::law::{Directions, ElementLaw, MAX_FAMILIES};
use super::matrix::{self, Matrix};
use super::real::Real;
use super::wide::{Eight, LANES, Wide, parts};

/// A vector at each corner of eight elements.
pub(super) type Corners = [[Eight; 3]; 4];

/// What the groups of a batch need for their stress. Slices have one entry per group, or none.
#[derive(Clone, Copy)]
pub(super) struct BatchInput<'a> {
    pub(super) groups: &'a [Group],
    pub(super) directions: &'a [Directions<Eight>],
    pub(super) viscosity: Option<(Viscosity, &'a [[Eight; 6]])>,
    pub(super) pressures: &'a [Eight],
    pub(super) positions: &'a [Point],
}

/// One job of the kernel.
pub(super) trait Task {
    /// Called once per group, before its elements.
    fn begin_group(&mut self, _group: &Group) {}

    /// Called for each vector of elements.
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>);

    /// Called once per group, after its elements.
    fn finish_group(&mut self, _group: &Group) {}
}

/// A vector of elements at the current positions.
pub(super) struct Elements<S: Simd> {
    pub(super) simd: S,
    /// Group in the batch, and part of the group.
    pub(super) index: usize,
    pub(super) part: usize,
    /// Deformation gradient.
    pub(super) f: Matrix<Wide<S>>,
    pub(super) inverse: Matrix<Wide<S>>,
    pub(super) volume: Wide<S>,
    pub(super) directions: Directions<Wide<S>>,
    pub(super) viscosity: Option<(Viscosity, [Wide<S>; 6])>,
    pub(super) pressure: Option<Wide<S>>,
}

/// A task over a batch.
pub(super) struct Pass<'a, 't, L, T> {
    pub(super) law: L,
    pub(super) input: BatchInput<'a>,
    pub(super) task: &'t mut T,
}

impl<L: ElementLaw, T: Task> WithSimd for Pass<'_, '_, L, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let input = self.input;
        for (index, group) in input.groups.iter().enumerate() {
            let positions = gather(group, input.positions);
            self.task.begin_group(group);
            for part in 0..parts::<S>() {
                let inverse = load(simd, &group.inverse, part);
                let volume = Wide::load(simd, &group.volume, part);
                let mut directions = [[volume.splat(0.0); 3]; MAX_FAMILIES];
                if L::FAMILIES > 0 {
                    for family in 0..L::FAMILIES {
                        for axis in 0..3 {
                            let lanes = &input.directions[index][family][axis];
                            directions[family][axis] = Wide::load(simd, lanes, part);
                        }
                    }
                }
                let viscosity = match input.viscosity {
                    Some((viscosity, starts)) => {
                        let mut start = [volume; 6];
                        for entry in 0..6 {
                            start[entry] = Wide::load(simd, &starts[index][entry], part);
                        }
                        Some((viscosity, start))
                    }
                    None => None,
                };
                let mut pressure = None;
                if let Some(pressures) = input.pressures.get(index) {
                    pressure = Some(Wide::load(simd, pressures, part));
                }
                let f = matrix::transpose_multiply(&edges(simd, &positions, part), &inverse);
                self.task.elements(
                    &self.law,
                    &Elements {
                        simd,
                        index,
                        part,
                        f,
                        inverse,
                        volume,
                        directions,
                        viscosity,
                        pressure,
                    },
                );
            }
            self.task.finish_group(group);
        }
    }
}

/// Vectors of the nodes at the corners.
#[inline(always)]
pub(super) fn gather(group: &Group, nodes: &[Point]) -> Corners {
    let mut result = [[[0.0; LANES]; 3]; 4];
    for corner in 0..4 {
        for lane in 0..LANES {
            let node = nodes[group.corners[corner][lane] as usize];
            for axis in 0..3 {
                result[corner][axis][lane] = node[axis];
            }
        }
    }
    result
}

/// Differences to the first corner, one per row.
#[inline(always)]
pub(super) fn edges<S: Simd>(simd: S, corners: &Corners, part: usize) -> Matrix<Wide<S>> {
    let origin = Wide::load(simd, &corners[0][0], part);
    let mut result = matrix::zero(origin);
    for axis in 0..3 {
        let origin = Wide::load(simd, &corners[0][axis], part);
        for edge in 0..3 {
            result[edge][axis] = Wide::load(simd, &corners[edge + 1][axis], part) - origin;
        }
    }
    result
}

#[inline(always)]
fn load<S: Simd>(simd: S, eights: &Matrix<Eight>, part: usize) -> Matrix<Wide<S>> {
    let mut result = matrix::zero(Wide::load(simd, &eights[0][0], part));
    for row in 0..3 {
        for col in 0..3 {
            result[row][col] = Wide::load(simd, &eights[row][col], part);
        }
    }
    result
}

impl<S: Simd> Elements<S> {
    /// First Piola-Kirchhoff stress [Pa]: law, viscosity, averaged pressure.
    #[inline(always)]
    pub(super) fn stress<L: ElementLaw>(&self, law: &L) -> Matrix<Wide<S>> {
        let mut stress = law.stress(&self.f, &self.directions);
        if let Some((viscosity, start)) = &self.viscosity {
            stress = matrix::add(&stress, &viscosity.stress(&self.f, start));
        }
        if let Some(pressure) = self.pressure {
            let cofactor = matrix::cofactor(&self.f);
            stress = matrix::add(&stress, &matrix::scale(pressure, &cofactor));
        }
        stress
    }

    /// Change of the stress along `slope` of the deformation gradient, with pressures that change by
    /// `lambda` times the change of volume and by `pressure_slope`.
    #[inline(always)]
    pub(super) fn stress_slope<L: ElementLaw>(
        &self,
        law: &L,
        slope: &Matrix<Wide<S>>,
        lambda: f64,
        pressure_slope: Wide<S>,
    ) -> Matrix<Wide<S>> {
        let f = dual::join(&self.f, slope);
        let constant = |value: Wide<S>| Dual { value, slope: value.splat(0.0) };
        let mut directions = [[constant(self.volume); 3]; MAX_FAMILIES];
        for family in 0..MAX_FAMILIES {
            for axis in 0..3 {
                directions[family][axis] = constant(self.directions[family][axis]);
            }
        }
        let mut stress = law.stress(&f, &directions);
        if let Some((viscosity, start)) = &self.viscosity {
            let mut starts = [constant(start[0]); 6];
            for entry in 0..6 {
                starts[entry] = constant(start[entry]);
            }
            stress = matrix::add(&stress, &viscosity.stress(&f, &starts));
        }
        if let Some(pressure) = self.pressure {
            let cofactor = matrix::cofactor(&f);
            let change = matrix::determinant(&f, &cofactor).slope;
            let pressure =
                Dual { value: pressure, slope: pressure_slope + change.splat(lambda) * change };
            stress = matrix::add(&stress, &matrix::scale(pressure, &cofactor));
        }
        dual::split(&stress).1
    }

    /// Forces at the corners: minus the volume times the stress times the shape gradients.
    #[inline(always)]
    fn store_forces(&self, stress: &Matrix<Wide<S>>, corners: &mut Corners) {
        let stress = matrix::scale(-self.volume, stress);
        for axis in 0..3 {
            let mut sum = self.volume.splat(0.0);
            for corner in 0..3 {
                let gradient = &self.inverse[corner];
                let force = stress[axis][0] * gradient[0]
                    + stress[axis][1] * gradient[1]
                    + stress[axis][2] * gradient[2];
                force.store(&mut corners[corner + 1][axis], self.part);
                sum = sum - force;
            }
            sum.store(&mut corners[0][axis], self.part);
        }
    }
}

/// Forces [N] at the corners.
pub(super) struct Forces<'a> {
    pub(super) forces: &'a mut [Corners],
}

impl Task for Forces<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>) {
        elements.store_forces(&elements.stress(law), &mut self.forces[elements.index]);
    }
}

/// Energy [J] of each element, without averaged pressures.
pub(super) struct Energies<'a> {
    pub(super) energies: &'a mut [Eight],
}

impl Task for Energies<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>) {
        let mut density = law.energy(&elements.f, &elements.directions);
        if let Some((viscosity, start)) = &elements.viscosity {
            density = density + viscosity.energy(&elements.f, start);
        }
        (elements.volume * density).store(&mut self.energies[elements.index], elements.part);
    }
}

/// Green's strain.
pub(super) struct Strains<'a> {
    pub(super) strains: &'a mut [[Eight; 6]],
}

impl Task for Strains<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, _: &L, elements: &Elements<S>) {
        let strain = packed_strain(&elements.f);
        for entry in 0..6 {
            strain[entry].store(&mut self.strains[elements.index][entry], elements.part);
        }
    }
}

/// Current volumes [m³].
pub(super) struct Volumes<'a> {
    pub(super) volumes: &'a mut [Eight],
}

impl Task for Volumes<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, _: &L, elements: &Elements<S>) {
        let ratio = matrix::determinant(&elements.f, &matrix::cofactor(&elements.f));
        (elements.volume * ratio).store(&mut self.volumes[elements.index], elements.part);
    }
}

/// Change of the volumes [m³] along `vector`.
pub(super) struct VolumeSlopes<'a> {
    pub(super) vector: &'a [Point],
    pub(super) corners: Corners,
    pub(super) volumes: &'a mut [Eight],
}

impl Task for VolumeSlopes<'_> {
    #[inline(always)]
    fn begin_group(&mut self, group: &Group) {
        self.corners = gather(group, self.vector);
    }

    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, _: &L, elements: &Elements<S>) {
        let edges = edges(elements.simd, &self.corners, elements.part);
        let slope = matrix::transpose_multiply(&edges, &elements.inverse);
        let change = matrix::dot(&matrix::cofactor(&elements.f), &slope);
        (elements.volume * change).store(&mut self.volumes[elements.index], elements.part);
    }
}

/// Minus the change of the forces along `vector`, with pressures that change by `pressure_slopes`.
pub(super) struct Product<'a> {
    pub(super) vector: &'a [Point],
    pub(super) corners: Corners,
    pub(super) pressure_slopes: &'a [Eight],
    pub(super) forces: &'a mut [Corners],
}

impl Task for Product<'_> {
    #[inline(always)]
    fn begin_group(&mut self, group: &Group) {
        self.corners = gather(group, self.vector);
    }

    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>) {
        let edges = edges(elements.simd, &self.corners, elements.part);
        let slope = matrix::transpose_multiply(&edges, &elements.inverse);
        let pressure_slope = match self.pressure_slopes.get(elements.index) {
            Some(slopes) => Wide::load(elements.simd, slopes, elements.part),
            None => elements.volume.splat(0.0),
        };
        let change = elements.stress_slope(law, &slope, 0.0, pressure_slope);
        let change = matrix::scale(elements.volume.splat(-1.0), &change);
        elements.store_forces(&change, &mut self.forces[elements.index]);
    }
}

/// Cauchy stress [Pa].
pub(super) struct Stresses<'a> {
    pub(super) stresses: &'a mut [[Eight; 6]],
}

impl Task for Stresses<'_> {
    #[inline(always)]
    fn elements<S: Simd, L: ElementLaw>(&mut self, law: &L, elements: &Elements<S>) {
        let ratio = matrix::determinant(&elements.f, &matrix::cofactor(&elements.f));
        let stress = matrix::multiply(&elements.stress(law), &matrix::transpose(&elements.f));
        for entry in 0..6 {
            let [row, col] = SYMMETRIC[entry];
            let lanes = &mut self.stresses[elements.index][entry];
            (stress[row][col] / ratio).store(lanes, elements.part);
        }
    }
}
