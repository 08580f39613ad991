//! What is to be estimated, where, and in which light.

use std::ops::Range;

use glam::DVec3;

use super::PixelDistribution;
use crate::visibility::Receiver;
use crate::{Error, Result, sphere::Order};

/// Radiance that arrives from infinitely far away.
#[derive(Clone, Copy)]
pub struct Light<'a> {
    /// Radiance per colour from the unit direction.
    pub radiance: &'a (dyn Fn(DVec3) -> [f64; 3] + Sync),
    /// Where the light is bright. Samples drawn from it join the others by the balance heuristic (Veach and Guibas 1995).
    pub distribution: Option<&'a PixelDistribution>,
}

/// What is integrated over the hemisphere n.w > 0 (the whole sphere for a receiver without a normal n), V being 1 where the ray
/// escapes. Everything is estimated from the same rays.
#[derive(Clone, Copy, Default)]
pub struct Request<'a> {
    /// 1/pi integral of V max(0, n.w): one value.
    pub ambient_occlusion: bool,
    /// Integral of V y: `len()` values.
    pub visibility_sh: Option<Order>,
    /// 1/pi integral of V max(0, n.w) y: `len()` values.
    pub transfer_sh: Option<Order>,
    /// Integral of L V max(0, n.w): three colours. Needs a light.
    pub irradiance: bool,
    /// Integral of L V w: three colours of three axes each. Needs a light.
    pub vector_irradiance: bool,
    /// L.
    pub light: Option<Light<'a>>,
}

/// Where the quantities of a [`Request`] stand in a row of results; empty for what is not asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Columns {
    /// One value.
    pub ambient_occlusion: Range<usize>,
    /// Coefficients.
    pub visibility_sh: Range<usize>,
    /// Coefficients.
    pub transfer_sh: Range<usize>,
    /// Colours.
    pub irradiance: Range<usize>,
    /// Colours of axes.
    pub vector_irradiance: Range<usize>,
}

impl Columns {
    /// Length of a row.
    pub fn len(&self) -> usize {
        self.vector_irradiance.end
    }

    /// Whether nothing is asked for.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Results of many receivers, row after row; see [`Request::columns`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimates {
    /// Values.
    pub values: Vec<f64>,
    /// The standard error of each value.
    pub errors: Vec<f64>,
}

impl Request<'_> {
    /// The layout of a row of results.
    pub fn columns(&self) -> Columns {
        let mut end = 0;
        let mut next = |len: usize| {
            end += len;
            end - len..end
        };
        Columns {
            ambient_occlusion: next(self.ambient_occlusion.into()),
            visibility_sh: next(self.visibility_sh.map_or(0, Order::len)),
            transfer_sh: next(self.transfer_sh.map_or(0, Order::len)),
            irradiance: next(if self.irradiance { 3 } else { 0 }),
            vector_irradiance: next(if self.vector_irradiance { 9 } else { 0 }),
        }
    }

    /// # Errors
    /// [`Error::Input`] if a lit quantity is asked for without a light.
    pub(super) fn check(&self) -> Result<()> {
        if (self.irradiance || self.vector_irradiance) && self.light.is_none() {
            return Err(Error::input("irradiance needs a light: give an environment, or do not ask for irradiance"));
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Input`] if receiver number `index` is not finite or lacks a normal that the request needs.
    pub(super) fn check_receiver(&self, index: usize, receiver: &Receiver) -> Result<()> {
        if !(receiver.position.is_finite() && receiver.normal.is_none_or(DVec3::is_finite)) {
            return Err(Error::input(format!("receiver {index}: position and normal must be finite")));
        }
        if receiver.normal.is_none() && (self.ambient_occlusion || self.transfer_sh.is_some() || self.irradiance) {
            return Err(Error::input(format!(
                "receiver {index} has no normal: only visibility and vector irradiance are defined over the whole sphere"
            )));
        }
        Ok(())
    }
}
