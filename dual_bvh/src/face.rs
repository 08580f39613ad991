//! The plane of a face and the side on which a receiver lies.

use glam::{DVec3, Vec3};

/// Normal of the face (a, b, c) by the right-hand rule, of twice the face's area in length.
///
/// Every caller must get the same bits from the same corners in the same order: the operations below are the definition.
#[inline(always)]
pub fn face_normal(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let [ax, ay, az] = a.to_array().map(f64::from);
    let [bx, by, bz] = b.to_array().map(f64::from);
    let [cx, cy, cz] = c.to_array().map(f64::from);
    let (ux, uy, uz) = (bx - ax, by - ay, bz - az);
    let (vx, vy, vz) = (cx - ax, cy - ay, cz - az);
    DVec3::new(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
}

/// n . (p - a), evaluated from left to right without fused operations.
#[inline(always)]
pub(crate) fn plane_value(n: [f64; 3], a: [f64; 3], p: [f64; 3]) -> f64 {
    n[0] * (p[0] - a[0]) + n[1] * (p[1] - a[1]) + n[2] * (p[2] - a[2])
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
    sign(plane_value(face_normal(a, b, c).to_array(), a.to_array().map(f64::from), p.to_array()))
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
