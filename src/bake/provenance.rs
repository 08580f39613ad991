use std::fmt;

use serde::{Deserialize, Serialize};

use super::Method;
use crate::reference::EmbreeVariant;

/// Where a result comes from: enough to make it again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program that computed it.
    pub version: String,
    /// The command that was given.
    pub command_line: String,
    /// How visibility was integrated.
    pub method: String,
    /// Sign convention of spherical-harmonic coefficients.
    pub sh_phase: Phase,
    /// Everything else that the numbers depend on, as name and value.
    pub parameters: Vec<(String, String)>,
}

impl Provenance {
    /// Provenance of a result of this version of the library, by `method`.
    pub fn new(method: impl Into<String>) -> Self {
        Self { version: env!("CARGO_PKG_VERSION").into(), method: method.into(), ..Self::default() }
    }

    /// Provenance of a result of this version of the library, by `method` with its settings.
    pub fn of(method: Method) -> Self {
        let provenance = Self::new(method.to_string());
        match method {
            Method::Isolines { lines } => provenance.with("isolines", lines),
            Method::Exact => provenance,
            Method::Qmc { samples, seed } => provenance.with("samples", samples).with("seed", seed),
            Method::Embree { samples, seed, variant } => {
                provenance.with("samples", samples).with("seed", seed).with("variant", variant)
            }
        }
    }

    /// The method with its settings, as [`Provenance::of`] has noted it.
    pub fn integrated_by(&self) -> Option<Method> {
        let text = |name: &str| self.parameters.iter().find(|fact| fact.0 == name).map(|fact| fact.1.as_str());
        let number = |name: &str| text(name)?.parse().ok();
        Some(match self.method.as_str() {
            "isolines" => Method::Isolines { lines: number("isolines")? },
            "exact" => Method::Exact,
            "qmc" => Method::Qmc { samples: number("samples")?, seed: number("seed")? },
            "embree" => {
                let noted = text("variant")?;
                let variant = EmbreeVariant::ALL.into_iter().find(|variant| variant.to_string() == noted)?;
                Method::Embree { samples: number("samples")?, seed: number("seed")?, variant }
            }
            _ => return None,
        })
    }

    /// Adds a parameter.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.parameters.push((name.into(), value.to_string()));
        self
    }

    /// First thing that `self` and `other` disagree on and that changes the numbers, as `(name, ours, theirs)`.
    /// The command line and the phase are left out: neither changes what was integrated.
    pub fn disagreement(&self, other: &Self) -> Option<(String, String, String)> {
        let facts = |provenance: &Self| {
            [("version", &provenance.version), ("method", &provenance.method)]
                .map(|(name, value)| (name.to_owned(), value.clone()))
                .into_iter()
                .chain(provenance.parameters.clone())
                .collect::<Vec<_>>()
        };
        let (ours, theirs) = (facts(self), facts(other));
        let value = |facts: &[(String, String)], name: &str| {
            facts.iter().find(|fact| fact.0 == name).map_or("not set".to_owned(), |fact| fact.1.clone())
        };
        ours.iter()
            .chain(&theirs)
            .map(|(name, _)| (name.clone(), value(&ours, name), value(&theirs, name)))
            .find(|(_, our, their)| our != their)
    }

    /// The provenance as one line of JSON in ASCII, as it stands in files: not every reader takes more.
    pub fn to_json(&self) -> String {
        let json = serde_json::to_string(self).expect("strings always serialise");
        let escaped = |c: char| c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}")).collect();
        json.chars().map(|c| if c.is_ascii() { c.to_string() } else { escaped(c) }).collect()
    }
}

/// Sign convention of the real spherical harmonics with odd |m|.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Phase {
    /// Y_1 = sqrt(3/4pi) (y, z, x), as everywhere in this library.
    #[default]
    #[serde(rename = "no Condon-Shortley")]
    Plain,
    /// Every coefficient times (-1)^m: Y_1 = sqrt(3/4pi) (-y, z, -x).
    #[serde(rename = "Condon-Shortley")]
    CondonShortley,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Plain => "no Condon-Shortley",
            Self::CondonShortley => "Condon-Shortley",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_round_trip_names_the_phase() {
        let provenance = Provenance::new("isolines").with("scene", "été 🌲\n");
        let json = provenance.to_json();
        assert!(json.is_ascii() && !json.contains('\n'), "{json}");
        assert!(json.contains("\"sh_phase\":\"no Condon-Shortley\""), "{json}");
        assert_eq!(serde_json::from_str::<Provenance>(&json).unwrap(), provenance);
    }

    #[test]
    fn methods_are_read_back() {
        let with_rays = EmbreeVariant::ALL.map(|variant| Method::Embree { samples: 64, seed: 3, variant });
        let others = [Method::Isolines { lines: 12 }, Method::Exact, Method::Qmc { samples: 64, seed: 3 }];
        for method in others.into_iter().chain(with_rays) {
            assert_eq!(Provenance::of(method).with("order", 4).integrated_by(), Some(method));
        }
        assert_eq!(Provenance::new("isolines").integrated_by(), None);
        assert_eq!(Provenance::default().integrated_by(), None);
    }

    #[test]
    fn disagreement_names_the_culprit() {
        let ours = Provenance::new("isolines").with("isolines", 256).with("order", 4);
        assert_eq!(ours.disagreement(&Provenance { command_line: "again".into(), ..ours.clone() }), None);
        let theirs = Provenance::new("isolines").with("isolines", 64).with("order", 4);
        assert_eq!(ours.disagreement(&theirs), Some(("isolines".into(), "256".into(), "64".into())));
        let fewer = Provenance::new("isolines").with("isolines", 256);
        assert_eq!(fewer.disagreement(&ours), Some(("order".into(), "not set".into(), "4".into())));
    }
}
