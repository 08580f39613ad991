//! Azimuths in order: a bucket for each on average, and comparisons inside.

use std::cmp::Ordering;

use super::chart::TURN_END;

/// Buffers of the sort.
#[derive(Debug, Default)]
pub(super) struct Ranks {
    firsts: Vec<u32>,
    /// Bits of the azimuth and index, in order. The bits of a positive double sort as the double does.
    keys: Vec<(u64, u32)>,
}

impl Ranks {
    /// Sorts azimuths in [0, 4], ties by what `compare` says of their indices, and returns (bits of the azimuth, index) in order.
    pub fn sort(
        &mut self,
        azimuths: impl ExactSizeIterator<Item = f64> + Clone,
        compare: impl Fn(u32, u32) -> Ordering,
    ) -> &[(u64, u32)] {
        let buckets = azimuths.len().max(1);
        let scale = buckets as f64 / TURN_END;
        // What is not a number goes first.
        let bucket = |azimuth: f64| ((azimuth * scale) as usize).min(buckets - 1);
        self.firsts.clear();
        self.firsts.resize(buckets + 1, 0);
        for azimuth in azimuths.clone() {
            self.firsts[bucket(azimuth) + 1] += 1;
        }
        for i in 0..buckets {
            self.firsts[i + 1] += self.firsts[i];
        }
        self.keys.resize(azimuths.len(), (0, 0));
        for (index, azimuth) in azimuths.enumerate() {
            let next = &mut self.firsts[bucket(azimuth)];
            self.keys[*next as usize] = (azimuth.to_bits(), index as u32);
            *next += 1;
        }
        // The first of each bucket has become its end.
        let mut start = 0;
        for &end in &self.firsts[..buckets] {
            let range = start as usize..end as usize;
            if range.len() > 1 {
                self.keys[range].sort_unstable_by(|a, b| a.0.cmp(&b.0).then_with(|| compare(a.1, b.1)));
            }
            start = end;
        }
        &self.keys
    }
}

#[cfg(test)]
mod tests {
    use std::cmp::Reverse;

    use super::*;

    #[test]
    fn buckets_sort_like_comparisons() {
        let spread = |i: u32| f64::from(i * 7919 % 1009) / 1009.0;
        let even: Vec<f64> = (0..1000).map(|i| TURN_END * spread(i)).collect();
        let crowded = even.iter().map(|x| 2.0 + x * 1e-9).chain([0.0, 4.0, 0.0]).collect();
        for azimuths in [vec![], vec![1.0], even, crowded, vec![3.0; 50]] {
            let mut expected: Vec<(u64, u32)> =
                azimuths.iter().enumerate().map(|(i, azimuth)| (azimuth.to_bits(), i as u32)).collect();
            expected.sort_unstable();
            assert_eq!(Ranks::default().sort(azimuths.iter().copied(), |a, b| a.cmp(&b)), expected);
            expected.sort_unstable_by_key(|&(azimuth, i)| (azimuth, Reverse(i)));
            assert_eq!(Ranks::default().sort(azimuths.iter().copied(), |a, b| b.cmp(&a)), expected);
        }
    }
}
