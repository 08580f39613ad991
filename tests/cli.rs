//! The command line as a user meets it: exit codes, one clear line, nothing left behind.

use std::path::Path;
use std::process::{Command, Output};

use glam::DVec3;
use silhouette::bake::{Array, Arrays, Baked, BakedVertices, Provenance, writers};

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
    for command in ["bake", "render", "integrate", "compare"] {
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
        ("integrate a.obj -o a.npz --order 9", "1..=8"),
        ("integrate a.obj -o a.npz --order four", "--order"),
        ("integrate a.obj -o a.npz --method magic", "isolines, qmc"),
        ("integrate a.obj -o a.npz --threads 0", "--threads"),
        ("integrate a.obj -o a.npz --samples 16", "--samples means nothing to --method isolines"),
        ("integrate a.obj -o a.npz --method qmc --isolines 16", "--isolines means nothing to --method qmc"),
        ("integrate a.obj -o a.npz --rotation 90", "--environment"),
        ("integrate a.obj -o a.npz --environment s.exr --rotation nan", "not a finite number"),
        ("render -o a.png --width 0", "--width"),
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
