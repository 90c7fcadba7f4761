//! Nearly incompressible tissue: the change of volume averaged at the nodes.
//!
//! A linear tetrahedron that must keep its volume cannot bend: the mesh locks. Here the resistance to
//! change of volume acts on the mean over the tetrahedra of a node instead (Bonet, Burton, Commun.
//! Numer. Meth. Eng. 14 (1998)): `W = Σ_a V_a k/2 (J_a - 1)²` with `J_a = v_a / V_a`, each tetrahedron
//! giving a quarter of its volume to each of its nodes. Nodes between two regions have one mean for
//! each. The pressure of a tetrahedron is the mean of `k (J_a - 1)` over its nodes, so the forces are
//! the exact gradient.

use palpate_model::Lists;

use super::group::{Batch, Group, PADDING};
use super::wide::{Eight, LANES};

/// The averaging points: nodes, once for each region that averages.
#[derive(Debug, Default)]
pub(super) struct Averaging {
    /// Point of each corner, for the groups that average (the first ones).
    corner_points: Vec<[[u32; LANES]; 4]>,
    /// Tetrahedra of each point as `8 * group + lane`.
    tetrahedra: Lists<u32>,
    /// Four times the rest volume [m³], and what it resists with [Pa].
    volumes: Vec<f64>,
    lambdas: Vec<f64>,
    /// Per point: pressure [Pa].
    point_pressures: Vec<f64>,
    /// Per group: what the kernel writes (volumes) and reads (pressures).
    pub(super) element_volumes: Vec<Eight>,
    pub(super) pressures: Vec<Eight>,
    pub(super) pressure_slopes: Vec<Eight>,
}

impl Averaging {
    /// `batches` that average come first.
    pub(super) fn new(batches: &[Batch], groups: &[Group], members: &[[u32; LANES]]) -> Self {
        let mut result = Self::default();
        let mut entries: Vec<(u32, u32)> = Vec::new();
        for batch in batches.iter().filter(|batch| batch.averaged_lambda > 0.0) {
            let range = batch.groups.clone();
            let mut nodes: Vec<u32> =
                groups[range.clone()].iter().flat_map(|g| g.corners).flatten().collect();
            nodes.sort_unstable();
            nodes.dedup();
            let first = result.lambdas.len() as u32;
            result.lambdas.resize(first as usize + nodes.len(), batch.averaged_lambda);
            result.volumes.resize(result.lambdas.len(), 0.0);
            for index in range {
                let points = groups[index].corners.map(|corner| {
                    corner.map(|node| {
                        first + nodes.binary_search(&node).expect("collected above") as u32
                    })
                });
                for corner in points {
                    for (lane, point) in corner.into_iter().enumerate() {
                        if members[index][lane] != PADDING {
                            entries.push((point, (LANES * index + lane) as u32));
                            result.volumes[point as usize] += groups[index].volume[lane];
                        }
                    }
                }
                result.corner_points.push(points);
            }
        }
        entries.sort_unstable();
        result.tetrahedra = Lists::new(result.lambdas.len(), entries.into_iter());
        result.point_pressures = vec![0.0; result.lambdas.len()];
        let count = result.corner_points.len();
        result.element_volumes = vec![[0.0; LANES]; count];
        result.pressures = vec![[0.0; LANES]; count];
        result.pressure_slopes = vec![[0.0; LANES]; count];
        result
    }

    /// Groups that average.
    pub(super) fn group_count(&self) -> usize {
        self.corner_points.len()
    }

    /// Energy [J] for the volumes in `element_volumes`.
    pub(super) fn energy(&self) -> f64 {
        let points = self.volumes.iter().zip(&self.lambdas).enumerate();
        points
            .map(|(point, (&volume, &lambda))| {
                let change = self.sum(point) / volume - 1.0;
                0.125 * volume * lambda * change * change
            })
            .sum()
    }

    /// Pressures for the volumes in `element_volumes`.
    pub(super) fn find_pressures(&mut self) {
        self.find_point_pressures(1.0);
        let (points, pressures) = (&self.point_pressures, &mut self.pressures);
        spread(&self.corner_points, points, pressures);
    }

    /// Changes of the pressures for the changes of volume in `element_volumes`.
    pub(super) fn find_pressure_slopes(&mut self) {
        self.find_point_pressures(0.0);
        let (points, slopes) = (&self.point_pressures, &mut self.pressure_slopes);
        spread(&self.corner_points, points, slopes);
    }

    fn find_point_pressures(&mut self, rest: f64) {
        for point in 0..self.lambdas.len() {
            let ratio = self.sum(point) / self.volumes[point];
            self.point_pressures[point] = self.lambdas[point] * (ratio - rest);
        }
    }

    fn sum(&self, point: usize) -> f64 {
        let volumes = self.element_volumes.as_flattened();
        self.tetrahedra.of(point as u32).iter().map(|&entry| volumes[entry as usize]).sum()
    }
}

/// Means over the corners.
fn spread(corner_points: &[[[u32; LANES]; 4]], points: &[f64], elements: &mut [Eight]) {
    for (corners, element) in corner_points.iter().zip(elements) {
        for lane in 0..LANES {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| points[corners[k][lane] as usize]);
            element[lane] = 0.25 * ((a + b) + (c + d));
        }
    }
}
