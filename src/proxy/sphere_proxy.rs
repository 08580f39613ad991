use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::{Error, Result};

/// A sphere that blocks and reflects light in one frame, in world space: eight floats, as they go to a device.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Proxy {
    /// Centre.
    pub center: Vec3,
    /// Radius, positive.
    pub radius: f32,
    /// Diffuse reflectance per colour; black proxies reflect nothing.
    pub albedo: Vec3,
    /// How much of what it hides it counts for, in (0, 1]: less than 1 where other spheres of its body hide the same, see
    /// [`share_overlap`](super::share_overlap).
    pub share: f32,
}

/// Most proxies in a frame: a tile's list counts them in 16 bits.
pub const MAX_PROXIES: usize = 1 << 16;

/// Refuses proxies that cannot be rendered.
///
/// # Errors
/// Too many proxies, a centre that is not finite, a radius that is not positive and finite, an albedo outside [0, 1] or a
/// share outside (0, 1]: the proxy is named.
pub fn check_proxies(proxies: &[Proxy]) -> Result<()> {
    if proxies.len() > MAX_PROXIES {
        return Err(Error::input(format!(
            "{} spheres are more than the {MAX_PROXIES} that fit a frame; use fewer per character",
            proxies.len()
        )));
    }
    for (i, Proxy { center, radius, albedo, share }) in proxies.iter().enumerate() {
        if !center.is_finite() {
            return Err(Error::input(format!("sphere {i}: its centre ({center}) is not finite")));
        }
        if !(radius.is_finite() && *radius > 0.0) {
            return Err(Error::input(format!("sphere {i}: its radius must be positive and finite, not {radius}")));
        }
        if !(*share > 0.0 && *share <= 1.0) {
            return Err(Error::input(format!("sphere {i}: its share must be in (0, 1], not {share}")));
        }
        if !(albedo.cmpge(Vec3::ZERO) & albedo.cmple(Vec3::ONE)).all() {
            return Err(Error::input(format!("sphere {i}: its albedo ({albedo}) must lie in [0, 1]")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_proxies_are_named() {
        let good = Proxy { center: Vec3::ONE, radius: 1.0, albedo: Vec3::splat(0.5), share: 1.0 };
        assert!(check_proxies(&[good; 3]).is_ok());
        let refused = |bad: Proxy, why: &str| {
            let message = check_proxies(&[good, bad]).unwrap_err().to_string();
            assert!(message.contains("sphere 1") && message.contains(why), "{message}");
        };
        for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            refused(Proxy { radius, ..good }, "radius");
        }
        for share in [0.0, 1.5, f32::NAN] {
            refused(Proxy { share, ..good }, "share");
        }
        refused(Proxy { center: Vec3::new(0.0, f32::NAN, 0.0), ..good }, "centre");
        refused(Proxy { albedo: Vec3::new(0.0, 1.5, 0.0), ..good }, "albedo");
        let message = check_proxies(&vec![good; MAX_PROXIES + 1]).unwrap_err().to_string();
        assert!(message.contains("65537 spheres"), "{message}");
    }
}
