//! Whatever bytes are in a file, its loader gives an error of one line or something valid, and never panics.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::prelude::{Compression, Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
use silhouette::bake::writers::npz;
use silhouette::bake::{Array, Arrays, Provenance};
use silhouette::scene::{Environment, Scene, load_points};
use silhouette::{Error, Result};

/// The SplitMix64 generator: the same damage in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// What numbers in text become.
const TOKENS: [&str; 18] = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "-0",
    "1e999",
    "1e38",
    "1e-45",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "9223372036854775807",
    "18446744073709551616",
    "",
    "\u{fc}",
    "0x10",
];

/// What four or eight bytes become.
const NUMBERS: [u64; 10] =
    [0, 1, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x7fff_ffff_ffff_ffff, 0xffff_ffff_ffff_ffff];

/// `bytes` with one to four faults.
fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len());
        let length = 1 + random.below(24);
        let end = (at + length).min(bytes.len());
        match random.below(10) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
            1 if !bytes.is_empty() => bytes[at] = random.next() as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let again = bytes[at..end].to_vec();
                bytes.splice(at..at, again);
            }
            5 => {
                let noise: Vec<u8> = (0..length).map(|_| random.next() as u8).collect();
                bytes.splice(at..at, noise);
            }
            6 | 7 => {
                let number = NUMBERS[random.below(NUMBERS.len())];
                let width = [1, 2, 4, 8][random.below(4)];
                let number = if random.below(2) == 0 { number.to_le_bytes() } else { number.to_be_bytes() };
                let number = if random.below(2) == 0 { &number[..width] } else { &number[8 - width..] };
                let end = (at + width).min(bytes.len());
                bytes.splice(at..end, number.iter().copied());
            }
            // A number in text.
            _ => {
                let is_digit = |b: &u8| b.is_ascii_digit() || b".-+e".contains(b);
                if let Some(start) = bytes[at..].iter().position(is_digit).map(|k| at + k) {
                    let length = bytes[start..].iter().take_while(|b| is_digit(b)).count();
                    let token = TOKENS[random.below(TOKENS.len())];
                    bytes.splice(start..start + length, token.bytes());
                }
            }
        }
    }
    bytes
}

/// Loads the file and what follows from it: damage must not come to light later either.
fn load(path: &Path) -> Result<()> {
    match path.extension().and_then(|extension| extension.to_str()) {
        Some("exr" | "hdr") => Environment::load(path).map(drop),
        Some("npy" | "txt") => load_points(path).map(drop),
        Some("npz") => npz::read(path).map(drop),
        _ => {
            let scene = Scene::load(path)?;
            let geometry = &scene.geometry;
            assert!(geometry.positions.iter().all(|p| p.is_finite()));
            assert!(geometry.triangles.as_flattened().iter().all(|&v| (v as usize) < geometry.positions.len()));
            Ok(())
        }
    }
}

/// Loads `count` damaged copies of a valid file.
fn assert_sound(name: &str, bytes: &[u8], count: u64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    load(&path).unwrap_or_else(|error| panic!("{name} as it should be: {error}"));
    let (mut refused, mut panics) = (0, Vec::new());
    for seed in 0..count {
        let bytes = damaged(bytes, &mut Random(seed));
        fs::write(&path, &bytes).unwrap();
        match catch_unwind(AssertUnwindSafe(|| load(&path))) {
            Err(_) => panics.push(seed),
            Ok(Ok(())) => {}
            Ok(Err(error)) => {
                refused += 1;
                let message = error.to_string();
                assert!(!message.trim().is_empty() && !message.contains('\n'), "{name}, seed {seed}: {message:?}");
                assert!(matches!(error, Error::File { .. }), "{name}, seed {seed} names no file: {message}");
            }
        }
    }
    assert!(panics.is_empty(), "{name}: seeds that panic: {panics:?}");
    // Damage that nobody notices is no test.
    assert!(refused > count / 10, "{name}: only {refused} of {count} refused");
}

/// Damaged copies of each file; the fuzz targets in `fuzz/` go on from there.
const COUNT: u64 = 1000;

#[test]
fn obj() {
    let text = "mtllib a.mtl\no one\nv 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1e0 -2\nvn 0 0 1\nvt 0 0\ng part\nf 1/1/1 2//1 3\n\
        f -4 -2 -1\nl 1 2\nf 1 2 3 \\\n 4\n";
    assert_sound("mesh.obj", text.replace("mtllib a.mtl\n", "").as_bytes(), COUNT);
}

const PLY_BODY: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
    element face 2\nproperty list uchar int vertex_indices\nend_header\n";

#[test]
fn ply_text() {
    let text = format!(
        "ply\nformat ascii 1.0\ncomment c\n{PLY_BODY}0 0 0 1\n1 0 0 2\n1 1 0.5 3\n0 1 0 255\n4 0 1 2 3\n3 0 2 3\n"
    );
    assert_sound("mesh.ply", text.as_bytes(), COUNT);
}

#[test]
fn ply_binary() {
    for order in ["little", "big"] {
        let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\n{PLY_BODY}").into_bytes();
        for corner in [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]] {
            for x in corner {
                bytes.extend(if order == "big" { x.to_be_bytes() } else { x.to_le_bytes() });
            }
            bytes.push(7);
        }
        for face in [&[0i32, 1, 2, 3][..], &[0, 2, 3]] {
            bytes.push(face.len() as u8);
            for &v in face {
                bytes.extend(if order == "big" { v.to_be_bytes() } else { v.to_le_bytes() });
            }
        }
        assert_sound("mesh.ply", &bytes, COUNT);
    }
}

/// A triangle with indices, a skin, a morph target and a sparse accessor; positions, indices, joints, weights, bind matrix.
fn gltf(uri: &str) -> (String, Vec<u8>) {
    let positions = [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0].iter().flat_map(|i| i.to_le_bytes()));
    bytes.extend([0; 12]);
    bytes.extend([255, 0, 0, 0].repeat(3));
    for column in 0..4 {
        bytes.extend((0..4).flat_map(|row| f32::from(u8::from(row == column)).to_le_bytes()));
    }
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1]}}],
        "nodes": [{{"mesh": 0, "skin": 0, "weights": [0.5]}}, {{"translation": [1, 2, 3], "rotation": [0, 0, 0, 1],
        "scale": [1, 1, 2], "mesh": 0, "children": [2]}}, {{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}}],
        "skins": [{{"joints": [1], "inverseBindMatrices": 4}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}}, "indices": 1,
        "material": 0, "mode": 4, "targets": [{{"POSITION": 5}}]}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [0.5, 0.25, 0.125, 1]}}}}],
        "accessors": [
        {{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0]}},
        {{"bufferView": 1, "byteOffset": 0, "componentType": 5123, "type": "SCALAR", "count": 3}},
        {{"bufferView": 2, "componentType": 5121, "type": "VEC4", "count": 3}},
        {{"bufferView": 3, "componentType": 5121, "type": "VEC4", "count": 3, "normalized": true}},
        {{"bufferView": 4, "componentType": 5126, "type": "MAT4", "count": 1}},
        {{"componentType": 5126, "type": "VEC3", "count": 3, "sparse": {{"count": 1,
        "indices": {{"bufferView": 1, "byteOffset": 2, "componentType": 5123}}, "values": {{"bufferView": 0, "byteOffset": 12}}}}}}],
        "bufferViews": [{{"buffer": 0, "byteOffset": 0, "byteLength": 36, "byteStride": 12}},
        {{"buffer": 0, "byteOffset": 36, "byteLength": 8}}, {{"buffer": 0, "byteOffset": 44, "byteLength": 12}},
        {{"buffer": 0, "byteOffset": 56, "byteLength": 12}}, {{"buffer": 0, "byteOffset": 68, "byteLength": 64}}],
        "buffers": [{{"byteLength": {}{uri}}}]}}"#,
        bytes.len()
    );
    (json, bytes)
}

/// RFC 4648 with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = |chunk: &[u8]| {
        let word = (0..3).fold(0u32, |word, k| word << 8 | u32::from(*chunk.get(k).unwrap_or(&0)));
        let digit =
            |k: usize| if k <= chunk.len() { DIGITS[(word >> (18 - 6 * k)) as usize & 63] as char } else { '=' };
        [0, 1, 2, 3].map(digit)
    };
    bytes.chunks(3).flat_map(digits).collect()
}

#[test]
fn gltf_text() {
    let (_, bytes) = gltf("");
    let (json, _) = gltf(&format!(r#", "uri": "data:application/octet-stream;base64,{}""#, base64(&bytes)));
    assert_sound("mesh.gltf", json.as_bytes(), 2 * COUNT);
}

#[test]
fn gltf_binary() {
    let (json, bytes) = gltf("");
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = |kind: &[u8; 4], data: &[u8]| [&(data.len() as u32).to_le_bytes(), &kind[..], data].concat();
    let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", &bytes)].concat();
    let glb = [&b"glTF"[..], &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks].concat();
    assert_sound("mesh.glb", &glb, 2 * COUNT);
}

#[test]
fn exr() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("light.exr");
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
    ] {
        let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| (at.x() as f32, at.y() as f32, 0.5f32));
        let encoding = Encoding { compression, ..Encoding::default() };
        let layer = Layer::new((6, 4), LayerAttributes::named("light"), encoding, channels);
        Image::from_layer(layer).write().to_file(&path).unwrap();
        assert_sound("light.exr", &fs::read(&path).unwrap(), COUNT / 4);
    }
}

#[test]
fn hdr() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("light.hdr");
    let pixels: Vec<image::Rgb<f32>> = (0..32).map(|i| image::Rgb([i as f32, 0.5, 2.0])).collect();
    image::codecs::hdr::HdrEncoder::new(fs::File::create(&path).unwrap()).encode(&pixels, 8, 4).unwrap();
    assert_sound("light.hdr", &fs::read(&path).unwrap(), COUNT);
}

fn npy(rows: usize) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, 6), }}");
    let header = format!("{header:<117}\n");
    let mut bytes = [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    let row = [0.5, 1.0, -2.0, 0.0, 0.0, 1.0f64];
    bytes.extend(row.repeat(rows).iter().flat_map(|x| x.to_le_bytes()));
    bytes
}

#[test]
fn npy_points() {
    assert_sound("points.npy", &npy(4), COUNT);
}

#[test]
fn text_points() {
    assert_sound("points.txt", b"# x y z\n0 0 0 0 0 1\n1.5,2,3,0,1,0\n\n-1e-3 0 4 0.6 0.8 0 # end\n", COUNT);
}

#[test]
fn npz_archives() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let mut arrays = Arrays::new();
    arrays.push(Array::new("ambient_occlusion", [3], vec![0.5, 1.0, 0.25])).unwrap();
    arrays.push(Array::new("visibility_sh", [3, 4], vec![0.5; 12])).unwrap();
    npz::write(&path, &arrays, &Provenance::new("exact")).unwrap();
    assert_sound("a.npz", &fs::read(&path).unwrap(), COUNT);
}

#[test]
fn scene_files() {
    let text = "receivers = \"pixels\"\n[[mesh]]\nshape.box = { size = [1, 2, 3], divisions = 2 }\nscale = 2.0\n\
        rotate = { axis = [0, 1, 0], degrees = 90 }\ntranslate = [0, 1, 0]\nalbedo = [0.8, 0.5, 0.3]\n\
        [[mesh]]\nshape.icosphere = { radius = 1.0, subdivisions = 1 }\n[environment]\nsky = { elevation = 40 }\n\
        up = \"y\"\nrotation = 30\n[camera]\nposition = [0, 2, 6]\nlook_at = [0, 1, 0]\nup = [0, 1, 0]\nfov = 45\n\
        resolution = [64, 48]\n";
    assert_sound("scene.toml", text.as_bytes(), COUNT / 4);
}
