//! Mass, momentum and inertia of a set of moving nodes.

use glam::{DMat3, DVec3};
use palpate_geometry::Point;

/// Rigid part of a body's motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertia {
    /// Centre of mass [m].
    pub(crate) center: DVec3,
    /// Its velocity [m/s].
    pub(crate) velocity: DVec3,
    /// Angular momentum about the centre [kg m²/s].
    pub(crate) spin: DVec3,
    /// Inertia about the centre [kg m²].
    pub(crate) tensor: DMat3,
}

impl Inertia {
    pub(crate) fn new(masses: &[f64], positions: &[Point], velocities: &[Point]) -> Self {
        let mut total = 0.0;
        let (mut center, mut velocity) = (DVec3::ZERO, DVec3::ZERO);
        for ((&m, &x), &v) in masses.iter().zip(positions).zip(velocities) {
            total += m;
            center += m * DVec3::from_array(x);
            velocity += m * DVec3::from_array(v);
        }
        center /= total;
        velocity /= total;
        let mut spin = DVec3::ZERO;
        let mut second = DMat3::ZERO;
        for ((&m, &x), &v) in masses.iter().zip(positions).zip(velocities) {
            let r = DVec3::from_array(x) - center;
            spin += m * r.cross(DVec3::from_array(v) - velocity);
            second += DMat3::from_cols(m * r.x * r, m * r.y * r, m * r.z * r);
        }
        let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
        let tensor = DMat3::from_diagonal(DVec3::splat(trace)) - second;
        Self { center, velocity, spin, tensor }
    }
}
