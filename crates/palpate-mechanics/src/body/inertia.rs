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
        let mut sum = RunningInertia::default();
        for ((&m, &x), &v) in masses.iter().zip(positions).zip(velocities) {
            sum.add(m, DVec3::from_array(x), DVec3::from_array(v));
        }
        sum.finish()
    }
}

/// Sums over nodes in one pass, about the first node: bodies may be far from the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunningInertia {
    origin: Option<(DVec3, DVec3)>,
    mass: f64,
    first: DVec3,
    momentum: DVec3,
    second: DMat3,
    spin: DVec3,
}

impl Default for RunningInertia {
    fn default() -> Self {
        let zero = DVec3::ZERO;
        Self {
            origin: None,
            mass: 0.0,
            first: zero,
            momentum: zero,
            second: DMat3::ZERO,
            spin: zero,
        }
    }
}

impl RunningInertia {
    #[inline]
    pub(super) fn add(&mut self, mass: f64, position: DVec3, velocity: DVec3) {
        let (origin, drift) = *self.origin.get_or_insert((position, velocity));
        let (r, v) = (position - origin, velocity - drift);
        self.mass += mass;
        self.first += mass * r;
        self.momentum += mass * v;
        self.second += DMat3::from_cols(mass * r.x * r, mass * r.y * r, mass * r.z * r);
        self.spin += mass * r.cross(v);
    }

    pub(super) fn finish(self) -> Inertia {
        let (origin, drift) = self.origin.unwrap_or_default();
        let (r, v) = (self.first / self.mass, self.momentum / self.mass);
        let shift = DMat3::from_cols(r.x * self.first, r.y * self.first, r.z * self.first);
        let second = self.second - shift;
        let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
        Inertia {
            center: origin + r,
            velocity: drift + v,
            spin: self.spin - self.first.cross(v),
            tensor: DMat3::from_diagonal(DVec3::splat(trace)) - second,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_about_a_node_equal_sums_about_the_centre() {
        let masses = [1.0, 2.0, 0.5, 3.0];
        let positions = [[1.0, 2.0, 3.0], [0.0, 1.0, -1.0], [2.0, 0.5, 0.0], [-1.0, 0.0, 1.0]];
        let velocities = [[0.1, 0.0, 0.3], [0.0, -1.0, 0.2], [0.5, 0.5, 0.0], [0.0, 0.7, -0.1]];
        let found = Inertia::new(&masses, &positions, &velocities);
        let nodes = || {
            let vectors = |list: [Point; 4]| list.map(DVec3::from_array);
            masses.into_iter().zip(vectors(positions)).zip(vectors(velocities))
        };
        let center = nodes().map(|((m, x), _)| m * x).sum::<DVec3>() / 6.5;
        let velocity = nodes().map(|((m, _), v)| m * v).sum::<DVec3>() / 6.5;
        let spin: DVec3 = nodes().map(|((m, x), v)| m * (x - center).cross(v - velocity)).sum();
        let about = |axis: DVec3| -> DVec3 {
            nodes().map(|((m, x), _)| m * (x - center).cross(axis.cross(x - center))).sum()
        };
        assert!(found.center.abs_diff_eq(center, 1e-14));
        assert!(found.velocity.abs_diff_eq(velocity, 1e-14));
        assert!(found.spin.abs_diff_eq(spin, 1e-14), "{} {spin}", found.spin);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            assert!(
                (found.tensor * axis).abs_diff_eq(about(axis), 1e-13),
                "{} {}",
                found.tensor * axis,
                about(axis)
            );
        }
    }
}
