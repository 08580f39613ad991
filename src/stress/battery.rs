use glam::{DMat3, DVec3, Vec3};

use super::invariance::invariances;
use super::pieces::{Triangle, ball, boxes, cuboid, floating, grid, knot, moved, placed, polygon, scene, soup, split};
use super::{Case, Term, Truth, at_random, closed};
use crate::Result;
use crate::bake::Receivers;
use crate::scene::shapes::Random;

/// All built-in cases, in the order of the table, with `many` receivers wherever their places are not what matters.
///
/// # Errors
/// None that depend on anything but the library itself.
pub fn battery(many: usize) -> Result<Vec<Case>> {
    let mut cases = receivers(many)?;
    cases.extend(faces(many)?);
    cases.extend(many_faces(many)?);
    cases.extend(invariances(many)?);
    Ok(cases)
}

/// A case from loose triangles.
pub(super) fn case(name: &str, triangles: &[Triangle], receivers: Receivers, truth: Truth) -> Result<Case> {
    Ok(Case { name: name.into(), geometry: scene(triangles)?, receivers, truth })
}

fn corners(polygon: &[Vec3]) -> Vec<DVec3> {
    polygon.iter().map(|corner| corner.as_dvec3()).collect()
}

/// Degenerate receivers.
fn receivers(many: usize) -> Result<Vec<Case>> {
    let mut random = Random::new(1);
    let cube = cuboid(grid(-16, -16, -16), grid(16, 16, 16));
    let cube_scene = scene(&cube)?;
    let rooms = [boxes(&mut random, 6), cube.clone()].concat();

    // Vertices, middles of edges and middles of the faces' diagonals, looking outwards along the face's normal.
    let on_cube = |sign: f64| {
        let faces = (0..cube_scene.triangles.len() as u32).flat_map(|t| {
            let [a, b, c] = cube_scene.corners(t);
            let n = sign * (b - a).cross(c - a).normalize();
            [a, a.midpoint(b), b.midpoint(c), (a + b + 2.0 * c) / 4.0].map(|p| (p, n))
        });
        Receivers::points(faces).on_surface(&cube_scene.face_tree())
    };
    let outwards = on_cube(1.0);
    let mut cases = vec![
        case("on corners, edges and faces of a box", &cube, outwards.clone(), Truth::Known(closed::open(&outwards)))?,
        case("on them, looking into the box", &cube, on_cube(-1.0), Truth::Rays)?,
    ];
    let vertices = Receivers::vertices(&*scene(&rooms)?).0;
    cases.push(case("on vertices of overlapping boxes", &rooms, vertices, Truth::Rays)?);

    // Tiles in the plane y = 0 around a hole, wound either way, and a far one; receivers in the hole, on the tiles' edges'
    // extensions among them, and on the tiles.
    let tile = |x: i32, z: i32, size: i32| {
        [grid(x, 0, z), grid(x, 0, z + size), grid(x + size, 0, z + size), grid(x + size, 0, z)]
    };
    let mut tiles = Vec::new();
    for (k, (x, z)) in [(-24, -8), (-8, -24), (8, -8), (-8, 8), (800_000, 0)].into_iter().enumerate() {
        let mut corners = tile(x, z, 16);
        if k % 2 == 1 {
            corners.reverse();
        }
        tiles.extend(polygon(&corners));
    }
    let places = [(0.0, 0.0), (0.25, 0.125), (-0.25, 0.5), (0.5, 0.5), (1.0, 0.0), (1.0, 0.25), (0.5, -0.75)];
    let coplanar = [DVec3::Y, -DVec3::Y].into_iter().flat_map(|n| places.map(|(x, z)| (DVec3::new(x, 0.0, z), n)));
    let coplanar = Receivers::points(coplanar).on_surface(&scene(&tiles)?.face_tree());
    let open = Truth::Known(closed::open(&coplanar));
    cases.push(case("in the plane of other faces", &tiles, coplanar, open)?);
    let aslant = places.map(|(x, z)| (DVec3::new(x, 0.0, z), DVec3::new(0.6, 0.0, 0.8)));
    let aslant = Receivers::points(aslant).on_surface(&scene(&tiles)?.face_tree());
    let open = Truth::Known(closed::open(&aslant));
    cases.push(case("seeing faces edge-on", &tiles, aslant, open)?);

    // A box that stands on a floor: what is on the floor beside, under and at the foot of it.
    let floor = polygon(&tile(-64, -64, 128));
    let standing = [floor, cuboid(grid(-16, 0, -16), grid(16, 16, 16))].concat();
    let foot = [(-1.0, -1.0), (-1.0, 0.0), (1.0, 0.25), (0.0, 1.0), (1.5, 0.0), (0.0, 0.0), (1.0, 2.0), (-4.0, -4.0)];
    let touching = foot.map(|(x, z)| (DVec3::new(x, 0.0, z), DVec3::Y));
    let touching = Receivers::points(touching).on_surface(&scene(&standing)?.face_tree());
    cases.push(case("where a box touches a floor", &standing, touching, Truth::Rays)?);
    let vertices = Receivers::vertices(&*scene(&standing)?).0;
    cases.push(case("on vertices that touch a floor", &standing, vertices, Truth::Rays)?);

    let solid = [cube.clone(), ball(grid(3, -2, 1), 5.0)?].concat();
    let inside = floating(&mut random, many, 0.99);
    let nothing = Truth::Known(closed::enclosed(&inside));
    cases.push(case("inside solids", &solid, inside, nothing)?);

    let wall = tile(-16, -16, 32);
    let near = (0..many).map(|k| {
        let height = 1e-9 * if k % 2 == 0 { 1.0 } else { -1.0 };
        let p = DVec3::new(random.between(-1.2, 1.2), height, random.between(-1.2, 1.2));
        (p, if k % 3 == 0 { DVec3::NEG_Y } else { random.in_ball().normalize() })
    });
    let near = Receivers::points(near.collect::<Vec<_>>());
    let truth = Truth::Known(closed::rows(&near, &[&corners(&wall)]));
    cases.push(case("1e-9 from a wall", &polygon(&wall), near, truth)?);

    let far = (0..many).map(|_| {
        let p = random.in_ball().normalize() * 10f64.powf(random.between(2.0, 7.0));
        (p, -p.normalize())
    });
    let far = Receivers::points(far.collect::<Vec<_>>());
    let truth = Truth::Known(closed::rows(&far, &[&corners(&wall)]));
    cases.push(case("far away", &polygon(&wall), far, truth)?);
    Ok(cases)
}

/// A polygon in many degenerate guises, of which the answer is always the polygon's.
fn faces(many: usize) -> Result<Vec<Case>> {
    let mut random = Random::new(2);
    let square = [grid(-16, 12, -12), grid(-16, 12, 20), grid(16, 12, 20), grid(16, 12, -12)];
    let below = |random: &mut Random| {
        let mut receivers = floating(random, many.max(5), 1.0);
        receivers.positions.iter_mut().for_each(|p| p.y = p.y.min(0.5));
        // In line with corners, sides and the middle, looking along axes.
        for (k, (x, z)) in [(-1.0, -0.75), (0.0, -0.75), (0.0, 0.25), (-1.0, 0.0), (2.0, 0.25)].into_iter().enumerate()
        {
            receivers.positions[k] = DVec3::new(x, 0.0, z);
            receivers.normals[k] = DVec3::Y;
        }
        receivers
    };
    let mut of_polygon = |name: &str, polygon: &[Vec3], triangles: &[Triangle]| {
        let receivers = below(&mut random);
        let truth = Truth::Known(closed::rows(&receivers, &[&corners(polygon)]));
        case(name, triangles, receivers, truth)
    };
    let fan = polygon(&square);
    let turned: Vec<Triangle> = fan.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let [a, b, c, d] = square;
    let other_fan = polygon(&[b, c, d, a]);
    let finer: Vec<Triangle> = fan.iter().flat_map(split).collect();
    // One side cut at its eighths, the other triangle left whole.
    let cuts: Vec<Vec3> = (0..=8).map(|k| a.lerp(b, k as f32 / 8.0)).collect();
    let t_junctions: Vec<Triangle> = cuts.windows(2).map(|pair| [c, pair[0], pair[1]]).chain([[a, c, d]]).collect();
    // A square with a side at x = 0, where coordinates are fine enough for a triangle of height 1.5e-8 beside that side.
    let shifted = square.map(|p| p + Vec3::X);
    let slivers: Vec<Triangle> = {
        let [a, b, c, d] = shifted;
        let beside = Vec3::new(1.5e-8, a.y, 0.25);
        [(a, b), (b, c), (c, d), (d, a)].map(|(a, b)| [a, b, beside]).to_vec()
    };
    let line = [grid(-30, 5, 3), grid(0, 5, 3), grid(30, 5, 3)];
    let no_area = [fan.clone(), vec![line, [a, a, b], [c, c, c], [a, a.midpoint(b), b]]].concat();
    let wound_back: Vec<Triangle> = other_fan.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let mut cases = Vec::new();
    for (name, triangles) in [
        ("coincident faces, split otherwise", [fan.clone(), other_fan, finer.clone()].concat()),
        ("coincident faces wound oppositely", [fan.clone(), wound_back].concat()),
        ("duplicate faces", [fan.clone(), turned.clone(), fan.clone(), finer.clone(), finer].concat()),
        ("T-junctions", t_junctions.clone()),
        ("T-junctions over coincident faces", [t_junctions, fan.clone()].concat()),
        ("zero-area faces", no_area),
        ("inconsistent winding", vec![fan[0], turned[1]]),
    ] {
        cases.push(of_polygon(name, &square, &triangles)?);
    }
    cases.push(of_polygon("slivers of aspect 1e8", &shifted, &slivers)?);

    // Copies at growing distances, all with the same silhouette from the origin.
    let deep: Vec<Triangle> = (0..128).flat_map(|k| moved(&fan, |p| p * (1.0 + k as f32 / 64.0))).collect();
    let origin = [DVec3::Y, DVec3::new(0.6, 0.8, 0.0), DVec3::new(-0.48, 0.6, 0.64)].map(|n| (DVec3::ZERO, n));
    let origin = Receivers::points(origin);
    let truth = Truth::Known(closed::rows(&origin, &[&corners(&square)]));
    cases.push(case("depth complexity 128, one silhouette", &deep, origin, truth)?);

    let triangle = [grid(3, 5, -7), grid(-9, 11, 2), grid(14, 8, 10)];
    let one = floating(&mut random, many, 2.0);
    let truth = Truth::Known(closed::rows(&one, &[&corners(&triangle)]));
    cases.push(case("one triangle", &[triangle], one, truth)?);

    let none = floating(&mut random, many, 2.0);
    let truth = Truth::Known(closed::open(&none));
    cases.push(case("no triangle", &[], none, truth)?);

    // Octants: corners on the poles of every chart, edges on its octants' boundaries.
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    for (name, signs) in [("vertices on the poles", [1.0, 1.0, 1.0]), ("vertices on negative poles", [-1.0, -1.0, 1.0])]
    {
        let octant: [Vec3; 3] = std::array::from_fn(|k| signs[k] * axes[k]);
        let normals = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, DVec3::ONE.normalize(), DVec3::new(0.0, 0.6, -0.8)];
        let origin = Receivers::points(normals.map(|n| (DVec3::ZERO, n)));
        let truth = Truth::Known(closed::rows(&origin, &[&corners(&octant)]));
        cases.push(case(name, &[octant], origin, truth)?);
    }

    cases.extend(along_isolines()?);
    Ok(cases)
}

/// Edges within the isoline u = m/1024, x = m and y + z = 1024 - m: over a whole quadrant of it and over a part. Isolines of
/// 1024 lines are those of odd m.
fn along_isolines() -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for m in [1, 256, 513] {
        let rest = 1024 - m;
        let on = |y: i32| Vec3::new(m as f32, y as f32, (rest - y) as f32);
        let apex = Vec3::new(m as f32 * 1.5 + 8.0, rest as f32 * 0.5, rest as f32 * 0.5);
        for (part, ends) in [("quadrant", [on(0), on(rest)]), ("part", [on(rest / 4), on(3 * rest / 4)])] {
            let triangle = [ends[0], ends[1], apex];
            let origin = Receivers::points([DVec3::X, DVec3::Z, DVec3::Y].map(|n| (DVec3::ZERO, n)));
            let truth = Truth::Known(closed::rows(&origin, &[&corners(&triangle)]));
            cases.push(case(&format!("edge along a {part} of isoline {m}/1024"), &[triangle], origin, truth)?);
        }
    }
    Ok(cases)
}

/// Many faces, and no closed form.
fn many_faces(many: usize) -> Result<Vec<Case>> {
    let mut random = Random::new(3);
    let mut cases = Vec::new();
    let crowd = boxes(&mut random, 12);
    cases.push(case("axis-aligned boxes", &crowd, floating(&mut random, many, 2.5), Truth::Rays)?);
    let geometry = scene(&crowd)?;
    cases.push(case("all over axis-aligned boxes", &crowd, at_random(&geometry, many, 4), Truth::Rays)?);

    let knots = [knot()?, moved(&knot()?, |p| Vec3::new(p.y, p.x + 0.25, p.z))].concat();
    let geometry = scene(&knots)?;
    cases.push(case("self-intersections", &knots, at_random(&geometry, many, 5), Truth::Rays)?);

    // Pages around a common edge, the first page along an axis.
    for pages in 1..=6 {
        let page = |k: usize| {
            let (s, c) = (k as f32 * 1.1).sin_cos();
            [Vec3::ZERO, Vec3::Y, Vec3::new(c, 0.5, s)]
        };
        let book: Vec<Triangle> = (0..pages).map(page).collect();
        let receivers = at_random(&*scene(&book)?, many, 6 + pages as u64);
        cases.push(case(&format!("an edge of {pages} faces"), &book, receivers, Truth::Rays)?);
    }

    let loose = soup(&mut random, 200);
    let geometry = scene(&loose)?;
    cases.push(case("triangle soup", &loose, at_random(&geometry, many, 13), Truth::Rays)?);

    // Shells within shells, receivers between them and outside; depth complexity 240 and more from outside.
    let shell = |k: usize| ball(Vec3::ZERO, 0.5 + k as f64 / 120.0);
    let shells = (0..120).map(shell).collect::<Result<Vec<_>>>()?.concat();
    // In all corners of the cube inside of the outermost, whose facets come as near as 1.393.
    let between = floating(&mut random, many, 0.8);
    let nothing = Truth::Known(closed::enclosed(&between));
    cases.push(case("inside nested shells", &shells, between, nothing)?);
    let outside = floating(&mut random, many, 1.0);
    let outside = placed(&outside, |p| p + 2.0 * DVec3::ONE, DMat3::IDENTITY);
    let outermost = scene(&shell(119)?)?;
    let twin = Truth::Sum(vec![Term::of(&outermost, &outside)]);
    cases.push(case("outside nested shells", &shells, outside, twin)?);
    Ok(cases)
}
