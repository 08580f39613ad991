use super::Request;
use crate::sphere::Order;
use crate::{Error, Result};

/// Where each array lies in a receiver's row of values, and how many there are.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Name, offset, shape of one row.
    pub(super) arrays: Vec<(&'static str, usize, Vec<usize>)>,
    /// Values in a row.
    pub(super) width: usize,
}

impl Layout {
    /// The rows for a request; refuses what makes no sense.
    pub(super) fn new(request: &Request, probes: bool) -> Result<Self> {
        let coefficients = Order::new(request.order)?.len();
        if probes && (request.ambient_occlusion || request.transfer_sh || request.irradiance) {
            return Err(Error::input(
                "occlusion, transfer vectors and irradiance need receivers with normals; ask probes for visibility_sh, \
                 bent_normal or vector_irradiance",
            ));
        }
        let wanted = [
            ("ambient_occlusion", request.ambient_occlusion, vec![]),
            ("visibility_sh", request.visibility_sh, vec![coefficients]),
            ("transfer_sh", request.transfer_sh, vec![coefficients]),
            ("bent_normal", request.bent_normal, vec![3]),
            ("irradiance", request.irradiance, vec![3]),
            ("vector_irradiance", request.vector_irradiance, vec![3, 3]),
        ];
        let mut layout = Self { arrays: Vec::new(), width: 0 };
        for (name, _, shape) in wanted.into_iter().filter(|(_, wanted, _)| *wanted) {
            let size: usize = shape.iter().product();
            layout.arrays.push((name, layout.width, shape));
            layout.width += size;
        }
        if layout.width == 0 {
            return Err(Error::input("nothing was asked for: request at least one array"));
        }
        Ok(layout)
    }

    /// A receiver's values of one array, if it was asked for.
    pub(super) fn slice<'a>(&self, name: &str, row: &'a mut [f64]) -> Option<&'a mut [f64]> {
        let (_, offset, shape) = self.arrays.iter().find(|(n, ..)| *n == name)?;
        Some(&mut row[*offset..*offset + shape.iter().product::<usize>()])
    }
}
