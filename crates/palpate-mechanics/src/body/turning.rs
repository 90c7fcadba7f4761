//! How an unattached body turns under contact forces.
//!
//! The linear law's stiffness is that of the rest shape, so its null space holds the rotations of the rest shape
//! and not those of the deformed one: `A^-1 f` gives a deformed body a wrong angular momentum. With
//! Q the rotations of the body as it is and `S = (Q^T M Q)^-1` the response is instead
//!
//! `P = (1 - Q S Q^T M) A^-1 (1 - M Q S Q^T) + k Q S Q^T`, k = dt² / (1 + alpha dt),
//!
//! symmetric, positive, and with `Q^T M P = k Q^T`: contact torques change the spin by what they are.
//!
//! Forces act where the step begins ([`Levers`]), Q turns the body as it is predicted: where a `Q^T` meets a
//! force it is that of the levers. The difference is the deformation of a step, but what is squeezed
//! between a tool and the ground bears forces by which a lever that is wrong by a millimetre turns it by radians.

use glam::{DMat3, DVec3};

/// Largest change of an arm from another shape, relative to the longest arm.
pub(super) fn largest_change(
    arms: impl Iterator<Item = DVec3>,
    others: impl Iterator<Item = DVec3>,
) -> f64 {
    let (mut change, mut radius) = (0.0_f64, 0.0_f64);
    for (arm, other) in arms.zip(others) {
        change = change.max((arm - other).length_squared());
        radius = radius.max(arm.length_squared());
    }
    (change / radius).sqrt()
}

/// Where forces act on one body: arms about its centre where the step begins, in the frame [m]. With others
/// two bodies would not change their angular momentum by opposite amounts.
#[derive(Debug, Default)]
pub(crate) struct Levers(pub(super) Vec<DVec3>);

impl Levers {
    pub(crate) fn of(&self, node: u32) -> DVec3 {
        self.0[node as usize]
    }

    /// Sum of forces on all nodes, in the frame [N], and their torque [N m].
    pub(super) fn load_and_torque(&self, forces: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
        load_and_torque(&self.0, forces)
    }
}

fn load_and_torque(arms: &[DVec3], forces: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    let sum = |[load, torque]: [DVec3; 2], (r, f): (&DVec3, DVec3)| [load + f, torque + r.cross(f)];
    arms.iter().zip(forces).fold([DVec3::ZERO; 2], sum)
}

/// Rotations of one body in its frame.
#[derive(Debug, Default)]
pub(super) struct Rotations {
    /// Arm of every node about the centre, in the frame [m].
    arms: Vec<DVec3>,
    /// S, the inverse inertia [1/(kg m²)].
    inverse_inertia: DMat3,
    /// k [s²].
    gain: f64,
}

impl Rotations {
    /// Takes the arms of all nodes about their centre; false if the body has no inertia about an axis.
    pub(super) fn set(
        &mut self,
        masses: &[f64],
        arms: impl Iterator<Item = DVec3>,
        gain: f64,
    ) -> bool {
        self.arms.clear();
        self.arms.extend(arms);
        self.gain = gain;
        let mut second = DMat3::ZERO;
        for (&m, &r) in masses.iter().zip(&self.arms) {
            second += DMat3::from_cols(m * r.x * r, m * r.y * r, m * r.z * r);
        }
        let trace = second.x_axis.x + second.y_axis.y + second.z_axis.z;
        self.inverse_inertia = (DMat3::from_diagonal(DVec3::splat(trace)) - second).inverse();
        self.inverse_inertia.is_finite()
    }

    /// Arms of all nodes about the centre, in the frame [m].
    pub(super) fn arms(&self) -> &[DVec3] {
        &self.arms
    }

    /// Angular momentum of displacements.
    fn moment(&self, masses: &[f64], values: &[[f64; 3]]) -> DVec3 {
        let terms = masses.iter().zip(&self.arms).zip(values);
        terms.map(|((&m, r), &d)| m * r.cross(DVec3::from_array(d))).sum()
    }

    /// Acceleration of the nodes by a torque about the centre, over time [m/s²].
    pub(super) fn turned_by(&self, torque: DVec3) -> impl Iterator<Item = DVec3> {
        let turn = self.inverse_inertia * torque;
        self.arms.iter().map(move |&r| turn.cross(r))
    }

    /// Takes the inertial loads of the motion as a whole out of `loads`.
    pub(super) fn take_whole(&self, masses: &[f64], mass: f64, loads: &mut [[f64; 3]]) {
        let forces = loads.iter().map(|&f| DVec3::from_array(f));
        let [load, torque] = load_and_torque(&self.arms, forces);
        self.take_inertial(masses, load / mass, torque, loads);
    }

    /// Takes the inertial loads of an acceleration, and of the turn that a torque causes, out of `loads`.
    fn take_inertial(
        &self,
        masses: &[f64],
        acceleration: DVec3,
        torque: DVec3,
        loads: &mut [[f64; 3]],
    ) {
        for ((&m, turned), f) in masses.iter().zip(self.turned_by(torque)).zip(loads) {
            *f = (DVec3::from_array(*f) - m * (acceleration + turned)).to_array();
        }
    }

    /// Takes the inertial loads of the turn out of `loads`; returns their torque.
    pub(super) fn balance(&self, masses: &[f64], levers: &Levers, loads: &mut [[f64; 3]]) -> DVec3 {
        let [_, torque] = levers.load_and_torque(loads.iter().map(|&f| DVec3::from_array(f)));
        self.take_inertial(masses, DVec3::ZERO, torque, loads);
        torque
    }

    /// Replaces the turn in `response` by the one that `torque` causes.
    pub(super) fn turn(&self, masses: &[f64], torque: DVec3, response: &mut [[f64; 3]]) {
        let moment = self.moment(masses, response);
        let turn = self.inverse_inertia * (self.gain * torque - moment);
        for (r, d) in self.arms.iter().zip(response) {
            *d = (DVec3::from_array(*d) + turn.cross(*r)).to_array();
        }
    }
}

/// Rotations of one body and its response to their inertial loads.
#[derive(Debug, Default)]
pub(crate) struct Turning {
    rotations: Rotations,
    /// Z = A^-1 M Q: entry `3 * axis + k` is along k for the rotation about `axis`.
    pub(super) loaded: Vec<[f64; 9]>,
    /// `S Q^T M Z S + k S`.
    both: DMat3,
}

impl Turning {
    /// Takes the arms of all nodes about their centre and fills `loaded` with M Q, which the caller
    /// solves with A before [`Turning::finish`].
    pub(super) fn begin(
        &mut self,
        masses: &[f64],
        arms: impl Iterator<Item = DVec3>,
        gain: f64,
    ) -> bool {
        let turns = self.rotations.set(masses, arms, gain);
        self.loaded.clear();
        for (&m, &r) in masses.iter().zip(&self.rotations.arms) {
            let rotations = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| m * axis.cross(r));
            self.loaded.push(std::array::from_fn(|entry| rotations[entry / 3][entry % 3]));
        }
        turns
    }

    /// Completes what [`Turning::begin`] began.
    pub(super) fn finish(&mut self, masses: &[f64]) {
        let s = self.rotations.inverse_inertia;
        let mut inner = DMat3::ZERO;
        for ((&m, &r), z) in masses.iter().zip(&self.rotations.arms).zip(&self.loaded) {
            let [x, y, z] = columns(z).map(|column| m * r.cross(column));
            inner += DMat3::from_cols(x, y, z);
        }
        self.both = s * (0.5 * (inner + inner.transpose())) * s + self.rotations.gain * s;
    }

    /// The rotations that it holds for.
    pub(super) fn rotations(&self) -> &Rotations {
        &self.rotations
    }

    /// What P adds to the response of A^-1 alone to a force on a node with a `lever`: a turn t and a
    /// counter-turn c per force, by which a node moves `t x arm - response c`.
    pub(crate) fn coefficients(&self, node: u32, lever: DVec3) -> [DMat3; 2] {
        let s = self.rotations.inverse_inertia;
        let torque =
            DMat3::from_cols(lever.cross(DVec3::X), lever.cross(DVec3::Y), lever.cross(DVec3::Z));
        [self.both * torque - s * self.response(node).transpose(), s * torque]
    }

    /// Arm of a node about the centre, in the frame [m].
    pub(crate) fn arm(&self, node: u32) -> DVec3 {
        self.rotations.arms[node as usize]
    }

    /// Displacement of a node per counter-turn.
    pub(crate) fn response(&self, node: u32) -> DMat3 {
        DMat3::from_cols_array(&self.loaded[node as usize])
    }
}

fn columns(entries: &[f64; 9]) -> [DVec3; 3] {
    let [a, b, c, d, e, f, g, h, i] = *entries;
    [DVec3::new(a, b, c), DVec3::new(d, e, f), DVec3::new(g, h, i)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_response_to_forces_is_that_of_its_columns_and_keeps_the_torque() {
        let masses = [1.0, 2.0, 0.5, 1.5, 0.7];
        let points =
            [[0.0, 0.1, 0.2], [1.0, 0.0, 0.3], [0.2, 1.1, 0.0], [0.3, 0.2, 0.9], [0.8, 0.7, 0.6]]
                .map(DVec3::from_array);
        let total: f64 = masses.iter().sum();
        let center = masses.iter().zip(points).map(|(&m, x)| m * x).sum::<DVec3>() / total;
        let gain = 0.01;
        // A diagonal matrix stands for A.
        let softness = [0.01, 0.004, 0.02, 0.005, 0.012];
        let mut turning = Turning::default();
        assert!(turning.begin(&masses, points.iter().map(|&x| x - center), gain));
        for (column, softness) in turning.loaded.iter_mut().zip(softness) {
            *column = column.map(|value| softness * value);
        }
        turning.finish(&masses);

        let loads = [(1_u32, DVec3::new(0.3, -0.2, 0.9)), (3, DVec3::new(-1.0, 0.4, 0.2))];
        let mut response = vec![[0.0; 3]; 5];
        for (node, load) in loads {
            response[node as usize] = load.to_array();
        }
        let levers = Levers(points.map(|x| 0.9 * (x - center) + DVec3::splat(0.05)).to_vec());
        let torque = turning.rotations().balance(&masses, &levers, &mut response);
        for (d, softness) in response.iter_mut().zip(softness) {
            *d = d.map(|value| softness * value);
        }
        turning.rotations().turn(&masses, torque, &mut response);

        let coefficients = loads.map(|(node, load)| {
            turning.coefficients(node, levers.of(node)).map(|coefficient| coefficient * load)
        });
        let [turn, counter] = [0, 1].map(|k| coefficients[0][k] + coefficients[1][k]);
        for node in 0..5_u32 {
            let mut sum = turn.cross(turning.arm(node)) - turning.response(node) * counter;
            for (loaded, load) in loads {
                if loaded == node {
                    sum += softness[node as usize] * load;
                }
            }
            let expected = DVec3::from_array(response[node as usize]);
            assert!((sum - expected).length() < 1e-15, "{sum} {expected}");
        }
        let spin: DVec3 = (0..5)
            .map(|i| masses[i] * (points[i] - center).cross(DVec3::from_array(response[i])))
            .sum();
        let expected: DVec3 = loads.iter().map(|&(i, f)| gain * levers.of(i).cross(f)).sum();
        assert!((spin - expected).length() < 1e-15);
    }

    #[test]
    fn loads_without_the_whole_move_and_turn_nothing() {
        let masses = [1.0, 2.0, 0.5, 1.5];
        let points = [[0.0, 0.1, 0.2], [1.0, 0.0, 0.3], [0.2, 1.1, 0.0], [0.3, 0.2, 0.9]];
        let mass: f64 = masses.iter().sum();
        let points = points.map(DVec3::from_array);
        let center = masses.iter().zip(points).map(|(&m, x)| m * x).sum::<DVec3>() / mass;
        let mut rotations = Rotations::default();
        assert!(rotations.set(&masses, points.iter().map(|&x| x - center), 0.01));
        let given = [[0.3, -0.2, 0.9], [-1.0, 0.4, 0.2], [0.1, 0.6, -0.3], [2.0, 0.0, 0.5]];
        let mut loads = given;
        rotations.take_whole(&masses, mass, &mut loads);
        let force = |loads: &[[f64; 3]]| loads.iter().map(|&f| DVec3::from(f)).sum::<DVec3>();
        let torque = |loads: &[[f64; 3]]| {
            let pairs = rotations.arms().iter().zip(loads);
            pairs.map(|(r, &f)| r.cross(DVec3::from(f))).sum::<DVec3>()
        };
        assert!(force(&loads).length() < 1e-15 && torque(&loads).length() < 1e-15);
        // What was taken is the inertial load of an acceleration as a whole.
        let turned: Vec<DVec3> = rotations.turned_by(torque(&given)).collect();
        let acceleration = force(&given) / mass;
        for (((now, before), m), turned) in loads.iter().zip(given).zip(masses).zip(turned) {
            let taken = DVec3::from(before) - DVec3::from(*now);
            assert!((taken - m * (acceleration + turned)).length() < 1e-15);
        }
    }
}
