//! The plane of a face and the side on which a receiver lies.

use glam::{DVec3, Vec3};

/// Normal of the face (a, b, c) by the right-hand rule, of twice the face's area in length.
///
/// Every caller must get the same bits from the same corners in the same order: the operations below are the definition.
#[inline(always)]
pub fn face_normal(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    let (ux, uy, uz) = (b.x - a.x, b.y - a.y, b.z - a.z);
    let (vx, vy, vz) = (c.x - a.x, c.y - a.y, c.z - a.z);
    DVec3::new(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
}

/// n . (p - a), evaluated from left to right without fused operations.
#[inline(always)]
pub(crate) fn plane_value(n: DVec3, a: DVec3, p: DVec3) -> f64 {
    n.x * (p.x - a.x) + n.y * (p.y - a.y) + n.z * (p.z - a.z)
}

/// Sign of a plane value: zero counts as positive.
#[inline(always)]
pub(crate) fn sign(value: f64) -> i8 {
    if value >= 0.0 { 1 } else { -1 }
}

/// The side of the face (a, b, c) on which the receiver `p` lies: +1 if n . (p - a) >= 0 with n = (b - a) x (c - a),
/// otherwise -1.
///
/// This is the one sign function: contours close because every face has one sign per receiver, whatever the rounding.
/// It is deterministic to the bit and always evaluated on the corners in the order in which the triangle lists them; whoever
/// counts crossings of the same faces has to use it too.
#[inline]
pub fn face_sign(p: DVec3, a: Vec3, b: Vec3, c: Vec3) -> i8 {
    sign(plane_value(face_normal(a, b, c), a.as_dvec3(), p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_side_that_sees_the_corners_counter_clockwise_is_positive() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(face_sign(DVec3::Z, a, b, c), 1);
        assert_eq!(face_sign(-DVec3::Z, a, b, c), -1);
        assert_eq!(face_sign(-DVec3::Z, a, c, b), 1);
    }

    #[test]
    fn a_receiver_in_the_plane_and_a_face_without_area_are_positive() {
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for winding in [[a, b, c], [a, c, b]] {
            assert_eq!(face_sign(DVec3::new(5.0, -3.0, 0.0), winding[0], winding[1], winding[2]), 1);
        }
        assert_eq!(face_sign(-DVec3::Z, a, b, 2.0 * b), 1);
    }

    #[test]
    fn the_smallest_height_decides() {
        let tiny = f64::from_bits(1);
        let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(face_sign(DVec3::new(0.0, 0.0, -tiny), a, b, c), -1);
        assert_eq!(face_sign(DVec3::new(0.0, 0.0, tiny), a, b, c), 1);
    }
}
