//! Affine maps that place bodies, and how to tell one in words.

use glam::{DMat3, DQuat, DVec3};
use palpate_geometry::Point;
use serde::{Deserialize, Serialize};

/// An affine map `x -> linear * x + translation`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct Pose {
    /// Linear part: scale, then rotation, of every ME, inner first.
    pub linear: DMat3,
    /// Translation [m].
    pub translation: DVec3,
}

impl Pose {
    /// Leaves every point where it is.
    pub const IDENTITY: Self = Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// A rotation followed by a translation [m].
    pub fn from_rotation_translation(rotation: DQuat, translation: DVec3) -> Self {
        Self { linear: DMat3::from_quat(rotation), translation }
    }

    /// The map that applies `inner` first, then `self`.
    pub fn after(&self, inner: &Self) -> Self {
        Self {
            linear: self.linear * inner.linear,
            translation: self.linear * inner.translation + self.translation,
        }
    }

    /// The image of a point.
    pub fn apply(&self, point: Point) -> Point {
        (self.linear * DVec3::from_array(point) + self.translation).to_array()
    }

    /// The map as scale, then rotation, then translation.
    pub fn describe(&self) -> PoseParts {
        let columns = [self.linear.x_axis, self.linear.y_axis, self.linear.z_axis];
        let lengths = columns.map(DVec3::length);
        let sheared = [(0, 1), (0, 2), (1, 2)].into_iter().any(|(i, j)| {
            columns[i].dot(columns[j]).abs() > SHEAR_TOLERANCE * lengths[i] * lengths[j]
        });
        let [x, y, z] = [0, 1, 2].map(|i| columns[i] / lengths[i]);
        let unit = DMat3::from_cols(x, y, z);
        // A mirror image can be told as a mirror of any axis and a rotation: the least rotation.
        let signs: &[[f64; 3]] = if unit.determinant() < 0.0 {
            &[[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0; 3]]
        } else {
            &[[1.0; 3]]
        };
        let (angle, axis, signs) = signs
            .iter()
            .map(|signs| {
                let rotation = nearest_rotation(unit * DMat3::from_diagonal((*signs).into()));
                let (axis, angle) = DQuat::from_mat3(&rotation).to_axis_angle();
                let reflex = angle > std::f64::consts::PI;
                let (axis, angle) =
                    if reflex { (-axis, std::f64::consts::TAU - angle) } else { (axis, angle) };
                (angle, axis, *signs)
            })
            .min_by(|left, right| left.0.total_cmp(&right.0))
            .unwrap_or((0.0, DVec3::X, [1.0; 3]));
        PoseParts {
            translation: self.translation.to_array(),
            axis: axis.to_array(),
            angle_degrees: angle.to_degrees(),
            scale: std::array::from_fn(|i| signs[i] * lengths[i]),
            sheared,
        }
    }
}

/// Columns further than this from right angles (as a cosine) are a shear.
const SHEAR_TOLERANCE: f64 = 1e-9;

/// A [`Pose`] in words: scale along the file's axes, then rotation, then translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseParts {
    /// Translation [m].
    pub translation: Point,
    /// Axis of the rotation, of length 1; any axis where the angle is zero.
    pub axis: Point,
    /// Angle of the rotation [degrees], 0..=180.
    pub angle_degrees: f64,
    /// Factors along the file's axes, negative for a mirror image.
    pub scale: Point,
    /// The map also shears (a rotation between two unequal scales): scale and rotation are then the
    /// lengths of the axes' images and the nearest rotation.
    pub sheared: bool,
}

/// Polar decomposition by Newton's iteration (Higham 1986); the identity's where that fails.
fn nearest_rotation(matrix: DMat3) -> DMat3 {
    let mut rotation = matrix;
    for _ in 0..50 {
        let next = (rotation + rotation.inverse().transpose()) * 0.5;
        let converged = next.abs_diff_eq(rotation, 1e-15);
        rotation = next;
        if converged {
            break;
        }
    }
    if rotation.is_finite() { rotation } else { DMat3::IDENTITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_a_pose_make_the_pose() {
        let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
        for scale in [[1.0, 2.0, 3.0], [-1.0, 2.0, 0.5], [-1.0, -2.0, -3.0], [1.0, -1.0, -1.0]] {
            let pose = Pose {
                linear: DMat3::from_quat(rotation) * DMat3::from_diagonal(scale.into()),
                translation: DVec3::new(1.0, 2.0, 3.0),
            };
            let parts = pose.describe();
            let told = DMat3::from_axis_angle(parts.axis.into(), parts.angle_degrees.to_radians())
                * DMat3::from_diagonal(parts.scale.into());
            assert!(told.abs_diff_eq(pose.linear, 1e-12), "{parts:?}");
            assert!(!parts.sheared && parts.angle_degrees <= 180.0);
        }
    }

    #[test]
    fn the_identity_and_a_shear_are_known() {
        let parts = Pose::IDENTITY.describe();
        assert_eq!((parts.angle_degrees, parts.scale, parts.sheared), (0.0, [1.0; 3], false));
        let mut shear = Pose::IDENTITY;
        shear.linear.y_axis.x = 0.1;
        assert!(shear.describe().sheared);
        let squash = DMat3::from_diagonal([1.0, 1.0, 2.0].into());
        shear.linear = squash * DMat3::from_rotation_x(0.3) * squash;
        assert!(shear.describe().sheared);
    }
}
