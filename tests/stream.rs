//! Receivers by the hundred thousand, which are integrated block by block: the bits are those of the whole.

use std::path::Path;
use std::process::Command;

use glam::DVec3;
use silhouette::bake::writers::{Spool, npz};
use silhouette::bake::{Array, Arrays, Method, Partial, Receivers, Request, integrate};
use silhouette::scene::Scene;

/// More than a block.
const COUNT: usize = (1 << 17) + 900;
const BLOCK: usize = 1 << 17;

fn points() -> impl Iterator<Item = (DVec3, DVec3)> {
    // A spiral in the plane of a square with a tetrahedron above it; some points lie on the square.
    (0..COUNT).map(|i| {
        let (angle, radius) = (0.01 * i as f64, 3.0 * (i as f64 / COUNT as f64).sqrt());
        (DVec3::new(radius * angle.cos(), 0.0, radius * angle.sin()), DVec3::Y)
    })
}

const MESH: &str = "v -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nf 1 2 3 4\nv 0 1 0\nv 1 2 0\nv 0 2 1\nv 0.3 1.5 -1\n\
                    f 5 6 7\nf 5 7 8\nf 5 8 6\nf 6 8 7\n";

fn run(folder: &Path, arguments: &str) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_silhouette"));
    let output = command.args(arguments.split_whitespace()).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn part(arrays: &Arrays, rows: std::ops::Range<usize>) -> Arrays {
    let mut parts = Arrays::new();
    for array in arrays {
        let width: usize = array.shape[1..].iter().product();
        let shape = [&[rows.len()], &array.shape[1..]].concat();
        parts.push(Array::new(&*array.name, shape, array.data[rows.start * width..rows.end * width].to_vec())).unwrap();
    }
    parts
}

#[test]
fn blocks_of_receivers_give_the_bits_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("mesh.obj"), MESH).unwrap();
    let text: String = points().map(|(p, n)| format!("{} {} {} {} {} {}\n", p.x, p.y, p.z, n.x, n.y, n.z)).collect();
    std::fs::write(folder.join("points.txt"), text).unwrap();
    let scene = Scene::from_meshes(&[folder.join("mesh.obj")]).unwrap();
    let receivers = Receivers::points(points()).on_surface(&scene.geometry.face_tree());
    let request =
        Request { order: 2, ambient_occlusion: true, visibility_sh: true, transfer_sh: true, ..Request::default() };
    for (method, options) in [
        (Method::Isolines { lines: 8 }, "--isolines 8"),
        // Rays are turned by a receiver's number.
        (Method::Qmc { samples: 8, seed: 5 }, "--method qmc --samples 8 --seed 5"),
    ] {
        let whole = integrate(&scene.geometry, None, &receivers, &request, method, None, &()).unwrap();
        let command = format!("integrate mesh.obj --points points.txt --order 2 {options} -q");
        run(folder, &format!("{command} --stats stats.json -o blocks.npz"));
        let blocks = npz::read(&folder.join("blocks.npz")).unwrap();
        assert!(blocks.arrays == whole.arrays, "{options}");
        let statistics = std::fs::read_to_string(folder.join("stats.json")).unwrap();
        assert!(statistics.contains(&format!("\"receivers\": {COUNT}")), "{statistics}");

        // Gone on with after the first block.
        let out = folder.join("rest.npz");
        let mut spool = Spool::new(&out);
        spool.append(&part(&whole.arrays, 0..BLOCK)).unwrap();
        spool.keep(&blocks.provenance.unwrap()).unwrap();
        run(folder, &format!("{command} --resume --stats stats.json -o rest.npz"));
        assert!(npz::read(&out).unwrap().arrays == whole.arrays, "{options}");
        assert!(!Partial::path(&out).exists());
        let statistics = std::fs::read_to_string(folder.join("stats.json")).unwrap();
        assert!(statistics.contains("\"receivers\": 900"), "{statistics}");
    }
}
