//! Sphere sets by the command line: fitted, kept, shown.

use std::path::Path;
use std::process::Command;

fn silhouette(folder: &Path, arguments: &str) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_silhouette"));
    let output = command.args(arguments.split_whitespace()).current_dir(folder).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn spheres_are_fitted_kept_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("tent.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 2 4 3\n").unwrap();
    let (code, table, error) = silhouette(folder, "proxies fit tent.obj --spheres 5 -o set.json --picture set.png -q");
    assert_eq!((code, error.as_str()), (Some(0), ""));
    assert!(table.contains("outside, sum") && table.lines().count() == 10, "{table}");
    let (code, shown, _) = silhouette(folder, "proxies show set.json tent.obj -o shown.png");
    assert_eq!(code, Some(0));
    assert!(shown.starts_with(&table) && shown.contains("the spheres hold all of the surface"), "{shown}");
    assert!(["set.png", "shown.png"].iter().all(|name| folder.join(name).metadata().unwrap().len() > 1000));
    let (_, list, _) = silhouette(folder, "proxies show set.json");
    assert_eq!(list.lines().count(), 6);
}

#[test]
fn what_is_wrong_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::fs::write(folder.join("bad.json"), r#"[{"world0": [0, 0, 0], "r": -1}]"#).unwrap();
    for (arguments, code, part) in [
        ("proxies fit a.obj --spheres 0 -o s.json", 2, "1..=4096"),
        ("proxies fit a.obj", 2, "--output"),
        ("proxies fit missing.obj -o s.json", 1, "missing.obj"),
        ("proxies fit a.obj -o s.json --without shield", 1, "a.obj: is no skinned glTF file"),
        ("proxies show bad.json", 1, "bad.json: sphere 0 has the radius -1"),
        ("proxies show bad.json a.obj --time 3", 2, "--clip"),
    ] {
        let (found, _, error) = silhouette(folder, arguments);
        assert!(found == Some(code) && error.contains(part), "{arguments}: {found:?} {error}");
        assert!(code == 2 || error.lines().count() == 1, "{error}");
    }
    assert!(!folder.join("s.json").exists());
}
