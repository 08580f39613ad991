use std::fmt;

use crate::DualBvh;
use crate::node::{Tree, WIDTH};

/// What a tree holds and what it takes. Displays as a small table.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// Vertices, used or not.
    pub vertices: usize,
    /// Faces.
    pub faces: usize,
    /// Groups of bodies.
    pub groups: usize,
    /// Edges.
    pub edges: usize,
    /// Edges with one face.
    pub border_edges: usize,
    /// Edges with two faces that run along it in opposite directions.
    pub regular_edges: usize,
    /// Edges with two faces that run along it in the same direction.
    pub twisted_edges: usize,
    /// Edges with more than two faces.
    pub fans: usize,
    /// Most faces of one edge.
    pub largest_fan: usize,
    /// Nodes.
    pub nodes: usize,
    /// Levels of nodes.
    pub height: usize,
    /// Leaves.
    pub leaves: usize,
    /// Share of the places for children and edges that are taken, in [0, 1].
    pub fill: f64,
    /// Bytes of nodes.
    pub node_bytes: usize,
    /// Bytes of the planes in the leaves.
    pub leaf_bytes: usize,
    /// Bytes of edges, with their places in the faces.
    pub edge_bytes: usize,
}

impl DualBvh {
    /// Counts what the tree holds.
    pub fn statistics(&self) -> Statistics {
        let trees = || self.groups.iter().flat_map(|group| [&group.balanced, &group.unbalanced]);
        let nodes: usize = trees().flat_map(|tree| &tree.levels).map(Vec::len).sum();
        let leaves: usize = trees().map(|tree| tree.edges.div_ceil(WIDTH)).sum();
        let roots = trees().filter(|tree| !tree.levels.is_empty()).count();
        let mut statistics = Statistics {
            vertices: self.positions.len(),
            faces: self.triangles.len(),
            groups: self.groups(),
            edges: self.edge_count(),
            nodes,
            leaves,
            height: trees().map(|tree| tree.levels.len()).max().unwrap_or_default(),
            node_bytes: trees().map(Tree::node_bytes).sum(),
            leaf_bytes: trees().map(Tree::leaf_bytes).sum(),
            edge_bytes: self.edges.bytes(),
            ..Statistics::default()
        };
        let places = WIDTH * (nodes + leaves);
        if places > 0 {
            statistics.fill = (nodes - roots + leaves + statistics.edges) as f64 / places as f64;
        }
        for edge in 0..self.edge_count() as u32 {
            let faces = self.edges.incidences(edge).len();
            statistics.largest_fan = statistics.largest_fan.max(faces);
            *match faces {
                1 => &mut statistics.border_edges,
                2 if self.edges.records[edge as usize].regular().is_some() => &mut statistics.regular_edges,
                2 => &mut statistics.twisted_edges,
                _ => &mut statistics.fans,
            } += 1;
        }
        statistics
    }
}

impl Statistics {
    /// Bytes of the tree, without the positions and triangles that it shares with others.
    pub fn bytes(&self) -> usize {
        self.node_bytes + self.leaf_bytes + self.edge_bytes
    }
}

impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each = |bytes: usize| bytes as f64 / self.edges.max(1) as f64;
        writeln!(f, "mesh     {} vertices, {} faces, {} groups", self.vertices, self.faces, self.groups)?;
        writeln!(
            f,
            "edges    {}: {} regular, {} border, {} twisted, {} fans of up to {} faces",
            self.edges, self.regular_edges, self.border_edges, self.twisted_edges, self.fans, self.largest_fan
        )?;
        writeln!(
            f,
            "tree     {} nodes in {} levels, {} leaves, {:.1} % filled",
            self.nodes,
            self.height,
            self.leaves,
            100.0 * self.fill
        )?;
        write!(
            f,
            "memory   {:.1} MB; per edge: {:.1} bytes of nodes, {:.1} of leaves, {:.1} of edges",
            self.bytes() as f64 / 1e6,
            each(self.node_bytes),
            each(self.leaf_bytes),
            each(self.edge_bytes)
        )
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::BuildOptions;

    #[test]
    fn every_kind_of_edge_is_counted() {
        // Edge 0-1 has three faces; 0-2 and 2-5 have two that run alike, 1-2 two that do not; six have one.
        let triangles = [[0, 1, 2], [0, 1, 3], [1, 0, 4], [2, 0, 5], [2, 1, 5]];
        let positions = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|x: f32| Vec3::new(x, x.sin(), x.cos()));
        let tree = DualBvh::build(positions.into(), triangles.into(), &BuildOptions::default()).unwrap();
        let statistics = tree.statistics();
        assert_eq!((statistics.vertices, statistics.faces, statistics.edges), (6, 5, 10));
        let kinds = [statistics.border_edges, statistics.regular_edges, statistics.twisted_edges, statistics.fans];
        assert_eq!(kinds, [6, 1, 2, 1]);
        assert_eq!(statistics.largest_fan, 3);
        assert_eq!((statistics.nodes, statistics.leaves, statistics.height), (2, 2, 1));
        assert_eq!(statistics.fill, (2 + 10) as f64 / 32.0);
    }

    #[test]
    fn the_table_names_what_was_counted() {
        let statistics = Statistics { faces: 12345, twisted_edges: 678, fill: 0.5, ..Statistics::default() };
        let table = statistics.to_string();
        assert!(["12345 faces", "678 twisted", "50.0 % filled"].iter().all(|words| table.contains(words)));
        assert_eq!(table.lines().count(), 4);
    }
}
