use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::cover::{Ball, uncovered};
use crate::bake::writers::atomically;
use crate::scene::Geometry;
use crate::{Error, Result};

/// A ball that stands for a part of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, in the frame of the joint it hangs on, or else of the world.
    pub center: Vec3,
    /// Radius in that frame's unit, positive.
    pub radius: f32,
    /// The joint it moves with: an index into [`SphereSet::joints`].
    pub joint: Option<u32>,
}

/// What a sphere can hang on: a node of a glTF file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// The node's name, `node 7` where it has none.
    pub name: String,
    /// The node's index in its file.
    pub node: u32,
}

/// The spheres that stand for one body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SphereSet {
    /// In no particular order.
    pub spheres: Vec<Sphere>,
    /// What they hang on; none for a body that does not move in itself.
    pub joints: Vec<Joint>,
}

/// Most spheres in a set: several times what a frame has time for.
pub const MAX_SPHERES: usize = 4096;

const FORMAT: &str = "silhouette sphere set";
const VERSION: u32 = 1;

impl SphereSet {
    /// Reads a sphere set from JSON, in one of two forms.
    ///
    /// Our own, which [`Self::save`] writes:
    ///
    /// ```json
    /// {
    ///   "format": "silhouette sphere set", "version": 1,
    ///   "joints": [{ "name": "hips", "node": 30 }],
    ///   "spheres": [
    ///     { "center": [0, 0.2, 0.1], "radius": 0.3, "joint": 0 },
    ///     { "center": [0, 1, 0], "radius": 0.2 }
    ///   ]
    /// }
    /// ```
    ///
    /// `joint` counts the entries of `joints`, whose `node` counts the nodes of the glTF file; centre and radius are in
    /// the frame of that node, or of the world where there is no `joint`. `joints` may be left out.
    ///
    /// And that of robot models, a list of `{ "link": "hand", "local": [x, y, z], "world0": [x, y, z], "r": r }`: the
    /// spheres stand in the world at `world0`, as the robot does when all its angles are zero.
    ///
    /// # Errors
    /// A file that cannot be read or is of neither form, no spheres or more than [`MAX_SPHERES`], a centre or a radius that
    /// is not finite, a radius of zero or below, a joint that is not in the list. The line names file and sphere.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|error| Error::file(path, error))?;
        Self::from_json(&text).map_err(|message| Error::file(path, message))
    }

    fn from_json(text: &str) -> std::result::Result<Self, String> {
        let json: Value = serde_json::from_str(text).map_err(|error| format!("not JSON: {error}"))?;
        let set = match json {
            Value::Array(spheres) => Self { spheres: entries(spheres, RobotSphere::sphere)?, joints: Vec::new() },
            Value::Object(_) => {
                let file: File = serde_json::from_value(json).map_err(|error| format!("not a sphere set: {error}"))?;
                if file.format != FORMAT || file.version != VERSION {
                    let File { format, version, .. } = file;
                    return Err(format!("holds `{format}`, version {version}; known is `{FORMAT}`, version {VERSION}"));
                }
                Self { spheres: entries(file.spheres, SetSphere::sphere)?, joints: file.joints }
            }
            _ => return Err("not a sphere set: neither an object nor a list".into()),
        };
        set.check()?;
        Ok(set)
    }

    /// Centre of a part of a mesh that is left out by the spheres, which stand in the world; none where they cover it.
    ///
    /// Decided on whole triangles, cut into pieces that lie in one sphere each; a piece that is smaller than `finest` and
    /// still in no single sphere counts as left out.
    pub fn uncovered(geometry: &Geometry, spheres: &[Sphere], finest: f64) -> Option<DVec3> {
        let balls: Vec<Ball> = spheres.iter().map(Ball::from).collect();
        uncovered(geometry, &balls, finest).map(|[a, b, c]| (a + b + c) / 3.0)
    }

    /// Says what is wrong with the set.
    fn check(&self) -> std::result::Result<(), String> {
        let count = self.spheres.len();
        if !(1..=MAX_SPHERES).contains(&count) {
            return Err(format!("holds {count} spheres; a set has 1 to {MAX_SPHERES}"));
        }
        for (i, Sphere { center, radius, joint }) in self.spheres.iter().enumerate() {
            if !(radius.is_finite() && *radius > 0.0) {
                return Err(format!("sphere {i} has the radius {radius}; it must be positive and finite"));
            }
            if !center.is_finite() {
                return Err(format!("sphere {i} has the centre {center}, which is not finite"));
            }
            if let Some(joint) = joint.filter(|&joint| joint as usize >= self.joints.len()) {
                return Err(format!("sphere {i} hangs on joint {joint}, but there are only {}", self.joints.len()));
            }
        }
        let mut names = BTreeSet::new();
        match self.joints.iter().find(|joint| !names.insert(joint.node)) {
            Some(joint) => Err(format!("joint `{}`: node {} is listed twice", joint.name, joint.node)),
            None => Ok(()),
        }
    }

    /// Writes the set as JSON, one sphere a line; see [`Self::load`].
    ///
    /// # Errors
    /// A set that could not be loaded again, or a file that cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        self.check().map_err(|message| Error::file(path, message))?;
        let lines = |entries: Vec<serde_json::Result<String>>| -> serde_json::Result<String> {
            Ok(entries.into_iter().collect::<serde_json::Result<Vec<_>>>()?.join(",\n    "))
        };
        let spheres = self.spheres.iter().map(|&sphere| serde_json::to_string(&SetSphere::from(sphere))).collect();
        let joints = self.joints.iter().map(serde_json::to_string).collect();
        let (spheres, joints) = lines(spheres)
            .and_then(|spheres| Ok((spheres, lines(joints)?)))
            .map_err(|error| Error::file(path, error))?;
        let text = format!(
            "{{\n  \"format\": \"{FORMAT}\", \"version\": {VERSION},\n  \"joints\": [\n    {joints}\n  ],\n  \
             \"spheres\": [\n    {spheres}\n  ]\n}}\n"
        );
        atomically(path, |file| file.write_all(text.as_bytes()).map_err(|error| Error::file(path, error)))
    }
}

fn entries<T: serde::de::DeserializeOwned>(
    entries: Vec<Value>,
    sphere: impl Fn(T) -> Sphere,
) -> std::result::Result<Vec<Sphere>, String> {
    let read = |(i, entry)| serde_json::from_value(entry).map(&sphere).map_err(|error| format!("sphere {i}: {error}"));
    entries.into_iter().enumerate().map(read).collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    version: u32,
    #[serde(default)]
    joints: Vec<Joint>,
    spheres: Vec<Value>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SetSphere {
    center: [f32; 3],
    radius: f32,
    #[serde(skip_serializing_if = "Option::is_none", default)]
    joint: Option<u32>,
}

impl SetSphere {
    fn sphere(self) -> Sphere {
        Sphere { center: self.center.into(), radius: self.radius, joint: self.joint }
    }
}

impl From<Sphere> for SetSphere {
    fn from(Sphere { center, radius, joint }: Sphere) -> Self {
        Self { center: center.into(), radius, joint }
    }
}

#[derive(Deserialize)]
struct RobotSphere {
    world0: [f32; 3],
    r: f32,
}

impl RobotSphere {
    fn sphere(self) -> Sphere {
        Sphere { center: self.world0.into(), radius: self.r, joint: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_is_loaded_again() {
        let set = SphereSet {
            spheres: vec![
                Sphere { center: Vec3::new(0.1, -2e-9, 3e7), radius: 0.3, joint: Some(1) },
                Sphere { center: Vec3::ZERO, radius: f32::MIN_POSITIVE, joint: None },
            ],
            joints: vec![Joint { name: "a \"b\"".into(), node: 4 }, Joint { name: "node 7".into(), node: 7 }],
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("set.json");
        set.save(&path).unwrap();
        assert_eq!(SphereSet::load(&path).unwrap(), set);
        let still = SphereSet { joints: Vec::new(), spheres: set.spheres[1..].to_vec() };
        still.save(&path).unwrap();
        assert_eq!(SphereSet::load(&path).unwrap(), still);
        let empty = SphereSet::default().save(&path).unwrap_err().to_string();
        assert!(empty.contains("holds 0 spheres"), "{empty}");
        assert_eq!(SphereSet::load(&path).unwrap(), still);
    }

    #[test]
    fn robots_stand_at_their_zero_pose() {
        let json = r#"[{"link": "base", "local": [9, 9, 9], "world0": [0.5, -1, 2], "r": 0.25}]"#;
        let sphere = Sphere { center: Vec3::new(0.5, -1.0, 2.0), radius: 0.25, joint: None };
        assert_eq!(SphereSet::from_json(json).unwrap(), SphereSet { spheres: vec![sphere], joints: Vec::new() });
    }

    #[test]
    fn bad_files_name_the_sphere() {
        let refused = |json: &str, why: &str| {
            let message = SphereSet::from_json(json).expect_err(json);
            assert!(message.contains(why) && !message.contains('\n'), "{message}");
        };
        let robot = |rest: &str| {
            format!(r#"[{{"link": "a", "local": [0, 0, 0], "world0": [0, 0, 0], "r": 1}}, {{"link": "b", {rest}}}]"#)
        };
        refused("", "not JSON");
        refused("7", "neither an object nor a list");
        refused("[]", "holds 0 spheres; a set has 1 to 4096");
        refused(&robot(r#""world0": [0, 0, 0], "r": 0"#), "sphere 1 has the radius 0; it must be positive and finite");
        refused(&robot(r#""world0": [0, 0, 0], "r": -2"#), "sphere 1 has the radius -2");
        refused(&robot(r#""world0": [0, 0, 0], "r": 1e50"#), "sphere 1");
        refused(&robot(r#""world0": [0, 1e50, 0], "r": 1"#), "sphere 1");
        refused(&robot(r#""world0": [0, 0], "r": 1"#), "sphere 1");
        refused(&robot(r#""world0": [0, 0, 0]"#), "sphere 1: missing field `r`");
        let ours = |rest: &str| format!(r#"{{"format": "{FORMAT}", "version": 1, {rest}}}"#);
        refused(r#"{"format": "cubes", "version": 1, "spheres": []}"#, "holds `cubes`, version 1");
        refused(&ours(r#""spheres": [], "radius": 1"#), "unknown field `radius`");
        refused(
            &ours(r#""spheres": [{"center": [0, 0, 0], "radius": 1, "joint": 0}]"#),
            "joint 0, but there are only 0",
        );
        refused(
            &ours(r#""spheres": [{"center": [0, 0, 0], "radius": 1, "name": 0}]"#),
            "sphere 0: unknown field `name`",
        );
        let twice = r#""joints": [{"name": "a", "node": 1}, {"name": "b", "node": 1}], "spheres": [{"center": [0, 0, 0], "radius": 1}]"#;
        refused(&ours(twice), "joint `b`: node 1 is listed twice");
        let many = format!("[{}]", [r#"{"world0": [0, 0, 0], "r": 1}"#; MAX_SPHERES + 1].join(","));
        refused(&many, "holds 4097 spheres");
        let missing = SphereSet::load("missing.json").unwrap_err().to_string();
        assert!(missing.starts_with("missing.json: "));
    }
}
