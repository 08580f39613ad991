use glam::DVec3;

use super::super::Mesh;

/// Appends the image of a `columns` x `rows` grid of the unit square under `point`, two triangles to a cell, wound
/// counter-clockwise seen from the side that `d point/du x d point/dv` points to. Cells for which `keep(column, row)`
/// is false are left out.
pub(super) fn append_grid(
    mesh: &mut Mesh,
    [columns, rows]: [u32; 2],
    point: impl Fn(f64, f64) -> DVec3,
    keep: impl Fn(u32, u32) -> bool,
) {
    let base = mesh.positions.len() as u32;
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            mesh.positions.push(point(u, v).as_vec3());
        }
    }
    for row in 0..rows {
        for column in (0..columns).filter(|&column| keep(column, row)) {
            let corner = base + row * (columns + 1) + column;
            let [a, b, c, d] = [corner, corner + 1, corner + columns + 2, corner + columns + 1];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
}

/// Mix of two numbers that is exact at both ends.
pub(super) fn mix(low: f64, high: f64, t: f64) -> f64 {
    low * (1.0 - t) + high * t
}
