use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::{FaceTree, Mesh, Topology};
use crate::{Error, Result};

/// Largest magnitude of a coordinate that a [`Geometry`] accepts, in scene units.
///
/// Fourth powers of lengths must stay finite in single precision where normals (length squared) meet offsets and areas
/// are compared; beyond this size nothing is gained by trying.
pub const MAX_COORDINATE: f32 = 1e15;

/// All triangles of a scene in world space: welded, cleaned, and kept exactly as loaded (f32, never re-centred).
///
/// Made by a [`GeometryBuilder`]. Vertices are welded over the whole scene where their positions are exactly equal
/// (-0 equals +0); no triangle's normal `(b - a) x (c - a)`, taken in f64, is zero, and no two triangles have the same
/// three corners.
#[derive(Clone, Debug)]
pub struct Geometry {
    /// Distinct vertex positions.
    pub positions: Arc<[Vec3]>,
    /// Vertex indices of every triangle; no triangle is degenerate, none occurs twice.
    pub triangles: Arc<[[u32; 3]]>,
    /// Index into `meshes` of every triangle.
    pub triangle_mesh: Vec<u32>,
    /// Index into `materials` of every triangle.
    pub triangle_material: Vec<u32>,
    /// Names of the meshes the triangles came from.
    pub meshes: Vec<String>,
    /// Materials.
    pub materials: Vec<Material>,
    /// What was dropped and merged on the way in.
    pub cleaning: Cleaning,
}

/// A diffuse material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the source file.
    pub name: String,
    /// Diffuse reflectance per colour, linear, in [0, 1].
    pub albedo: Vec3,
}

impl Default for Material {
    /// What a mesh without a material gets: a light grey.
    fn default() -> Self {
        Self { name: "default".into(), albedo: Vec3::splat(0.8) }
    }
}

/// Counts of what assembling a [`Geometry`] dropped or merged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaning {
    /// Vertices merged into an earlier one with an equal position.
    pub welded_vertices: usize,
    /// Triangles of zero area dropped.
    pub degenerate_triangles: usize,
    /// Triangles dropped because an earlier one has the same three corners.
    pub duplicate_triangles: usize,
}

/// The triangles around every vertex, see [`Geometry::vertex_faces`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VertexFaces {
    first: Vec<u32>,
    triangles: Vec<u32>,
}

impl VertexFaces {
    /// Indices of the triangles that have `vertex` as a corner, ascending.
    pub fn of(&self, vertex: u32) -> &[u32] {
        let vertex = vertex as usize;
        &self.triangles[self.first[vertex] as usize..self.first[vertex + 1] as usize]
    }
}

impl Geometry {
    /// A tree over all triangles, for rays.
    pub fn face_tree(&self) -> FaceTree {
        FaceTree::new(self.positions.clone(), self.triangles.clone())
    }

    /// Smallest and largest coordinates; `None` without triangles.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold([first; 2], |[low, high], &p| [low.min(p), high.max(p)]))
    }

    /// The corners of a triangle in f64.
    pub fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize].as_dvec3())
    }

    /// Which edges join which triangles.
    pub fn topology(&self) -> Topology {
        Topology::new(self.positions.len(), &self.triangles)
    }

    /// The triangles around every vertex.
    pub fn vertex_faces(&self) -> VertexFaces {
        let mut first = vec![0u32; self.positions.len() + 1];
        for &v in self.triangles.as_flattened() {
            first[v as usize + 1] += 1;
        }
        for v in 0..self.positions.len() {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut triangles = vec![0u32; 3 * self.triangles.len()];
        for (t, corners) in (0u32..).zip(self.triangles.iter()) {
            for &v in corners {
                triangles[next[v as usize] as usize] = t;
                next[v as usize] += 1;
            }
        }
        VertexFaces { first, triangles }
    }

    /// Unit normal of every welded vertex: the normals of its triangles, weighted by their angles at the vertex
    /// (Thürmer and Wüthrich 1998), which does not depend on how the surface is cut into triangles.
    ///
    /// `None` where the weighted normals cancel: their sum is shorter than 1e-9 times the sum of the angles, as at the
    /// apex of a double cover or on an edge shared by two faces folded flat. The direction left over is rounding.
    pub fn angle_weighted_normals(&self) -> Vec<Option<DVec3>> {
        let faces = self.vertex_faces();
        let normal = |vertex: usize| {
            let (mut sum, mut angles) = (DVec3::ZERO, 0.0);
            for &t in faces.of(vertex as u32) {
                let corners = self.triangles[t as usize];
                let at = corners.iter().position(|&v| v as usize == vertex)?;
                let [a, b, c] = [0, 1, 2].map(|k| self.positions[corners[(at + k) % 3] as usize].as_dvec3());
                let (u, v) = (b - a, c - a);
                let n = u.cross(v);
                let angle = n.length().atan2(u.dot(v));
                sum += n.normalize() * angle;
                angles += angle;
            }
            (sum.length() > 1e-9 * angles).then(|| sum.normalize())
        };
        (0..self.positions.len()).into_par_iter().map(normal).collect()
    }
}

/// Assembles a [`Geometry`] from meshes.
///
/// ```
/// use glam::{DAffine3, Vec3};
/// use silhouette::scene::{GeometryBuilder, Mesh};
///
/// let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
/// let mut builder = GeometryBuilder::default();
/// builder.add(Mesh::new("triangle", corners.clone(), vec![[0, 1, 2]]), DAffine3::IDENTITY)?;
/// builder.add(Mesh::new("again", corners, vec![[2, 0, 1]]), DAffine3::IDENTITY)?;
/// let geometry = builder.build();
/// assert_eq!((geometry.positions.len(), geometry.triangles.len()), (3, 1));
/// assert_eq!(geometry.cleaning.duplicate_triangles, 1);
/// # Ok::<(), silhouette::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct GeometryBuilder {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    triangle_mesh: Vec<u32>,
    triangle_material: Vec<u32>,
    meshes: Vec<String>,
    materials: Vec<Material>,
}

impl GeometryBuilder {
    /// Adds a mesh, moved as by [`Mesh::transformed`].
    ///
    /// # Errors
    /// A position that is not finite or beyond [`MAX_COORDINATE`], an index out of range, an albedo outside [0, 1]
    /// (each names mesh and element), or more vertices or triangles than 32 bits can count. The builder keeps what it had.
    pub fn add(&mut self, mesh: Mesh, transform: DAffine3) -> Result<()> {
        let Mesh { name, positions, triangles, material } = mesh.transformed(transform);
        let base = self.positions.len();
        // Half-edges are counted in 32 bits: three to a triangle.
        let limit = u32::MAX as usize / 3;
        if base + positions.len() > limit || self.triangles.len() + triangles.len() > limit {
            return Err(Error::input(format!("mesh `{name}`: the scene has more than {limit} vertices or triangles")));
        }
        if let Some(i) = triangles.iter().position(|t| t.iter().any(|&v| v as usize >= positions.len())) {
            let bad = triangles[i].into_iter().max().unwrap_or_default();
            return Err(Error::input(format!(
                "mesh `{name}`: triangle {i} refers to vertex {bad}, but there are only {}",
                positions.len()
            )));
        }
        if !(material.albedo.cmpge(Vec3::ZERO) & material.albedo.cmple(Vec3::ONE)).all() {
            return Err(Error::input(format!(
                "mesh `{name}`: material `{}` has albedo {}, outside [0, 1]",
                material.name, material.albedo
            )));
        }
        if let Some(i) = positions.iter().position(|&p| !is_in_range(p)) {
            return Err(Error::input(format!("mesh `{name}`: vertex {i} {}", out_of_range(positions[i]))));
        }

        let material = self.material(material);
        let mesh = self.meshes.len() as u32;
        self.meshes.push(name);
        self.positions.extend(positions);
        self.triangle_mesh.resize(self.triangles.len() + triangles.len(), mesh);
        self.triangle_material.resize(self.triangles.len() + triangles.len(), material);
        self.triangles.extend(triangles.into_iter().map(|t| t.map(|v| v + base as u32)));
        Ok(())
    }

    /// Equal materials are kept once.
    fn material(&mut self, material: Material) -> u32 {
        let index = self.materials.iter().position(|known| *known == material).unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        });
        index as u32
    }

    /// Welds, drops what is degenerate or double, and hands out the geometry. Vertices that no kept triangle uses are
    /// dropped too; the rest keep their order of first appearance, triangles keep theirs.
    pub fn build(self) -> Geometry {
        let Self { positions, mut triangles, triangle_mesh, triangle_material, meshes, materials } = self;
        let mut cleaning = Cleaning::default();

        let first_equal = first_of_equals(&positions, |p| p.to_array().map(|x| (x + 0.0).to_bits()));
        cleaning.welded_vertices = first_equal.iter().enumerate().filter(|&(i, &first)| i as u32 != first).count();
        triangles.par_iter_mut().for_each(|t| *t = t.map(|v| first_equal[v as usize]));
        drop(first_equal);

        let first_double = first_of_equals(&triangles, |t| {
            let mut key = *t;
            key.sort_unstable();
            key
        });
        let mut kept = Vec::with_capacity(triangles.len());
        for (i, &t) in triangles.iter().enumerate() {
            let [a, b, c] = t.map(|v| positions[v as usize].as_dvec3());
            if (b - a).cross(c - a) == DVec3::ZERO {
                cleaning.degenerate_triangles += 1;
            } else if first_double[i] as usize != i {
                cleaning.duplicate_triangles += 1;
            } else {
                kept.push(i);
            }
        }

        let mut index = vec![u32::MAX; positions.len()];
        for v in kept.iter().flat_map(|&i| triangles[i]) {
            index[v as usize] = 0;
        }
        let mut distinct = Vec::new();
        for (&p, index) in positions.iter().zip(&mut index).filter(|(_, index)| **index == 0) {
            *index = distinct.len() as u32;
            distinct.push(p);
        }
        Geometry {
            positions: distinct.into(),
            triangles: kept.iter().map(|&i| triangles[i].map(|v| index[v as usize])).collect(),
            triangle_mesh: kept.iter().map(|&i| triangle_mesh[i]).collect(),
            triangle_material: kept.iter().map(|&i| triangle_material[i]).collect(),
            meshes,
            materials,
            cleaning,
        }
    }
}

/// Whether a position is finite and within [`MAX_COORDINATE`].
pub(super) fn is_in_range(p: Vec3) -> bool {
    p.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

/// Says why a position is refused.
pub(super) fn out_of_range(p: Vec3) -> String {
    if p.is_finite() {
        format!("({}, {}, {}) is beyond the accepted range of ±{MAX_COORDINATE:e}; scale the scene down", p.x, p.y, p.z)
    } else {
        format!("({}, {}, {}) is not finite", p.x, p.y, p.z)
    }
}

/// For every element the index of the first one with the same key.
fn first_of_equals<T: Sync>(elements: &[T], key: impl Fn(&T) -> [u32; 3] + Sync) -> Vec<u32> {
    let mut sorted: Vec<([u32; 3], u32)> = elements.par_iter().map(&key).zip(0..elements.len() as u32).collect();
    sorted.par_sort_unstable();
    let mut first = vec![0; elements.len()];
    for equals in sorted.chunk_by(|a, b| a.0 == b.0) {
        for &(_, i) in equals {
            first[i as usize] = equals[0].1;
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_SQRT_2;

    use super::super::EdgeKind;
    use super::*;

    fn build(meshes: impl IntoIterator<Item = (Vec<Vec3>, Vec<[u32; 3]>)>) -> Geometry {
        let mut builder = GeometryBuilder::default();
        for (positions, triangles) in meshes {
            builder.add(Mesh::new("mesh", positions, triangles), DAffine3::IDENTITY).unwrap();
        }
        builder.build()
    }

    /// The unit cube as twelve loose triangles: 36 vertices of which 8 differ.
    fn loose_cube() -> Vec<Vec3> {
        let mut corners = Vec::new();
        for axis in 0..3 {
            let [x, y, z] = [0, 1, 2].map(|k| [Vec3::X, Vec3::Y, Vec3::Z][(axis + k) % 3]);
            corners.extend([x, x + y, x + y + z, x, x + y + z, x + z]);
            corners.extend([Vec3::ZERO, y + z, y, Vec3::ZERO, z, y + z]);
        }
        corners
    }

    fn loose(corners: Vec<Vec3>) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        (corners, triangles)
    }

    #[test]
    fn equal_positions_are_welded_over_all_meshes() {
        let (mut first, mut second) = (loose_cube(), loose_cube());
        first.truncate(18);
        second.drain(..18);
        let geometry = build([loose(first), loose(second)]);
        assert_eq!((geometry.positions.len(), geometry.triangles.len()), (8, 12));
        assert_eq!(geometry.cleaning, Cleaning { welded_vertices: 28, ..Cleaning::default() });
        assert_eq!(geometry.triangle_mesh, [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1]);
        let topology = geometry.topology();
        assert_eq!((topology.edges().len(), topology.count(EdgeKind::Manifold), topology.bodies()), (18, 18, 1));
    }

    #[test]
    fn signed_zeros_are_equal_and_neighbouring_floats_are_not() {
        let above_one = f32::from_bits(1.0f32.to_bits() + 1);
        let a = vec![Vec3::new(0.0, -0.0, 0.0), Vec3::X, Vec3::Y];
        let b = vec![Vec3::new(-0.0, 0.0, -0.0), Vec3::new(above_one, 0.0, 0.0), Vec3::new(-0.0, 1.0, 0.0)];
        let geometry = build([loose(a), loose(b)]);
        assert_eq!(geometry.positions.len(), 4);
        assert_eq!(geometry.triangles.as_ref(), [[0, 1, 2], [0, 3, 2]]);
    }

    #[test]
    fn degenerate_and_duplicate_triangles_are_dropped_and_counted() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE, 2.0 * Vec3::ONE, 3.0 * Vec3::ONE, Vec3::X];
        // Of the seven: two corners equal by index, two by position, three in a line, one double, one double turned round.
        let triangles = vec![[0, 1, 1], [1, 6, 2], [3, 4, 5], [0, 1, 2], [1, 2, 0], [0, 2, 6], [0, 1, 3]];
        let geometry = build([(positions, triangles)]);
        assert_eq!(geometry.triangles.as_ref(), [[0, 1, 2], [0, 1, 3]]);
        assert_eq!(geometry.positions.len(), 4);
        let expected = Cleaning { welded_vertices: 1, degenerate_triangles: 3, duplicate_triangles: 2 };
        assert_eq!(geometry.cleaning, expected);
    }

    #[test]
    fn identity_keeps_every_bit_and_mirrors_keep_the_outside() {
        let corner = Vec3::new(0.1, f32::MIN_POSITIVE, 123456.79);
        let geometry = build([loose(vec![corner, Vec3::X, Vec3::Y])]);
        assert_eq!(geometry.positions[0].to_array().map(f32::to_bits), corner.to_array().map(f32::to_bits));

        let (positions, triangles) = loose(loose_cube());
        let mut builder = GeometryBuilder::default();
        let mirror = DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
        builder.add(Mesh::new("cube", positions, triangles), mirror).unwrap();
        let geometry = builder.build();
        let volume: f64 = (0..12).map(|t| geometry.corners(t)).map(|[a, b, c]| a.dot(b.cross(c))).sum();
        assert_eq!(volume / 6.0, 1.0);
    }

    #[test]
    fn bad_meshes_are_refused_by_name_and_element() {
        let refused = |positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, scale: f64, why: &str| {
            let transform = DAffine3::from_scale(DVec3::splat(scale));
            let error = GeometryBuilder::default().add(Mesh::new("bad", positions, triangles), transform).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
        };
        let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        refused(corners.clone(), vec![[0, 1, 2], [0, 1, 3]], 1.0, "mesh `bad`: triangle 1 refers to vertex 3");
        refused(vec![Vec3::ZERO, Vec3::NAN], vec![], 1.0, "mesh `bad`: vertex 1 (NaN, NaN, NaN) is not finite");
        refused(vec![Vec3::ZERO, Vec3::INFINITY], vec![], 1.0, "not finite");
        refused(vec![Vec3::splat(1.1e15)], vec![], 1.0, "accepted range of ±1e15");
        refused(corners.clone(), vec![], 1e16, "mesh `bad`: vertex 1");
        refused(corners, vec![], 1e300, "not finite");
        let mut mesh = Mesh::new("bad", vec![], vec![]);
        mesh.material.albedo = Vec3::new(0.0, 1.5, 0.0);
        assert!(GeometryBuilder::default().add(mesh, DAffine3::IDENTITY).unwrap_err().to_string().contains("albedo"));
    }

    #[test]
    fn corner_normals_of_a_cube_do_not_depend_on_the_diagonals() {
        let geometry = build([loose(loose_cube())]);
        let faces = geometry.vertex_faces();
        for (v, normal) in (0u32..).zip(geometry.angle_weighted_normals()) {
            let outward = (geometry.positions[v as usize].as_dvec3() - 0.5).normalize();
            assert!(normal.unwrap().distance(outward) < 1e-15);
            assert!(faces.of(v).iter().all(|&t| geometry.triangles[t as usize].contains(&v)));
        }
        assert_eq!((0..8).map(|v| faces.of(v).len()).sum::<usize>(), 36);
    }

    #[test]
    fn cancelling_normals_are_flagged() {
        // A roof edge 0-1 with a right angle, and a flat flap folded back onto itself along 4-5: at 4 both angles are
        // right angles, at 5 they differ.
        let positions = [
            [0., 0., 0.],
            [1., 0., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [5., 0., 0.],
            [6., 0., 0.],
            [5., 1., 0.],
            [5., 2., 0.],
        ];
        let positions = positions.map(Vec3::from_array).to_vec();
        let normals = build([(positions, vec![[0, 1, 2], [1, 0, 3], [4, 5, 6], [5, 4, 7]])]).angle_weighted_normals();
        assert!(normals[0].unwrap().distance(DVec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2)) < 1e-15);
        assert_eq!(normals[4], None);
        assert_eq!(normals[5], Some(DVec3::NEG_Z));
    }
}
