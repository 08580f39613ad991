use std::fmt;
use std::thread;

/// What a race ran on, as far as the system tells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Machine {
    /// The processor's name.
    pub processor: String,
    /// Processors on offer.
    pub cores: usize,
    /// Features of the instruction set that this program looks for.
    pub features: String,
    /// Processes that wanted to run when the race began, mean of a minute.
    pub load: String,
    /// The build.
    pub program: String,
}

impl Machine {
    /// This one.
    pub fn here() -> Self {
        let line = |file: &str, key: &str| {
            let text = std::fs::read_to_string(file).ok()?;
            let line = text.lines().find(|line| line.starts_with(key))?;
            Some(line.split_once(':').map_or(line, |(_, value)| value).trim().to_owned())
        };
        let mut features = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            let known = [
                ("avx2", is_x86_feature_detected!("avx2")),
                ("fma", is_x86_feature_detected!("fma")),
                ("avx512f", is_x86_feature_detected!("avx512f")),
            ];
            features.extend(known.into_iter().filter(|(_, has)| *has).map(|(name, _)| name));
        }
        let unknown = || "unknown".to_owned();
        let load = line("/proc/loadavg", "").and_then(|line| Some(line.split(' ').next()?.to_owned()));
        let build = if cfg!(debug_assertions) { "with assertions" } else { "release" };
        #[cfg(feature = "embree")]
        let embree =
            crate::reference::EmbreeScene::version().map_or_else(|_| unknown(), |version| format!("Embree {version}"));
        #[cfg(not(feature = "embree"))]
        let embree = "no Embree";
        Self {
            processor: line("/proc/cpuinfo", "model name").unwrap_or_else(unknown),
            cores: thread::available_parallelism().map_or(1, std::num::NonZero::get),
            features: if features.is_empty() { std::env::consts::ARCH.to_owned() } else { features.join(", ") },
            load: load.unwrap_or_else(unknown),
            program: format!("silhouette {} ({build}, {embree})", env!("CARGO_PKG_VERSION")),
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { processor, cores, features, load, program } = self;
        write!(f, "{program}; {processor}, {cores} cores, {features}; load {load} at the start")
    }
}
