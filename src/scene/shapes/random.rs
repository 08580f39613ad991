use glam::DVec3;

/// The SplitMix64 generator (Steele, Lea and Flood 2014): shapes must come out alike for ever, which a crate's default
/// generator does not promise.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
    }

    /// Uniform in [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the unit ball.
    pub(crate) fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_number_is_the_published_one() {
        // SplitMix64 seeded with 1234567 starts with 6457827717110365317.
        assert_eq!(Random::new(1_234_567).unit(), (6_457_827_717_110_365_317u64 >> 11) as f64 / (1u64 << 53) as f64);
    }

    #[test]
    fn ball_is_filled_evenly() {
        let mut random = Random::new(7);
        let count = 20_000;
        let inner = (0..count).filter(|_| random.in_ball().length() < 0.5).count() as f64;
        // A share of 1/8, with a standard deviation of sqrt(7/64 / count).
        assert!((inner / f64::from(count) - 0.125).abs() < 4.0 * (7.0 / 64.0 / f64::from(count)).sqrt());
    }
}
