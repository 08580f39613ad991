use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3};
use gltf::buffer;

use super::clip::{Clip, Place};
use super::{Joint, Sphere, SphereSet};
use crate::scene::gltf::{local, material, node_name, open, scene_nodes};
use crate::scene::gltf_read::{Checked, Influences, influences, joints, morphed_positions, skinned, triangles};
use crate::scene::{Geometry, GeometryBuilder, Mesh};
use crate::{Error, Result};

/// A body with joints: the meshes of a glTF file, what holds their vertices, and the clips that move it.
///
/// ```no_run
/// use silhouette::proxy::{Character, fit};
///
/// let knight = Character::load("knight.glb")?;
/// let (spheres, _) = fit(&knight.geometry(&knight.rest())?, 64, &())?;
/// let set = knight.attach(&spheres)?;
/// let pose = knight.pose(knight.clip("Walking_A")?, 0.5);
/// let (spheres, meshes) = (knight.place(&set, &pose)?, knight.meshes(&pose));
/// # Ok::<(), silhouette::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Character {
    path: PathBuf,
    nodes: Vec<Node>,
    /// The nodes of the scene; parents come first.
    order: Vec<usize>,
    parts: Vec<Part>,
    clips: Vec<Clip>,
}

#[derive(Clone, Debug)]
struct Node {
    name: String,
    parent: Option<usize>,
    rest: DAffine3,
}

/// A primitive in its own space.
#[derive(Clone, Debug)]
struct Part {
    node: usize,
    mesh: Mesh,
    skin: Option<Skin>,
}

#[derive(Clone, Debug)]
struct Skin {
    /// Nodes, and what carries a vertex into their frames.
    joints: Vec<(usize, DAffine3)>,
    influences: Vec<Influences>,
}

/// A vertex in a pose, a third of the area around it, and the nodes that hold it with their shares.
struct HeldVertex {
    position: DVec3,
    area: f64,
    weights: Vec<(usize, f64)>,
}

/// Where every node of a character stands in the world.
#[derive(Clone, Debug)]
pub struct Pose {
    worlds: Vec<DAffine3>,
}

impl Character {
    /// Reads a skinned glTF file, text (`.gltf`) or binary (`.glb`), with everything that its default scene shows: meshes
    /// that hang on a joint move with it.
    ///
    /// # Errors
    /// As [`load_meshes`](crate::scene::load_meshes), a file without a skin, or a clip whose times or values are malformed.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let found = Self::find(path)?;
        found.ok_or_else(|| Error::file(path, "no skin in this file, so nothing holds its vertices to joints"))
    }

    /// As [`Self::load`], but `None` where no mesh of the scene has a skin.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn find(path: impl AsRef<Path>) -> Result<Option<Self>> {
        let path = path.as_ref();
        let character = read(path)
            .map_err(|message| Error::file(path, message.split_whitespace().collect::<Vec<_>>().join(" ")))?;
        Ok(character.parts.iter().any(|part| part.skin.is_some()).then_some(character))
    }

    /// All clips, in file order.
    pub fn clips(&self) -> &[Clip] {
        &self.clips
    }

    /// A clip by its name.
    ///
    /// # Errors
    /// An unknown name, or a character without clips; the known ones are listed.
    pub fn clip(&self, name: &str) -> Result<&Clip> {
        self.clips.iter().find(|clip| clip.name == name).ok_or_else(|| {
            let known: Vec<&str> = self.clips.iter().map(|clip| clip.name.as_str()).collect();
            Error::file(
                &self.path,
                match known.len() {
                    0 => format!("no clip is called `{name}`: there are none in this file"),
                    _ => format!("no clip is called `{name}`; there are {}", known.join(", ")),
                },
            )
        })
    }

    /// Leaves out the meshes of the nodes with these names, such as tools that are not in hand.
    ///
    /// # Errors
    /// A name that no mesh has, the known ones are listed; or nothing left.
    pub fn without(mut self, names: &[String]) -> Result<Self> {
        for name in names {
            let nodes = &self.nodes;
            if self.parts.iter().all(|part| nodes[part.node].name != *name) {
                let known: Vec<&str> = self.parts.iter().map(|part| nodes[part.node].name.as_str()).collect();
                let message = format!("no mesh is called `{name}`; there are {}", known.join(", "));
                return Err(Error::file(&self.path, message));
            }
            self.parts.retain(|part| nodes[part.node].name != *name);
        }
        match self.parts.is_empty() {
            true => Err(Error::file(&self.path, "no mesh is left")),
            false => Ok(self),
        }
    }

    /// The pose of the file's nodes without any clip.
    pub fn rest(&self) -> Pose {
        self.posed(&BTreeMap::new())
    }

    /// The pose that a clip has at `time` in seconds, held before its first and after its last key.
    pub fn pose(&self, clip: &Clip, time: f64) -> Pose {
        let rest = |node: usize| {
            let (scale, rotation, translation) = self.nodes[node].rest.to_scale_rotation_translation();
            Place { translation, rotation, scale }
        };
        self.posed(&clip.places(time, rest))
    }

    fn posed(&self, places: &BTreeMap<usize, Place>) -> Pose {
        let mut worlds = vec![DAffine3::IDENTITY; self.nodes.len()];
        for &node in &self.order {
            let parent = self.nodes[node].parent.map_or(DAffine3::IDENTITY, |parent| worlds[parent]);
            worlds[node] = parent * places.get(&node).map_or(self.nodes[node].rest, |place| place.affine());
        }
        Pose { worlds }
    }

    /// The meshes in a pose, in the world: linear blending, as the format has it.
    pub fn meshes(&self, pose: &Pose) -> Vec<Mesh> {
        self.parts.iter().map(|part| part.posed(pose)).collect()
    }

    /// The meshes in a pose as one geometry.
    ///
    /// # Errors
    /// As [`GeometryBuilder::add`].
    pub fn geometry(&self, pose: &Pose) -> Result<Geometry> {
        let mut builder = GeometryBuilder::default();
        for mesh in self.meshes(pose) {
            builder.add(mesh, DAffine3::IDENTITY).map_err(|error| Error::file(&self.path, error))?;
        }
        Ok(builder.build())
    }

    /// Hangs spheres that stand in the world around the rest pose on joints, each on the one that holds most of the surface
    /// within it.
    ///
    /// # Errors
    /// A joint that is squashed flat in the rest pose: it has no frame to hang a sphere in.
    pub fn attach(&self, spheres: &SphereSet) -> Result<SphereSet> {
        let rest = self.rest();
        let held = self.held_area(&rest);
        let mut set = SphereSet::default();
        for sphere in &spheres.spheres {
            let center = sphere.center.as_dvec3();
            let mut areas = BTreeMap::new();
            let mut nearest = (f64::INFINITY, 0);
            for HeldVertex { position, area, weights } in &held {
                let distance = position.distance(center);
                let strongest = weights.iter().max_by(|a, b| a.1.total_cmp(&b.1));
                if let Some(strongest) = strongest.filter(|_| distance < nearest.0) {
                    nearest = (distance, strongest.0);
                }
                if distance <= f64::from(sphere.radius) {
                    for (node, weight) in weights {
                        *areas.entry(*node).or_insert(0.0) += weight * area;
                    }
                }
            }
            let most = areas.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
            let node = most.map_or(nearest.1, |(node, _)| node);
            set.spheres.push(self.hang(sphere, node, &rest, &mut set.joints)?);
        }
        Ok(set)
    }

    fn hang(&self, sphere: &Sphere, node: usize, rest: &Pose, joints: &mut Vec<Joint>) -> Result<Sphere> {
        let world = rest.worlds[node];
        let inverse = world.inverse();
        let stretch = stretch(world.matrix3);
        if !(inverse.is_finite() && stretch > 0.0) {
            let message = format!("joint `{}` is squashed flat in the rest pose", self.nodes[node].name);
            return Err(Error::file(&self.path, message));
        }
        let joint = joints.iter().position(|joint| joint.node as usize == node).unwrap_or_else(|| {
            joints.push(Joint { name: self.nodes[node].name.clone(), node: node as u32 });
            joints.len() - 1
        });
        let center = inverse.transform_point3(sphere.center.as_dvec3()).as_vec3();
        // What rounding moves the centre by must not leave anything out.
        let moved = world.transform_point3(center.as_dvec3()).distance(sphere.center.as_dvec3());
        let radius = (((f64::from(sphere.radius) + moved) / stretch) as f32).next_up();
        Ok(Sphere { center, radius, joint: Some(joint as u32) })
    }

    /// Every vertex in the pose with a third of the area around it and the nodes that hold it.
    fn held_area(&self, pose: &Pose) -> Vec<HeldVertex> {
        let mut held = Vec::new();
        for part in &self.parts {
            let mesh = part.posed(pose);
            let mut areas = vec![0.0; mesh.positions.len()];
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize].as_dvec3());
                t.iter().for_each(|&v| areas[v as usize] += (b - a).cross(c - a).length() / 6.0);
            }
            for (i, (p, area)) in mesh.positions.iter().zip(areas).enumerate() {
                let weights = match &part.skin {
                    None => vec![(part.node, 1.0)],
                    Some(skin) => {
                        let influences = &skin.influences[i];
                        let total: f64 = influences.iter().map(|(_, weight)| weight).sum();
                        influences.iter().map(|&(j, w)| (skin.joints[usize::from(j)].0, w / total)).collect()
                    }
                };
                held.push(HeldVertex { position: p.as_dvec3(), area, weights });
            }
        }
        held
    }

    /// The spheres of a set in the world, where the pose carries them. Joints that stretch make them larger, by their largest
    /// factor.
    ///
    /// # Errors
    /// A joint that this character does not have under that number and name.
    pub fn place(&self, set: &SphereSet, pose: &Pose) -> Result<Vec<Sphere>> {
        for joint in &set.joints {
            if self.nodes.get(joint.node as usize).is_none_or(|node| node.name != joint.name) {
                let message = format!("node {} is not the joint `{}` that the spheres hang on", joint.node, joint.name);
                return Err(Error::file(&self.path, message));
            }
        }
        let placed = |sphere: &Sphere| {
            let joint = sphere.joint.and_then(|joint| set.joints.get(joint as usize));
            let world = joint.map_or(DAffine3::IDENTITY, |joint| pose.worlds[joint.node as usize]);
            let center = world.transform_point3(sphere.center.as_dvec3()).as_vec3();
            Sphere { center, radius: (f64::from(sphere.radius) * stretch(world.matrix3)) as f32, joint: sphere.joint }
        };
        Ok(set.spheres.iter().map(placed).collect())
    }
}

impl Part {
    fn posed(&self, pose: &Pose) -> Mesh {
        let Some(skin) = &self.skin else { return self.mesh.clone().transformed(pose.worlds[self.node]) };
        let carried: Vec<DAffine3> = skin.joints.iter().map(|&(node, bind)| pose.worlds[node] * bind).collect();
        let vertices = self.mesh.positions.iter().zip(&skin.influences);
        let positions = vertices.map(|(&p, influences)| skinned(p, influences, &carried)).collect();
        Mesh { positions, ..self.mesh.clone() }
    }
}

/// By how much a matrix stretches a vector at most: its largest singular value, by the iteration of powers.
fn stretch(matrix: DMat3) -> f64 {
    let square = matrix.transpose() * matrix;
    // The longest column is within a factor of sqrt(3) of the answer and never across it.
    let mut v = [square.x_axis, square.y_axis, square.z_axis].into_iter().fold(DVec3::ZERO, |longest, column| {
        if column.length_squared() > longest.length_squared() { column } else { longest }
    });
    for _ in 0..64 {
        let Some(next) = (square * v).try_normalize() else { return 0.0 };
        v = next;
    }
    (matrix * v).length()
}

fn read(path: &Path) -> Checked<Character> {
    let (document, buffers) = open(path)?;
    let mut nodes: Vec<Node> =
        document.nodes().map(|node| Node { name: node_name(&node), parent: None, rest: local(&node) }).collect();
    let mut order = Vec::new();
    let mut parts = Vec::new();
    let mut in_scene = vec![false; nodes.len()];
    let scene = scene_nodes(&document)?;
    for (node, parent) in &scene {
        nodes[node.index()].parent = *parent;
        in_scene[node.index()] = true;
        order.push(node.index());
    }
    for (node, _) in &scene {
        read_parts(node, &in_scene, &buffers, &mut parts)?;
    }
    let clips = document.animations().map(|animation| Clip::read(&animation, &buffers)).collect::<Checked<_>>()?;
    Ok(Character { path: path.to_owned(), nodes, order, parts, clips })
}

fn read_parts(node: &gltf::Node, in_scene: &[bool], buffers: &[buffer::Data], parts: &mut Vec<Part>) -> Checked<()> {
    let Some(mesh) = node.mesh() else { return Ok(()) };
    let name = node_name(node);
    let weights = node.weights().or(mesh.weights()).unwrap_or(&[]);
    let joints = node.skin().map(|skin| joints(&skin, buffers)).transpose()?;
    if let Some((joint, _)) = joints.iter().flatten().find(|(joint, _)| !in_scene[*joint]) {
        return Err(format!("joint node {joint} is not in the scene"));
    }
    for primitive in mesh.primitives() {
        let place = |e: String| format!("mesh `{name}`, primitive {}: {e}", primitive.index());
        let Some(triangles) = triangles(&primitive, buffers).map_err(place)? else { continue };
        let positions = morphed_positions(&primitive, weights, buffers).map_err(place)?;
        let skin = joints.as_ref().map(|joints| {
            let influences = influences(&primitive, positions.len(), joints.len(), buffers)?;
            Ok(Skin { joints: joints.clone(), influences })
        });
        let skin = skin.transpose().map_err(place)?;
        let mesh = Mesh { name: name.clone(), positions, triangles, material: material(&primitive) };
        parts.push(Part { node: node.index(), mesh, skin });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::{DQuat, Vec3};
    use serde_json::{Value, json};

    use super::*;
    use crate::scene::load_meshes;

    /// A glTF file under construction.
    #[derive(Default)]
    struct Document {
        bytes: Vec<u8>,
        views: Vec<Value>,
        accessors: Vec<Value>,
    }

    impl Document {
        fn add(&mut self, kind: &str, component: u32, count: usize, bytes: Vec<u8>) -> usize {
            self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
            self.bytes.extend(bytes);
            self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
            let view = self.views.len() - 1;
            self.accessors.push(json!({
                "bufferView": view, "componentType": component, "type": kind, "count": count,
                "min": [-99, -99, -99], "max": [99, 99, 99]
            }));
            if kind != "VEC3" {
                let accessor = self.accessors[view].as_object_mut().unwrap();
                accessor.remove("min");
                accessor.remove("max");
            }
            view
        }

        fn floats<const N: usize>(&mut self, kind: &str, values: &[[f32; N]]) -> usize {
            self.add(kind, 5126, values.len(), values.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect())
        }
    }

    /// A tetrahedron at the origin on the joint `root`, one at y = 2 on the joint `tip`, which is moved by (0, 2, 0), and one
    /// that hangs at the tip without a skin. The clip `bend` turns the tip a quarter about z in a second and doubles its size
    /// along x by a spline without slopes; `jump` steps the root up by 5 after a second.
    fn document() -> (Value, Vec<u8>) {
        let corners = [[0f32, 0., 0.], [0.5, 0., 0.], [0., 0.5, 0.], [0., 0., 0.5]];
        let upper = corners.map(|[x, y, z]| [x, y + 2.0, z]);
        let mut document = Document::default();
        let positions = document.floats("VEC3", &[corners, upper].concat());
        let faces = [[0u8, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let indices = [faces, faces.map(|t| t.map(|v| v + 4))].concat();
        let indices = document.add("SCALAR", 5121, 24, indices.into_flattened());
        let joints = [[[0u8, 0, 0, 0]; 4], [[1, 0, 0, 0]; 4]].concat();
        let joints = document.add("VEC4", 5121, 8, joints.into_flattened());
        let weights = document.floats("VEC4", &[[1f32, 0., 0., 0.]; 8]);
        let bind = |y: f32| [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., y, 0., 1.];
        let bind = document.floats("MAT4", &[bind(0.0), bind(-2.0)]);
        let small = document.floats("VEC3", &corners.map(|p| p.map(|x| 0.2 * x)));
        let few = document.add("SCALAR", 5121, 12, faces.into_iter().flatten().collect());
        let times = document.floats("SCALAR", &[[0f32], [1.0]]);
        let half = 0.5f32.sqrt();
        let turns = document.floats("VEC4", &[[0f32, 0., 0., 1.], [0., 0., half, half]]);
        let scales = [[0f32; 3], [1.; 3], [0.; 3], [0.; 3], [2., 1., 1.], [0.; 3]];
        let scales = document.floats("VEC3", &scales);
        let jumps = document.floats("VEC3", &[[0f32; 3], [0., 5., 0.]]);
        let json = json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0, 1] }],
            "nodes": [
                { "name": "body", "mesh": 0, "skin": 0 },
                { "name": "root", "children": [2] },
                { "name": "tip", "translation": [0, 2, 0], "children": [3] },
                { "name": "tool", "mesh": 1, "translation": [0, 1, 0] }
            ],
            "skins": [{ "joints": [1, 2], "inverseBindMatrices": bind }],
            "meshes": [
                { "primitives": [{ "indices": indices, "attributes":
                    { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights } }] },
                { "primitives": [{ "indices": few, "attributes": { "POSITION": small } }] }
            ],
            "animations": [
                { "name": "bend",
                  "samplers": [{ "input": times, "output": turns },
                               { "input": times, "output": scales, "interpolation": "CUBICSPLINE" }],
                  "channels": [{ "sampler": 0, "target": { "node": 2, "path": "rotation" } },
                               { "sampler": 1, "target": { "node": 2, "path": "scale" } }] },
                { "name": "jump",
                  "samplers": [{ "input": times, "output": jumps, "interpolation": "STEP" }],
                  "channels": [{ "sampler": 0, "target": { "node": 1, "path": "translation" } }] }
            ],
            "accessors": document.accessors,
            "bufferViews": document.views,
            "buffers": [{ "byteLength": document.bytes.len(), "uri": "body.bin" }]
        });
        (json, document.bytes)
    }

    fn load_document(change: impl FnOnce(&mut Value)) -> Result<Character> {
        let folder = tempfile::tempdir().unwrap();
        let (mut json, bytes) = document();
        change(&mut json);
        let path = folder.path().join("body.gltf");
        fs::write(&path, json.to_string()).unwrap();
        fs::write(folder.path().join("body.bin"), bytes).unwrap();
        let character = Character::load(&path)?;
        // What stands at rest is what the loader of meshes gives.
        assert_eq!(character.meshes(&character.rest()), load_meshes(&path).unwrap());
        Ok(character)
    }

    fn close(found: Vec3, expected: [f64; 3]) {
        assert!(found.as_dvec3().distance(DVec3::from_array(expected)) < 1e-6, "{found} for {expected:?}");
    }

    #[test]
    fn clips_move_vertices_spheres_and_what_hangs_on_a_joint() {
        let character = load_document(|_| ()).unwrap();
        let ball = |x: f32, y: f32, radius| Sphere { center: Vec3::new(x, y, 0.0), radius, joint: None };
        // Around a corner of each body, and one that no vertex is in.
        let spheres = vec![ball(0.5, 0.0, 0.1), ball(0.5, 2.0, 0.1), ball(0.1, 3.0, 0.05), ball(3.0, 1.9, 0.1)];
        let set = character.attach(&SphereSet { spheres: spheres.clone(), joints: Vec::new() }).unwrap();
        let names = set.spheres.iter().map(|s| set.joints[s.joint.unwrap() as usize].name.as_str());
        assert_eq!(names.collect::<Vec<_>>(), ["root", "tip", "tool", "tip"]);
        for (rest, sphere) in character.place(&set, &character.rest()).unwrap().iter().zip(&spheres) {
            close(rest.center, sphere.center.as_dvec3().to_array());
            assert!((sphere.radius..sphere.radius * 1.001).contains(&rest.radius));
        }

        let bend = character.clip("bend").unwrap();
        assert_eq!(bend.duration, 1.0);
        // Halfway: an eighth of a turn, and half of the way from 1 to 2 along x.
        let (s, x) = (0.5f64.sqrt(), 0.5 * 1.5);
        let pose = character.pose(bend, 0.5);
        let meshes = character.meshes(&pose);
        close(meshes[0].positions[1], [0.5, 0.0, 0.0]);
        close(meshes[0].positions[5], [x * s, 2.0 + x * s, 0.0]);
        close(meshes[1].positions[0], [-s, 2.0 + s, 0.0]);
        let placed = character.place(&set, &pose).unwrap();
        close(placed[0].center, [0.5, 0.0, 0.0]);
        close(placed[1].center, [x * s, 2.0 + x * s, 0.0]);
        close(placed[2].center, [0.15 * s - s, 2.0 + 0.15 * s + s, 0.0]);
        assert!((placed[1].radius - 0.15).abs() < 1e-5 && (placed[0].radius - 0.1).abs() < 1e-5);
        // A quarter: the spline without slopes has 3 t^2 - 2 t^3 of its way behind it.
        let stretched = 0.5 * (1.0 + 0.15625);
        let quarter = character.meshes(&character.pose(bend, 0.25))[0].positions[5];
        assert!((f64::from(quarter.distance(Vec3::new(0.0, 2.0, 0.0))) - stretched).abs() < 1e-6);
        // Before the first key and after the last one the pose stays.
        close(character.meshes(&character.pose(bend, -3.0))[0].positions[5], [0.5, 2.0, 0.0]);
        close(character.meshes(&character.pose(bend, 7.0))[0].positions[5], [0.0, 3.0, 0.0]);

        let jump = character.clip("jump").unwrap();
        let height = |time| character.meshes(&character.pose(jump, time))[0].positions[0].y;
        assert_eq!([0.0, 0.999, 1.0].map(height), [0.0, 0.0, 5.0]);
    }

    #[test]
    fn the_largest_stretch_is_found() {
        let turn = |axis: DVec3, angle| DMat3::from_quat(DQuat::from_axis_angle(axis.normalize(), angle));
        for scale in [DVec3::ONE, DVec3::new(3.0, 1.0, 2.0), DVec3::new(1.0, -4.0, 0.0), DVec3::splat(1e-3)] {
            let matrix = turn(DVec3::ONE, 0.7) * DMat3::from_diagonal(scale) * turn(DVec3::new(1.0, -2.0, 0.3), 1.9);
            let expected = scale.abs().max_element();
            assert!((stretch(matrix) - expected).abs() < 1e-9 * expected, "{scale}");
        }
        assert_eq!(stretch(DMat3::ZERO), 0.0);
    }

    #[test]
    fn parts_can_be_left_out() {
        let character = load_document(|_| ()).unwrap();
        let without =
            |names: &[&str]| character.clone().without(&names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
        assert_eq!(without(&["tool"]).unwrap().meshes(&character.rest()).len(), 1);
        let message = without(&["sword"]).unwrap_err().to_string();
        assert!(message.contains("no mesh is called `sword`; there are body, tool"), "{message}");
        assert!(without(&["body", "tool"]).unwrap_err().to_string().contains("no mesh is left"));
    }

    #[test]
    fn what_is_missing_is_said_in_one_line() {
        let refused = |change: &dyn Fn(&mut Value), why: &str| {
            let message = load_document(change).expect_err(why).to_string();
            assert!(message.contains("body.gltf: ") && message.contains(why) && !message.contains('\n'), "{message}");
        };
        refused(&|json| drop(json["nodes"][0].as_object_mut().unwrap().remove("skin")), "no skin in this file");
        refused(&|json| json["scenes"][0]["nodes"] = json!([0]), "joint node 1 is not in the scene");
        refused(&|json| json["animations"][0]["samplers"][0]["output"] = json!(0), "clip `bend`, channel 0");
        refused(&|json| json["animations"][1]["samplers"][0]["output"] = json!(0), "8 values belong to 2 times");
        refused(&|json| json["animations"][1]["samplers"][0]["interpolation"] = json!("CUBICSPLINE"), "2 values");
        let unsorted = |json: &mut Value| {
            let times = json["animations"][0]["samplers"][0]["input"].as_u64().unwrap() as usize;
            json["accessors"][times]["bufferView"] = json!(0);
        };
        refused(&unsorted, "its times do not rise");

        let character = load_document(|_| ()).unwrap();
        let message = character.clip("walk").unwrap_err().to_string();
        assert!(message.contains("no clip is called `walk`; there are bend, jump"), "{message}");
        let still = load_document(|json| drop(json.as_object_mut().unwrap().remove("animations"))).unwrap();
        let message = still.clip("walk").unwrap_err().to_string();
        assert!(message.contains("no clip is called `walk`: there are none in this file"), "{message}");
        let foreign = SphereSet { spheres: Vec::new(), joints: vec![Joint { name: "hips".into(), node: 1 }] };
        let message = still.place(&foreign, &still.rest()).unwrap_err().to_string();
        assert!(message.contains("node 1 is not the joint `hips`"), "{message}");
        let flat = load_document(|json| json["nodes"][2]["scale"] = json!([1, 0, 1])).unwrap();
        let sphere = Sphere { center: Vec3::new(0.5, 2.0, 0.0), radius: 0.1, joint: None };
        let message = flat.attach(&SphereSet { spheres: vec![sphere], joints: Vec::new() }).unwrap_err().to_string();
        assert!(message.contains("joint `tip` is squashed flat"), "{message}");
    }
}
