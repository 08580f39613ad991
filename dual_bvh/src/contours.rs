use crate::candidates::room;
use crate::divided::Divided;

/// A contour edge of one receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Contour {
    /// The edge, an index into [`crate::Candidates::edges`].
    pub edge: u32,
    /// Sum of orientation times sign over the faces of the edge, not zero: the change of the number of surfaces that a ray from
    /// the receiver crosses, as the ray passes the edge a -> b from its left, where (a x b) . w > 0 for the ray's direction w and
    /// the ends relative to the receiver, to its right.
    pub jump: i32,
}

/// The contours of one receiver, or those chosen of them, see [`crate::Candidates::contours`]. Keep it and use it again: its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct Contours {
    // Both buffers may be longer than what they hold.
    pub(crate) signs: Vec<i8>,
    face_count: usize,
    pub(crate) buffer: Vec<Contour>,
    pub(crate) count: usize,
    /// Working memory of the choice.
    pub(crate) divided: Divided,
}

impl Contours {
    /// The side of each of the candidates' faces on which the receiver lies, by local number: 1 or -1, 0 for an excluded face. If
    /// the contours are those of one group, only the numbers of its faces mean anything.
    pub fn signs(&self) -> &[i8] {
        &self.signs[..self.face_count]
    }

    /// The contours, in the order of the candidates.
    pub fn edges(&self) -> &[Contour] {
        &self.buffer[..self.count]
    }

    /// Makes room for the signs of so many faces, and for so many contours, written eight at a time.
    pub(crate) fn room(&mut self, faces: usize, edges: usize) {
        room(&mut self.signs, faces);
        room(&mut self.buffer, edges + 8);
        (self.face_count, self.count) = (faces, 0);
    }
}
