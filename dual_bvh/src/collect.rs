//! From the edges that a search found to candidates with their vertices and faces.

use glam::DVec3;

use crate::candidates::{Block, CandidateEdge, Candidates, Part, room};
use crate::edge::Incidence;
use crate::face::{face_normal, plane_value, sign};
#[cfg(target_arch = "x86_64")]
use crate::features::has_lookup;
use crate::pairs::FACES;
use crate::prefetch::{AHEAD, ahead, prefetch};
use crate::search::Scratch;
use crate::{DualBvh, Tile};

impl DualBvh {
    /// Turns the hits in a group into candidates, in simple passes, each of which lets many loads overlap.
    #[inline(always)]
    pub(crate) fn collect(&self, group: u32, tile: &Tile<'_>, scratch: &mut Scratch, out: &mut Candidates) {
        let Scratch { hits, excluded_hits, regular, border, other, .. } = scratch;
        regular.clear();
        border.clear();
        other.clear();
        // So many edges come first of which some face may be left out; all, if there is no other.
        let mut together = usize::MAX;
        for (hit, &edge) in ahead(hits, AHEAD, |&edge| prefetch(&self.edges.records[edge as usize])).enumerate() {
            if hit == *excluded_hits {
                together = regular.len();
            }
            let record = self.edges.records[edge as usize];
            if let Some(faces) = record.regular() {
                regular.push((record.vertices(), faces));
            } else if let Some(use_) = record.lone() {
                border.push((record.vertices(), use_));
            } else if !record.fan().is_some_and(|fan| self.is_fan_certain(tile, &self.edges.fans[fan])) {
                other.push(edge);
            }
        }
        let (old_edges, old_incidences) = (out.edge_count, out.incidence_count);
        let (old_vertices, old_faces) = (out.vertices().len(), out.faces().len());
        out.vertices.begin_part();
        out.faces.begin_part();
        let count = regular.len() + border.len() + other.len();
        out.edge_count += count;

        room(&mut out.edges, out.edge_count);
        room(&mut out.uses, out.edge_count + 1);
        out.vertices.reserve(2 * count + 1);
        let (pairs, rest) = out.edges[old_edges..].split_at_mut(regular.len());
        let (lone, rest) = rest.split_at_mut(border.len());
        for i in 0..regular.len() {
            if let Some(&([a, b], _)) = regular.get(i + AHEAD) {
                out.vertices.prefetch(a);
                out.vertices.prefetch(b);
            }
            let ([a, b], _) = regular[i];
            pairs[i] = CandidateEdge { a: out.vertices.insert(a), b: out.vertices.insert(b) };
        }
        for (edge, &([a, b], _)) in lone.iter_mut().zip(&*border) {
            *edge = CandidateEdge { a: out.vertices.insert(a), b: out.vertices.insert(b) };
        }
        for (edge, &other) in rest.iter_mut().zip(&*other) {
            let [a, b] = self.edges.records[other as usize].vertices();
            *edge = CandidateEdge { a: out.vertices.insert(a), b: out.vertices.insert(b) };
        }
        let others = other.iter().map(|&other| self.edges.incidences(other).len() as u32);
        let counts = regular.iter().map(|_| 2).chain(border.iter().map(|_| 1)).chain(others);
        let mut end = old_incidences as u32;
        out.uses[old_edges] = end;
        for (next, count) in out.uses[old_edges + 1..].iter_mut().zip(counts) {
            end += count;
            *next = end;
        }

        out.incidence_count = end as usize;
        room(&mut out.incidences, out.incidence_count);
        out.faces.reserve(out.incidence_count - old_incidences + 1);
        let (pairs, rest) = out.incidences[old_incidences..].split_at_mut(2 * regular.len());
        let (lone, rest) = rest.split_at_mut(border.len());
        let number =
            |(local, use_): (&mut Incidence, Incidence)| *local = use_.with_face(out.faces.insert(use_.face()));
        let others = other.iter().flat_map(|&edge| self.edge_faces(edge));
        lone.iter_mut().zip(border.iter().map(|&(_, use_)| use_)).chain(rest.iter_mut().zip(others)).for_each(number);
        let old_blocks = out.blocks.len();
        let mut block = Block { edges: old_edges..old_edges, faces: old_faces..old_faces };
        for i in 0..regular.len() {
            if let Some(&(_, [f, g])) = regular.get(i + AHEAD) {
                out.faces.prefetch(f);
                out.faces.prefetch(g);
            }
            let faces = out.faces.globals().len();
            // All edges of excluded faces stay together, so that these have one number each.
            if i >= together && faces + 2 > block.faces.start + FACES {
                (block.edges.end, block.faces.end) = (old_edges + i, faces);
                let next = Block { edges: block.edges.end..block.edges.end, faces: faces..faces };
                out.blocks.push(std::mem::replace(&mut block, next));
                out.faces.begin_part();
            }
            let (_, [f, g]) = regular[i];
            pairs[2 * i] = Incidence::new(out.faces.insert(f), false);
            pairs[2 * i + 1] = Incidence::new(out.faces.insert(g), true);
        }
        (block.edges.end, block.faces.end) = (old_edges + regular.len(), out.faces.globals().len());
        out.blocks.push(block);

        let vertices = out.vertices.globals();
        out.positions.iter_mut().for_each(|lanes| room(lanes, vertices.len()));
        let [x, y, z] = out.positions.each_mut().map(|lanes| &mut lanes[old_vertices..]);
        let vertices = ahead(&vertices[old_vertices..], AHEAD, |&vertex| prefetch(&self.positions[vertex as usize]));
        for (((x, y), z), &vertex) in x.iter_mut().zip(y).zip(z).zip(vertices) {
            [*x, *y, *z] = self.positions[vertex as usize].to_array();
        }
        #[cfg_attr(not(target_arch = "x86_64"), expect(unused_mut, reason = "no other processor has tables"))]
        let mut tables = 0..0;
        #[cfg(target_arch = "x86_64")]
        if has_lookup() {
            tables = out.ends.push(&out.edges[old_edges..out.edge_count], old_vertices);
            out.pairs.room(out.edge_count);
            for block in out.blocks[old_blocks..].iter().filter(|block| block.is_paired()) {
                let uses = &out.incidences[old_incidences..][2 * (block.edges.start - old_edges)..];
                let uses = uses[..2 * block.edges.len()].chunks_exact(2);
                let first = block.faces.start as u32;
                out.pairs.set(block.edges.start, uses.map(|uses| [0, 1].map(|side| uses[side].face() - first)));
            }
        }
        let part = Part {
            group,
            vertices: old_vertices..out.vertices.globals().len(),
            faces: old_faces..out.faces.globals().len(),
            edges: old_edges..out.edge_count,
            first: old_incidences,
            blocks: old_blocks..out.blocks.len(),
            tables,
            regular: regular.len(),
            border: border.len(),
        };
        self.collect_planes(&part, out);
        out.push(part);
    }

    #[inline(always)]
    fn collect_planes(&self, part: &Part, out: &mut Candidates) {
        let count = out.faces.globals().len();
        let faces = &out.faces.globals()[part.faces.clone()];
        let triangles = ahead(faces, 2 * AHEAD, |&face| prefetch(&self.triangles[face as usize]));
        let corners = ahead(faces, AHEAD, |&face| {
            self.triangles[face as usize].iter().for_each(|&corner| prefetch(&self.positions[corner as usize]));
        });
        out.normals.iter_mut().for_each(|lanes| room(lanes, count));
        out.anchors.iter_mut().for_each(|lanes| room(lanes, count));
        let [nx, ny, nz] = out.normals.each_mut().map(|lanes| &mut lanes[part.faces.clone()]);
        let [ax, ay, az] = out.anchors.each_mut().map(|lanes| &mut lanes[part.faces.clone()]);
        for (i, (&face, _)) in triangles.zip(corners).enumerate() {
            let [a, b, c] = self.triangles[face as usize];
            let a = self.positions[a as usize];
            let n = face_normal(a, self.positions[b as usize], self.positions[c as usize]);
            (nx[i], ny[i], nz[i]) = (n.x, n.y, n.z);
            (ax[i], ay[i], az[i]) = (a.x, a.y, a.z);
        }
    }

    /// Whether a fan is certain to be no contour, unless one of its faces is excluded.
    fn is_fan_certain(&self, tile: &Tile<'_>, fan: &[Incidence]) -> bool {
        if !tile.excluded().is_empty() && fan.iter().any(|use_| tile.excluded().contains(&use_.face())) {
            return false;
        }
        let jump = fan.iter().try_fold(0, |jump, use_| {
            let [a, b, c] = self.triangles[use_.face() as usize].map(|vertex| self.positions[vertex as usize]);
            let sign = certain_sign(tile, face_normal(a, b, c), a.as_dvec3())?;
            Some(jump + i32::from(use_.orientation()) * i32::from(sign))
        });
        jump == Some(0)
    }
}

/// The side of a plane, through `anchor` with normal `n` of any length, on which all of a tile lies; none if that is not certain.
#[inline(always)]
fn certain_sign(tile: &Tile<'_>, n: DVec3, anchor: DVec3) -> Option<i8> {
    let value = plane_value(n, anchor, tile.center);
    // Rounding of the value, at the centre and at the receiver, is below 16 units of roundoff of the length of its terms.
    let arm = (tile.center - anchor).abs().element_sum() + tile.radius;
    let reach = (n.length() * tile.radius).min(n.abs().dot(tile.half));
    let bound = reach + n.length() * 16.0 * f64::EPSILON * arm + f64::MIN_POSITIVE;
    (value.abs() > bound).then(|| sign(value))
}
