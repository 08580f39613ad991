/// Whether the processor has the features that kernels in 512 bits use: `avx512f`, `avx512vl`, `avx512bw` and `avx512dq`.
#[cfg(target_arch = "x86_64")]
#[inline]
pub fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
}

/// Whether the processor has the features with which [`crate::pairs::Pairs`] and [`crate::ends::Ends`] look up bytes in registers.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn has_lookup() -> bool {
    has_avx512() && is_x86_feature_detected!("avx512vbmi") && is_x86_feature_detected!("popcnt")
}
