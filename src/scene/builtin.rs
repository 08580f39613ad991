use std::path::Path;

use super::{Scene, file};
use crate::{Error, Result};

macro_rules! scenes {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../../scenes/", $name, ".toml")))),*]
    };
}

/// Name and scene file of every built-in scene.
const SCENES: [(&str, &str); 14] = scenes![
    "default",
    "icosphere",
    "icosphere_328k",
    "knots_25k",
    "knots_100k",
    "knots_400k",
    "knots_2m",
    "foliage",
    "room",
    "room_closed",
    "room_open",
    "building",
    "teapot",
    "walkers",
];

pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|(name, _)| *name)
}

pub(super) fn scene(name: &str) -> Result<Scene> {
    let Some((name, text)) = SCENES.iter().find(|(known, _)| *known == name) else {
        let known: Vec<&str> = names().collect();
        return Err(Error::input(format!("no built-in scene is called `{name}`; there are {}", known.join(", "))));
    };
    file::read(text, &Path::new("scenes").join(name).with_extension("toml"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ReceiverSource;

    #[test]
    fn small_scenes_have_their_sizes() {
        for (name, expected) in [
            ("default", 20_000..30_000),
            ("icosphere", 5_122..5_123),
            ("knots_25k", 25_002..25_003),
            ("knots_100k", 100_002..100_003),
            ("foliage", 50_002..50_003),
            ("room", 26_000..27_000),
            ("room_closed", 26_000..27_000),
            ("room_open", 26_000..27_000),
        ] {
            let scene = scene(name).unwrap();
            let triangles = scene.geometry.triangles.len();
            assert!(expected.contains(&triangles), "{name}: {triangles}");
        }
    }

    #[test]
    fn default_scene_can_be_baked_and_looked_at() {
        let scene = scene("default").unwrap();
        assert!(scene.environment.is_some() && scene.camera.is_some());
        assert_eq!(scene.receivers, ReceiverSource::Vertices);
        assert!(scene.geometry.angle_weighted_normals().iter().all(Option::is_some));
    }

    #[test]
    fn unknown_names_list_the_known_ones() {
        let message = scene("nowhere").unwrap_err().to_string();
        assert!(names().all(|name| message.contains(name)), "{message}");
    }
}
