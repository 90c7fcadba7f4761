//! Attachments: nodes of one body tied to the surface of another, as a ligament ties two organs.

use glam::{DMat3, DVec3};
use palpate_geometry::{Aabb, Point, point_triangle};
use serde::{Deserialize, Serialize};

use super::Body;
use crate::number::Shortest;

/// How far, in mean surface edges of the first body, nodes are tied where nothing else is said.
const REACH: f64 = 0.5;

/// Two bodies that are tied together where they touch in the model.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Attachment {
    /// The body whose nodes are tied, and the one to whose surface, by index in the model.
    pub bodies: [usize; 2],
    /// Stiffness of the tie [Pa/m]; `None`: that of contact between the two bodies.
    pub stiffness: Option<f64>,
    /// The ties, by node; at least one.
    pub ties: Vec<AttachedNode>,
}

/// A node that is tied to a place on or near a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct AttachedNode {
    /// Node of the first body.
    pub node: u32,
    /// Corners of the triangle, nodes of the second body.
    pub corners: [u32; 3],
    /// Barycentric weights of the place on the triangle.
    pub weights: [f64; 3],
    /// From there to the node [m], along [`triangle_axes`].
    pub offset: Point,
}

/// Why two bodies cannot be tied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AttachmentError {
    /// A body and itself.
    #[error("a body cannot be attached to itself")]
    SameBody,
    /// Nothing that could be pulled.
    #[error("`{0}` and `{1}` are both rigid: there is nothing to attach")]
    BothRigid(String, String),
    /// A reach that is not positive and finite, or a stiffness.
    #[error("{what} must be greater than 0, found {found}")]
    NotPositive {
        /// Which number.
        what: &'static str,
        /// What came.
        found: f64,
    },
    /// Bodies that are too far apart.
    #[error(
        "no node of `{first}` is within {} m of `{second}`; the nearest is {} m away",
        rounded(*within), rounded(*nearest)
    )]
    OutOfReach {
        /// Name of the body whose nodes were to be tied.
        first: String,
        /// Name of the other one.
        second: String,
        /// The reach [m].
        within: f64,
        /// The smallest distance of a node [m].
        nearest: f64,
    },
}

/// A length to four digits.
fn rounded(length: f64) -> Shortest {
    Shortest(format!("{length:.3e}").parse().unwrap_or(length))
}

/// Axes that turn with a triangle, as columns: along its first edge, across it, along its normal.
pub fn triangle_axes([a, b, c]: [DVec3; 3]) -> DMat3 {
    let along = (b - a).normalize_or_zero();
    let normal = along.cross(c - a).normalize_or_zero();
    DMat3::from_cols(along, normal.cross(along), normal)
}

impl Attachment {
    /// Ties the surface nodes of the first of `bodies` that are within `within` [m] of the surface of
    /// the second. When the first is rigid they change places: what is tied must be able to move.
    ///
    /// `within` is by default half the mean surface edge of the body whose nodes are tied.
    ///
    /// # Errors
    /// If nothing is within reach, or the bodies cannot be tied.
    ///
    /// # Panics
    /// If a body does not exist.
    pub fn find(
        all: &[Body],
        [mut first, mut second]: [usize; 2],
        within: Option<f64>,
        stiffness: Option<f64>,
    ) -> Result<Self, AttachmentError> {
        if first == second {
            return Err(AttachmentError::SameBody);
        }
        for (what, value) in [("within", within), ("stiffness", stiffness)] {
            if let Some(found) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(AttachmentError::NotPositive { what, found });
            }
        }
        if all[first].rigid.is_some() {
            (first, second) = (second, first);
        }
        let (a, b) = (&all[first], &all[second]);
        if a.rigid.is_some() {
            return Err(AttachmentError::BothRigid(a.name.clone(), b.name.clone()));
        }
        let within = within.unwrap_or_else(|| REACH * a.mesh.mean_surface_edge());
        let triangles: Vec<([u32; 3], [Point; 3], Aabb)> = b
            .mesh
            .triangles()
            .iter()
            .map(|&corners| {
                let points = corners.map(|node| b.mesh.nodes()[node as usize]);
                (corners, points, Aabb::from_points(&points))
            })
            .collect();
        let mut ties = Vec::new();
        let mut nearest = f64::INFINITY;
        for &node in a.mesh.surface_nodes() {
            let point = a.mesh.nodes()[node as usize];
            let Some((distance, tie)) = closest(node, point, &triangles) else { continue };
            nearest = nearest.min(distance);
            // Held nodes cannot be pulled, and need not be.
            if distance <= within && a.fixed_nodes.binary_search(&node).is_err() {
                ties.push(tie);
            }
        }
        if ties.is_empty() {
            let (first, second) = (a.name.clone(), b.name.clone());
            return Err(AttachmentError::OutOfReach { first, second, within, nearest });
        }
        Ok(Self { bodies: [first, second], stiffness, ties })
    }
}

/// The closest place to `point`, with its distance [m]; `None` of no triangles.
fn closest(
    node: u32,
    point: Point,
    triangles: &[([u32; 3], [Point; 3], Aabb)],
) -> Option<(f64, AttachedNode)> {
    let mut best: Option<(f64, AttachedNode)> = None;
    for (corners, points, bounds) in triangles {
        let limit = best.as_ref().map_or(f64::INFINITY, |(distance, _)| distance * distance);
        if bounds.distance_squared(&point) > limit {
            continue;
        }
        let found = point_triangle(point, points);
        if found.distance_squared < limit {
            let corner = points.map(DVec3::from_array);
            let place: DVec3 = corner.iter().zip(found.weights).map(|(&x, w)| w * x).sum();
            let offset = triangle_axes(corner).transpose() * (DVec3::from_array(point) - place);
            let tie = AttachedNode {
                node,
                corners: *corners,
                weights: found.weights,
                offset: offset.to_array(),
            };
            best = Some((found.distance_squared.sqrt(), tie));
        }
    }
    best
}
