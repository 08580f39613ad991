//! The command line as a user meets it: exit codes, one clear line, nothing left behind.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use glam::DVec3;
use silhouette::bake::{
    Array, Arrays, Baked, BakedVertices, Method, Partial, Provenance, Receivers, Request, integrate, writers,
};
use silhouette::scene::{Environment, Scene, UpAxis};
use silhouette::sphere::Lobe;

/// Runs the binary in `folder`.
fn silhouette(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_silhouette"))
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Runs the binary, which must exit with `code`, and returns what it said on standard error.
fn fails(folder: &Path, arguments: &str, code: i32) -> String {
    let output = silhouette(folder, arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments}: {text}");
    text
}

fn succeeds(folder: &Path, arguments: &str) -> String {
    let output = silhouette(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn archive(path: &Path, occlusion: &[f64]) {
    let count = occlusion.len();
    let mut arrays = Arrays::new();
    arrays.push(Array::new("ambient_occlusion", [count], occlusion.to_vec())).unwrap();
    let vertices = BakedVertices {
        positions: vec![DVec3::ZERO; count],
        normals: vec![DVec3::Z; count],
        triangles: [].into(),
        arrays,
        provenance: Provenance::new("isolines"),
    };
    writers::write(path, &Baked::Vertices(vertices)).unwrap();
}

#[test]
fn help_tells_by_example() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(succeeds(folder, "--help").contains("silhouette bake -o"));
    for command in ["bake", "render", "integrate", "compare", "race"] {
        let help = succeeds(folder, &format!("{command} --help"));
        let examples = help.split_once("Examples:").unwrap_or_else(|| panic!("{command} has no examples")).1;
        assert!(examples.contains(&format!("silhouette {command} ")), "{command}");
    }
    assert!(succeeds(folder, "--version").starts_with("silhouette "));
    assert!(fails(folder, "", 2).contains("Usage"));
}

#[test]
fn wrong_usage_is_told_apart_from_errors() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (arguments, part) in [
        ("fly", "fly"),
        ("bake", "--output"),
        ("integrate -o a.npz", "MESH"),
        ("integrate a.obj -o a.npz --isolines 0", "--isolines"),
        ("integrate a.obj -o a.npz --order 11", "1..=10"),
        ("integrate a.obj -o a.npz --order four", "--order"),
        ("integrate a.obj -o a.npz --order 4 --lobe diffuse", "--lobe"),
        ("integrate a.obj -o a.npz --lobe shiny", "neither `diffuse` nor an exponent"),
        ("integrate a.obj -o a.npz --lobe -2", "exponent"),
        ("integrate a.obj -o a.npz --lobe-error 0.1", "--lobe"),
        ("integrate a.obj -o a.npz --method magic", "isolines, exact, qmc"),
        ("integrate a.obj -o a.npz --threads 0", "--threads"),
        ("integrate a.obj -o a.npz --samples 16", "--samples means nothing to --method isolines"),
        ("integrate a.obj -o a.npz --method qmc --isolines 16", "--isolines means nothing to --method qmc"),
        ("integrate a.obj -o a.npz --gradients", "--gradients needs --method exact"),
        ("integrate a.obj -o a.npz --rotation 90", "--environment"),
        ("integrate a.obj -o a.npz --environment s.exr --rotation nan", "not a finite number"),
        ("render -o a.png --width 0", "--width"),
        ("bake -o a.npz --error 1e-3 --isolines 16", "--isolines means nothing to --error"),
        ("bake -o a.npz --method auto --samples 16", "--samples means nothing to --error"),
        ("bake -o a.npz --method qmc --error 1e-3 --seed 1", "--seed means nothing to --error"),
        ("bake -o a.npz --method exact --error 1e-3", "--error means nothing to --method exact"),
        ("bake -o a.npz --error 0", "above 0"),
        ("race -o a --threads 0", "0 is not in"),
        ("render -o a.png --show occlusion --environment s.exr", "--environment means nothing"),
        ("compare a.npz b.npz --fail-above -1", "--fail-above"),
    ] {
        let text = fails(folder, arguments, 2);
        assert!(text.contains(part), "{arguments}: {text}");
    }
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 0);
}

#[test]
fn targets_are_checked_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (arguments, part) in [
        (
            "bake -o out.xyz",
            "error: out.xyz: .xyz says nothing of how to write results per vertex; use .npz, .ply, .exr, .glb\n",
        ),
        ("bake -o out", "no extension"),
        ("render -o out.glb", "use .npz, .exr, .png"),
        ("integrate a.obj -o out.ply", "integrate writes .npz"),
        ("bake -o nowhere/out.npz", "the folder nowhere does not exist"),
        ("bake -o out.npz --preview out.obj", "out.obj: .obj says nothing"),
        ("bake -o out.npz --resume", "out.npz.partial.npz: there is nothing to go on from"),
    ] {
        let text = fails(folder, arguments, 1);
        assert!(text.contains(part), "{arguments}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 0);
}

#[test]
fn compare_prints_draws_and_judges() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    archive(&folder.join("a.npz"), &[0.5, 0.25, 1.0]);
    archive(&folder.join("b.npz"), &[0.5, 0.5, 1.0]);
    archive(&folder.join("short.npz"), &[0.5]);
    let table = succeeds(folder, "compare a.npz b.npz -o diff.png");
    assert!(table.contains("RMSE") && table.contains("row 1") && table.contains("-8.33e-2"), "{table}");
    assert!(std::fs::read(folder.join("diff.png")).unwrap().starts_with(b"\x89PNG"));
    succeeds(folder, "compare a.npz b.npz --fail-above 0.15");
    let text = fails(folder, "compare a.npz b.npz --fail-above 0.1", 1);
    assert!(text.contains("array ambient_occlusion: RMSE 1.443e-1 is above 1e-1"), "{text}");
    succeeds(folder, "compare a.npz b.npz --arrays positions,normals --fail-above 0");
    for (arguments, part) in [
        ("compare a.npz missing.npz", "missing.npz: No such file"),
        ("compare a.npz short.npz", "a.npz: array ambient_occlusion has shape [3]"),
        ("compare a.npz b.npz --arrays light", "a.npz: has no array light"),
        ("compare a.npz b.npz -o diff.bmp", "diff.bmp: a plot is written as .png or .svg"),
    ] {
        let text = fails(folder, arguments, 1);
        assert!(text.starts_with("error: ") && text.contains(part), "{arguments}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
    let mut bytes = std::fs::read(folder.join("a.npz")).unwrap();
    bytes.truncate(200);
    std::fs::write(folder.join("cut.npz"), bytes).unwrap();
    assert!(fails(folder, "compare cut.npz b.npz", 1).contains("cut.npz: not a NumPy archive, or truncated"));
}

/// Names of all that is in a folder, sorted.
fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A tetrahedron over a triangle.
const SOLID: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n\
    v -3 -3 -0.5\nv 3 -3 -0.5\nv 0 4 -0.5\nf 5 6 7\n";

/// An environment in which each pixel differs.
fn environment(path: &Path) {
    exr::prelude::write_rgb_file(path, 8, 4, |x, y| (1.0 + x as f32, y as f32, 0.5)).unwrap();
}

/// A binary PLY of one triangle, with a coordinate and an index to spoil.
fn binary_ply(corner: f32, index: u32) -> Vec<u8> {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                  property float z\nelement face 1\nproperty list uchar uint vertex_indices\nend_header\n";
    let mut bytes = header.as_bytes().to_vec();
    for x in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, corner, 0.0f32] {
        bytes.extend(x.to_le_bytes());
    }
    bytes.push(3);
    for i in [0, 1, index] {
        bytes.extend(i.to_le_bytes());
    }
    bytes
}

#[test]
fn bad_files_give_one_line_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).unwrap();
    write("good.obj", TRIANGLE.as_bytes());
    environment(&folder.join("good.exr"));
    let good_exr = std::fs::read(folder.join("good.exr")).unwrap();
    let good_ply = binary_ply(1.0, 2);
    for (name, bytes) in [
        ("empty.obj", &b""[..]),
        ("faceless.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        ("nan.obj", b"v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n"),
        ("huge.obj", b"v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 4\n"),
        ("cut.obj", b"v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n"),
        ("empty.ply", b""),
        ("cut.ply", &good_ply[..good_ply.len() - 6]),
        ("nan.ply", &binary_ply(f32::NAN, 2)),
        ("beyond.ply", &binary_ply(1.0, 3)),
        ("empty.glb", b""),
        ("cut.glb", b"glTF\x02\x00\x00\x00\xff\x00\x00\x00"),
        ("cut.gltf", b"{\"asset\": {\"version\": \"2.0\"}, "),
        ("mesh.stl", b"solid\n"),
        ("empty.txt", b""),
        ("nan.txt", b"0 0 0 0 0 1\n0 0 nan 0 0 1\n"),
        ("zero.txt", b"0 0 1 0 0 0\n"),
        ("long.txt", b"0 0 1 0 0 1\n\n0 0 1 0 0 1.01\n"),
        ("five.txt", b"0 0 1 0 0\n"),
        ("cut.npy", b"\x93NUMPY\x01\x00\x76\x00{'descr'"),
        ("empty.exr", b""),
        ("cut.exr", &good_exr[..good_exr.len() / 2]),
        ("text.exr", b"not an image"),
        ("empty.hdr", b""),
        ("cut.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n\x01"),
        ("sky.png", b"\x89PNG"),
        ("unknown.toml", b"[[mesh]]\nshape.teapot = {}\ncolour = 3\n"),
        ("malformed.toml", b"[[mesh]\n"),
        ("light.toml", b"[[mesh]]\nfile = \"good.obj\"\n[environment]\nfile = \"cut.exr\"\n"),
        ("mesh.toml", b"[[mesh]]\nfile = \"nan.obj\"\n"),
        ("later.toml", b"[[mesh]]\nfile = \"gone.obj\"\n"),
    ] {
        write(name, bytes);
    }
    let before = listing(folder);
    for (arguments, part) in [
        ("integrate missing.obj -o out.npz", "missing.obj: No such file"),
        ("integrate good.obj empty.obj -o out.npz", "empty.obj: "),
        ("integrate faceless.obj -o out.npz", "faceless.obj: "),
        ("integrate nan.obj -o out.npz", "nan.obj:2: "),
        ("integrate huge.obj -o out.npz", "huge.obj:2: "),
        ("integrate beyond.obj -o out.npz", "beyond.obj:5: "),
        ("integrate cut.obj -o out.npz", "cut.obj:3: "),
        ("integrate empty.ply -o out.npz", "empty.ply"),
        ("integrate cut.ply -o out.npz", "cut.ply: "),
        ("integrate nan.ply -o out.npz", "nan.ply: "),
        ("integrate beyond.ply -o out.npz", "beyond.ply: "),
        ("integrate empty.glb -o out.npz", "empty.glb: "),
        ("integrate cut.glb -o out.npz", "cut.glb: "),
        ("bake cut.gltf -o out.npz", "cut.gltf: "),
        ("bake mesh.stl -o out.npz", "mesh.stl: not a mesh by its extension"),
        ("integrate good.obj --points missing.txt -o out.npz", "missing.txt: No such file"),
        ("integrate good.obj --points empty.txt -o out.npz", "empty.txt: no points"),
        ("integrate good.obj --points nan.txt -o out.npz", "nan.txt:2: NaN is not finite"),
        ("integrate good.obj --points zero.txt -o out.npz", "zero.txt:1: the normal is zero"),
        ("integrate good.obj --points long.txt -o out.npz", "long.txt:3: the normal has length 1.01"),
        ("integrate good.obj --points five.txt -o out.npz", "five.txt:1: 5 columns"),
        ("integrate good.obj --points cut.npy -o out.npz", "cut.npy: "),
        ("integrate good.obj --environment missing.exr -o out.npz", "missing.exr: "),
        ("integrate good.obj --environment empty.exr -o out.npz", "empty.exr: "),
        ("integrate good.obj --environment cut.exr -o out.npz", "cut.exr: "),
        ("render good.obj --environment text.exr -o out.png", "text.exr: "),
        ("render good.obj --environment empty.hdr -o out.exr", "empty.hdr: "),
        ("render good.obj --environment cut.hdr -o out.exr", "cut.hdr: "),
        ("integrate good.obj --environment sky.png -o out.npz", "sky.png: not an environment by its extension"),
        ("inspect cut.exr -o out.png", "cut.exr: "),
        ("bake unknown.toml -o out.glb", "unknown.toml:3: unknown field `colour`"),
        ("bake malformed.toml -o out.ply", "malformed.toml:1: "),
        ("bake light.toml -o out.exr", "cut.exr: "),
        ("render mesh.toml -o out.png", "nan.obj:2: "),
        ("inspect later.toml -o out.png", "gone.obj: No such file"),
        ("bake missing.toml -o out.npz --preview out.png", "missing.toml: No such file"),
        ("bake nowhere -o out.npz", "no built-in scene is called `nowhere`"),
        ("race icosphere nowhere --quick -o out", "no built-in scene is called `nowhere`"),
        ("race icosphere missing.obj --quick -o out", "missing.obj: No such file"),
    ] {
        let text = fails(folder, arguments, 1);
        assert!(text.starts_with("error: ") && text.contains(part), "{arguments}: {text}");
        assert!(text.ends_with('\n') && text.lines().count() == 1, "{arguments}: {text}");
        assert_eq!(listing(folder), before, "{arguments}");
    }
    // An earlier result stays as it was.
    write("out.npz", b"earlier");
    fails(folder, "integrate good.obj --points zero.txt -o out.npz", 1);
    assert_eq!(std::fs::read(folder.join("out.npz")).unwrap(), b"earlier");
}

#[test]
fn integrate_keeps_its_contract() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("solid.obj"), SOLID).unwrap();
    std::fs::write(folder.join("points.csv"), "0.2,0.2,2,0,0,1\n-1,-1,-0.2,0,0,1\n0.1,0.1,0.1,1,0,0\n2,2,1,0,-1,0\n")
        .unwrap();
    environment(&folder.join("sky.exr"));
    let points = [
        (DVec3::new(0.2, 0.2, 2.0), DVec3::Z),
        (DVec3::new(-1.0, -1.0, -0.2), DVec3::Z),
        (DVec3::splat(0.1), DVec3::X),
        (DVec3::new(2.0, 2.0, 1.0), DVec3::NEG_Y),
    ];
    for (method, options) in
        [("isolines", "--isolines 64"), ("exact", "--method exact"), ("qmc", "--method qmc --samples 128")]
    {
        succeeds(
            folder,
            &format!(
                "integrate solid.obj --points points.csv --order 3 --environment sky.exr --up z --rotation 20 {options} \
                 --threads 2 --stats stats.json -o out.npz"
            ),
        );
        let archive = writers::npz::read(&folder.join("out.npz")).unwrap();
        let shapes: Vec<(&str, &[usize])> = archive
            .arrays
            .iter()
            .filter(|array| !array.name.ends_with("_error"))
            .map(|array| (array.name.as_str(), &array.shape[..]))
            .collect();
        assert_eq!(
            shapes,
            [
                ("ambient_occlusion", &[4][..]),
                ("visibility_sh", &[4, 9]),
                ("transfer_sh", &[4, 9]),
                ("irradiance", &[4, 3]),
                ("vector_irradiance", &[4, 3, 3]),
            ]
        );
        for array in archive.arrays.iter().filter(|array| array.name.ends_with("_error")) {
            let of = archive.arrays.get(array.name.trim_end_matches("_error")).unwrap();
            assert_eq!(array.shape, of.shape);
        }
        // Row i is point i, to the bit what the library gives.
        let scene = Scene::load(folder.join("solid.obj")).unwrap();
        let light = Environment::load(folder.join("sky.exr")).unwrap();
        let light = light.oriented(UpAxis::Z, 20.0).unwrap();
        let request = Request {
            order: 3,
            ambient_occlusion: true,
            visibility_sh: true,
            transfer_sh: true,
            irradiance: true,
            vector_irradiance: true,
            ..Request::default()
        };
        let engine = match method {
            "qmc" => Method::Qmc { samples: 128, seed: 0 },
            "exact" => Method::Exact,
            _ => Method::Isolines { lines: 64 },
        };
        let expected =
            integrate(&scene.geometry, Some(&light), &Receivers::points(points), &request, engine, None, &()).unwrap();
        assert_eq!(archive.arrays, expected.arrays);
        // Nothing is over the first point; the third is inside the solid.
        let occlusion = &archive.arrays.get("ambient_occlusion").unwrap().data;
        assert!(occlusion[2] == 0.0 && (method == "qmc" || (occlusion[0] - 1.0).abs() < 1e-14), "{occlusion:?}");

        // Doubles in the file, too: the archive is stored plainly.
        let bytes = std::fs::read(folder.join("out.npz")).unwrap();
        let count = |part: &[u8]| bytes.windows(part.len()).filter(|window| *window == part).count();
        assert_eq!(count(b"'descr': '<f8'"), archive.arrays.len());

        let stats = std::fs::read_to_string(folder.join("stats.json")).unwrap();
        let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
        for key in [
            "receivers",
            "method",
            "triangles",
            "threads",
            "build_seconds",
            "integrate_seconds",
            "contours_per_receiver",
            "depth_alarms",
            "skipped",
        ] {
            assert!(stats.get(key).is_some(), "{key} is missing in {stats}");
        }
        assert_eq!((&stats["receivers"], &stats["triangles"], &stats["threads"]), (&4.into(), &5.into(), &2.into()));
        assert_eq!((&stats["method"], &stats["depth_alarms"]), (&method.into(), &0.into()));
    }
    // Without light and points: the vertices, and the arrays that need no light.
    succeeds(folder, "integrate solid.obj -o vertices.npz --isolines 16");
    let archive = writers::npz::read(&folder.join("vertices.npz")).unwrap();
    let values = archive.arrays.iter().filter(|array| !array.name.ends_with("_error"));
    let shapes: Vec<_> = values.map(|array| (array.name.as_str(), array.shape[0])).collect();
    assert_eq!(shapes, [("ambient_occlusion", 7), ("visibility_sh", 7), ("transfer_sh", 7)]);
    // The other phase turns the sign of odd m only.
    succeeds(folder, "integrate solid.obj -o phase.npz --isolines 16 --sh-phase condon-shortley");
    let other = writers::npz::read(&folder.join("phase.npz")).unwrap();
    let [plain, other] = [&archive, &other].map(|archive| &archive.arrays.get("transfer_sh").unwrap().data);
    for (i, (a, b)) in plain.iter().zip(other).enumerate() {
        let k = i % 16;
        let l = k.isqrt();
        let m = k as isize - (l * l + l) as isize;
        assert_eq!(*a, if m % 2 == 0 { *b } else { -b });
    }
}

#[test]
fn bake_render_inspect_and_compare_write_what_they_promise() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("solid.obj"), SOLID).unwrap();
    environment(&folder.join("sky.exr"));
    for (name, start) in
        [("a.npz", &b"PK\x03\x04"[..]), ("a.ply", b"ply\n"), ("a.exr", b"\x76\x2f\x31\x01"), ("a.glb", b"glTF")]
    {
        let said = silhouette(folder, &format!("bake solid.obj -o {name} --order 2 --isolines 16"));
        assert!(said.status.success() && said.stdout.is_empty() && said.stderr.is_empty(), "{name}");
        assert!(std::fs::read(folder.join(name)).unwrap().starts_with(start), "{name}");
    }
    let archive = writers::npz::read(&folder.join("a.npz")).unwrap();
    let shape = |name: &str| archive.arrays.get(name).map(|array| array.shape.clone());
    assert_eq!(shape("transfer_sh"), Some(vec![7, 4]));
    assert_eq!(shape("bent_normal"), Some(vec![7, 3]));
    assert_eq!(shape("triangles"), Some(vec![5, 3]));
    let provenance = archive.provenance.unwrap();
    assert!(provenance.command_line.ends_with("bake solid.obj -o a.npz --order 2 --isolines 16"));
    // What was baked can be loaded again as a mesh.
    for name in ["a.ply", "a.glb"] {
        assert!(succeeds(folder, &format!("inspect {name}")).contains('5'));
    }
    for name in ["g.npz", "g.ply", "g.exr", "g.glb"] {
        succeeds(folder, &format!("bake solid.obj -o {name} --order 2 --method exact --gradients"));
    }
    let gradients = writers::npz::read(&folder.join("g.npz")).unwrap().arrays;
    assert_eq!(gradients.get("visibility_sh_gradient").map(|array| array.shape.clone()), Some(vec![7, 4, 3]));
    assert!(gradients.get("ambient_occlusion_gradient").unwrap().data.iter().any(|&slope| slope.abs() > 0.01));
    let text = String::from_utf8_lossy(&std::fs::read(folder.join("g.glb")).unwrap()).into_owned();
    assert!(text.contains("_AMBIENT_OCCLUSION_GRADIENT"));
    succeeds(folder, "bake solid.obj -o b.npz --quantities occlusion --isolines 16 --preview b.png");
    let names: Vec<String> =
        writers::npz::read(&folder.join("b.npz")).unwrap().arrays.iter().map(|array| array.name.clone()).collect();
    assert_eq!(names, ["ambient_occlusion", "ambient_occlusion_error", "positions", "normals", "triangles"]);

    for (name, options) in [
        ("occlusion.png", ""),
        ("light.png", "--environment sky.exr --up z"),
        ("light.exr", "--environment sky.exr"),
        ("occlusion.npz", "--show occlusion"),
    ] {
        succeeds(folder, &format!("render solid.obj -o {name} --width 24 --height 16 --isolines 16 {options}"));
    }
    let image = writers::npz::read(&folder.join("occlusion.npz")).unwrap();
    assert_eq!(image.arrays.get("ambient_occlusion").unwrap().shape, [16, 24]);
    succeeds(folder, "render solid.obj -o again.exr --width 24 --height 16 --isolines 64 --environment sky.exr");
    let table = succeeds(folder, "compare light.exr again.exr -o difference.png");
    assert!(table.contains("RMSE"), "{table}");
    fails(folder, "compare light.exr again.exr --fail-above 0", 1);
    succeeds(folder, "compare light.exr light.exr --fail-above 0");

    let table = succeeds(folder, "inspect solid.obj -o solid.png");
    assert!(table.contains('5') && table.to_lowercase().contains("triangles"), "{table}");
    assert!(succeeds(folder, "inspect sky.exr").contains('8'));
    for name in ["b.png", "occlusion.png", "light.png", "difference.png", "solid.png"] {
        assert!(std::fs::read(folder.join(name)).unwrap().starts_with(b"\x89PNG\r\n"), "{name}");
    }
    assert!(
        listing(folder).iter().all(|name| !name.contains("partial") && !name.contains("tmp")),
        "{:?}",
        listing(folder)
    );
}

#[cfg(unix)]
#[test]
fn interrupted_bakes_go_on_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Seconds of work on one thread, many times what it takes to begin.
    std::fs::write(folder.join("knot.toml"), "[[mesh]]\nshape.torus_knot = { triangles = 8000 }\n").unwrap();
    let bake = "bake knot.toml -o out.npz --isolines 1024 --order 6 --threads 1";
    let interrupted_after = |pause: Duration, arguments: &str| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_silhouette"))
            .args(arguments.split_whitespace())
            .current_dir(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(pause);
        if child.try_wait().unwrap().is_none() {
            assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        }
        let output = child.wait_with_output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    // How fast the machine is just now is found by trying: too early and nothing is kept, too late and all is done. Steps
    // up are far smaller than the time in between, so none leads over it.
    let mut pause = Duration::from_millis(60);
    let kept = (0..20).any(|_| {
        let (code, text) = interrupted_after(pause, bake);
        if code == Some(130) && text.contains("are kept in out.npz.partial.npz; --resume goes on from there") {
            assert_eq!(listing(folder), ["knot.toml", "out.npz.partial.npz"], "{text}");
            return true;
        }
        if code == Some(0) {
            std::fs::remove_file(folder.join("out.npz")).unwrap();
            pause = pause.mul_f64(0.5);
        } else {
            // Before the handler is in place, the system ends the process and there is no code.
            assert!(code.is_none_or(|code| code == 130), "{code:?}: {text}");
            pause = pause.mul_f64(1.3);
        }
        assert_eq!(listing(folder), ["knot.toml"], "{text}");
        false
    });
    assert!(kept, "no pause was right");
    // With other settings it does not go on, and what is kept stays.
    let text = fails(folder, "bake knot.toml -o out.npz --isolines 64 --order 6 --resume", 1);
    assert!(text.contains("was made with isolines = 1024, not 64") && text.lines().count() == 1, "{text}");
    // What is kept can be interrupted again.
    let (code, text) = interrupted_after(pause, &format!("{bake} --resume"));
    assert!(code == Some(130) || code == Some(0), "{code:?}: {text}");
    if code == Some(130) {
        assert_eq!(listing(folder), ["knot.toml", "out.npz.partial.npz"], "{text}");
        succeeds(folder, &format!("{bake} --resume"));
    }
    assert_eq!(listing(folder), ["knot.toml", "out.npz"]);
    succeeds(folder, &bake.replace("out.npz", "whole.npz").replace("--threads 1", "--threads 2"));
    let [resumed, whole] = ["out.npz", "whole.npz"].map(|name| writers::npz::read(&folder.join(name)).unwrap().arrays);
    assert!(resumed == whole);
}

/// Parts of the command's work that `--stats` tells of.
fn statistics(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_lobe_decides_how_many_bands_are_baked() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("solid.obj"), SOLID).unwrap();
    for (command, lobe, error, noted) in
        [("bake", "diffuse", 0.1, "diffuse"), ("integrate", "12", 0.25, "cos^12"), ("integrate", "12", 0.4, "cos^12")]
    {
        let line = format!("{command} solid.obj -o out.npz --isolines 16 --lobe {lobe} --lobe-error {error}");
        let output = silhouette(folder, &line);
        let said = String::from_utf8(output.stderr).unwrap();
        let expected = Lobe::new(lobe.parse().unwrap_or(1.0)).unwrap().order(error).unwrap();
        assert!(output.status.success() && said.contains(&format!("takes {} bands", expected.bands())), "{said}");
        let written = writers::npz::read(&folder.join("out.npz")).unwrap();
        assert_eq!(written.arrays.get("transfer_sh").unwrap().shape, [7, expected.len()]);
        let parameters = written.provenance.unwrap().parameters;
        let value = |name: &str| parameters.iter().find(|fact| fact.0 == name).map(|fact| fact.1.clone());
        assert_eq!(value("order"), Some(expected.bands().to_string()));
        assert_eq!((value("lobe"), value("lobe_error")), (Some(noted.into()), Some(error.to_string())));
        std::fs::remove_file(folder.join("out.npz")).unwrap();
    }
    let text = fails(folder, "bake solid.obj -o out.npz --lobe 500", 1);
    assert!(text.contains("the most on offer; allow that much"), "{text}");
    assert_eq!(listing(folder), ["solid.obj"]);
}

#[test]
fn an_error_is_planned_for_and_the_plan_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("knot.toml"), "[[mesh]]\nshape.torus_knot = { triangles = 2000 }\n").unwrap();
    let output = silhouette(folder, "bake knot.toml -o out.npz --error 1e-2 --stats stats.json");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && text.contains("expected") && text.contains("estimated error"), "{text}");
    let stats = statistics(&folder.join("stats.json"));
    assert_eq!(stats["plan"]["error"], 1e-2);
    assert!(stats["plan"]["candidates"].as_array().is_some_and(|candidates| !candidates.is_empty()));
    assert!(stats["estimated_error"].as_f64().is_some_and(|error| error < 4e-2), "{stats}");
    let whole = writers::npz::read(&folder.join("out.npz")).unwrap();
    let provenance = whole.provenance.unwrap();
    let method = provenance.integrated_by().expect("the plan can be repeated");

    // On from half of a run that had chosen something else, by what that had chosen.
    succeeds(folder, "bake knot.toml -o half.npz --isolines 12");
    let half = writers::npz::read(&folder.join("half.npz")).unwrap();
    let mut arrays = half.arrays.clone();
    for name in ["positions", "normals", "triangles"] {
        arrays.remove(name);
    }
    let count = arrays.get("ambient_occlusion").unwrap().shape[0];
    let partial = Partial {
        arrays,
        done: (0..count).map(|i| i % 2 == 0).collect(),
        provenance: half.provenance.unwrap().with("error", "1e-2"),
    };
    assert_ne!(partial.provenance.integrated_by(), Some(method));
    let part = Partial::path(&folder.join("on.npz"));
    partial.write(&part).unwrap();
    assert!(fails(folder, "bake knot.toml -o on.npz --error 1e-3 --resume", 1).contains("error = 1e-2, not 1e-3"));
    succeeds(folder, "bake knot.toml -o on.npz --error 1e-2 --resume");
    let on = writers::npz::read(&folder.join("on.npz")).unwrap();
    assert!(on.arrays == half.arrays);
    assert!(!part.exists());
}

#[cfg(not(feature = "embree"))]
#[test]
fn a_build_without_embree_says_how_to_get_one() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in ["bake -o a.npz --method embree", "bake -o a.npz --method embree --error 1e-3"] {
        let text = fails(folder.path(), arguments, 1);
        assert!(
            text.contains("libembree-dev") && text.contains("--features embree") && text.lines().count() == 1,
            "{text}"
        );
    }
}

#[cfg(feature = "embree")]
#[test]
fn embree_integrates_what_the_judge_does() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("knot.toml"), "[[mesh]]\nshape.torus_knot = { triangles = 2000 }\n").unwrap();
    for method in ["embree", "qmc"] {
        succeeds(folder, &format!("bake knot.toml -o {method}.npz --method {method} --samples 1024"));
    }
    succeeds(
        folder,
        "compare embree.npz qmc.npz --arrays transfer_sh,visibility_sh,ambient_occlusion --fail-above 2e-2",
    );
    succeeds(folder, "bake knot.toml -o again.npz --method embree --samples 1024 --threads 1");
    let [one, two] = ["embree.npz", "again.npz"].map(|name| writers::npz::read(&folder.join(name)).unwrap().arrays);
    assert!(one == two, "the threads do not matter");
}

#[test]
fn films_and_judgements_are_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = r#"
[[mesh]]
shape.plane = { size = [8, 8] }

[[character]]
walker = { circle = 1.0, spheres = 20 }

[environment]
sky = { elevation = 50 }

[camera]
position = [0, 3, 6]
look_at = [0, 0.8, 0]
resolution = [64, 48]
"#;
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let said = succeeds(folder, "animate scene.toml --frames 3 --bake 4 --turn-light 20 -q -o film");
    assert!(said.contains("3 frames, 20 spheres"), "{said}");
    let mut names: Vec<_> = listing(&folder.join("film"));
    names.sort();
    let expected = ["contact_sheet.png", "frame_0000.png", "frame_0001.png", "frame_0002.png"];
    assert_eq!(names[..4], expected);
    assert_eq!(names[4..], ["frames.csv", "frames.json", "frames.png"]);
    let picture = image::open(folder.join("film/frame_0001.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (64, 48));

    #[cfg(feature = "gpu")]
    for rest in ["--exponential matrix", "--exponential direct --receiver-scale 1"] {
        let said =
            succeeds(folder, &format!("animate scene.toml --frames 1 --bake 4 --device gpu {rest} -q -o device"));
        assert!(said.contains("1 frames, 20 spheres"), "{said}");
    }

    let table = succeeds(folder, "judge scene.toml --size 16 --samples 16 --isolines 8 --bake 4 -q -o verdict");
    assert!(table.contains("| exponential | ol |") && table.contains("| spheres | 40 |"), "{table}");
    assert!(table.contains("| static shadows on bodies | none |"), "{table}");
    for name in ["judgement.csv", "judgement.md", "differences.png"] {
        assert!(folder.join("verdict").join(name).exists(), "{name}");
    }
}

#[test]
fn what_proxies_cannot_do_is_said_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let lines = |text: String, why: &str| {
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(text.contains(why), "{text}");
    };
    lines(fails(folder, "animate room -o film", 1), "no [[character]]");
    lines(fails(folder, "animate --spheres 12 -o film", 1), "walker: 3 spheres; it needs 10 to");
    let bad = "[[character]]\nwalker = { height = -1 }\n";
    std::fs::write(folder.join("bad.toml"), bad).unwrap();
    lines(fails(folder, "animate bad.toml -o film", 1), "bad.toml:1: walker: circle, height and pace must be positive");
    std::fs::write(folder.join("dark.toml"), "[[character]]\nwalker = {}\n").unwrap();
    assert!(fails(folder, "animate dark.toml -o film", 2).contains("--environment"));
    assert!(fails(folder, "animate --internal-order 3 -o film", 2).contains("less than --order 4"));
    #[cfg(not(feature = "gpu"))]
    lines(fails(folder, "animate --device gpu -o film", 1), "--features gpu");
    assert!(listing(folder).iter().all(|name| name.ends_with(".toml")));
}

#[test]
fn a_bake_after_a_move_keeps_what_the_move_cannot_change() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = |x: f64| {
        format!(
            "[[mesh]]\nshape.plane = {{ size = [8, 8], divisions = [12, 12] }}\n\
             [[mesh]]\nshape.box = {{ size = [0.2, 9, 40] }}\ntranslate = [0, 4.51, 0]\n\
             [[mesh]]\nshape.icosphere = {{ radius = 0.5, subdivisions = 2 }}\ntranslate = [{x}, 0.8, 0]\n"
        )
    };
    std::fs::write(folder.join("old.toml"), scene(2.0)).unwrap();
    std::fs::write(folder.join("new.toml"), scene(2.5)).unwrap();
    for method in ["--method exact", "--isolines 64"] {
        succeeds(folder, &format!("bake old.toml -o old.npz {method} --sh-phase condon-shortley"));
        let update = "--update old.npz --before old.toml --stats stats.json";
        assert_eq!(succeeds(folder, &format!("bake new.toml -o new.npz {method} {update} --quiet")), "");
        succeeds(folder, &format!("bake new.toml -o whole.npz {method} --quiet"));
        let kept = statistics(&folder.join("stats.json"))["skipped"]["finished_before"].as_u64().unwrap();
        let [new, whole] = ["new.npz", "whole.npz"].map(|name| writers::npz::read(&folder.join(name)).unwrap().arrays);
        let all = whole.get("ambient_occlusion").unwrap().data.len() as u64;
        assert!(kept > all / 5 && kept < all, "{kept} of {all}");
        assert!(new == whole, "{method}");
    }
    let update = "bake new.toml -o x.npz --quiet --update old.npz --before old.toml";
    let text = fails(folder, &format!("{update} --isolines 32"), 1);
    assert!(text.contains("was made with isolines = 64, not 32") && text.lines().count() == 1, "{text}");
    fails(folder, &format!("{update} --resume"), 2);
    fails(folder, "bake new.toml -o x.npz --update old.npz", 2);
    let text = fails(folder, "bake new.toml -o x.npz --isolines 64 --update none.npz --before old.toml", 1);
    assert!(text.contains("none.npz") && text.lines().count() == 1, "{text}");
    assert!(!folder.join("x.npz").exists());
}
