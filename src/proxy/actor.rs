use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::character::Character;
use super::clip::Clip;
use super::overlap::share_overlap;
use super::walker::Posed;
use super::{Proxy, Sphere, SphereSet, Surface, fit};
use crate::bake::Control;
use crate::scene::{Body, SkinnedBody, Walker};
use crate::{Error, Result};

/// A body of a scene, ready to move.
#[derive(Clone, Debug)]
pub enum Actor {
    /// A figure made up.
    Walker(Walker),
    /// A character from a file.
    Skinned(Box<Skinned>),
}

/// A character with its spheres, placed in a scene.
#[derive(Clone, Debug)]
pub struct Skinned {
    character: Character,
    spheres: SphereSet,
    clip: Option<Clip>,
    start: f64,
    placement: DAffine3,
    scale: f64,
    /// Of all meshes together.
    triangles: Arc<[[u32; 3]]>,
    /// Of every triangle, and their mean for the spheres.
    albedo: (Vec<Vec3>, Vec3),
}

impl Actor {
    /// Loads what the body names, and fits its spheres if they are not in a file.
    ///
    /// # Errors
    /// As [`Body::check`], [`Character::load`], [`Character::without`], [`Character::clip`], [`SphereSet::load`],
    /// [`fit`](super::fit()) and [`Character::attach`].
    pub fn new(body: &Body, control: &dyn Control) -> Result<Self> {
        body.check()?;
        match body {
            Body::Walker(walker) => Ok(Self::Walker(walker.clone())),
            Body::Skinned(body) => Skinned::new(body, control).map(|skinned| Self::Skinned(Box::new(skinned))),
        }
    }

    /// The body as it stands `time` seconds after its start.
    ///
    /// # Errors
    /// Spheres that hang on joints of another character.
    pub fn pose(&self, time: f64) -> Result<Posed> {
        match self {
            Self::Walker(walker) => Ok(walker.pose(time)),
            Self::Skinned(skinned) => skinned.pose(time),
        }
    }
}

impl Skinned {
    fn new(body: &SkinnedBody, control: &dyn Control) -> Result<Self> {
        let character = Character::load(&body.file)?.without(&body.without)?;
        let clip = body.clip.as_ref().map(|name| character.clip(name).cloned()).transpose()?;
        let rest = character.rest();
        let spheres = match &body.set {
            Some(file) => SphereSet::load(file)?,
            None => {
                let (fitted, _) = fit(&character.geometry(&rest)?, body.spheres, control)?;
                character.attach(&fitted)?
            }
        };
        let meshes = character.meshes(&rest);
        let (mut triangles, mut albedo, mut base) = (Vec::new(), Vec::new(), 0u32);
        for mesh in &meshes {
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| base + v)));
            let colour = body.albedo.map_or(mesh.material.albedo, Vec3::from);
            albedo.resize(triangles.len(), colour);
            base += mesh.positions.len() as u32;
        }
        if triangles.is_empty() {
            return Err(Error::file(&body.file, "there is nothing to be seen: no triangles"));
        }
        let mean = albedo.iter().sum::<Vec3>() / albedo.len() as f32;
        Ok(Self {
            character,
            spheres,
            clip,
            start: body.start,
            placement: DAffine3::from_scale_rotation_translation(
                DVec3::splat(body.scale),
                DQuat::from_rotation_y(body.turn.to_radians()),
                body.translate.into(),
            ),
            scale: body.scale,
            triangles: triangles.into(),
            albedo: (albedo, mean.clamp(Vec3::ZERO, Vec3::ONE)),
        })
    }

    fn pose(&self, time: f64) -> Result<Posed> {
        let pose = match &self.clip {
            None => self.character.rest(),
            Some(clip) => {
                let time = self.start + time;
                let duration = clip.duration;
                self.character.pose(clip, if duration > 0.0 { time.rem_euclid(duration) } else { 0.0 })
            }
        };
        let place = |p: Vec3| self.placement.transform_point3(p.as_dvec3()).as_vec3();
        let positions: Vec<Vec3> =
            self.character.meshes(&pose).into_iter().flat_map(|mesh| mesh.positions).map(place).collect();
        // Files split vertices where a surface has an edge: the mean of the faces around a vertex is its normal.
        let mut normals = vec![Vec3::ZERO; positions.len()];
        for t in self.triangles.iter() {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            let area = (b - a).cross(c - a);
            t.iter().for_each(|&v| normals[v as usize] += area);
        }
        normals.iter_mut().for_each(|n| *n = n.normalize_or(Vec3::Z));
        let proxy = |sphere: Sphere| Proxy {
            center: place(sphere.center),
            radius: (self.scale * f64::from(sphere.radius)) as f32,
            albedo: self.albedo.1,
            share: 1.0,
        };
        let mut proxies: Vec<Proxy> = self.character.place(&self.spheres, &pose)?.into_iter().map(proxy).collect();
        share_overlap(&mut proxies);
        let (triangles, albedo) = (self.triangles.clone(), self.albedo.0.clone());
        Ok(Posed { surface: Surface { positions, normals, triangles, albedo, ..Surface::default() }, proxies })
    }
}
