//! What a convex blocker hides, exactly: its outline on the sphere of directions and the integrals over what it bounds.

use std::collections::BTreeSet;

use glam::DVec3;
use silhouette::scene::Geometry;
use silhouette::sphere::{BoundaryArc, Order, closed_forms, region_harmonics};

/// A convex occluder: a closed body, or a planar polygon.
pub struct Blocker {
    pub geometry: Geometry,
    pub is_closed: bool,
}

impl Blocker {
    /// Corners, relative to `p`, of the faces that together cover once what the blocker hides, in an order that is
    /// counter-clockwise on the sphere of directions.
    fn faces(&self, p: DVec3) -> impl Iterator<Item = ([u32; 3], [DVec3; 3])> {
        self.geometry.triangles.iter().filter_map(move |&ids| {
            let corners = ids.map(|v| self.geometry.positions[v as usize].as_dvec3() - p);
            let [a, b, c] = corners;
            match a.dot((b - a).cross(c - a)) {
                // Seen from behind, where a body's faces hide what its others hide already.
                towards if towards > 0.0 => (!self.is_closed).then_some((ids, corners)),
                _ => Some(([ids[0], ids[2], ids[1]], [a, c, b])),
            }
        })
    }

    /// Share of the cosine-weighted hemisphere about `n` that is hidden: Lambert's formula, face by face.
    pub fn form_factor(&self, p: DVec3, n: DVec3) -> f64 {
        self.faces(p).map(|(_, corners)| closed_forms::polygon_form_factor(&corners, n)).sum()
    }

    /// Boundary of what is hidden of the hemisphere about `n`, on the left of its arcs.
    ///
    /// Edges between two of the faces cancel. A convex outline meets the horizon at two points at most: between them
    /// the horizon closes it.
    fn outline(&self, p: DVec3, n: DVec3) -> Vec<BoundaryArc> {
        let edges = || {
            self.faces(p)
                .flat_map(|(ids, w)| [0, 1, 2].map(|k| (k, (k + 1) % 3)).map(|(i, j)| ([ids[i], ids[j]], [w[i], w[j]])))
        };
        let all: BTreeSet<[u32; 2]> = edges().map(|(ids, _)| ids).collect();
        let (mut arcs, mut leaves, mut enters) = (Vec::new(), None, None);
        for (_, [a, b]) in edges().filter(|([i, j], _)| !all.contains(&[*j, *i])) {
            let (ha, hb) = (n.dot(a), n.dot(b));
            let level = || a.lerp(b, ha / (ha - hb)).normalize();
            let (start, end) = match (ha > 0.0, hb > 0.0) {
                (true, true) => (a.normalize(), b.normalize()),
                (true, false) => (a.normalize(), *leaves.insert(level())),
                (false, true) => (*enters.insert(level()), b.normalize()),
                (false, false) => continue,
            };
            arcs.push(BoundaryArc { start, end, normal: a.cross(b).normalize() });
        }
        if let (Some(start), Some(end)) = (leaves, enters) {
            arcs.push(BoundaryArc { start, end, normal: n });
        }
        arcs
    }

    /// Harmonics of what is hidden of the hemisphere about `n`.
    pub fn harmonics(&self, order: Order, p: DVec3, n: DVec3) -> Vec<f64> {
        let arcs = self.outline(p, n);
        let apex = arcs.iter().map(|arc| arc.start).sum::<DVec3>().normalize_or_zero();
        let solid_angle = arcs.iter().map(|arc| arc.solid_angle_from(apex)).sum();
        let mut out = vec![0.0; order.len()];
        region_harmonics(order, &arcs, solid_angle, &mut out);
        out
    }
}
