use crate::bake::{Array, Arrays, Control, Method, Prepared, Receivers, Request};
use crate::{Error, Result};

use super::Verdict;
use super::contestant::integrate;

/// The values that contestants are measured by.
///
/// They are the exact method's. Along a thousand isolines every one must come out alike, within what both state;
/// where it does not, rays decide. All of them must then stand up to rays.
pub struct Truth {
    arrays: Arrays,
    /// Root mean square of what the values themselves may be off by.
    pub error: f64,
    /// Receivers whose values are those of the isolines.
    pub replaced: usize,
}

/// How far a contestant is from the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Distance {
    /// Root mean square of the difference.
    pub rmse: f64,
    /// Largest absolute difference.
    pub worst: f64,
    /// Root mean square of the stated errors.
    pub stated: f64,
    /// Whether they are what they should be.
    pub verdict: Verdict,
}

/// Lines of the second opinion.
const LINES: u32 = 1024;
/// Rays of the general check, and of a decision.
const RAYS: u32 = 1 << 12;
const DECIDING_RAYS: u32 = 1 << 16;
/// Standard errors by which thousands of values may be off rays of eight randomisations, which estimate them roughly.
const SIGMAS: f64 = 12.0;
/// The shares of so many rays pass for none: where all rays meet the same, their standard error is zero.
const SHARES: f64 = 16.0;
/// Standard errors by which a few disputed values may be.
const DECIDING_SIGMAS: f64 = 6.0;
/// A single value may be this many times as wrong as values state on average.
const OUTLIER: f64 = 50.0;

impl Truth {
    /// The values of `request` at all receivers.
    ///
    /// # Errors
    /// [`Error::Input`] if rays contradict them; [`Error::Interrupted`]; as [`Prepared::integrate`].
    pub fn find(prepared: &Prepared, receivers: &Receivers, request: &Request, control: &dyn Control) -> Result<Self> {
        let by = |receivers: &Receivers, method| {
            Ok::<_, Error>(integrate(prepared, receivers, request, method, control)?.arrays)
        };
        let mut exact = by(receivers, Method::Exact)?;
        let lines = by(receivers, Method::Isolines { lines: LINES })?;
        let disputed = beyond(&exact, &lines, 1.0, 0.0)?;
        let mut replaced = 0;
        if !disputed.is_empty() {
            let few = receivers.pick(disputed.iter().copied());
            let rays = by(&few, Method::Qmc { samples: DECIDING_RAYS, seed: 1 })?;
            // What is smaller than a few rays' share no ray may meet, however many there are.
            let floor = SHARES / f64::from(DECIDING_RAYS);
            let contradicted = |arrays: &Arrays| beyond(&rows(arrays, &disputed)?, &rays, DECIDING_SIGMAS, floor);
            let lines_too = contradicted(&lines)?;
            for number in contradicted(&exact)?.into_iter().filter(|number| !lines_too.contains(number)) {
                exact = with_row(&exact, &lines, disputed[number])?;
                replaced += 1;
            }
        }
        let rays = by(receivers, Method::Qmc { samples: RAYS, seed: 2 })?;
        if let Some(receiver) = beyond(&exact, &rays, SIGMAS, SHARES / f64::from(RAYS))?.first() {
            return Err(Error::input(format!("rays contradict the reference at receiver {receiver}: this is a bug")));
        }
        let error = rms(errors(&exact).flat_map(|array| array.data.iter().copied()));
        Ok(Self { arrays: exact, error, replaced })
    }

    /// Measures `arrays`, whose true error may exceed the stated one by the factor `allowance`.
    ///
    /// # Errors
    /// [`Error::Input`] if the arrays are others.
    pub fn measure(&self, arrays: &Arrays, allowance: f64) -> Result<Distance> {
        let (mut differences, mut worst) = (Vec::new(), (0.0, 0));
        for (truth, size) in values(&self.arrays) {
            let Some(array) = arrays.get(&truth.name).filter(|array| array.shape == truth.shape) else {
                return Err(Error::input(format!(
                    "{} is missing, or has another shape than the reference",
                    truth.name
                )));
            };
            for (flat, (a, b)) in array.data.iter().zip(&truth.data).enumerate() {
                let difference = (a - b).abs();
                if difference > worst.0 {
                    worst = (difference, flat / size);
                }
                differences.push(difference);
            }
        }
        let rmse = rms(differences);
        let stated = rms(errors(arrays).flat_map(|array| array.data.iter().copied()));
        let allowed = allowance * stated + 3.0 * self.error;
        let verdict = if rmse > allowed {
            Verdict::Disqualified(format!("is off by {rmse:.1e}, but states {stated:.1e}"))
        } else if worst.0 > OUTLIER * allowed {
            Verdict::Disqualified(format!("receiver {} is off by {:.1e}, but {stated:.1e} is stated", worst.1, worst.0))
        } else {
            Verdict::Counts
        };
        Ok(Distance { rmse, worst: worst.0, stated, verdict })
    }
}

/// Arrays of values, and how many of a receiver each has.
fn values(arrays: &Arrays) -> impl Iterator<Item = (&Array, usize)> {
    let values = arrays.iter().filter(|array| !array.name.ends_with("_error"));
    values.map(|array| (array, array.shape[1..].iter().product()))
}

fn errors(arrays: &Arrays) -> impl Iterator<Item = &Array> {
    arrays.iter().filter(|array| array.name.ends_with("_error"))
}

/// Receivers at which `a` and `b` differ by more than `a` states, plus `factor` times what `b` does, plus `floor`.
fn beyond(a: &Arrays, b: &Arrays, factor: f64, floor: f64) -> Result<Vec<usize>> {
    let mut found = Vec::new();
    for (array, size) in values(a) {
        let data = |arrays: &Arrays, name: &str| match arrays.get(name) {
            Some(array) => Ok(array.data.clone()),
            None => Err(Error::input(format!("array {name} is missing"))),
        };
        let name = format!("{}_error", array.name);
        let (other, error, other_error) = (data(b, &array.name)?, data(a, &name)?, data(b, &name)?);
        found.extend((0..array.data.len()).filter_map(|flat| {
            let allowed = error[flat] + factor * other_error[flat] + floor * (1.0 + array.data[flat].abs());
            ((array.data[flat] - other[flat]).abs() > allowed).then_some(flat / size)
        }));
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// The rows of `receivers` alone.
fn rows(arrays: &Arrays, receivers: &[usize]) -> Result<Arrays> {
    let mut picked = Arrays::new();
    for array in arrays {
        let size: usize = array.shape[1..].iter().product();
        let data = receivers.iter().flat_map(|receiver| &array.data[receiver * size..][..size]).copied().collect();
        let shape: Vec<usize> = std::iter::once(receivers.len()).chain(array.shape[1..].iter().copied()).collect();
        picked.push(Array::new(array.name.clone(), shape, data))?;
    }
    Ok(picked)
}

/// `arrays` with one receiver's row from `other`.
fn with_row(arrays: &Arrays, other: &Arrays, receiver: usize) -> Result<Arrays> {
    let mut mixed = Arrays::new();
    for array in arrays {
        let mut array = array.clone();
        let size: usize = array.shape[1..].iter().product();
        if let Some(other) = other.get(&array.name) {
            array.data[receiver * size..][..size].copy_from_slice(&other.data[receiver * size..][..size]);
        }
        mixed.push(array)?;
    }
    Ok(mixed)
}

fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (count, sum) = values.into_iter().fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x * x));
    (sum / f64::max(count, 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::race::Quantity;
    use crate::scene::{GeometryBuilder, Mesh};

    /// A hole between the isolines that no ray meets: both agree, and both are wrong.
    #[test]
    fn rays_do_not_decide_about_less_than_their_share() {
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let square = |x: f32, y: f32, half: f32, z: f32| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(i, j)| corner(x + half * i, y + half * j, z))
        };
        let [hole, ceiling, floor] =
            [square(0.313, 0.207, 1e-4, 1.0), square(0.0, 0.0, 1.0, 1.0), square(0.0, 0.0, 1.0, -1.0)];
        let mut mesh = Mesh::new("box", [hole, ceiling, floor].concat(), vec![[8, 9, 10], [8, 10, 11]]);
        for (inner, outer) in [(0, 4), (4, 8)] {
            for side in 0..4 {
                let [a, b] = [side, (side + 1) % 4];
                mesh.triangles.extend([[inner + a, outer + a, outer + b], [inner + a, outer + b, inner + b]]);
            }
        }
        let mut builder = GeometryBuilder::default();
        builder.add(mesh, DAffine3::IDENTITY).unwrap();
        let geometry = builder.build();
        let receivers = Receivers::points([(DVec3::new(0.01, 0.02, -0.5), DVec3::Z)]);
        let prepared = Prepared::new(&geometry, None);
        let truth = Truth::find(&prepared, &receivers, &Quantity::Occlusion.request(), &()).unwrap();
        let value = truth.arrays.get("ambient_occlusion").unwrap().data[0];
        // Seen at a distance of 1.5 upwards, and a little aside.
        let distance = DVec3::new(0.303, 0.187, 1.5);
        let expected = 4e-8 * 1.5f64.powi(2) / distance.length_squared().powi(2) / std::f64::consts::PI;
        assert!((value / expected - 1.0).abs() < 1e-2, "{value} {expected}");
        assert_eq!(truth.replaced, 0);
    }
}
