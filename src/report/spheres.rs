use glam::DVec3;
use plotters::prelude::{BLACK, IntoFont, Text};

use super::Picture;
use super::orthographic::Orthographic;
use crate::Result;
use crate::proxy::Sphere;
use crate::scene::Geometry;

/// Pixels along the side of one view.
const VIEW: usize = 480;
/// Height of the captions.
const CAPTION: usize = 32;
/// Colours of spheres, again and again in this order.
const COLOURS: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];

/// Draws a mesh, where there is one, and below it spheres in the world, both from the front (+z), the right (+x) and the top
/// (+y) and to the same scale. Spheres on one joint have one colour.
///
/// # Errors
/// When drawing fails.
pub fn draw_spheres(geometry: Option<&Geometry>, spheres: &[Sphere]) -> Result<Picture> {
    let bounds = spheres.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], sphere| {
        let (center, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
        [low.min(center - radius), high.max(center + radius)]
    });
    let bounds = if spheres.is_empty() { [DVec3::ZERO; 2] } else { bounds };
    let bounds = geometry
        .and_then(Geometry::bounds)
        .map_or(bounds, |[low, high]| [bounds[0].min(low.as_dvec3()), bounds[1].max(high.as_dvec3())]);
    let views = [("front", DVec3::X, DVec3::Y), ("right", DVec3::NEG_Z, DVec3::Y), ("top", DVec3::X, DVec3::NEG_Z)];
    let rows = 1 + usize::from(geometry.is_some());
    let mut sheet = Picture::filled(views.len() * VIEW, rows * VIEW + CAPTION, [255; 3]);
    for (i, (_, right, up)) in views.into_iter().enumerate() {
        if let Some(geometry) = geometry {
            let mut view = Orthographic::new(VIEW, bounds, right, up);
            view.fill(geometry);
            sheet.paste(&view.picture(), i * VIEW, CAPTION);
        }
        let mut view = Orthographic::new(VIEW, bounds, right, up);
        for (number, sphere) in spheres.iter().enumerate() {
            let colour = COLOURS[sphere.joint.map_or(number, |joint| joint as usize) % COLOURS.len()];
            view.ball(sphere.center.as_dvec3(), sphere.radius.into(), colour);
        }
        sheet.paste(&view.picture(), i * VIEW, CAPTION + (rows - 1) * VIEW);
    }
    sheet.draw(|area| {
        for (i, (name, ..)) in views.iter().enumerate() {
            let style = ("sans-serif", 18).into_font().color(&BLACK);
            area.draw(&Text::new(*name, ((i * VIEW + 12) as i32, 8), style))?;
        }
        Ok(())
    })?;
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, Vec3};

    use super::*;
    use crate::scene::GeometryBuilder;
    use crate::scene::shapes::Cuboid;

    #[test]
    fn mesh_and_spheres_stand_below_each_other() {
        let mut builder = GeometryBuilder::default();
        builder.add(Cuboid::default().mesh().unwrap(), DAffine3::IDENTITY).unwrap();
        let sphere = Sphere { center: Vec3::ZERO, radius: 1.0, joint: None };
        let sheet = draw_spheres(Some(&builder.build()), &[sphere]).unwrap();
        assert_eq!((sheet.width(), sheet.height()), (3 * VIEW, 2 * VIEW + CAPTION));
        // The ball of twice the box's size fills its view; the box does not.
        let left = |row: usize| sheet.pixel(VIEW / 10, CAPTION + row * VIEW + VIEW / 2);
        assert_eq!(left(0), [255; 3]);
        assert!(left(1)[2] < left(1)[0]);
        let alone = draw_spheres(None, &[sphere]).unwrap();
        assert_eq!(alone.height(), VIEW + CAPTION);
        assert_eq!(alone.pixel(VIEW / 10, CAPTION + VIEW / 2), left(1));
    }
}
