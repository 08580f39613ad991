//! Eight single-precision numbers side by side: one for each of eight neighbouring receivers.
//!
//! Plain arrays that compilers turn into vector instructions. Products and sums are never fused, so that the portable code
//! and the one compiled for AVX2 give the same bits.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use bytemuck::{Pod, Zeroable};

/// Receivers handled side by side.
pub const LANES: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Lanes(pub [f32; LANES]);

impl Lanes {
    /// Eight zeros.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// The same number eight times.
    #[inline(always)]
    pub fn splat(x: f32) -> Self {
        Self([x; LANES])
    }

    /// `f` of every lane's number.
    #[inline(always)]
    pub fn each(mut f: impl FnMut(usize) -> f32) -> Self {
        // A loop: closures that the standard library calls for arrays are not always inlined, and then lack AVX2.
        let mut lanes = Self::ZERO;
        for (i, lane) in lanes.0.iter_mut().enumerate() {
            *lane = f(i);
        }
        lanes
    }

    /// Eight neighbours out of a plane of numbers.
    #[inline(always)]
    pub fn load(plane: &[f32], first: usize) -> Self {
        let mut lanes = Self::ZERO;
        lanes.0.copy_from_slice(&plane[first..first + LANES]);
        lanes
    }

    /// Square roots.
    #[inline(always)]
    pub fn sqrt(mut self) -> Self {
        for i in 0..LANES {
            self.0[i] = self.0[i].sqrt();
        }
        self
    }

    /// The lesser of two.
    #[inline(always)]
    pub fn min(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] = if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] };
        }
        self
    }

    /// The greater of two.
    #[inline(always)]
    pub fn max(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] = if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] };
        }
        self
    }

    /// Whether any lane is below its bound.
    #[inline(always)]
    pub fn any_below(self, bound: Self) -> bool {
        let mut any = false;
        for i in 0..LANES {
            any |= self.0[i] < bound.0[i];
        }
        any
    }

    /// `below` where a lane is below its bound, else `otherwise`.
    #[inline(always)]
    pub fn where_below(self, bound: Self, below: Self, mut otherwise: Self) -> Self {
        for i in 0..LANES {
            otherwise.0[i] = if self.0[i] < bound.0[i] { below.0[i] } else { otherwise.0[i] };
        }
        otherwise
    }

    /// 3 t^2 - 2 t^3 of t clamped to [0, 1].
    #[inline(always)]
    pub fn smoothstep(self) -> Self {
        let t = self.max(Self::ZERO).min(Self::splat(1.0));
        t * t * (Self::splat(3.0) - t * 2.0)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for i in 0..LANES {
                    self.0[i] $op other.0[i];
                }
                self
            }
        }

        impl $trait<f32> for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $method(mut self, other: f32) -> Self {
                for i in 0..LANES {
                    self.0[i] $op other;
                }
                self
            }
        }
    };
}

operator!(Add, add, +=);
operator!(Sub, sub, -=);
operator!(Mul, mul, *=);
operator!(Div, div, /=);

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(mut self) -> Self {
        for i in 0..LANES {
            self.0[i] = -self.0[i];
        }
        self
    }
}

/// Calls a kernel compiled for AVX2 where the processor has it, else compiled for any processor. Both give the same bits.
macro_rules! dispatch {
    ($(#[$doc:meta])* $name:ident [$($generic:ident),*] ($($argument:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$doc])*
        #[expect(clippy::too_many_arguments, reason = "plain data in, plain data out")]
        #[allow(unfulfilled_lint_expectations)]
        fn $name<$(const $generic: usize),*>($($argument: $type),*) $(-> $out)? {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn portable<$(const $generic: usize),*>($($argument: $type),*) $(-> $out)? $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            #[allow(clippy::too_many_arguments)]
            fn avx2<$(const $generic: usize),*>($($argument: $type),*) $(-> $out)? {
                portable::<$($generic),*>($($argument),*)
            }

            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has AVX2.
                return unsafe { avx2::<$($generic),*>($($argument),*) };
            }
            portable::<$($generic),*>($($argument),*)
        }
    };
}
pub(super) use dispatch;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_do_not_mix() {
        let x = Lanes::each(|i| i as f32);
        let y = x * x - x / 2.0 + Lanes::splat(1.0);
        assert!((0..LANES).all(|i| y.0[i] == (i * i) as f32 - i as f32 / 2.0 + 1.0));
        assert_eq!(x.where_below(Lanes::splat(3.0), -x, x).0, [0.0, -1.0, -2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert!(x.any_below(Lanes::splat(0.5)) && !x.any_below(Lanes::ZERO));
        assert_eq!((x / 4.0).smoothstep().0[..5], [0.0, 0.15625, 0.5, 0.84375, 1.0]);
    }
}
