use std::fmt;

/// How Embree is asked: which is fastest depends on the scene and the processor, the results do not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct EmbreeVariant {
    /// How rays are handed over.
    pub kernel: EmbreeKernel,
    /// How hard its tree is built.
    pub quality: EmbreeQuality,
}

/// How rays are handed to Embree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum EmbreeKernel {
    /// Packets of eight neighbours, `rtcOccluded8`.
    #[default]
    Packets,
    /// Streams of single rays, `rtcOccluded1M`.
    Streams,
}

/// Build quality of Embree's tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum EmbreeQuality {
    /// `RTC_BUILD_QUALITY_MEDIUM`, Embree's own default.
    #[default]
    Medium,
    /// `RTC_BUILD_QUALITY_HIGH`, with spatial splits.
    High,
}

impl EmbreeVariant {
    /// All there are.
    pub const ALL: [Self; 4] = {
        use EmbreeKernel::{Packets, Streams};
        use EmbreeQuality::{High, Medium};
        [
            Self { kernel: Packets, quality: Medium },
            Self { kernel: Packets, quality: High },
            Self { kernel: Streams, quality: Medium },
            Self { kernel: Streams, quality: High },
        ]
    };
}

impl fmt::Display for EmbreeVariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kernel = match self.kernel {
            EmbreeKernel::Packets => "rtcOccluded8",
            EmbreeKernel::Streams => "rtcOccluded1M",
        };
        let quality = match self.quality {
            EmbreeQuality::Medium => "medium",
            EmbreeQuality::High => "high",
        };
        write!(f, "{kernel}, {quality}")
    }
}
