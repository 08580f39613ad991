use std::fmt;

use super::{Arrays, Statistics};
use crate::reference::EmbreeVariant;
use crate::{Error, Result};

/// What to compute at every receiver. What is not asked for is not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// Number of spherical-harmonic bands; `order^2` coefficients.
    pub order: usize,
    /// `ambient_occlusion`, `[N]`: 1/pi integral of V max(0, n.w); 1 = open.
    pub ambient_occlusion: bool,
    /// `visibility_sh`, `[N, order^2]`: integral of `V [n.w > 0] y`.
    pub visibility_sh: bool,
    /// `transfer_sh`, `[N, order^2]`: 1/pi integral of V max(0, n.w) y.
    pub transfer_sh: bool,
    /// `bent_normal`, `[N, 3]`: unit mean of the visible directions (Landis 2002); zero where nothing is visible.
    pub bent_normal: bool,
    /// `irradiance`, `[N, 3]`: integral of L V max(0, n.w).
    pub irradiance: bool,
    /// `vector_irradiance`, `[N, 3 colours, 3 axes]`: integral of `L V [n.w > 0] w`.
    pub vector_irradiance: bool,
    /// Beside each of `ambient_occlusion`, `visibility_sh` and `transfer_sh` that is asked for, `NAME_gradient`, with an axis of
    /// three more: its derivative by the receiver's position, per unit of length of the scene, the normal kept. By
    /// [`Method::Exact`] only.
    pub gradients: bool,
}

impl Default for Request {
    /// Nothing yet, in four bands.
    fn default() -> Self {
        Self {
            order: 4,
            ambient_occlusion: false,
            visibility_sh: false,
            transfer_sh: false,
            bent_normal: false,
            irradiance: false,
            vector_irradiance: false,
            gradients: false,
        }
    }
}

/// How visibility is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Along isolines (Nowrouzezahrai, Baran, Mitchell and Jarosz 2014): those of the octahedral map under textured light,
    /// those of an equal-area chart for everything else.
    Isolines {
        /// Number of lines over the sphere, closed loops or pairs of opposite meridians; the error falls as its power 1.5.
        lines: u32,
    },
    /// The visible region's boundary without discretisation, and closed forms over it: no knob.
    Exact,
    /// Quasi-Monte Carlo by ray casting, Owen-scrambled Sobol points.
    Qmc {
        /// Rays per receiver.
        samples: u32,
        /// Seed of the scrambling.
        seed: u32,
    },
    /// The same on Embree, in single precision and as fast as it gets; only in builds with the feature `embree`.
    Embree {
        /// Rays per receiver.
        samples: u32,
        /// Seed of the scrambling.
        seed: u32,
        /// How Embree is asked.
        variant: EmbreeVariant,
    },
}

impl Method {
    /// Whether this build has the method.
    ///
    /// # Errors
    /// [`Error::Input`] that says how to build it.
    pub fn check(self) -> Result<()> {
        match self {
            Self::Embree { .. } if !cfg!(feature = "embree") => Err(Error::input(
                "this build has no Embree: install libembree-dev (Debian, Ubuntu), then cargo build --release --features embree",
            )),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Isolines { .. } => "isolines",
            Self::Exact => "exact",
            Self::Qmc { .. } => "qmc",
            Self::Embree { .. } => "embree",
        })
    }
}

/// What a run over a list of receivers gave.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The arrays asked for; rows of receivers that are not done are zero.
    pub arrays: Arrays,
    /// Whether each receiver is finished; all are unless the run was interrupted.
    pub done: Vec<bool>,
    /// What the run did and how long it took.
    pub statistics: Statistics,
}
