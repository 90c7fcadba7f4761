//! What one contact asks for: its normal force by its gap, its friction by its slip; what a tie asks
//! for.

mod tie;

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::filter::Candidate;
use super::problem::Block;
use tie::TieLaw;

/// Part of the contact distance in which the penalty is soft. Below it, and where the recovery is
/// limited, a contact is [`HARDENING`] times stiffer: surfaces must not pass through each other even
/// where all the load is on a few nodes, since an open surface would then push the wrong way.
pub(super) const SOFT_PART: f64 = 0.5;
pub(super) const HARDENING: f64 = 100.0;
/// Smallest softness of an equation relative to its own compliance: keeps the matrix regular.
pub(super) const SOFTNESS_FLOOR: f64 = 1e-6;
/// Steps of Newton's method for the direction of a sliding contact's friction.
const SLIDE_STEPS: usize = 4;

/// One piece of the normal law: `softness * force = target - displacement by contact forces`.
#[derive(Clone, Copy, Debug)]
struct Piece {
    target: f64,
    softness: f64,
    /// 1 / (softness + own compliance).
    stiffness: f64,
}

/// What a candidate asks for, given what it does to itself.
#[derive(Clone, Copy, Debug)]
pub(super) enum Law {
    Contact(ContactLaw),
    Tie(TieLaw),
}

impl Law {
    pub(super) fn new(candidate: &Candidate, block: &Block) -> Self {
        match candidate.tied {
            Some(offset) => Self::Tie(TieLaw::new(offset, candidate, block)),
            None => Self::Contact(ContactLaw::new(candidate, block)),
        }
    }

    /// Nearest force that can be carried.
    pub(super) fn admissible(&self, force: DVec3) -> DVec3 {
        match self {
            Self::Contact(law) => law.admissible(force),
            Self::Tie(_) => force,
        }
    }

    /// Force that the law asks for while all others stay as they are; `moved` is the displacement by
    /// all forces.
    pub(super) fn answer(&self, force: DVec3, moved: DVec3) -> DVec3 {
        match self {
            Self::Contact(law) => law.answer(force, moved),
            Self::Tie(law) => law.answer(force, moved),
        }
    }

    /// How far the force is from obeying the law, in contact distances.
    pub(super) fn violation(&self, force: DVec3, moved: DVec3) -> f64 {
        match self {
            Self::Contact(law) => law.violation(force, moved),
            Self::Tie(law) => law.violation(force, moved),
        }
    }
}

/// The laws of one contact, given what it does to itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContactLaw {
    /// Penalty by the overlap; the steeper one of a deep overlap; as hard as it takes to reach the
    /// recovery gap, which is less than the penalty.
    pieces: [Piece; 3],
    friction: f64,
    /// Slip without contact forces [m].
    slip: DVec2,
    /// Displacement along the normal, and along the tangents, per normal force [m/N].
    pressed: f64,
    dragged: DVec2,
    /// Displacement along each tangent per force along it [m/N].
    rubbed: DVec2,
    distance: f64,
}

impl ContactLaw {
    fn new(candidate: &Candidate, block: &Block) -> Self {
        let hard = HARDENING * candidate.stiffness;
        let soft_part = SOFT_PART * candidate.distance;
        let own = block.own;
        let pressed = own.x_axis.x;
        let piece = |stiffness: f64, goal: f64| {
            let softness = stiffness.recip().max(SOFTNESS_FLOOR * pressed);
            Piece {
                target: goal - (candidate.gap + block.free.x),
                softness,
                stiffness: (softness + pressed).recip(),
            }
        };
        Self {
            pieces: [
                piece(candidate.stiffness, candidate.distance),
                // Continues the soft law from the end of the soft part on.
                piece(hard, candidate.distance - soft_part + soft_part / HARDENING),
                piece(hard, candidate.recovery),
            ],
            friction: candidate.friction,
            slip: block.free.yz(),
            pressed,
            dragged: own.x_axis.yz(),
            rubbed: DVec2::new(own.y_axis.y, own.z_axis.z),
            distance: candidate.distance,
        }
    }

    /// Nearest force that the contact can carry.
    fn admissible(&self, force: DVec3) -> DVec3 {
        let normal = force.x.max(0.0);
        let friction = force.yz().clamp_length_max(self.friction * normal);
        DVec3::new(normal, friction.x, friction.y)
    }

    /// Force that the laws ask for while all others stay as they are; `moved` is the displacement of
    /// the contact by all forces.
    fn answer(&self, force: DVec3, moved: DVec3) -> DVec3 {
        let others = moved.x - self.pressed * force.x;
        let [elastic, hard, recovering] = self.pieces.map(|p| (p.target - others) * p.stiffness);
        let normal = elastic.max(hard).min(recovering).max(0.0);
        if normal == 0.0 || self.friction == 0.0 {
            return DVec3::new(normal, 0.0, 0.0);
        }
        let slip = self.slip + moved.yz() + self.dragged * (normal - force.x);
        let wanted = self.rubbed * force.yz() - slip;
        let friction = resist(self.friction * normal, self.rubbed, wanted);
        DVec3::new(normal, friction.x, friction.y)
    }

    /// How far the contact is from obeying its laws, in contact distances: by what its gap differs
    /// from the one that its normal force belongs to, or it slips though its friction could be larger
    /// or point elsewhere.
    fn violation(&self, force: DVec3, moved: DVec3) -> f64 {
        let [elastic, hard, recovering] =
            self.pieces.map(|p| p.target - moved.x - p.softness * force.x);
        let gap = elastic.max(hard).min(recovering);
        let gap = if force.x > 0.0 { gap.abs() } else { gap.max(0.0) };
        let slip = self.slip + moved.yz();
        let softest = self.rubbed.max_element();
        let limit = self.friction * force.x;
        let slip_error = if limit > 0.0 && softest > 0.0 {
            let answer = (force.yz() - slip / softest).clamp_length_max(limit);
            softest * (answer - force.yz()).length()
        } else {
            0.0
        };
        gap.max(slip_error) / self.distance
    }
}

/// Friction that stops the slip `own * force - wanted` along two uncoupled tangents, or has size
/// `limit` and is opposite to the slip that is left.
fn resist(limit: f64, own: DVec2, wanted: DVec2) -> DVec2 {
    let size = wanted.length();
    if limit <= 0.0 || size == 0.0 {
        return DVec2::ZERO;
    }
    let stick = wanted / own;
    if stick.length_squared() <= limit * limit {
        return stick;
    }
    // The slip is -shift * force: (own + shift) force = wanted with |force| = limit. Newton's method
    // on 1/|force|, which is concave in the shift, rises to the root from the left.
    let mut shift = (size / limit - own.max_element()).max(0.0);
    let mut force = stick;
    for _ in 0..SLIDE_STEPS {
        force = wanted / (own + shift);
        let square = force.length_squared();
        let fall = (force * force / (own + shift)).element_sum();
        shift += (square.sqrt() / limit - 1.0) * square / fall;
    }
    force.clamp_length_max(limit)
}
