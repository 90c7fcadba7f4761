//! Tetrahedra in groups of eight, one lane each, all of one region.

use std::ops::Range;

use glam::{DMat3, DVec3};
use palpate_geometry::Point;

use super::law::{Directions, Lame, Law, MAX_FAMILIES};
use super::matrix::Matrix;
use super::wide::{Eight, LANES};

/// No tetrahedron: a lane that only fills a group.
pub(super) const PADDING: u32 = u32::MAX;

/// Eight tetrahedra. Lanes that fill a group repeat its first tetrahedron with volume 0.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Group {
    /// Node of each corner.
    pub(super) corners: [[u32; LANES]; 4],
    /// Inverse of the matrix of the rest edges [1/m]: row i is the shape gradient of corner i + 1.
    pub(super) inverse: Matrix<Eight>,
    /// Rest volume [m³].
    pub(super) volume: Eight,
}

/// The groups of one region.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    /// The law, with lambda capped where the volume is averaged.
    pub(super) law: Law,
    /// Lamé parameters of the viscosity.
    pub(super) viscous: Lame,
    /// What averaged pressures add to lambda, and the stiffness of single elements counts [Pa]; 0: none.
    pub(super) averaged_lambda: f64,
    pub(super) groups: Range<usize>,
}

/// All groups, and the tetrahedron in each lane.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub(super) groups: Vec<Group>,
    /// Index of each tetrahedron, or [`PADDING`].
    pub(super) members: Vec<[u32; LANES]>,
    /// Fibre directions per group; empty if no law has any.
    pub(super) directions: Vec<Directions<Eight>>,
}

impl Layout {
    /// Appends `tetrahedra` (indices into `corners`) as groups and returns which they are.
    pub(super) fn append(
        &mut self,
        rest: &[Point],
        corners: &[[u32; 4]],
        tetrahedra: &[u32],
        fibres: &[[Point; MAX_FAMILIES]],
    ) -> Range<usize> {
        let first = self.groups.len();
        for members in tetrahedra.chunks(LANES) {
            let mut group = Group {
                corners: [[0; LANES]; 4],
                inverse: [[[0.0; LANES]; 3]; 3],
                volume: [0.0; LANES],
            };
            let mut indices = [PADDING; LANES];
            let mut directions = [[[0.0; LANES]; 3]; MAX_FAMILIES];
            for lane in 0..LANES {
                let member = members.get(lane).copied();
                let tetrahedron = member.unwrap_or(members[0]) as usize;
                let nodes = corners[tetrahedron];
                let [origin, a, b, c] = nodes.map(|node| DVec3::from_array(rest[node as usize]));
                let edges = DMat3::from_cols(a - origin, b - origin, c - origin);
                let inverse = edges.inverse();
                for corner in 0..4 {
                    group.corners[corner][lane] = nodes[corner];
                }
                for row in 0..3 {
                    for col in 0..3 {
                        group.inverse[row][col][lane] = inverse.col(col)[row];
                    }
                }
                if let Some(member) = member {
                    group.volume[lane] = edges.determinant() / 6.0;
                    indices[lane] = member;
                }
                for (family, direction) in directions.iter_mut().enumerate() {
                    for (axis, lanes) in direction.iter_mut().enumerate() {
                        lanes[lane] = fibres.get(tetrahedron).map_or(0.0, |f| f[family][axis]);
                    }
                }
            }
            self.groups.push(group);
            self.members.push(indices);
            if !fibres.is_empty() {
                self.directions.push(directions);
            }
        }
        first..self.groups.len()
    }
}
