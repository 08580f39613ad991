//! How fast errors fall.

/// Numbers of isolines at which errors are measured.
pub const LINES: [u32; 4] = [16, 64, 256, 1024];

/// Least-squares slope p of log error = log c - p log N over [`LINES`].
pub fn slope(errors: &[f64]) -> f64 {
    let points: Vec<(f64, f64)> = LINES.iter().zip(errors).map(|(&n, e)| (f64::from(n).ln(), e.ln())).collect();
    let count = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (covariance, variance) = points.iter().fold((0.0, 0.0), |(c, v), p| {
        let dx = p.0 - mx;
        (c + dx * (p.1 - my), v + dx * dx)
    });
    -covariance / variance
}
