use glam::DVec3;

use crate::scene::Environment;
use crate::sphere::{self, Order};

/// An environment's radiance in spherical harmonics, per colour: integral of L y over the sphere.
pub fn environment_harmonics(environment: &Environment, order: Order) -> [Vec<f64>; 3] {
    let mut light = [(); 3].map(|()| vec![0.0; order.len()]);
    let mut y = vec![0.0; order.len()];
    for (pixel, radiance) in environment.pixels().iter().enumerate() {
        let (column, row) = (pixel % environment.width(), pixel / environment.width());
        sphere::evaluate(order, environment.pixel_direction(column, row), &mut y);
        for (light, radiance) in light.iter_mut().zip(radiance.to_array()) {
            let power = f64::from(radiance) * environment.solid_angle(row);
            light.iter_mut().zip(&y).for_each(|(light, y)| *light += power * y);
        }
    }
    light
}

/// Radiance that leaves a white diffuse surface under a light given in spherical harmonics (Sloan et al. 2002): the
/// product of its transfer vector and the light's coefficients. Times pi it is irradiance.
pub fn relit(transfer: &[f64], light: &[Vec<f64>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|colour| transfer.iter().zip(&light[colour]).map(|(t, l)| t * l).sum())
}

/// Vector irradiance, integral of L V w, under the same radiance from everywhere.
pub fn even_vector_irradiance(visible_moment: DVec3, radiance: [f64; 3]) -> [DVec3; 3] {
    radiance.map(|radiance| visible_moment * radiance)
}
