use super::Request;
use crate::sphere::Order;
use crate::{Error, Result};

/// Where each array lies in a receiver's row of values, and how many there are.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Name, offset and shape of one receiver's part.
    pub(super) arrays: Vec<(String, usize, Vec<usize>)>,
    /// Values in a row.
    pub(super) width: usize,
}

impl Layout {
    /// The rows for a request; refuses what makes no sense. Beside every array stands one of the same shape, `NAME_error`,
    /// with the estimated absolute error of each value (by rays: the standard error).
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
            ("irradiance", request.irradiance, vec![3]),
            ("vector_irradiance", request.vector_irradiance, vec![3, 3]),
            ("bent_normal", request.bent_normal, vec![3]),
        ];
        let mut layout = Self { arrays: Vec::new(), width: 0 };
        for (name, _, shape) in wanted.iter().filter(|(_, wanted, _)| *wanted).cloned() {
            layout.push(name.into(), shape);
        }
        for (name, _, mut shape) in wanted[..3].iter().filter(|(_, wanted, _)| *wanted && request.gradients).cloned() {
            shape.push(3);
            layout.push(format!("{name}_gradient"), shape);
        }
        if layout.width == 0 {
            return Err(Error::input("nothing was asked for: request at least one array"));
        }
        for (name, _, shape) in layout.arrays.clone().into_iter().filter(|(name, ..)| name != "bent_normal") {
            layout.push(name + "_error", shape);
        }
        Ok(layout)
    }

    fn push(&mut self, name: String, shape: Vec<usize>) {
        let size: usize = shape.iter().product();
        self.arrays.push((name, self.width, shape));
        self.width += size;
    }

    /// Whether an array was asked for.
    pub(super) fn has(&self, name: &str) -> bool {
        self.arrays.iter().any(|(n, ..)| n == name)
    }

    /// A receiver's values of one array, if it was asked for.
    pub(super) fn slice<'a>(&self, name: &str, row: &'a mut [f64]) -> Option<&'a mut [f64]> {
        let (_, offset, shape) = self.arrays.iter().find(|(n, ..)| n == name)?;
        Some(&mut row[*offset..*offset + shape.iter().product::<usize>()])
    }
}
