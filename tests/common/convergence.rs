//! How fast errors fall.

/// Least-squares slope p of log error = log c - p log N over numbers of isolines N.
pub fn slope<const K: usize>(lines: [u32; K], errors: [f64; K]) -> f64 {
    let points = lines.map(|n| f64::from(n).ln()).into_iter().zip(errors.map(f64::ln));
    let count = K as f64;
    let (mx, my) = points.clone().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
    let (covariance, variance) = points.fold((0.0, 0.0), |(c, v), p| {
        let dx = p.0 - mx;
        (c + dx * (p.1 - my), v + dx * dx)
    });
    -covariance / variance
}
