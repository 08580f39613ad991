//! Polygon files, binary little endian: positions, normals and one float property per component.

use std::io::Write;
use std::path::Path;

use crate::bake::BakedVertices;
use crate::bake::channels::{narrow, split};
use crate::{Error, Result};

use super::atomic::atomically;

/// Properties: `x y z nx ny nz`, then the components (`sh_l1_m-1`, ...), all float; faces of three corners.
pub(super) fn write(path: &Path, vertices: &BakedVertices) -> Result<()> {
    let channels = split(&vertices.arrays, 1)?;
    let BakedVertices { positions, normals, triangles, provenance, .. } = vertices;

    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {}\n", provenance.to_json());
    header += &format!("element vertex {}\n", positions.len());
    let names =
        ["x", "y", "z", "nx", "ny", "nz"].into_iter().chain(channels.iter().map(|channel| channel.name.as_str()));
    // Some readers take no dots in names.
    names.for_each(|name| header += &format!("property float {}\n", name.replace('.', "_")));
    header += &format!("element face {}\nproperty list uchar uint vertex_indices\nend_header\n", triangles.len());

    atomically(path, |file| {
        let io = |error| Error::file(path, error);
        file.write_all(header.as_bytes()).map_err(io)?;
        for (i, (position, normal)) in positions.iter().zip(normals).enumerate() {
            for x in position.to_array().into_iter().chain(normal.to_array()) {
                file.write_all(&narrow("vertex", x)?.to_le_bytes()).map_err(io)?;
            }
            for channel in &channels {
                file.write_all(&channel.values[i].to_le_bytes()).map_err(io)?;
            }
        }
        for corners in triangles.iter() {
            file.write_all(&[3]).map_err(io)?;
            file.write_all(bytemuck::cast_slice(&corners.map(u32::to_le))).map_err(io)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Property};

    use super::super::tests::tetrahedron;
    use super::*;

    #[test]
    fn reads_back_by_an_independent_reader() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let vertices = tetrahedron();
        write(&path, &vertices).unwrap();
        let mut file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let ply = Parser::<DefaultElement>::new().read_ply(&mut file).unwrap();
        let read = &ply.payload["vertex"];
        assert_eq!(read.len(), 4);
        let float = |i: usize, name: &str| match read[i][name] {
            Property::Float(x) => x,
            _ => panic!("{name} is no float"),
        };
        for i in 0..4 {
            assert_eq!(f64::from(float(i, "z")), vertices.positions[i].z);
            assert_eq!(f64::from(float(i, "ny")), vertices.normals[i].y);
            let coefficient = |name: &str, column: usize, width: usize| {
                vertices.arrays.get(name).unwrap().data[i * width + column] as f32
            };
            assert_eq!(float(i, "sh_l1_m-1"), coefficient("visibility_sh", 1, 9));
            assert_eq!(float(i, "sh_l2_m2"), coefficient("visibility_sh", 8, 9));
            assert_eq!(float(i, "transfer_l1_m1"), coefficient("transfer_sh", 3, 4));
            assert_eq!(float(i, "ambient_occlusion"), coefficient("ambient_occlusion", 0, 1));
            assert_eq!(float(i, "bent_normal_y"), coefficient("bent_normal", 1, 3));
        }
        let faces: Vec<_> =
            ply.payload["face"].iter().map(|face| face["vertex_indices"].to_u32_list().unwrap()).collect();
        assert_eq!(faces, vertices.triangles.iter().map(|corners| corners.to_vec()).collect::<Vec<_>>());
        assert!(ply.header.comments.iter().any(|comment| comment.as_str().contains("\"method\":\"isolines\"")));
    }
}
