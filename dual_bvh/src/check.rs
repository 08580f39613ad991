//! Every invariant of a tree, tested one by one.

use crate::DualBvh;
use crate::dual::{Dual, Plane, face_units};
use crate::edge::{Edges, sides};
use crate::groups::Group;
use crate::node::{Bounds, FAN, Leaf, STEPS, Tree, WIDTH, fractions};

/// A broken invariant of a tree: a defect of this crate, or of the memory it ran in, never of the mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Defect {
    /// The faces have three sides each, the edges together must have as many faces.
    #[error("{faces} faces have {sides} sides in all edges together, not three each")]
    Sides {
        /// Number of faces.
        faces: usize,
        /// Sides found in the edges.
        sides: usize,
    },
    /// The list of a face's edges has another number of entries than there are faces.
    #[error("the edges of {listed} faces are listed, but there are {faces} faces")]
    Faces {
        /// Number of faces.
        faces: usize,
        /// Faces with a list of edges.
        listed: usize,
    },
    /// A side of a face and its edge do not agree on vertices, face or direction.
    #[error("edge {edge} is not side {side} of face {face}")]
    Side {
        /// The face.
        face: usize,
        /// Its side, counted from 0.
        side: usize,
        /// The edge that should be that side.
        edge: u32,
    },
    /// Two records stand for the same edge.
    #[error("edges {first} and {second} join the same vertices")]
    Twice {
        /// An edge.
        first: u32,
        /// Another one.
        second: u32,
    },
    /// An edge stands in the tree for the other parity of its number of faces.
    #[error("edge {edge} has {faces} faces and stands in the wrong tree")]
    Parity {
        /// The edge.
        edge: u32,
        /// Its number of faces.
        faces: usize,
    },
    /// A group shares a vertex with another one, is empty, or lies outside of its box; or not all edges belong to groups.
    #[error("group {group} is not a group of its own, or not in its box")]
    Group {
        /// The group.
        group: usize,
    },
    /// A tree has not as many nodes or leaves as its edges need.
    #[error("a tree over {edges} edges has {found:?} nodes per level, then leaves, instead of {expected:?}")]
    Shape {
        /// Number of edges.
        edges: usize,
        /// Numbers there should be.
        expected: Vec<usize>,
        /// Numbers there are.
        found: Vec<usize>,
    },
    /// A child does not enclose one of its edges.
    #[error("child {lane} of node {node} at height {height} does not enclose the {what} of edge {edge}")]
    Bounds {
        /// Levels above the leaves' parents.
        height: usize,
        /// Number of the node in its level.
        node: usize,
        /// Number of the child in the node.
        lane: usize,
        /// The edge.
        edge: u32,
        /// What of the edge lies outside.
        what: &'static str,
    },
    /// A leaf holds another plane for an edge than the edge has.
    #[error("leaf {leaf} holds a wrong plane of edge {edge}")]
    Plane {
        /// The leaf.
        leaf: usize,
        /// The edge.
        edge: u32,
    },
}

impl DualBvh {
    /// Tests every invariant that the search relies on. Takes longer than building the tree did.
    ///
    /// # Errors
    ///
    /// The first defect found. There is none unless this crate is at fault.
    pub fn check(&self) -> Result<(), Defect> {
        self.edges.check(&self.triangles)?;
        self.check_groups()?;
        let units = face_units(&self.positions, &self.triangles);
        let dual = Dual::new(&self.positions, &self.triangles, &self.edges, &units);
        self.groups.iter().try_for_each(|group| group.check(&self.edges, &dual))
    }

    fn check_groups(&self) -> Result<(), Defect> {
        let mut next = 0;
        for (number, group) in self.groups.iter().enumerate() {
            if group.first != next || group.edges().is_empty() {
                return Err(Defect::Group { group: number });
            }
            next = group.edges().end;
        }
        if next as usize != self.edge_count() || self.groups.len() != self.boxes.first().map_or(0, Vec::len) {
            return Err(Defect::Group { group: self.groups.len() });
        }
        let mut of_vertices = vec![None; self.positions.len()];
        for (face, corners) in self.triangles.iter().enumerate() {
            let group = self.group_of(face as u32);
            let [low, high] = self.boxes[0][group as usize];
            for &vertex in corners {
                let p = self.positions[vertex as usize];
                let is_inside = p.cmpge(low).all() && p.cmple(high).all();
                if *of_vertices[vertex as usize].get_or_insert(group) != group || !is_inside {
                    return Err(Defect::Group { group: group as usize });
                }
            }
        }
        for levels in self.boxes.windows(2) {
            for (i, [low, high]) in levels[0].iter().enumerate() {
                let holds = levels[1].get(i / WIDTH).is_some_and(|[l, h]| low.cmpge(*l).all() && high.cmple(*h).all());
                if !holds {
                    return Err(Defect::Group { group: i });
                }
            }
        }
        Ok(())
    }
}

impl Group {
    fn check(&self, edges: &Edges, dual: &Dual<'_>) -> Result<(), Defect> {
        let odd = self.first + self.balanced.edges as u32;
        for edge in self.edges() {
            let faces = edges.incidences(edge).len();
            if faces.is_multiple_of(2) != (edge < odd) {
                return Err(Defect::Parity { edge, faces });
            }
        }
        self.balanced.check_shape(true)?;
        self.unbalanced.check_shape(false)?;
        self.balanced.check_bounds(dual, self.first, true)?;
        self.unbalanced.check_bounds(dual, odd, false)?;
        for (index, leaf) in self.balanced.leaves.iter().enumerate() {
            let bounds = self.balanced.levels[0][index / WIDTH].get(index % WIDTH);
            for (lane, edge) in self.balanced.edges_below(0, index).enumerate() {
                let edge = self.first + edge as u32;
                let holds = if dual.is_fan(edge) {
                    leaf.planes[0][3][lane] == FAN
                } else {
                    dual.planes(edge).enumerate().all(|(which, plane)| leaf.holds(which, lane, &plane, &bounds))
                };
                if !holds {
                    return Err(Defect::Plane { leaf: index, edge });
                }
            }
        }
        Ok(())
    }
}

impl Edges {
    fn check(&self, triangles: &[[u32; 3]]) -> Result<(), Defect> {
        let (faces, edges) = (triangles.len(), 0..self.records.len() as u32);
        let sides_found: usize = edges.clone().map(|edge| self.incidences(edge).len()).sum();
        if sides_found != 3 * faces {
            return Err(Defect::Sides { faces, sides: sides_found });
        }
        if self.of_faces.len() != faces {
            return Err(Defect::Faces { faces, listed: self.of_faces.len() });
        }
        // As many sides as there are uses of edges, and every side with its own use: every use with its own side.
        for (face, (triangle, listed)) in triangles.iter().zip(&self.of_faces).enumerate() {
            for (side, ((u, v), &edge)) in sides(triangle).zip(listed).enumerate() {
                let orientation = if u < v { 1 } else { -1 };
                let uses = |edge| {
                    self.incidences(edge)
                        .iter()
                        .filter(|use_| use_.face() as usize == face && use_.orientation() == orientation)
                        .count()
                };
                let agrees = edges.contains(&edge)
                    && self.records[edge as usize].vertices() == [u.min(v), u.max(v)]
                    && uses(edge) == 1;
                if !agrees {
                    return Err(Defect::Side { face, side, edge });
                }
            }
        }
        let mut sorted: Vec<u32> = edges.collect();
        sorted.sort_by_key(|&edge| self.records[edge as usize].vertices());
        for pair in sorted.windows(2) {
            let [first, second] = [pair[0], pair[1]];
            if self.records[first as usize].vertices() == self.records[second as usize].vertices() {
                return Err(Defect::Twice { first, second });
            }
        }
        Ok(())
    }
}

impl Tree {
    fn check_shape(&self, balanced: bool) -> Result<(), Defect> {
        let edges = self.edges;
        let leaves = if balanced { edges.div_ceil(WIDTH) } else { 0 };
        let expected: Vec<usize> = Self::shape(edges).into_iter().chain([leaves]).collect();
        let found: Vec<usize> = self.levels.iter().map(Vec::len).chain([self.leaves.len()]).collect();
        if found == expected { Ok(()) } else { Err(Defect::Shape { edges, expected, found }) }
    }

    fn check_bounds(&self, dual: &Dual<'_>, first: u32, balanced: bool) -> Result<(), Defect> {
        for (height, level) in self.levels.iter().enumerate() {
            for (index, node) in level.iter().enumerate() {
                for lane in 0..WIDTH {
                    let bounds = node.get(lane);
                    for edge in self.edges_below(height, WIDTH * index + lane) {
                        let edge = first + edge as u32;
                        let outside = |what| Defect::Bounds { height, node: index, lane, edge, what };
                        if !dual.vertices(edge).iter().all(|p| bounds.holds_point(p.to_array())) {
                            return Err(outside("ends"));
                        }
                        if balanced && !dual.planes(edge).all(|plane| bounds.holds_plane(&plane)) {
                            return Err(outside("planes"));
                        }
                        if !balanced && bounds.offset_half != f32::INFINITY {
                            return Err(outside("jump"));
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

impl Bounds {
    fn holds_point(&self, p: [f64; 3]) -> bool {
        (0..3).all(|axis| (p[axis] - f64::from(self.center[axis])).abs() <= f64::from(self.half[axis]))
    }

    fn holds_plane(&self, plane: &Plane) -> bool {
        fractions(plane, self).iter().all(|fraction| fraction.abs() <= 1.0)
    }
}

impl Leaf {
    /// Whether the plane lies within half a step of the one held.
    fn holds(&self, which: usize, lane: usize, plane: &Plane, bounds: &Bounds) -> bool {
        fractions(plane, bounds).iter().zip(&self.planes[which]).all(|(fraction, lanes)| {
            (fraction * f64::from(STEPS) - f64::from(lanes[lane])).abs() <= 0.5 && lanes[lane] != FAN
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::*;
    use crate::BuildOptions;

    /// A closed strip of quads around an axis, several nodes high, with an open fan of four faces and one of three on top.
    fn tree() -> DualBvh {
        let around = 60;
        let mut positions: Vec<Vec3> = (0..2 * around)
            .map(|i| {
                let (sin, cos) = (0.21 * i as f32).sin_cos();
                Vec3::new((3.0 + 0.01 * i as f32) * cos, (3.0 + 0.02 * i as f32) * sin, 0.3 * (i % 7) as f32)
            })
            .collect();
        let mut triangles = Vec::new();
        for i in 0..around - 1 {
            triangles.extend([[i, i + 1, around + i], [i + 1, around + i + 1, around + i]]);
        }
        for (edge, faces) in [(0, 3), (10, 2)] {
            for _ in 0..faces {
                triangles.push([edge, edge + 1, positions.len() as u32]);
                positions.push(Vec3::new(0.1, 0.4 * positions.len() as f32, 5.0));
            }
        }
        let triangles: Arc<[[u32; 3]]> = triangles.into();
        DualBvh::build(positions.into(), triangles, &BuildOptions::default()).unwrap()
    }

    /// The defect found after breaking a sound tree.
    fn defect(breaking: impl FnOnce(&mut DualBvh)) -> Defect {
        let mut tree = tree();
        assert_eq!(tree.check(), Ok(()));
        breaking(&mut tree);
        tree.check().expect_err("the defect goes unnoticed")
    }

    #[test]
    fn the_tree_under_test_has_everything() {
        let tree = tree();
        let fans: Vec<usize> = (0..tree.edge_count() as u32).map(|edge| tree.edge_faces(edge).len()).collect();
        assert!([1, 2, 3, 4].iter().all(|count| fans.contains(count)));
        assert!(tree.groups[0].balanced.levels.len() > 1 && tree.groups[0].unbalanced.levels.len() > 1);
    }

    #[test]
    fn lost_and_foreign_faces_are_found() {
        let lost = defect(|tree| {
            let edge = (0..tree.edge_count()).find(|&edge| tree.edges.records[edge].fan().is_some()).unwrap();
            tree.edges.records[edge].shorten();
        });
        assert!(matches!(lost, Defect::Sides { .. }));
        assert!(matches!(defect(|tree| tree.edges.of_faces.truncate(5)), Defect::Faces { listed: 5, .. }));
        assert!(matches!(defect(|tree| tree.edges.of_faces[7].swap(0, 1)), Defect::Side { face: 7, side: 0, .. }));
        let outside = defect(|tree| tree.edges.of_faces[3][2] = u32::MAX);
        assert_eq!(outside, Defect::Side { face: 3, side: 2, edge: u32::MAX });
        assert!(matches!(defect(|tree| tree.edges.fans.swap(0, 4)), Defect::Side { .. }));
        let turned = defect(|tree| tree.triangles = tree.triangles.iter().map(|&[a, b, c]| [b, a, c]).collect());
        assert!(matches!(turned, Defect::Side { .. }));
    }

    #[test]
    fn an_edge_split_in_two_is_found() {
        // Two faces at an edge, then each at an edge of its own: the sides agree, the edge stands there twice.
        let triangles = [[0, 1, 2], [1, 0, 3]];
        let mut edges = Edges::collect(4, &triangles);
        let other = Edges::collect(4, &triangles[..1]).records[0];
        edges.records.push(other);
        edges.records[0] = Edges::collect(4, &[[0, 2, 3], [1, 0, 3]]).records[0];
        let order: Vec<u32> = (0..edges.records.len() as u32).collect();
        edges.reorder(&order, &triangles);
        assert_eq!(edges.check(&triangles), Err(Defect::Twice { first: 0, second: 5 }));
    }

    #[test]
    fn an_edge_in_the_wrong_tree_is_found() {
        let wrong = defect(|tree| {
            tree.groups[0].balanced.edges -= 1;
            tree.groups[0].unbalanced.edges += 1;
        });
        assert!(matches!(wrong, Defect::Parity { faces: 2 | 4, .. }));
    }

    #[test]
    fn wrong_groups_are_found() {
        assert_eq!(defect(|tree| tree.groups[0].first = 1), Defect::Group { group: 0 });
        assert_eq!(defect(|tree| tree.boxes[0][0][1].x = 0.5), Defect::Group { group: 0 });
        assert_eq!(defect(|tree| tree.groups.push(Group::default())), Defect::Group { group: 1 });
        assert_eq!(defect(|tree| tree.boxes[0].push([Vec3::ZERO; 2])), Defect::Group { group: 1 });
        assert_eq!(defect(|tree| tree.boxes.push(vec![[Vec3::ZERO; 2]])), Defect::Group { group: 0 });
    }

    #[test]
    fn a_wrong_shape_is_found() {
        let lost_leaf = defect(|tree| tree.groups[0].balanced.leaves.truncate(3));
        assert!(matches!(lost_leaf, Defect::Shape { .. }));
        let lost_level = defect(|tree| tree.groups[0].unbalanced.levels.truncate(1));
        assert!(matches!(lost_level, Defect::Shape { .. }));
    }

    #[test]
    fn every_bound_of_every_child_is_tested() {
        // A bound shrunk by a little more than its slack loses an edge, on either tree, at any height.
        let shrink = |half: &mut f32| *half -= 1e-4 * half.abs() + 1e-5;
        for height in 0..2 {
            for axis in 0..3 {
                let trees: [fn(&mut DualBvh) -> &mut Tree; 2] =
                    [|t| &mut t.groups[0].balanced, |t| &mut t.groups[0].unbalanced];
                for tree in trees {
                    let ends = defect(|t| shrink(&mut tree(t).levels[height][0].half[axis][1]));
                    assert!(matches!(ends, Defect::Bounds { lane: 1, node: 0, what: "ends", .. }));
                }
                let planes = defect(|tree| shrink(&mut tree.groups[0].balanced.levels[height][0].normal_half[axis][1]));
                assert!(matches!(planes, Defect::Bounds { lane: 1, what: "planes", .. }));
            }
            // Above the leaves' parents these bounds are not the tightest.
            let planes = defect(|tree| match &mut tree.groups[0].balanced.levels[height][0].offset_half[0] {
                half if height == 0 => shrink(half),
                half => *half *= 0.5,
            });
            assert!(matches!(planes, Defect::Bounds { lane: 0, what: "planes", .. }));
            let jump = defect(|tree| tree.groups[0].unbalanced.levels[height][0].offset_half[2] = 1e30);
            assert!(matches!(jump, Defect::Bounds { lane: 2, what: "jump", .. }));
            let nan = defect(|tree| tree.groups[0].balanced.levels[height][0].center[0][0] = f32::NAN);
            assert!(matches!(nan, Defect::Bounds { lane: 0, .. }));
        }
    }

    #[test]
    fn a_wrong_plane_in_a_leaf_is_found() {
        for (which, term) in (0..2).flat_map(|which| (0..4).map(move |term| (which, term))) {
            let leaf = 2;
            let wrong = defect(|tree| {
                let lane = &mut tree.groups[0].balanced.leaves[leaf].planes[which][term][5];
                *lane = lane.wrapping_add(if *lane > 0 { -2 } else { 2 });
            });
            assert_eq!(wrong, Defect::Plane { leaf, edge: 21 });
        }
        let fan = defect(|tree| {
            let edge =
                (0..tree.groups[0].balanced.edges).find(|&edge| tree.edges.records[edge].fan().is_some()).unwrap();
            tree.groups[0].balanced.leaves[edge / WIDTH].planes[0][3][edge % WIDTH] = 0;
        });
        assert!(matches!(fan, Defect::Plane { .. }));
    }
}
