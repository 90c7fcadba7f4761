//! Energy and momentum of bodies, for tests and reports.

use glam::DVec3;
use palpate_geometry::Point;

use crate::body::{BodyKind, MovingBody};

/// Energy of the deformable bodies [J].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of motion.
    pub kinetic: f64,
    /// Of deformation.
    pub elastic: f64,
    /// Of height, zero at the origin.
    pub gravitational: f64,
}

impl Energy {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.gravitational
    }

    pub(crate) fn add(&mut self, body: &mut MovingBody) {
        let BodyKind::Elastic(elastic) = &mut body.kind else { return };
        self.elastic += elastic.elastic_energy(&body.positions);
        for ((&m, &x), &v) in elastic.masses().iter().zip(&body.positions).zip(&body.velocities) {
            self.kinetic += 0.5 * m * DVec3::from_array(v).length_squared();
            self.gravitational -= m * elastic.gravity().dot(DVec3::from_array(x));
        }
    }
}

/// Momentum of deformable bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// Linear momentum [kg m/s].
    pub linear: Point,
    /// Angular momentum about the origin [kg m²/s].
    pub angular: Point,
}

impl Momentum {
    pub(crate) fn add(&mut self, body: &MovingBody) {
        let BodyKind::Elastic(elastic) = &body.kind else { return };
        let mut linear = DVec3::from_array(self.linear);
        let mut angular = DVec3::from_array(self.angular);
        for ((&m, &x), &v) in elastic.masses().iter().zip(&body.positions).zip(&body.velocities) {
            let impulse = m * DVec3::from_array(v);
            linear += impulse;
            angular += DVec3::from_array(x).cross(impulse);
        }
        *self = Self { linear: linear.to_array(), angular: angular.to_array() };
    }
}
