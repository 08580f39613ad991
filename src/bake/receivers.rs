use glam::DVec3;

use crate::scene::{FaceTree, Geometry, VertexFaces, faces_at};
use crate::visibility::Receiver;

/// The points a result is computed for, in the order of its rows.
#[derive(Clone, Debug, Default)]
pub struct Receivers {
    /// Positions, world space.
    pub positions: Vec<DVec3>,
    /// Unit normals; empty for probes, which see all around.
    pub normals: Vec<DVec3>,
    own: OwnFaces,
    first: usize,
}

/// The faces on which receivers lie.
#[derive(Clone, Debug, Default)]
enum OwnFaces {
    /// They float.
    #[default]
    None,
    /// One face for each.
    One(Vec<u32>),
    /// All faces around each vertex.
    Incident(VertexFaces),
    /// Any number for each: those of receiver `i` stand at `first[i]..first[i + 1]`.
    Several { first: Vec<usize>, faces: Vec<u32> },
}

impl OwnFaces {
    fn several(lists: Vec<Vec<u32>>) -> Self {
        let (mut first, mut faces) = (vec![0], Vec::new());
        for list in lists {
            faces.extend(list);
            first.push(faces.len());
        }
        Self::Several { first, faces }
    }
}

impl Receivers {
    /// Receivers on no surface of the scene: positions are used as given, and so are the
    /// directions of the normals; what digits in a file leave their lengths short of 1 is made up. See [`Receivers::on_surface`].
    pub fn points(points: impl IntoIterator<Item = (DVec3, DVec3)>) -> Self {
        let (positions, normals) = points.into_iter().map(|(p, n)| (p, unit(n))).unzip();
        Self { positions, normals, ..Self::default() }
    }

    /// Probes: receivers without a horizon.
    pub fn probes(positions: Vec<DVec3>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Receivers that each lie on one face: the points of a picture, for instance.
    pub fn on_faces(points: impl IntoIterator<Item = (DVec3, DVec3, u32)>) -> Self {
        let (positions, (normals, faces)) = points.into_iter().map(|(p, n, face)| (p, (n, face))).unzip();
        Self { positions, normals, own: OwnFaces::One(faces), first: 0 }
    }

    /// Receivers that each lie on some faces, any number of them: the faces that meet in an edge, for instance.
    pub fn leaving_out(points: impl IntoIterator<Item = (DVec3, DVec3, Vec<u32>)>) -> Self {
        let (positions, (normals, own)): (_, (_, Vec<_>)) = points.into_iter().map(|(p, n, own)| (p, (n, own))).unzip();
        Self { positions, normals, own: OwnFaces::several(own), first: 0 }
    }

    /// The vertices of a mesh with their angle-weighted normals; each leaves out its own incident faces.
    ///
    /// A vertex whose faces' normals cancel (or that has no face) has no direction to look in; it gets +z, and its index is
    /// among those returned.
    pub fn vertices(geometry: &Geometry) -> (Self, Vec<usize>) {
        let mut undirected = Vec::new();
        let mut normals: Vec<DVec3> = geometry
            .angle_weighted_normals()
            .into_iter()
            .enumerate()
            .map(|(vertex, normal)| {
                normal.unwrap_or_else(|| {
                    undirected.push(vertex);
                    DVec3::Z
                })
            })
            .collect();
        // The memory of what may be none is larger, and would be kept.
        normals.shrink_to_fit();
        let positions = geometry.positions.iter().map(|p| p.as_dvec3()).collect();
        (Self { positions, normals, own: OwnFaces::Incident(geometry.vertex_faces()), first: 0 }, undirected)
    }

    /// The same receivers as a part of a longer row, in which they have the numbers from `first` on: rays are turned by a
    /// receiver's number, and are so the same for a part as for the whole.
    pub fn numbered_from(self, first: usize) -> Self {
        Self { first, ..self }
    }

    /// The number of a receiver in the row that these are part of.
    pub(super) fn number(&self, index: usize) -> usize {
        self.first + index
    }

    /// The same receivers, each of which leaves out exactly the faces of a scene on which it lies: the face it is inside
    /// of, those that share its edge or corner, and all that coincide there. Decided without tolerance ([`faces_at`]); a face
    /// elsewhere in the same plane is none of them, nor is one that rounding has set the receiver beside.
    pub fn on_surface(self, faces: &FaceTree) -> Self {
        let own = faces_at(faces, self.positions.iter().copied());
        Self { own: OwnFaces::several(own), ..self }
    }

    /// Some of the receivers, in the order of their indices in `picked`.
    ///
    /// # Panics
    /// If there is no receiver of an index.
    pub fn pick(&self, picked: impl IntoIterator<Item = usize>) -> Self {
        let picked: Vec<usize> = picked.into_iter().collect();
        let own = match self.own {
            OwnFaces::None => OwnFaces::None,
            _ => OwnFaces::several(picked.iter().map(|&index| self.get(index).excluded.to_vec()).collect()),
        };
        let positions = picked.iter().map(|&index| self.positions[index]).collect();
        let normals =
            if self.normals.is_empty() { Vec::new() } else { picked.iter().map(|&i| self.normals[i]).collect() };
        Self { positions, normals, own, first: 0 }
    }

    /// Number of receivers.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// One receiver.
    pub fn get(&self, index: usize) -> Receiver<'_> {
        let excluded = match &self.own {
            OwnFaces::None => &[],
            OwnFaces::One(faces) => &faces[index..=index],
            OwnFaces::Incident(faces) => faces.of(index as u32),
            OwnFaces::Several { first, faces } => &faces[first[index]..first[index + 1]],
        };
        Receiver { position: self.positions[index], normal: self.normals.get(index).copied(), excluded }
    }
}

/// A vector's direction. What is of unit length to rounding keeps its bits: bringing it there again might change the last one.
fn unit(n: DVec3) -> DVec3 {
    if (n.length_squared() - 1.0).abs() < 1e-15 { n } else { n.normalize_or_zero() }
}
