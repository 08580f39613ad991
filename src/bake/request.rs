use crate::sphere::Order;
use crate::{Error, Result};

/// What to compute for every receiver. What is not asked for is not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// Bands of the spherical harmonics.
    pub order: Order,
    /// `ambient_occlusion`: 1/pi integral of V max(0, n.w); 1 is open.
    pub ambient_occlusion: bool,
    /// `visibility_sh`: integral of V \[n.w > 0\] y; over the whole sphere for probes.
    pub visibility_sh: bool,
    /// `transfer_sh`: 1/pi integral of V max(0, n.w) y.
    pub transfer_sh: bool,
    /// `bent_normal`: unit mean of the visible directions; the normal itself where nothing is visible.
    pub bent_normal: bool,
    /// `irradiance`: integral of L V max(0, n.w), per colour.
    pub irradiance: bool,
    /// `vector_irradiance`: integral of L V \[n.w > 0\] w, colour by axis.
    pub vector_irradiance: bool,
}

/// Where each array lies in a receiver's row of values, and how many there are.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    /// Name, offset, shape of one row.
    pub(crate) arrays: Vec<(&'static str, usize, Vec<usize>)>,
    /// Values in a row.
    pub(crate) width: usize,
}

impl Request {
    /// Whether an environment is needed.
    pub fn needs_light(&self) -> bool {
        self.irradiance || self.vector_irradiance
    }

    /// Bands of visibility from which everything else follows: none, if only light is asked for.
    ///
    /// The cosine is a harmonic of band 1, so that occlusion and the bent normal need two bands, and the transfer vector
    /// one more than it has itself.
    pub(crate) fn visibility_order(&self) -> Option<Order> {
        let bands = [
            (self.ambient_occlusion || self.bent_normal).then_some(2),
            self.visibility_sh.then_some(self.order.bands()),
            self.transfer_sh.then_some(self.order.bands() + 1),
        ];
        let bands = bands.into_iter().flatten().max()?;
        Some(Order::new(bands).expect("a result's order leaves room for one more band"))
    }

    /// Refuses what makes no sense.
    pub(crate) fn validate(&self, probes: bool) -> Result<()> {
        if probes && (self.ambient_occlusion || self.transfer_sh || self.irradiance) {
            return Err(Error::input(
                "occlusion, transfer vectors and irradiance need receivers with normals; ask probes for visibility_sh or \
                 vector_irradiance",
            ));
        }
        Ok(())
    }

    pub(crate) fn layout(&self) -> Layout {
        let coefficients = self.order.len();
        let wanted = [
            ("ambient_occlusion", self.ambient_occlusion, vec![]),
            ("visibility_sh", self.visibility_sh, vec![coefficients]),
            ("transfer_sh", self.transfer_sh, vec![coefficients]),
            ("bent_normal", self.bent_normal, vec![3]),
            ("irradiance", self.irradiance, vec![3]),
            ("vector_irradiance", self.vector_irradiance, vec![3, 3]),
        ];
        let mut layout = Layout { arrays: Vec::new(), width: 0 };
        for (name, _, shape) in wanted.into_iter().filter(|(_, wanted, _)| *wanted) {
            let size: usize = shape.iter().product();
            layout.arrays.push((name, layout.width, shape));
            layout.width += size;
        }
        layout
    }
}

impl Layout {
    /// A receiver's values of one array.
    pub(crate) fn slice<'a>(&self, name: &str, row: &'a mut [f64]) -> Option<&'a mut [f64]> {
        let (_, offset, shape) = self.arrays.iter().find(|(n, ..)| *n == name)?;
        Some(&mut row[*offset..*offset + shape.iter().product::<usize>()])
    }
}
