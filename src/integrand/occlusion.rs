use std::f64::consts::PI;

use glam::DVec3;

use crate::sphere::{self, Order};

/// Integral of V w from the harmonics of V: band 1 holds y, z, x times sqrt(3 / 4 pi).
pub fn visible_moment(visibility: &[f64]) -> DVec3 {
    DVec3::new(visibility[3], visibility[1], visibility[2]) * (4.0 * PI / 3.0).sqrt()
}

/// Ambient occlusion 1/pi integral of V (n.w) from the harmonics of V \[n.w > 0\] (two bands or more); 1 is open.
pub fn ambient_occlusion(visibility: &[f64], normal: DVec3) -> f64 {
    visible_moment(visibility).dot(normal) / PI
}

/// Bent normal (Landis 2002): unit mean of the visible directions; zero where they cancel or there are none.
pub fn bent_normal(visibility: &[f64]) -> DVec3 {
    visible_moment(visibility).normalize_or_zero()
}

/// Transfer vector of a diffuse surface (Sloan et al. 2002): 1/pi integral of V (n.w) y to `order`, from the harmonics of
/// V \[n.w > 0\] with one band more. Its product with the harmonics of the light is outgoing radiance for albedo 1.
pub fn transfer(order: Order, visibility: &[f64], normal: DVec3, out: &mut [f64]) {
    let bands = order.bands() + 1;
    sphere::cosine_product(order, normal, &visibility[..bands * bands], out);
    out.iter_mut().for_each(|t| *t /= PI);
}
