//! Sizes and shapes of a mesh: volume, edge length, element quality.

use palpate_geometry::{Point, tetrahedron};

use super::Mesh;

/// Shape of the tetrahedra of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualitySummary {
    /// Smallest radius ratio: 1 for a regular tetrahedron, 0 for a flat one.
    pub worst: f64,
    /// The tetrahedron that has it.
    pub worst_tetrahedron: u32,
    /// Mean radius ratio.
    pub mean: f64,
    /// Smallest angle between two faces of a tetrahedron [degrees].
    pub min_dihedral: f64,
    /// Largest angle between two faces of a tetrahedron [degrees].
    pub max_dihedral: f64,
    /// How many radius ratios are below [`QualitySummary::POOR`].
    pub poor_count: usize,
}

impl QualitySummary {
    /// Below this radius ratio a tetrahedron is so flat that its stiffness spoils the solution
    /// around it.
    pub const POOR: f64 = 0.1;
}

impl Mesh {
    /// Volume [m³]: the sum of the tetrahedra, or what a surface-only mesh encloses (meaningful when
    /// it is closed; negative when its triangles point inward).
    pub fn volume(&self) -> f64 {
        if !self.is_surface_only() {
            return (0..self.tetrahedra().len())
                .map(|index| tetrahedron::signed_volume(&self.tetrahedron_corners(index)))
                .sum();
        }
        // Cones to a nearby apex: far from the origin, cones to it would cancel.
        let apex = self.bounds().center();
        (self.triangles().iter())
            .map(|triangle| {
                let [a, b, c] = triangle.map(|node| self.nodes()[node as usize]);
                tetrahedron::signed_volume(&[apex, a, b, c])
            })
            .sum()
    }

    /// Positions [m] of the four nodes of a tetrahedron.
    ///
    /// # Panics
    /// If `index` is not a tetrahedron of the mesh.
    pub fn tetrahedron_corners(&self, index: usize) -> [Point; 4] {
        self.tetrahedra()[index].map(|node| self.nodes()[node as usize])
    }

    /// Mean length [m] of the surface edges.
    pub fn mean_surface_edge(&self) -> f64 {
        let length = |edge: &[u32; 2]| {
            let [a, b] = edge.map(|node| self.nodes()[node as usize]);
            (0..3).map(|axis| (b[axis] - a[axis]).powi(2)).sum::<f64>().sqrt()
        };
        self.surface_edges().iter().map(length).sum::<f64>() / self.surface_edges().len() as f64
    }

    /// The numbers of its regions, each once, ascending.
    pub(crate) fn region_numbers(&self) -> Vec<i32> {
        let mut numbers = self.regions().to_vec();
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    }

    /// Shape of all tetrahedra; `None` for a surface-only mesh.
    pub fn quality(&self) -> Option<QualitySummary> {
        if self.is_surface_only() {
            return None;
        }
        let mut summary = QualitySummary {
            worst: f64::INFINITY,
            worst_tetrahedron: 0,
            mean: 0.0,
            min_dihedral: 180.0,
            max_dihedral: 0.0,
            poor_count: 0,
        };
        for index in 0..self.tetrahedra().len() {
            let quality = tetrahedron::quality(&self.tetrahedron_corners(index));
            if quality.radius_ratio < summary.worst {
                summary.worst = quality.radius_ratio;
                summary.worst_tetrahedron = index as u32;
            }
            summary.mean += quality.radius_ratio;
            summary.min_dihedral = summary.min_dihedral.min(quality.min_dihedral);
            summary.max_dihedral = summary.max_dihedral.max(quality.max_dihedral);
            summary.poor_count += usize::from(quality.radius_ratio < QualitySummary::POOR);
        }
        summary.mean /= self.tetrahedra().len() as f64;
        Some(summary)
    }
}
