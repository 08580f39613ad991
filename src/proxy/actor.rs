use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::{Character, Clip, Posed, Proxy, SphereSet, Surface, fit};
use crate::Result;
use crate::bake::Control;
use crate::scene::{Actor as Source, Mesh, Model, ModelSpheres, Walker};

/// A body that moves, ready to be posed.
#[derive(Clone, Debug)]
pub enum Actor {
    /// A built-in figure.
    Walker(Walker),
    /// A glTF file.
    Model(Box<Player>),
}

/// A character that plays a clip in a loop.
#[derive(Clone, Debug)]
pub struct Player {
    character: Character,
    set: SphereSet,
    clip: Option<Clip>,
    ahead: f64,
    place: DAffine3,
    scale: f64,
    albedo: Option<Vec3>,
}

impl Actor {
    /// Reads what a scene describes; spheres that it does not name are fitted.
    ///
    /// # Errors
    /// As [`Character::load`], [`Character::clip`], [`SphereSet::load`] and [`fit`].
    pub fn load(source: &Source, control: &dyn Control) -> Result<Self> {
        match source {
            Source::Walker(walker) => Ok(Self::Walker(walker.clone())),
            Source::Model(model) => Ok(Self::Model(Box::new(Player::load(model, control)?))),
        }
    }

    /// The body `time` seconds after it started; its proxies get the number `body`.
    pub fn pose(&self, time: f64, body: u32) -> Posed {
        match self {
            Self::Walker(walker) => walker.pose(time, body),
            Self::Model(player) => player.pose(time, body),
        }
    }
}

impl Player {
    fn load(model: &Model, control: &dyn Control) -> Result<Self> {
        let character = Character::load(&model.file)?.without(&model.without)?;
        let clip = model.clip.as_ref().map(|name| character.clip(name).cloned()).transpose()?;
        let set = match &model.spheres {
            ModelSpheres::File(file) => SphereSet::load(file)?,
            ModelSpheres::Count(count) => {
                let (spheres, _) = fit(&character.geometry(&character.rest())?, *count, control)?;
                character.attach(&spheres)?
            }
        };
        // Whether the spheres are this character's is told now, not in a frame.
        character.place(&set, &character.rest())?;
        let turn = DQuat::from_rotation_y(model.turn.to_radians());
        let place =
            DAffine3::from_scale_rotation_translation(DVec3::splat(model.scale), turn, DVec3::from(model.translate));
        let albedo = model.albedo.map(Vec3::from);
        Ok(Self { character, set, clip, ahead: model.ahead, place, scale: model.scale, albedo })
    }

    fn pose(&self, time: f64, body: u32) -> Posed {
        let pose = match &self.clip {
            Some(clip) if clip.duration > 0.0 => {
                self.character.pose(clip, (time + self.ahead).rem_euclid(clip.duration))
            }
            Some(clip) => self.character.pose(clip, 0.0),
            None => self.character.rest(),
        };
        let mut surface = Surface::default();
        let mut triangles = Vec::new();
        for mesh in self.character.meshes(&pose) {
            let mesh = mesh.transformed(self.place);
            let first = surface.positions.len() as u32;
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| first + v)));
            let albedo = self.albedo.unwrap_or(mesh.material.albedo);
            surface.albedo.extend(std::iter::repeat_n(albedo, mesh.triangles.len()));
            surface.normals.extend(normals(&mesh));
            surface.positions.extend(mesh.positions);
        }
        surface.triangles = triangles.into();
        // The joints are those that were looked up when the actor was loaded.
        let spheres = self.character.place(&self.set, &pose).unwrap_or_default();
        let albedo = self.albedo.unwrap_or_else(|| mean(&surface));
        let proxy = |sphere: super::Sphere| Proxy {
            center: self.place.transform_point3(sphere.center.as_dvec3()).as_vec3(),
            radius: sphere.radius * self.scale as f32,
            albedo,
            body,
        };
        Posed { proxies: spheres.into_iter().map(proxy).collect(), surface }
    }
}

/// Unit normals of the vertices as the file has them: faces count by their area, and hard edges stay, since files double their
/// vertices.
fn normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        t.iter().for_each(|&v| sums[v as usize] += (b - a).cross(c - a));
    }
    sums.into_iter().map(|sum| sum.normalize_or(Vec3::Y)).collect()
}

/// Reflectance of a surface, its triangles alike.
fn mean(surface: &Surface) -> Vec3 {
    surface.albedo.iter().sum::<Vec3>() / surface.albedo.len().max(1) as f32
}
