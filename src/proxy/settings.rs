use super::exponential::Exponential;
use super::indirect::IndirectOperator;
use super::overlap::Overlap;
use super::self_shadow::SelfShadowing;
use super::shade::Interpolant;
use super::upsample::Upsampling;
use crate::sphere::Order;
use crate::{Error, Result};

/// How frames are rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Bands of light and visibility: 2 to 6.
    pub order: Order,
    /// Bands in which log visibility is accumulated and exponentiated, before the rest is cut off: `order` to 6. Six halve the
    /// error of four.
    pub internal_order: Order,
    /// How the exponential is taken.
    pub exponential: Exponential,
    /// Whether the logarithms of spheres that overlap in a body are shared out.
    pub overlap: Overlap,
    /// The rule for spheres below a receiver's horizon.
    pub self_shadowing: SelfShadowing,
    /// Whether and how proxies reflect light.
    pub indirect: Option<IndirectOperator>,
    /// Pixels of the display per receiver, across and down: 1, 2 or 4.
    pub receiver_scale: usize,
    /// How pixels take from receivers.
    pub upsampling: Upsampling,
    /// What they take.
    pub interpolant: Interpolant,
    /// The most, over the greatest irradiance, that one proxy may be wrong by where it is out of reach.
    pub error: f64,
}

impl Default for Settings {
    /// Four bands, the better modes, receivers at a quarter of the display, an error of 1/128: as in the paper.
    fn default() -> Self {
        let order = Order::new(4).expect("four bands are an order");
        Self {
            order,
            internal_order: order,
            exponential: Exponential::default(),
            overlap: Overlap::default(),
            self_shadowing: SelfShadowing::default(),
            indirect: Some(IndirectOperator::default()),
            receiver_scale: 4,
            upsampling: Upsampling::default(),
            interpolant: Interpolant::default(),
            error: 1.0 / 128.0,
        }
    }
}

impl Settings {
    /// Fails where a value is out of its domain.
    ///
    /// # Errors
    /// One line that names the value.
    pub fn check(&self) -> Result<()> {
        let (order, internal) = (self.order.bands(), self.internal_order.bands());
        if !(2..=6).contains(&order) {
            return Err(Error::input(format!("proxies: the order must be 2 to 6, not {order}")));
        }
        if !(order..=6).contains(&internal) {
            return Err(Error::input(format!("proxies: the internal order must be {order} to 6, not {internal}")));
        }
        if ![1, 2, 4].contains(&self.receiver_scale) {
            let scale = self.receiver_scale;
            return Err(Error::input(format!("proxies: receivers stand for 1, 2 or 4 pixels a side, not {scale}")));
        }
        if !(self.error > 0.0 && self.error < 1.0) {
            return Err(Error::input(format!("proxies: the error must be in (0, 1), not {}", self.error)));
        }
        Ok(())
    }
}
