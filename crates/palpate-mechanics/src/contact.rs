//! Contact: from close pairs to forces that push bodies apart.

pub(crate) mod compliance;
mod coupling;
pub(crate) mod filter;
pub(crate) mod gauss_seidel;
pub(crate) mod last_forces;
mod law;
pub(crate) mod node_compliance;
mod patch;
pub(crate) mod problem;
pub(crate) mod response;
mod surface;
mod touch;
#[cfg(test)]
mod twin;

use palpate_contact::PairKind;
use palpate_geometry::Point;
use palpate_model::Body;

use crate::error::{MechanicsError, check_parameters};
pub use patch::{Patch, PatchMemory};
pub(crate) use surface::Surface;
pub use touch::Touch;

/// A contact that carried a force in the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Which elements touch.
    pub kind: PairKind,
    /// Body of side a and of side b.
    pub bodies: [u32; 2],
    /// Vertex-triangle: the node of side a, the triangle's nodes of side b. Edge-edge: two and two.
    pub nodes: [u32; 4],
    /// Weights of the nodes: the contact points are their weighted sums, positive on side a and
    /// negative on side b.
    pub weights: [f64; 4],
    /// Unit vector along which side a is pushed.
    pub normal: Point,
    /// Middle between the two contact points at the start of the step [m].
    pub point: Point,
    /// Distance between the surfaces at the end of the step [m]; negative when they overlap.
    pub gap: f64,
    /// Normal force [N], positive.
    pub normal_force: f64,
    /// Friction force on side a [N], across the normal.
    pub friction_force: Point,
}

impl Contact {
    /// The whole force on side a [N]; side b feels the opposite.
    pub fn force(&self) -> Point {
        std::array::from_fn(|k| self.normal_force * self.normal[k] + self.friction_force[k])
    }

    /// Body of the node in place `corner` of `nodes`.
    pub fn body_of(&self, corner: usize) -> usize {
        self.bodies[side(self.kind, corner)] as usize
    }
}

/// Side (0 or 1) of the node in place `corner` of a pair.
pub(crate) fn side(kind: PairKind, corner: usize) -> usize {
    match kind {
        PairKind::VertexTriangle => usize::from(corner > 0),
        PairKind::EdgeEdge => usize::from(corner > 1),
    }
}

/// Penalty pressure per overlap of a body: this many times its Young's modulus over its mean edge.
/// Stiffer than the elements behind the surface, so that the overlap stays well below the contact
/// distance, and soft enough to share the load among neighbouring nodes.
const STIFFNESS_FACTOR: f64 = 5.0;
/// Contact distance of a body, in mean surface edges.
const DISTANCE_FACTOR: f64 = 0.1;

/// Contact parameters of one body, defaults filled in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactParameters {
    /// Contact distance [m]; `None`: that of the partner.
    distance: Option<f64>,
    /// What counts when the partner has no distance either [m].
    own_distance: f64,
    /// Penalty pressure per overlap [Pa/m]; `None`: that of the partner.
    stiffness: Option<f64>,
    friction: f64,
    pub(crate) rigid: bool,
    pub(crate) self_contact: bool,
    pub(crate) mean_edge: f64,
}

impl ContactParameters {
    pub(crate) fn new(index: usize, body: &Body) -> Result<Self, MechanicsError> {
        let settings = &body.contact;
        let positive = |value: Option<f64>| value.is_none_or(|v| v.is_finite() && v > 0.0);
        let friction = settings.friction;
        let checks = [
            ("friction", friction, friction.is_finite() && friction >= 0.0, "a number >= 0"),
            (
                "contact distance",
                settings.distance.unwrap_or(0.0),
                positive(settings.distance),
                "a positive number of m",
            ),
            (
                "contact stiffness",
                settings.stiffness.unwrap_or(0.0),
                positive(settings.stiffness),
                "a positive number of Pa/m",
            ),
        ];
        check_parameters(index, body, &checks)?;
        let mean_edge = body.mesh.mean_surface_edge();
        let rigid = body.rigid.is_some();
        let own_distance = settings.distance.unwrap_or(DISTANCE_FACTOR * mean_edge);
        let stiffness = STIFFNESS_FACTOR * body.material.young / mean_edge;
        Ok(Self {
            distance: settings.distance.or((!rigid).then_some(own_distance)),
            own_distance,
            stiffness: settings.stiffness.or((!rigid).then_some(stiffness)),
            friction,
            rigid,
            self_contact: settings.self_contact,
            mean_edge,
        })
    }

    /// Mean edge [m] of a deformable body; a rigid one puts no limit.
    pub(crate) fn soft_edge(&self) -> f64 {
        if self.rigid { f64::INFINITY } else { self.mean_edge }
    }

    /// Contact distance between two bodies: the mean [m].
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        match (self.distance, other.distance) {
            (Some(a), Some(b)) => 0.5 * (a + b),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => 0.5 * (self.own_distance + other.own_distance),
        }
    }

    /// Penalty pressure per overlap between two bodies: the harmonic mean [Pa/m].
    pub(crate) fn stiffness(&self, other: &Self) -> f64 {
        match (self.stiffness, other.stiffness) {
            (Some(a), Some(b)) => 2.0 * a * b / (a + b),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => 0.0,
        }
    }

    /// Friction coefficient between two bodies: the geometric mean.
    pub(crate) fn friction(&self, other: &Self) -> f64 {
        (self.friction * other.friction).sqrt()
    }
}
