//! The battery of `silhouette stress`: every case is a test, by every method.

use std::sync::LazyLock;

use glam::{DAffine3, Vec3};
use silhouette::bake::Method;
use silhouette::scene::{GeometryBuilder, MAX_COORDINATE, Mesh};
use silhouette::stress::{Case, Settings, Verdict, battery, try_case};

static CASES: LazyLock<Vec<Case>> = LazyLock::new(|| battery(16).unwrap());

fn holds(name: &str) {
    let case = CASES.iter().find(|case| case.name == name).unwrap_or_else(|| panic!("there is no case `{name}`"));
    for method in [Method::Exact, Method::Isolines { lines: 1024 }] {
        let row = try_case(case, method, Settings::default(), &()).unwrap();
        assert_eq!(row.verdict, Verdict::Good, "{name}, {method}");
    }
}

macro_rules! cases {
    ($($(#[$meta:meta])* $test:ident = $name:literal,)*) => {
        $(#[test]
        $(#[$meta])*
        fn $test() {
            holds($name);
        })*

        #[test]
        fn every_case_is_a_test() {
            let names: Vec<&str> = CASES.iter().map(|case| case.name.as_str()).collect();
            assert_eq!(names, [$($name),*]);
        }
    };
}

cases! {
    on_corners_edges_and_faces_of_a_box = "on corners, edges and faces of a box",
    on_them_looking_into_the_box = "on them, looking into the box",
    on_vertices_of_overlapping_boxes = "on vertices of overlapping boxes",
    in_the_plane_of_other_faces = "in the plane of other faces",
    seeing_faces_edge_on = "seeing faces edge-on",
    where_a_box_touches_a_floor = "where a box touches a floor",
    on_vertices_that_touch_a_floor = "on vertices that touch a floor",
    inside_solids = "inside solids",
    at_1e_minus_9_from_a_wall = "1e-9 from a wall",
    far_away = "far away",
    coincident_faces_split_otherwise = "coincident faces, split otherwise",
    coincident_faces_wound_oppositely = "coincident faces wound oppositely",
    duplicate_faces = "duplicate faces",
    t_junctions = "T-junctions",
    t_junctions_over_coincident_faces = "T-junctions over coincident faces",
    zero_area_faces = "zero-area faces",
    inconsistent_winding = "inconsistent winding",
    slivers_of_aspect_1e8 = "slivers of aspect 1e8",
    depth_complexity_128_one_silhouette = "depth complexity 128, one silhouette",
    one_triangle = "one triangle",
    no_triangle = "no triangle",
    vertices_on_the_poles = "vertices on the poles",
    vertices_on_negative_poles = "vertices on negative poles",
    edge_along_a_quadrant_of_isoline_1 = "edge along a quadrant of isoline 1/1024",
    edge_along_a_part_of_isoline_1 = "edge along a part of isoline 1/1024",
    edge_along_a_quadrant_of_isoline_256 = "edge along a quadrant of isoline 256/1024",
    edge_along_a_part_of_isoline_256 = "edge along a part of isoline 256/1024",
    edge_along_a_quadrant_of_isoline_513 = "edge along a quadrant of isoline 513/1024",
    edge_along_a_part_of_isoline_513 = "edge along a part of isoline 513/1024",
    axis_aligned_boxes = "axis-aligned boxes",
    all_over_axis_aligned_boxes = "all over axis-aligned boxes",
    self_intersections = "self-intersections",
    an_edge_of_1_faces = "an edge of 1 faces",
    an_edge_of_2_faces = "an edge of 2 faces",
    an_edge_of_3_faces = "an edge of 3 faces",
    an_edge_of_4_faces = "an edge of 4 faces",
    an_edge_of_5_faces = "an edge of 5 faces",
    an_edge_of_6_faces = "an edge of 6 faces",
    triangle_soup = "triangle soup",
    inside_nested_shells = "inside nested shells",
    outside_nested_shells = "outside nested shells",
    scaled_by_2_to_40 = "scaled by 2^40",
    scaled_by_2_to_minus_40 = "scaled by 2^-40",
    scaled_to_1e15 = "scaled to 1e15",
    scaled_to_1e_30 = "scaled to 1e-30",
    scaled_to_denormals = "scaled to denormals",
    moved_by_1e6_sizes = "moved by 1e6 sizes",
    turned_by_a_quarter = "turned by a quarter",
    turned_about_a_diagonal = "turned about a diagonal",
    turned_obliquely = "turned obliquely",
    turned_obliquely_again = "turned obliquely again",
    relabelled_and_wound_at_random = "relabelled and wound at random",
    faces_split = "faces split",
    more_occluders_not_more_light = "more occluders, not more light",
    hidden_geometry_added = "hidden geometry added",
    disjoint_occluders_add_up = "disjoint occluders add up",
    visible_and_hidden_make_the_whole = "visible and hidden make the whole",
    two_hemispheres_make_the_sphere = "two hemispheres make the sphere",
}

/// What lies beyond the stated range, or is no number, is refused in one line that says where.
#[test]
fn beyond_the_range_is_refused() {
    for (bad, why) in [
        (2.0 * MAX_COORDINATE, "beyond the accepted range"),
        (f32::MAX, "beyond the accepted range"),
        (-f32::MAX, "beyond the accepted range"),
        (f32::INFINITY, "not finite"),
        (f32::NAN, "not finite"),
    ] {
        let mesh = Mesh::new("far", vec![Vec3::ZERO, Vec3::X, Vec3::new(0.0, bad, 0.0)], vec![[0, 1, 2]]);
        let message = GeometryBuilder::default().add(mesh, DAffine3::IDENTITY).unwrap_err().to_string();
        assert!(message.contains("mesh `far`: vertex 2") && message.contains(why), "{message}");
        assert!(!message.contains('\n'));
    }
    let mesh = Mesh::new("far", vec![Vec3::ZERO, Vec3::X, Vec3::splat(MAX_COORDINATE)], vec![[0, 1, 2]]);
    GeometryBuilder::default().add(mesh, DAffine3::IDENTITY).unwrap();
}
