//! Names of an array's components in files that hold one number per channel.

use crate::{Error, Result};

use super::{Array, Arrays};

/// Meaning of one axis of an array behind the receiver's.
#[derive(Clone, Copy, PartialEq)]
enum Axis {
    /// Spherical harmonics, index l*l + l + m.
    Harmonics,
    /// Red, green, blue.
    Colour,
    /// x, y, z.
    Space,
    /// No more than a number.
    Index,
}

impl Axis {
    fn fits(self, length: usize) -> bool {
        match self {
            Self::Harmonics => length.isqrt().pow(2) == length,
            Self::Colour | Self::Space => length == 3,
            Self::Index => true,
        }
    }

    fn label(self, i: usize) -> String {
        match self {
            Self::Harmonics => {
                let (l, m) = band(i);
                format!("l{l}.m{m}")
            }
            Self::Colour => ["R", "G", "B"][i].into(),
            Self::Space => ["x", "y", "z"][i].into(),
            Self::Index => i.to_string(),
        }
    }
}

/// Band and order of the coefficient at l*l + l + m.
fn band(i: usize) -> (usize, isize) {
    let l = i.isqrt();
    (l, i as isize - (l * l + l) as isize)
}

/// Axes of the array `name` behind the receiver's, whose lengths are `inner`.
fn axes(name: &str, inner: &[usize]) -> Vec<Axis> {
    fn known(name: &str) -> &'static [Axis] {
        match name {
            "irradiance" | "radiance" => &[Axis::Colour],
            "vector_irradiance" => &[Axis::Colour, Axis::Space],
            "bent_normal" | "positions" | "normals" => &[Axis::Space],
            _ if name.ends_with("_sh") => &[Axis::Harmonics],
            _ => &[],
        }
    }
    let mut axes = known(name.strip_suffix("_gradient").unwrap_or(name)).to_vec();
    if name.ends_with("_gradient") {
        axes.push(Axis::Space);
    }
    if axes.len() != inner.len() || axes.iter().zip(inner).any(|(axis, &length)| !axis.fits(length)) {
        axes = vec![Axis::Index; inner.len()];
    }
    axes
}

/// Name of every component of one receiver's row, in order, when the first `leading` axes of `array` tell the
/// receiver (1 for a list of receivers, 2 for an image).
///
/// `visibility_sh` gives `sh.l0.m0`, `sh.l1.m-1`, ...; `transfer_sh` `transfer.l0.m0`, ...; `bent_normal`
/// `bent_normal.x`, ...; `irradiance` `irradiance.R`, ...; `radiance`, the picture itself, plain `R`, `G`, `B`.
pub fn components(array: &Array, leading: usize) -> Vec<String> {
    let inner = &array.shape[leading.min(array.shape.len())..];
    let axes = axes(&array.name, inner);
    let stem = match array.name.as_str() {
        "visibility_sh" => "sh",
        "radiance" if axes == [Axis::Colour] => "",
        name => name.strip_suffix("_sh").unwrap_or(name),
    };
    let row = Array::new("", inner, Vec::new());
    (0..inner.iter().product())
        .map(|i| {
            let labels = row.index(i).into_iter().zip(&axes).map(|(i, axis)| axis.label(i));
            let parts: Vec<String> =
                [stem.to_owned()].into_iter().filter(|stem| !stem.is_empty()).chain(labels).collect();
            parts.join(".")
        })
        .collect()
}

/// One component of all receivers in single precision.
pub(crate) struct Channel {
    /// Name of the component.
    pub name: String,
    /// One number per receiver.
    pub values: Vec<f32>,
}

/// Takes `arrays` apart into one channel per component; the first `leading` axes of every array tell the receiver.
///
/// # Errors
/// When a number is too large for single precision.
pub(crate) fn split(arrays: &Arrays, leading: usize) -> Result<Vec<Channel>> {
    let mut channels = Vec::new();
    for array in arrays {
        let names = components(array, leading);
        let stride = names.len();
        for (i, name) in names.into_iter().enumerate() {
            let values =
                array.data.iter().skip(i).step_by(stride.max(1)).map(|&x| narrow(&name, x)).collect::<Result<_>>()?;
            channels.push(Channel { name, values });
        }
    }
    Ok(channels)
}

/// `x` in single precision.
pub(crate) fn narrow(name: &str, x: f64) -> Result<f32> {
    let narrow = x as f32;
    if narrow.is_finite() {
        Ok(narrow)
    } else {
        Err(Error::input(format!("{name}: {x:e} is too large for single precision; write .npz, which keeps doubles")))
    }
}

/// Multiplies every spherical-harmonic coefficient by (-1)^m: from one phase convention to the other and back. The first
/// `leading` axes of every array tell the receiver.
///
/// # Errors
/// None: the same finite numbers come back with other signs.
pub fn flip_phase(arrays: Arrays, leading: usize) -> Result<Arrays> {
    let mut flipped = Arrays::new();
    for mut array in arrays {
        let inner = array.shape[leading.min(array.shape.len())..].to_vec();
        let axes = axes(&array.name, &inner);
        if let Some(axis) = axes.iter().position(|&axis| axis == Axis::Harmonics) {
            let below: usize = inner[axis + 1..].iter().product();
            for (flat, x) in array.data.iter_mut().enumerate() {
                if band(flat / below.max(1) % inner[axis]).1 % 2 != 0 {
                    *x = -*x;
                }
            }
        }
        flipped.push(array)?;
    }
    Ok(flipped)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(name: &str, shape: &[usize], leading: usize) -> Vec<String> {
        components(&Array::new(name, shape, vec![]), leading)
    }

    #[test]
    fn components_are_named_by_their_meaning() {
        assert_eq!(names("visibility_sh", &[9, 4], 1), ["sh.l0.m0", "sh.l1.m-1", "sh.l1.m0", "sh.l1.m1"]);
        assert_eq!(
            names("transfer_sh", &[2, 2, 9], 2)[4..],
            ["transfer.l2.m-2", "transfer.l2.m-1", "transfer.l2.m0", "transfer.l2.m1", "transfer.l2.m2"]
        );
        assert_eq!(names("ambient_occlusion", &[9], 1), ["ambient_occlusion"]);
        assert_eq!(names("bent_normal", &[9, 3], 1), ["bent_normal.x", "bent_normal.y", "bent_normal.z"]);
        assert_eq!(names("radiance", &[2, 2, 3], 2), ["R", "G", "B"]);
        assert_eq!(names("vector_irradiance", &[9, 3, 3], 1)[5], "vector_irradiance.G.z");
        assert_eq!(names("visibility_sh_gradient", &[9, 4, 3], 1)[3], "visibility_sh_gradient.l1.m-1.x");
        assert_eq!(names("other", &[9, 2], 1), ["other.0", "other.1"]);
        // Five numbers are not whole bands.
        assert_eq!(names("visibility_sh", &[9, 5], 1)[4], "sh.4");
    }

    #[test]
    fn channels_take_one_component_of_every_receiver() {
        let mut arrays = Arrays::new();
        arrays.push(Array::new("bent_normal", [2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).unwrap();
        let channels = split(&arrays, 1).unwrap();
        assert_eq!(channels[1].name, "bent_normal.y");
        assert_eq!(channels[1].values, [2.0, 5.0]);
        let mut large = Arrays::new();
        large.push(Array::new("a", [1], vec![1e300])).unwrap();
        assert!(split(&large, 1).is_err());
    }

    #[test]
    fn the_other_phase_flips_odd_m_only() {
        let mut arrays = Arrays::new();
        arrays.push(Array::new("transfer_sh", [2, 9], vec![1.0; 18])).unwrap();
        arrays.push(Array::new("transfer_sh_gradient", [1, 4, 3], vec![1.0; 12])).unwrap();
        arrays.push(Array::new("ambient_occlusion", [2], vec![1.0; 2])).unwrap();
        let flipped = flip_phase(arrays.clone(), 1).unwrap();
        let row = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
        assert_eq!(flipped.get("transfer_sh").unwrap().data, [row, row].concat());
        let gradient = [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0];
        assert_eq!(flipped.get("transfer_sh_gradient").unwrap().data, gradient);
        assert_eq!(flipped.get("ambient_occlusion").unwrap().data, [1.0; 2]);
        assert_eq!(flip_phase(flipped, 1).unwrap(), arrays);
    }
}
