//! NumPy archives: an uncompressed zip of one `.npy` per array, all doubles, and the provenance as a string.

use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::Path;

use glam::DVec3;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use crate::bake::{Array, Arrays, BakedImage, BakedVertices, Provenance};
use crate::scene::npy;
use crate::{Error, Result};

use super::atomic::atomically;

/// Name under which the provenance stands: a string array that holds JSON.
pub(super) const PROVENANCE: &str = "provenance";

/// What a NumPy archive holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Archive {
    /// All numeric arrays, as doubles, in the order of the file.
    pub arrays: Arrays,
    /// Where they come from, if the file says so.
    pub provenance: Option<Provenance>,
}

/// Writes `arrays` and their provenance: `numpy.load(path)["name"]` gives an array back,
/// `json.loads(str(numpy.load(path)["provenance"]))` the provenance.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, arrays: &Arrays, provenance: &Provenance) -> Result<()> {
    write_with_triangles(path, arrays, &[], provenance)
}

/// Reads all arrays of an archive, plain or deflated. Integers and booleans become doubles.
///
/// # Errors
/// When the file is missing, truncated or no archive, or when an array is not numeric or holds infinities or NaN.
pub fn read(path: &Path) -> Result<Archive> {
    let mut zip = open(path)?;
    let mut archive = Archive::default();
    for i in 0..zip.len() {
        let (name, bytes) = entry(&mut zip, i).map_err(|message| Error::file(path, message))?;
        let Some(name) = name.strip_suffix(".npy") else {
            return Err(Error::file(path, format!("{name} is no NumPy array")));
        };
        let content = npy::parse(&bytes).map_err(|message| Error::file(path, format!("array {name}: {message}")))?;
        match content {
            npy::Content::Text(json) if name == PROVENANCE => archive.provenance = Some(parse_provenance(path, &json)?),
            npy::Content::Text(_) => return Err(Error::file(path, format!("array {name} holds text, not numbers"))),
            npy::Content::Numbers { shape, data } => {
                archive.arrays.push(Array::new(name, shape, data)).map_err(|error| Error::file(path, error))?;
            }
        }
    }
    Ok(archive)
}

/// Reads where an archive comes from, if it says so, and nothing else of it.
///
/// # Errors
/// When the file is missing, truncated or no archive.
pub fn read_provenance(path: &Path) -> Result<Option<Provenance>> {
    let mut zip = open(path)?;
    let Some(i) = zip.index_for_name(&format!("{PROVENANCE}.npy")) else { return Ok(None) };
    let refuse = |message| Error::file(path, message);
    let (_, bytes) = entry(&mut zip, i).map_err(refuse)?;
    match npy::parse(&bytes).map_err(refuse)? {
        npy::Content::Text(json) => parse_provenance(path, &json).map(Some),
        npy::Content::Numbers { .. } => Ok(None),
    }
}

fn parse_provenance(path: &Path, json: &str) -> Result<Provenance> {
    serde_json::from_str(json).map_err(|error| Error::file(path, format!("provenance: {error}")))
}

pub(super) fn open(path: &Path) -> Result<ZipArchive<BufReader<File>>> {
    let file = File::open(path).map_err(|error| Error::file(path, error))?;
    ZipArchive::new(BufReader::new(file))
        .map_err(|error| Error::file(path, format!("not a NumPy archive, or truncated ({error})")))
}

fn entry(zip: &mut ZipArchive<impl Read + Seek>, i: usize) -> std::result::Result<(String, Vec<u8>), String> {
    let mut file = zip.by_index(i).map_err(|error| error.to_string())?;
    let name = file.name().map_err(|error| error.to_string())?.into_owned();
    let mut bytes = Vec::new();
    // Grows with what is really there: the size in the directory may be a lie.
    file.read_to_end(&mut bytes).map_err(|error| format!("array {name}: truncated or damaged ({error})"))?;
    Ok((name, bytes))
}

/// Results with `positions` and `normals` [N, 3] and, for a mesh, `triangles` [T, 3] as 32-bit integers beside them.
pub(super) fn write_vertices(path: &Path, vertices: &BakedVertices) -> Result<()> {
    let mut arrays = vertices.arrays.clone();
    for (name, vectors) in [("positions", &vertices.positions), ("normals", &vertices.normals)] {
        let data = vectors.iter().flat_map(DVec3::to_array).collect();
        arrays.push(Array::new(name, [vectors.len(), 3], data))?;
    }
    write_with_triangles(path, &arrays, &vertices.triangles, &vertices.provenance)
}

/// Results with `coverage` [height, width] beside them.
pub(super) fn write_image(path: &Path, image: &BakedImage) -> Result<()> {
    let mut arrays = image.arrays.clone();
    let coverage = image.coverage.iter().map(|&c| c.into()).collect();
    arrays.push(Array::new("coverage", [image.height, image.width], coverage))?;
    write(path, &arrays, &image.provenance)
}

fn write_with_triangles(path: &Path, arrays: &Arrays, triangles: &[[u32; 3]], provenance: &Provenance) -> Result<()> {
    atomically(path, |file| {
        let mut zip = ZipWriter::new(file);
        let mut all = || -> zip::result::ZipResult<()> {
            for array in arrays {
                let bytes = array.data.iter().map(|x| x.to_le_bytes());
                add(&mut zip, &array.name, "<f8", &array.shape, bytes)?;
            }
            if !triangles.is_empty() {
                let bytes = triangles.as_flattened().iter().map(|i| i.to_le_bytes());
                add(&mut zip, "triangles", "<u4", &[triangles.len(), 3], bytes)?;
            }
            add_provenance(&mut zip, provenance)
        };
        all().and_then(|()| zip.finish().map(drop)).map_err(|error| Error::file(path, error))
    })
}

pub(super) fn add_provenance(
    zip: &mut ZipWriter<impl Write + Seek>,
    provenance: &Provenance,
) -> zip::result::ZipResult<()> {
    let json: Vec<char> = provenance.to_json().chars().collect();
    let bytes = json.iter().map(|&c| u32::from(c).to_le_bytes());
    add(zip, PROVENANCE, &format!("<U{}", json.len()), &[], bytes)
}

/// Begins an array of so many bytes.
pub(super) fn start(
    zip: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    descr: &str,
    shape: &[usize],
    bytes: usize,
) -> zip::result::ZipResult<()> {
    // A fixed date, so that equal results are equal files.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default())
        .large_file(bytes >= u32::MAX as usize);
    zip.start_file(format!("{name}.npy"), options)?;
    npy::write_header(zip, descr, shape)?;
    Ok(())
}

fn add<const N: usize>(
    zip: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    descr: &str,
    shape: &[usize],
    numbers: impl ExactSizeIterator<Item = [u8; N]>,
) -> zip::result::ZipResult<()> {
    start(zip, name, descr, shape, numbers.len() * N)?;
    let mut block = Vec::with_capacity(1 << 16);
    for number in numbers {
        block.extend_from_slice(&number);
        if block.len() >= 1 << 16 {
            zip.write_all(&block)?;
            block.clear();
        }
    }
    zip.write_all(&block)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{image, tetrahedron};
    use super::*;

    #[test]
    fn vertices_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let vertices = tetrahedron();
        write_vertices(&path, &vertices).unwrap();
        let archive = read(&path).unwrap();
        assert_eq!(archive.provenance.as_ref(), Some(&vertices.provenance));
        for array in &vertices.arrays {
            assert_eq!(archive.arrays.get(&array.name), Some(array));
        }
        assert_eq!(archive.arrays.get("positions").unwrap().data[9..], [f64::from(0.1f32), 0.0, -3.0]);
        assert_eq!(archive.arrays.get("triangles").unwrap().shape, [4, 3]);
        assert_eq!(archive.arrays.get("triangles").unwrap().data[..3], [0.0, 2.0, 1.0]);
    }

    #[test]
    fn images_carry_their_coverage() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        write_image(&path, &image()).unwrap();
        let arrays = read(&path).unwrap().arrays;
        assert_eq!(arrays.get("coverage").unwrap().data, [1.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
        assert_eq!(arrays.get("visibility_sh").unwrap().shape, [2, 3, 4]);
    }

    #[test]
    fn bad_archives_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let message = |path: &Path| {
            let message = read(path).unwrap_err().to_string();
            assert!(message.starts_with(&path.display().to_string()) && !message.contains('\n'), "{message}");
            message
        };
        assert!(message(&path).contains("No such file"));
        std::fs::write(&path, "not a zip").unwrap();
        assert!(message(&path).contains("not a NumPy archive"));
        write_vertices(&path, &tetrahedron()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in (0..whole.len()).step_by(101) {
            std::fs::write(&path, &whole[..cut]).unwrap();
            message(&path);
        }
        // A flipped bit in the numbers fails the checksum.
        let mut damaged = whole.clone();
        damaged[200] ^= 1;
        std::fs::write(&path, damaged).unwrap();
        assert!(message(&path).contains("damaged"));
    }

    #[test]
    fn foreign_archives_are_read_or_refused_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        let archive = |name: &str, descr: &str, bytes: &[u8]| {
            let mut zip = ZipWriter::new(File::create(&path).unwrap());
            zip.start_file(name, SimpleFileOptions::default().compression_method(CompressionMethod::Deflated)).unwrap();
            npy::write_header(&mut zip, descr, &[1]).unwrap();
            zip.write_all(bytes).unwrap();
            zip.finish().unwrap();
            read(&path).map_err(|error| error.to_string())
        };
        assert_eq!(archive("x.npy", "<f4", &2.5f32.to_le_bytes()).unwrap().arrays.get("x").unwrap().data, [2.5]);
        assert!(archive("x.npy", "<f8", &f64::NAN.to_le_bytes()).unwrap_err().contains("array x: NaN at [0]"));
        assert!(archive("x.npy", "<U1", &[65, 0, 0, 0]).unwrap_err().contains("holds text"));
        assert!(archive("x.txt", "<f8", &[0; 8]).unwrap_err().contains("x.txt is no NumPy array"));
    }
}
