use std::fmt;

use glam::{DAffine3, DQuat, DVec3};

use crate::bake::{Receivers, Request, tiles};
use crate::scene::shapes::{Plane, Random};
use crate::scene::{Environment, Geometry, GeometryBuilder, Mesh, Sky};
use crate::{Error, Result};

/// A scene to race in, and where.
pub struct Track {
    /// Its name in tables and files.
    pub name: String,
    /// What is seen.
    pub geometry: Geometry,
    /// A textured environment with a small sun.
    pub environment: Environment,
    /// A bake of the whole scene, lifted off the surface: what a run's planning is paid by.
    pub bake: Receivers,
    /// Whole tiles of the bake, evenly spread, in bake order: what is measured.
    pub receivers: Receivers,
    /// Number of these tiles.
    pub tiles: usize,
}

/// What is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Ambient occlusion in [0, 1].
    Occlusion,
    /// Four bands of harmonics of the visibility.
    Harmonics,
    /// Irradiance from the textured environment, pi on open ground.
    Light,
}

impl Quantity {
    /// All there are.
    pub const ALL: [Self; 3] = [Self::Occlusion, Self::Harmonics, Self::Light];

    /// The request for it.
    pub fn request(self) -> Request {
        Request {
            order: 4,
            ambient_occlusion: self == Self::Occlusion,
            visibility_sh: self == Self::Harmonics,
            irradiance: self == Self::Light,
            ..Request::default()
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Occlusion => "AO",
            Self::Harmonics => "SH(4)",
            Self::Light => "light",
        })
    }
}

/// Distance of the receivers from the surface, as a fraction of the scene's diagonal: above the rounding of the rays' single
/// precision, below anything that matters.
const LIFT: f64 = 2e-5;

impl Track {
    /// A track with about `count` receivers of a bake of a light map of `side` x `side` points; without an environment under the
    /// default [`Sky`].
    ///
    /// The bake's points are shared evenly among the meshes and spread evenly by area over each.
    ///
    /// # Errors
    /// A geometry without triangles.
    pub fn new(
        name: String,
        geometry: Geometry,
        environment: Option<Environment>,
        count: usize,
        side: usize,
    ) -> Result<Self> {
        let environment = match environment.filter(|light| light.uniform().is_none()) {
            Some(environment) => environment,
            None => Sky::default().environment()?,
        };
        let Some([low, high]) = geometry.bounds().map(|bounds| bounds.map(|bound| bound.as_dvec3())) else {
            return Err(Error::input(format!("{name}: there are no triangles to race over")));
        };
        let diagonal = low.distance(high);
        let bake = Receivers::points(points(&geometry, side * side, LIFT * diagonal));
        let tiles = tiles(&geometry, &bake.positions, &bake.normals);
        let spread = spread(&tiles, count);
        let receivers = bake.pick(spread.iter().copied().flatten().map(|&index| index as usize));
        Ok(Self { name, geometry, environment, bake, receivers, tiles: spread.len() })
    }
}

/// The meshes, centred and scaled to a half-size of 1, over a plane that they nearly touch.
///
/// # Errors
/// As [`GeometryBuilder::add`].
pub fn over_plane(meshes: Vec<Mesh>) -> Result<Geometry> {
    let points = || meshes.iter().flat_map(|mesh| &mesh.positions).map(|p| p.as_dvec3());
    let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let (centre, half) = (low.midpoint(high), 0.5 * (high - low));
    let scale = half.max_element().recip();
    let place = DAffine3::from_scale_rotation_translation(DVec3::splat(scale), DQuat::IDENTITY, -centre * scale);
    let mut builder = GeometryBuilder::default();
    let mut object = Mesh::default();
    meshes.iter().for_each(|mesh| object.append(mesh));
    builder.add(object, place)?;
    let below = DVec3::NEG_Y * (half.y * scale + 1e-3);
    builder.add(Plane { size: [4.0; 2], ..Plane::default() }.mesh()?, DAffine3::from_translation(below))?;
    Ok(builder.build())
}

/// So many points of the bake, or a few less, and normals.
fn points(geometry: &Geometry, count: usize, lift: f64) -> Vec<(DVec3, DVec3)> {
    let mut random = Random::new(1);
    let mut by_mesh = vec![Vec::new(); geometry.meshes.len().max(1)];
    for face in 0..geometry.triangles.len() as u32 {
        let [a, b, c] = geometry.corners(face);
        by_mesh[geometry.triangle_mesh[face as usize] as usize].push((face, (b - a).cross(c - a).length()));
    }
    by_mesh.retain(|faces| !faces.is_empty());
    let share = (count / by_mesh.len()).max(1);
    let mut points = Vec::with_capacity(count);
    for faces in by_mesh {
        let step = faces.iter().map(|(_, area)| area).sum::<f64>() / share as f64;
        // One point at random in each step of the running area.
        let (mut reached, mut next) = (0.0, step * random.unit());
        let mut taken = 0;
        for (face, area) in faces {
            reached += area;
            let [a, b, c] = geometry.corners(face);
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            while next < reached {
                let (s, t) = (random.unit(), random.unit());
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                points.push((a + (b - a) * s + (c - a) * t + lift * normal, normal));
                taken += 1;
                next = step * (f64::from(taken) + random.unit());
            }
        }
    }
    points
}

/// Tiles, evenly spread over all of them, of about `count` receivers.
fn spread(tiles: &[Vec<u32>], count: usize) -> Vec<&[u32]> {
    let all: usize = tiles.iter().map(Vec::len).sum();
    let wanted = (count * tiles.len()).div_ceil(all.max(1)).clamp(1, tiles.len().max(1));
    (0..wanted).map(|i| &tiles[(2 * i + 1) * tiles.len() / (2 * wanted)][..]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::TILE_RECEIVERS;
    use crate::scene::Scene;

    #[test]
    fn half_of_the_bake_lies_on_each_of_two_meshes_just_above_it() {
        let scene = Scene::builtin("icosphere").unwrap();
        let track = Track::new("ico".into(), scene.geometry, None, 256, 300).unwrap();
        assert!((89_998..=90_000).contains(&track.bake.len()), "{}", track.bake.len());
        let on_plane = track.bake.positions.iter().filter(|p| p.y < 0.1).count();
        assert!(on_plane.abs_diff(45_000) < 2, "{on_plane}");
        assert!((128..=512).contains(&track.receivers.len()), "{}", track.receivers.len());
        assert!((track.receivers.len().div_ceil(TILE_RECEIVERS)..64).contains(&track.tiles), "{}", track.tiles);
        for position in &track.bake.positions {
            let height = if position.y < 0.1 { position.y } else { (*position - DVec3::Y * 1.2).length() - 1.0 };
            // The facets' sagitta is below 0.004.
            assert!((-0.004..0.001).contains(&height), "{position}");
        }
    }

    #[test]
    fn meshes_are_set_on_a_plane() {
        let mesh = crate::scene::shapes::Icosphere { radius: 5.0, subdivisions: 2 }.mesh().unwrap();
        let away = DAffine3::from_translation(DVec3::new(100.0, 7.0, -3.0));
        let geometry = over_plane(vec![mesh.transformed(away)]).unwrap();
        let [low, high] = geometry.bounds().unwrap();
        assert!((low.y + 1.001).abs() < 1e-5 && (high.y - 1.0).abs() < 1e-5, "{low} {high}");
        assert_eq!((low.x, high.x), (-2.0, 2.0));
        assert_eq!(geometry.meshes.len(), 2);
    }

    #[test]
    fn nothing_cannot_be_raced_over() {
        let nothing = GeometryBuilder::default().build();
        let message = Track::new("void".into(), nothing, None, 1, 8).err().unwrap().to_string();
        assert!(message.contains("void: there are no triangles"));
    }
}
