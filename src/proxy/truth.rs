//! What the proxies, and the bodies they stand for, really hide and reflect: the judge of the renderer.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{DistantLight, Proxy, Receivers, Surface};
use crate::bake::{Control, Method, Request, integrate};
use crate::reference::{RayScene, Sobol};
use crate::scene::{FaceTree, Geometry, GeometryBuilder, Material, Mesh};
use crate::sphere::{Order, evaluate};
use crate::{Error, Result};

/// Bands of the transfer vectors of a [`Truth`]: those of the largest order of the renderer.
const BANDS: usize = 6;
/// Their coefficients.
const LEN: usize = BANDS * BANDS;

/// What is hidden from every receiver, and what it gets instead.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    /// For every place of the receivers' planes: integral of (1 - V) max(0, n.w) y over what the static scene leaves open, in six
    /// bands; none where nothing is seen.
    hidden: Vec<Option<[f32; LEN]>>,
    /// Likewise integral of V max(0, n.w) y with the visibility V of the static scene alone; empty for spheres.
    open: Vec<Option<[f32; LEN]>>,
    /// Irradiance that spheres reflect, in the light they were given; empty for surfaces.
    reflected: Vec<[f32; 3]>,
}

/// A scene that stands still, ready for rays from points on it.
pub struct StaticScene {
    rays: RayScene,
    tree: FaceTree,
}

impl StaticScene {
    /// Of a scene's geometry.
    pub fn new(geometry: &Geometry) -> Self {
        let tree = FaceTree::new(geometry.positions.clone(), geometry.triangles.clone());
        Self { rays: RayScene::new(geometry), tree }
    }
}

impl Truth {
    /// By quasi-Monte Carlo over the spheres themselves: analytic intersections, `samples` directions per receiver distributed as
    /// the cosine. Spheres reflect `light` unshadowed, as the renderer's do, but the nearest one hides those behind. With
    /// a static scene, directions that it blocks do not count.
    pub fn of_spheres(
        receivers: &Receivers,
        proxies: &[Proxy],
        light: &DistantLight,
        static_scene: Option<&StaticScene>,
        samples: u32,
        control: &dyn Control,
    ) -> Result<Self> {
        let reflected = light.reflected();
        control.begin("spheres", receivers.depth.len() as u64);
        let judge = |index: usize| -> (Option<[f32; LEN]>, [f32; 3]) {
            if !receivers.is_seen(index) || control.cancelled() {
                return (None, [0.0; 3]);
            }
            let (p, n) = (receivers.point(index).as_dvec3(), receivers.normal_at(index).as_dvec3().normalize());
            let seen = SeenSpheres::new(p, n, proxies);
            control.advance(1);
            let mut hidden = [0.0; LEN];
            let mut irradiance = [0.0; 3];
            if seen.list.is_empty() {
                return (Some([0.0; LEN]), irradiance);
            }
            let own = static_scene.map(|scene| around(&scene.tree, p, n, f64::from(receivers.depth[index])));
            let blocked = |w: DVec3| match (static_scene, &own) {
                (Some(scene), Some(own)) => scene.rays.occluded(p, w, own),
                _ => false,
            };
            let (tangent, bitangent) = n.any_orthonormal_pair();
            let sobol = Sobol::new(index as u32);
            let mut y = [0.0; LEN];
            let weight = PI / f64::from(samples);
            for k in 0..samples {
                let [u, v] = sobol.point(k);
                let (sin, cos) = (TAU * v).sin_cos();
                let r = (1.0 - u).sqrt();
                let w = r * cos * tangent + r * sin * bitangent + u.sqrt() * n;
                let Some(hit) = seen.nearest(w.as_vec3()) else { continue };
                if blocked(w) {
                    continue;
                }
                evaluate(order(), w, &mut y);
                hidden.iter_mut().zip(&y).for_each(|(sum, y)| *sum += weight * y);
                let proxy = &proxies[hit.0 as usize];
                let normal = (p.as_vec3() + hit.1 * w.as_vec3() - proxy.center) / proxy.radius;
                let radiance = reflected.radiance(normal);
                for colour in 0..3 {
                    irradiance[colour] += weight as f32 * proxy.albedo[colour] * radiance[colour];
                }
            }
            (Some(hidden.map(|x| x as f32)), irradiance)
        };
        let (hidden, reflected) = (0..receivers.depth.len()).into_par_iter().map(judge).unzip();
        if control.cancelled() { Err(Error::Interrupted) } else { Ok(Self { hidden, open: Vec::new(), reflected }) }
    }

    /// By the integrator over the bodies' own triangles, `method`; behind or before the static `set`, if it is given.
    ///
    /// # Errors
    /// As [`integrate`]; [`Error::Interrupted`] if `control` stops it.
    pub fn of_surfaces(
        receivers: &Receivers,
        bodies: &[Surface],
        set: Option<&Geometry>,
        method: Method,
        control: &dyn Control,
    ) -> Result<Self> {
        let with = Self::transfer(receivers, &geometry(bodies, set)?, method, control)?;
        let without = match set {
            Some(set) => Self::transfer(receivers, set, method, control)?,
            None => vec![],
        };
        let places: Vec<usize> = (0..receivers.depth.len()).filter(|&i| receivers.is_seen(i)).collect();
        let mut hidden: Vec<Option<[f32; LEN]>> = vec![None; receivers.depth.len()];
        let mut all_open = hidden.clone();
        let mut cosine = vec![0.0; LEN];
        for (row, &place) in places.iter().enumerate() {
            let with = &with[row * LEN..][..LEN];
            let open = match without.get(row * LEN..(row + 1) * LEN) {
                Some(without) => without,
                None => {
                    let n = receivers.normal_at(place).as_dvec3().normalize();
                    cosine.copy_from_slice(&crate::sphere::clamped_cosine(order(), n));
                    cosine.iter_mut().for_each(|c| *c /= PI);
                    &cosine
                }
            };
            hidden[place] = Some(std::array::from_fn(|k| (PI * (open[k] - with[k])) as f32));
            all_open[place] = Some(std::array::from_fn(|k| (PI * open[k]) as f32));
        }
        Ok(Self { hidden, open: all_open, reflected: Vec::new() })
    }

    /// Transfer vectors of the receivers that see something, one after the other.
    fn transfer(receivers: &Receivers, geometry: &Geometry, method: Method, control: &dyn Control) -> Result<Vec<f64>> {
        let tree = FaceTree::new(geometry.positions.clone(), geometry.triangles.clone());
        let seen: Vec<usize> = (0..receivers.depth.len()).filter(|&i| receivers.is_seen(i)).collect();
        let points: Vec<_> = seen
            .par_iter()
            .map(|&i| {
                let (p, n) = (receivers.point(i).as_dvec3(), receivers.normal_at(i).as_dvec3().normalize());
                (p, n, around(&tree, p, n, f64::from(receivers.depth[i])))
            })
            .collect();
        let request = Request { order: BANDS, transfer_sh: true, ..Request::default() };
        let points = crate::bake::Receivers::leaving_out(points);
        let outcome = integrate(geometry, None, &points, &request, method, None, control)?;
        if !outcome.done.iter().all(|done| *done) {
            return Err(Error::Interrupted);
        }
        Ok(outcome.arrays.get("transfer_sh").expect("was asked for").data.clone())
    }

    /// Hidden irradiance at a place in `light`, per colour; none where nothing is seen.
    pub fn hidden(&self, place: usize, light: &DistantLight) -> Option<[f64; 3]> {
        self.hidden[place].map(|hidden| lit(&hidden, light))
    }

    /// Irradiance at a place in `light` that the static scene leaves, without bodies; none for spheres and where nothing is seen.
    pub fn open(&self, place: usize, light: &DistantLight) -> Option<[f64; 3]> {
        self.open.get(place)?.map(|open| lit(&open, light))
    }

    /// Irradiance that the spheres reflect to a place.
    pub fn reflected(&self, place: usize) -> Option<[f64; 3]> {
        self.reflected.get(place).map(|colour| colour.map(f64::from))
    }
}

/// Irradiance of a receiver with a transfer vector.
fn lit(transfer: &[f32; LEN], light: &DistantLight) -> [f64; 3] {
    let sum = |colour: &Vec<f64>| colour.iter().zip(transfer).map(|(l, t)| l * f64::from(*t)).sum();
    light.coefficients().each_ref().map(sum)
}

fn order() -> Order {
    Order::new(BANDS).expect("six bands are an order")
}

/// The bodies' triangles, with those of the set.
fn geometry(bodies: &[Surface], set: Option<&Geometry>) -> Result<Geometry> {
    let mut builder = GeometryBuilder::default();
    let meshes = bodies.iter().map(|body| (body.positions.clone(), body.triangles.to_vec()));
    let set = set.map(|set| (set.positions.to_vec(), set.triangles.to_vec()));
    for (i, (positions, triangles)) in meshes.chain(set).enumerate() {
        let mesh = Mesh { name: format!("body {i}"), positions, triangles, material: Material::default() };
        builder.add(mesh, glam::DAffine3::IDENTITY)?;
    }
    Ok(builder.build())
}

/// The faces on which a receiver in single precision lies: those that pass within the rounding of its coordinates.
fn around(tree: &FaceTree, p: DVec3, n: DVec3, depth: f64) -> Vec<u32> {
    let mut faces = Vec::new();
    let near = 4.0 * f64::from(f32::EPSILON) * (p.abs().max_element() + depth);
    // Any face through the receiver is met by one of both rays along its normal from just beside it.
    for side in [1.0, -1.0] {
        tree.visit(p + side * near * n, -side * n, |face| {
            let [a, b, c] = tree.corners(face).map(|v| v.as_dvec3());
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let height = normal.dot(p - a);
            let q = p - height * normal;
            let inside = [(a, b), (b, c), (c, a)].into_iter().all(|(a, b)| {
                let edge = b - a;
                edge.cross(q - a).dot(normal) >= -near * edge.length()
            });
            if height.abs() <= near && inside && !faces.contains(&face) {
                faces.push(face);
            }
            std::ops::ControlFlow::Continue(())
        });
    }
    faces
}

/// The spheres that reach above a receiver's horizon, relative to it.
struct SeenSpheres {
    list: Vec<(u32, Vec3, f32)>,
}

impl SeenSpheres {
    fn new(p: DVec3, n: DVec3, proxies: &[Proxy]) -> Self {
        let relative = (0u32..).zip(proxies).filter_map(|(i, proxy)| {
            let offset = proxy.center.as_dvec3() - p;
            let radius = f64::from(proxy.radius);
            // Distance squared to the rim: negative inside.
            let power = offset.length_squared() - radius * radius;
            (offset.dot(n) > -radius).then_some((i, offset.as_vec3(), power as f32))
        });
        Self { list: relative.collect() }
    }

    /// The sphere that the ray along `w` meets first, and where. Receivers inside of a sphere see it from within where they look
    /// towards its far side.
    fn nearest(&self, w: Vec3) -> Option<(u32, f32)> {
        let mut nearest: Option<(u32, f32)> = None;
        for &(i, offset, power) in &self.list {
            let along = offset.dot(w);
            let discriminant = along * along - power;
            if along > 0.0 && discriminant > 0.0 {
                let t = (along - discriminant.sqrt()).max(0.0);
                if nearest.is_none_or(|(_, best)| t < best) {
                    nearest = Some((i, t));
                }
            }
        }
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::shapes::Icosphere;
    use crate::sphere::closed_forms::sphere_form_factor;

    fn receivers() -> Receivers {
        let mut receivers = Receivers::nothing(4, 1, 0);
        for (x, p) in [[0.0, 0.0], [1.5, 0.2], [2.5, -1.0]].into_iter().enumerate() {
            let i = receivers.index(x, 0);
            receivers.position[0][i] = p[0];
            receivers.position[1][i] = 0.0;
            receivers.position[2][i] = p[1];
            receivers.normal[1][i] = 1.0;
            receivers.normal[2][i] = 0.0;
            receivers.depth[i] = 1.0;
        }
        receivers
    }

    /// The constant light 1.
    fn even() -> DistantLight {
        let mut colour = vec![0.0; 16];
        colour[0] = (4.0 * PI).sqrt();
        DistantLight::from_coefficients(Order::new(4).unwrap(), [colour.clone(), colour.clone(), colour])
    }

    #[test]
    fn spheres_and_their_surfaces_hide_their_form_factor() {
        let (center, radius) = (Vec3::new(0.3, 0.8, -0.2), 0.9);
        let proxies = [Proxy { center, radius, albedo: Vec3::new(1.0, 0.5, 0.0), share: 1.0 }];
        let receivers = receivers();
        let spheres = Truth::of_spheres(&receivers, &proxies, &even(), None, 4096, &()).unwrap();
        let mut mesh = Icosphere { radius: radius.into(), subdivisions: 5 }.mesh().unwrap();
        mesh.positions.iter_mut().for_each(|p| *p += center);
        let normals = mesh.positions.iter().map(|p| (*p - center).normalize()).collect();
        let albedo = vec![Vec3::ONE; mesh.triangles.len()];
        let body = Surface {
            positions: mesh.positions,
            normals,
            triangles: mesh.triangles.into(),
            albedo,
            ..Surface::default()
        };
        let surfaces = Truth::of_surfaces(&receivers, &[body], None, Method::Exact, &()).unwrap();
        for x in 0..3 {
            let i = receivers.index(x, 0);
            let offset = (center - receivers.point(i)).as_dvec3();
            if offset.length() < f64::from(radius) {
                continue;
            }
            let expected = PI * sphere_form_factor(offset, radius.into(), DVec3::Y);
            let by_spheres = spheres.hidden(i, &even()).unwrap();
            let by_surfaces = surfaces.hidden(i, &even()).unwrap();
            // 4096 scrambled points; and a polyhedron that lacks 1/3000 of the area.
            assert!((by_spheres[0] - expected).abs() < 5e-3, "{by_spheres:?} {expected}");
            assert!((by_surfaces[1] - expected).abs() < 2e-3, "{by_surfaces:?} {expected}");
            // A white surface under even light of radiance 1 looks like the light.
            let reflected = spheres.reflected(i).unwrap();
            assert!((reflected[0] - by_spheres[0]).abs() < 1e-3 && (reflected[1] - 0.5 * by_spheres[0]).abs() < 1e-3);
        }
        assert!(spheres.hidden(3, &even()).is_none());
    }
}
