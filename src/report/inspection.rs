use std::fmt;

use glam::{DVec3, Vec3};
use plotters::prelude::{BLACK, IntoFont, RGBColor, Rectangle, Text};
use plotters::style::Color;

use super::Picture;
use super::orthographic::Orthographic;
use crate::Result;
use crate::scene::{Cleaning, EdgeId, EdgeKind, Environment, Geometry, Material, Topology};

/// What was found in a geometry; displays as a table.
#[derive(Clone, Debug)]
pub struct Inspection {
    /// Triangles kept.
    pub triangles: usize,
    /// Distinct vertices.
    pub vertices: usize,
    /// Meshes in the files.
    pub meshes: usize,
    /// Sets of triangles connected through shared edges.
    pub bodies: usize,
    /// Edges.
    pub edges: usize,
    /// Edges of one face.
    pub boundary_edges: usize,
    /// Edges of three faces or more.
    pub non_manifold_edges: usize,
    /// Edges of two faces that run in the same direction.
    pub inconsistently_wound_edges: usize,
    /// What was dropped or merged.
    pub cleaning: Cleaning,
    /// Smallest and largest coordinates; none without triangles.
    pub bounds: Option<[Vec3; 2]>,
    /// Sum of the triangles' areas.
    pub area: f64,
    /// Every material with its number of triangles.
    pub materials: Vec<(Material, usize)>,
}

impl Inspection {
    /// Looks through a geometry.
    pub fn new(geometry: &Geometry) -> Self {
        let topology = geometry.topology();
        let mut materials: Vec<_> = geometry.materials.iter().map(|material| (material.clone(), 0)).collect();
        for &material in &geometry.triangle_material {
            materials[material as usize].1 += 1;
        }
        let corners = (0..geometry.triangles.len() as u32).map(|t| geometry.corners(t));
        Self {
            triangles: geometry.triangles.len(),
            vertices: geometry.positions.len(),
            meshes: geometry.meshes.len(),
            bodies: topology.bodies(),
            edges: topology.edges().len(),
            boundary_edges: topology.count(EdgeKind::Boundary),
            non_manifold_edges: topology.count(EdgeKind::NonManifold),
            inconsistently_wound_edges: topology.count(EdgeKind::InconsistentlyWound),
            cleaning: geometry.cleaning,
            bounds: geometry.bounds(),
            area: corners.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum(),
            materials,
        }
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Cleaning { welded_vertices, degenerate_triangles, duplicate_triangles } = self.cleaning;
        for (name, count) in [
            ("triangles", self.triangles),
            ("vertices", self.vertices),
            ("meshes", self.meshes),
            ("bodies", self.bodies),
            ("edges", self.edges),
            ("  boundary", self.boundary_edges),
            ("  non-manifold", self.non_manifold_edges),
            ("  inconsistently wound", self.inconsistently_wound_edges),
            ("welded vertices", welded_vertices),
            ("degenerate faces dropped", degenerate_triangles),
            ("duplicate faces dropped", duplicate_triangles),
        ] {
            writeln!(f, "{name:<26}{count:>12}")?;
        }
        if let Some([low, high]) = self.bounds {
            for (axis, k) in [("x", 0), ("y", 1), ("z", 2)] {
                writeln!(f, "{:<26}{:>12} to {}", format!("bounds in {axis}"), low[k], high[k])?;
            }
        }
        write!(f, "{:<26}{:>12.6}", "area", self.area)?;
        for (Material { name, albedo }, count) in &self.materials {
            let colour = format!("albedo {:.3} {:.3} {:.3}", albedo.x, albedo.y, albedo.z);
            write!(f, "\n{:<26}{count:>12} triangles, {colour}", format!("material {name}"))?;
        }
        Ok(())
    }
}

/// What was found in an environment; displays as a table.
#[derive(Clone, Debug)]
pub struct EnvironmentInspection {
    /// Pixels across and down.
    pub resolution: [usize; 2],
    /// Radiance averaged over the sphere.
    pub mean: DVec3,
    /// Pixel with the largest sum of colours.
    pub brightest: [usize; 2],
    /// Its radiance.
    pub brightest_radiance: Vec3,
    /// Its direction in the scene.
    pub brightest_direction: DVec3,
    /// Pixels with a negative colour, as lossy compression leaves them around bright spots.
    pub negative_pixels: usize,
    /// The least colour of any pixel.
    pub least: f32,
}

impl EnvironmentInspection {
    /// Looks through an environment.
    pub fn new(environment: &Environment) -> Self {
        let brightest @ [x, y] = environment.brightest();
        Self {
            resolution: [environment.width(), environment.height()],
            mean: environment.mean(),
            brightest,
            brightest_radiance: environment.pixels()[y * environment.width() + x],
            brightest_direction: environment.pixel_direction(x, y),
            negative_pixels: environment.pixels().iter().filter(|l| l.min_element() < 0.0).count(),
            least: environment.pixels().iter().fold(f32::INFINITY, |least, l| least.min(l.min_element())),
        }
    }
}

impl fmt::Display for EnvironmentInspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.resolution;
        let (mean, most, direction) = (self.mean, self.brightest_radiance, self.brightest_direction);
        writeln!(f, "{:<26}{width} x {height} pixels", "environment")?;
        writeln!(f, "{:<26}{:.6} {:.6} {:.6}", "mean radiance", mean.x, mean.y, mean.z)?;
        writeln!(f, "{:<26}{:.6} {:.6} {:.6}", "largest radiance", most.x, most.y, most.z)?;
        writeln!(f, "{:<26}column {}, row {}", "  in pixel", self.brightest[0], self.brightest[1])?;
        writeln!(f, "{:<26}{:.4} {:.4} {:.4}", "  from direction", direction.x, direction.y, direction.z)?;
        write!(f, "{:<26}{}, down to {}", "negative pixels", self.negative_pixels, self.least.min(0.0))
    }
}

/// Pixels along the side of one view.
const VIEW: usize = 560;
/// Height of the captions.
const CAPTION: usize = 40;

/// Kinds of edges that are marked, with their colours; the later ones lie on top.
const MARKED: [(EdgeKind, &str, RGBColor); 3] = [
    (EdgeKind::Boundary, "boundary", RGBColor(0, 110, 220)),
    (EdgeKind::NonManifold, "non-manifold", RGBColor(220, 30, 30)),
    (EdgeKind::InconsistentlyWound, "inconsistently wound", RGBColor(200, 0, 200)),
];

/// Draws a geometry from the front (+z), the right (+x) and the top (+y), with its irregular edges marked and a legend.
/// Faces seen from behind are brown; edges behind others are pale.
///
/// # Errors
/// When drawing fails.
pub fn draw_geometry(geometry: &Geometry) -> Result<Picture> {
    let topology = geometry.topology();
    let bounds = geometry.bounds().unwrap_or_default().map(|p| p.as_dvec3());
    let views = [("front", DVec3::X, DVec3::Y), ("right", DVec3::NEG_Z, DVec3::Y), ("top", DVec3::X, DVec3::NEG_Z)];
    let mut sheet = Picture::filled(views.len() * VIEW, VIEW + CAPTION, [255; 3]);
    for (i, (_, right, up)) in views.into_iter().enumerate() {
        let mut view = Orthographic::new(VIEW, bounds, right, up);
        view.fill(geometry);
        for (kind, _, RGBColor(r, g, b)) in MARKED {
            for edge in topology.edges().filter(|&edge| topology.kind(edge) == kind) {
                view.mark(ends(geometry, &topology, edge), [r, g, b]);
            }
        }
        sheet.paste(&view.picture(), i * VIEW, 0);
    }
    sheet.draw(|area| {
        let text = |label: String, x: usize, y: usize| {
            Text::new(label, (x as i32, y as i32), ("sans-serif", 18).into_font().color(&BLACK))
        };
        for (i, (name, ..)) in views.iter().enumerate() {
            area.draw(&text((*name).into(), i * VIEW + 12, 10))?;
        }
        let legend = MARKED.map(|(kind, name, colour)| (format!("{} {name} edges", topology.count(kind)), colour));
        for (i, (label, colour)) in legend.into_iter().enumerate() {
            let x = 12 + i * VIEW;
            let corners = [(x as i32, VIEW as i32 + 12), (x as i32 + 16, VIEW as i32 + 28)];
            area.draw(&Rectangle::new(corners, colour.filled()))?;
            area.draw(&text(label, x + 24, VIEW + 10))?;
        }
        Ok(())
    })?;
    Ok(sheet)
}

fn ends(geometry: &Geometry, topology: &Topology, edge: EdgeId) -> [DVec3; 2] {
    topology.ends(edge).map(|v| geometry.positions[v.0 as usize].as_dvec3())
}

/// Draws an environment, tone-mapped, with a frame around its brightest pixel.
///
/// # Errors
/// When drawing fails.
pub fn draw_environment(environment: &Environment) -> Result<Picture> {
    let (width, height) = (environment.width(), environment.height());
    let colours: Vec<[f64; 3]> = environment.pixels().iter().map(|l| l.as_dvec3().to_array()).collect();
    let mut picture = Picture::tone_mapped(width, height, &colours);
    let [x, y] = environment.brightest().map(|x| x as i32);
    picture.draw(|area| {
        let corners = [(x - 6, y - 6), (x + 6, y + 6)];
        Ok(area.draw(&Rectangle::new(corners, RGBColor(220, 30, 30).stroke_width(2)))?)
    })?;
    Ok(picture)
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::scene::{GeometryBuilder, Mesh};

    /// A fan of three faces around the edge from (0,0,0) to (1,0,0), one face that runs along a neighbour the wrong way,
    /// and one face given twice.
    fn irregular() -> Geometry {
        let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., -1., 0.], [1., 1., 0.]];
        let triangles = vec![[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 2, 5], [2, 5, 1], [3, 3, 1]];
        let mesh = Mesh::new("fan", corners.map(Vec3::from_array).to_vec(), triangles);
        let mut builder = GeometryBuilder::default();
        builder.add(mesh, DAffine3::IDENTITY).unwrap();
        builder.build()
    }

    #[test]
    fn counts_are_found_and_printed() {
        let found = Inspection::new(&irregular());
        assert_eq!((found.triangles, found.vertices, found.bodies, found.edges), (4, 6, 1, 9));
        assert_eq!((found.boundary_edges, found.non_manifold_edges, found.inconsistently_wound_edges), (7, 1, 1));
        assert_eq!(found.cleaning, Cleaning { degenerate_triangles: 1, duplicate_triangles: 1, welded_vertices: 0 });
        assert!((found.area - 2.0).abs() < 1e-12);
        assert_eq!(found.materials, [(Material::default(), 4)]);
        let table = found.to_string();
        let has = |name: &str, value: &str| {
            table.lines().any(|line| line.trim().starts_with(name) && line.trim().ends_with(value))
        };
        assert!(has("non-manifold", " 1") && has("boundary", " 7") && has("bounds in z", " 0 to 1"), "{table}");
    }

    #[test]
    fn every_kind_of_edge_is_marked_in_its_colour() {
        let sheet = draw_geometry(&irregular()).unwrap();
        assert_eq!((sheet.width(), sheet.height()), (3 * VIEW, VIEW + CAPTION));
        for (_, name, RGBColor(r, g, b)) in MARKED {
            let marked = |from: usize, to: usize| {
                (from..to)
                    .flat_map(|y| (0..sheet.width()).map(move |x| (x, y)))
                    .filter(|&(x, y)| sheet.pixel(x, y) == [r, g, b])
                    .count()
            };
            assert!(marked(0, VIEW) > 50, "{name}");
            assert!(marked(VIEW, VIEW + CAPTION) > 100, "legend of {name}");
        }
    }

    #[test]
    fn nothing_can_be_drawn_too() {
        let nothing = GeometryBuilder::default().build();
        assert!(Inspection::new(&nothing).bounds.is_none());
        assert_eq!(draw_geometry(&nothing).unwrap().pixel(VIEW / 2, VIEW / 2), [255; 3]);
    }

    #[test]
    fn brightest_pixel_is_told_and_framed() {
        let mut pixels = vec![Vec3::ONE; 64 * 32];
        pixels[8 * 64 + 16] = Vec3::splat(9.0);
        pixels[5].y = -0.25;
        let environment = Environment::new(64, 32, pixels).unwrap();
        let found = EnvironmentInspection::new(&environment);
        assert_eq!((found.brightest, found.brightest_radiance), ([16, 8], Vec3::splat(9.0)));
        assert_eq!((found.negative_pixels, found.least), (1, -0.25));
        assert_eq!(found.brightest_direction, environment.pixel_direction(16, 8));
        assert!(found.to_string().contains("64 x 32 pixels"));
        let picture = draw_environment(&environment).unwrap();
        assert_eq!((picture.pixel(10, 8), picture.pixel(16, 2)), ([220, 30, 30], [220, 30, 30]));
    }
}
