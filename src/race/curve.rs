use super::Row;

/// Error against time of one method in one event: what reaches an error, and in what time.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// (error, seconds per receiver), from the coarsest on; only rows that count.
    points: Vec<(f64, f64)>,
}

/// A time read off a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Time {
    /// Seconds per receiver.
    pub seconds: f64,
    /// Whether it lies beyond what was measured.
    pub extrapolated: bool,
}

/// Last points that an extrapolation is fitted to.
const FITTED: usize = 4;

impl Curve {
    /// The curve through the rows that count.
    pub fn new<'a>(rows: impl Iterator<Item = &'a Row>) -> Self {
        let mut points: Vec<(f64, f64)> = Vec::new();
        for row in rows.filter(|row| row.counts() && row.seconds > 0.0) {
            // Whoever is both slower and worse than a cheaper setting is not on the curve.
            let (error, seconds) = (row.rmse.max(f64::MIN_POSITIVE), row.total());
            if points.last().is_none_or(|last| error < last.0) {
                points.push((error, seconds));
            }
        }
        Self { points }
    }

    /// Time to reach `error`, with a knob that can be turned evenly: between two settings along the straight line in
    /// logarithms, before the first setting its time, and beyond the last, from three points on, along the line fitted to the
    /// last few.
    pub fn at(&self, error: f64) -> Option<Time> {
        let Some(next) = self.points.iter().position(|point| point.0 <= error) else { return self.beyond(error) };
        let (e1, t1) = self.points[next];
        let measured = |seconds| Some(Time { seconds, extrapolated: false });
        let Some((e0, t0)) = next.checked_sub(1).map(|before| self.points[before]) else { return measured(t1) };
        let share = (error / e0).ln() / (e1 / e0).ln();
        measured((t0.ln() + share * (t1 / t0).ln()).exp())
    }

    /// Time to reach `error` with a knob that has only the settings measured.
    pub fn reaching(&self, error: f64) -> Option<Time> {
        let reached = self.points.iter().filter(|point| point.0 <= error).map(|point| point.1);
        let seconds = reached.fold(f64::INFINITY, f64::min);
        if seconds.is_finite() { Some(Time { seconds, extrapolated: false }) } else { self.beyond(error) }
    }

    fn beyond(&self, error: f64) -> Option<Time> {
        let last = &self.points[self.points.len().saturating_sub(FITTED)..];
        if last.len() < 3 {
            return None;
        }
        let logs: Vec<(f64, f64)> = last.iter().map(|(error, seconds)| (error.ln(), seconds.ln())).collect();
        let count = logs.len() as f64;
        let (x, y) = logs.iter().fold((0.0, 0.0), |(x, y), log| (x + log.0 / count, y + log.1 / count));
        let slope = logs.iter().map(|log| (log.0 - x) * (log.1 - y)).sum::<f64>()
            / logs.iter().map(|log| (log.0 - x).powi(2)).sum::<f64>();
        Some(Time { seconds: (y + slope * (error.ln() - x)).exp(), extrapolated: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(points: &[(f64, f64)]) -> Curve {
        Curve { points: points.to_vec() }
    }

    #[test]
    fn power_laws_are_read_off_exactly() {
        // seconds = error^-1.25
        let law = |error: f64| error.powf(-1.25);
        let curve = curve(&[1e-1, 3e-2, 1e-2, 1e-3].map(|error| (error, law(error))));
        for (error, extrapolated) in [(5e-2, false), (2e-3, false), (1e-3, false), (1e-5, true)] {
            let time = curve.at(error).unwrap();
            assert!((time.seconds / law(error) - 1.0).abs() < 1e-9, "{error}");
            assert_eq!(time.extrapolated, extrapolated);
        }
        // Nothing is cheaper than the cheapest setting.
        assert_eq!(curve.at(1.0).unwrap().seconds, law(1e-1));
        assert_eq!(curve.reaching(5e-2).unwrap().seconds, law(3e-2));
    }

    #[test]
    fn a_single_setting_reaches_its_error_or_nothing() {
        let exact = curve(&[(1e-12, 7.0)]);
        assert_eq!(exact.at(1e-3), Some(Time { seconds: 7.0, extrapolated: false }));
        assert_eq!(exact.at(1e-13), None);
        assert_eq!(curve(&[]).at(1.0), None);
    }
}
