use std::fmt::{self, Write};
use std::path::Path;

use super::Picture;
use super::panel::panel;
use crate::bake::writers::atomically;
use crate::{Error, Result};

/// How far one way of rendering sphere proxies is from the truth, on one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// What varies: `order`, `exponential`, ...
    pub group: String,
    /// Which value it has here.
    pub mode: String,
    /// Against the same spheres, exactly.
    pub spheres: Deviation,
    /// Against the true surfaces; none for what surfaces are not asked for.
    pub surfaces: Option<Deviation>,
}

/// Errors over all pixels and colours, over the greatest unshadowed irradiance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Root mean square.
    pub rmse: f64,
    /// Greatest magnitude.
    pub maximum: f64,
    /// Mean: positive where too much light arrives.
    pub bias: f64,
}

impl Deviation {
    /// Of the given errors.
    pub fn new(errors: impl Iterator<Item = f64>) -> Self {
        let (mut count, mut sum, mut squares, mut maximum) = (0u64, 0.0, 0.0, 0.0f64);
        for error in errors {
            count += 1;
            sum += error;
            squares += error * error;
            maximum = maximum.max(error.abs());
        }
        let count = count.max(1) as f64;
        Self { rmse: (squares / count).sqrt(), maximum, bias: sum / count }
    }
}

/// All verdicts on one frame, with a picture of each one's errors.
#[derive(Clone, Debug, Default)]
pub struct Judgement {
    /// In the order of the table.
    pub verdicts: Vec<Verdict>,
    panels: Vec<Picture>,
}

impl Judgement {
    /// Adds a verdict, with its errors pixel by pixel: root mean squares over the colours, none where nothing is seen.
    ///
    /// # Errors
    /// When drawing fails.
    pub fn add(&mut self, verdict: Verdict, width: usize, height: usize, errors: &[Option<f64>]) -> Result<()> {
        self.panels.push(panel(&format!("{}: {}", verdict.group, verdict.mode), width, height, errors)?);
        self.verdicts.push(verdict);
        Ok(())
    }

    /// Writes `judgement.csv`, `judgement.md` and `differences.png` into `folder`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let text = |name: &str, text: String| {
            let path = folder.join(name);
            atomically(&path, |file| {
                std::io::Write::write_all(file, text.as_bytes()).map_err(|error| Error::file(&path, error))
            })
        };
        text("judgement.csv", self.csv())?;
        text("judgement.md", self.to_string())?;
        self.differences().write(&folder.join("differences.png"))
    }

    fn csv(&self) -> String {
        let mut csv = String::from(
            "group,mode,spheres_rmse,spheres_maximum,spheres_bias,surfaces_rmse,surfaces_maximum,surfaces_bias\n",
        );
        for Verdict { group, mode, spheres: s, surfaces } in &self.verdicts {
            _ = write!(csv, "{group},{mode},{:e},{:e},{:e}", s.rmse, s.maximum, s.bias);
            match surfaces {
                Some(s) => _ = writeln!(csv, ",{:e},{:e},{:e}", s.rmse, s.maximum, s.bias),
                None => csv.push_str(",,,\n"),
            }
        }
        csv
    }

    fn differences(&self) -> Picture {
        let columns = (1..).find(|n| n * n >= self.panels.len()).unwrap_or(1);
        let width = self.panels.iter().map(Picture::width).max().unwrap_or(1);
        let height = self.panels.iter().map(Picture::height).max().unwrap_or(1);
        let mut picture =
            Picture::filled(columns * width, self.panels.len().div_ceil(columns).max(1) * height, [255; 3]);
        for (i, panel) in self.panels.iter().enumerate() {
            picture.paste(panel, i % columns * width, i / columns * height);
        }
        picture
    }
}

impl fmt::Display for Judgement {
    /// A table in Markdown.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| | mode | same spheres: RMSE | maximum | bias | true surfaces: RMSE | maximum | bias |")?;
        writeln!(f, "|---|---|---|---|---|---|---|---|")?;
        let mut before = "";
        for Verdict { group, mode, spheres: s, surfaces } in &self.verdicts {
            let shown = if group == before { "" } else { group };
            before = group;
            write!(f, "| {shown} | {mode} | {:.4} | {:.3} | {:+.4} ", s.rmse, s.maximum, s.bias)?;
            match surfaces {
                Some(s) => writeln!(f, "| {:.4} | {:.3} | {:+.4} |", s.rmse, s.maximum, s.bias)?,
                None => writeln!(f, "| - | - | - |")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_become_tables_and_panels() {
        let deviation = Deviation::new([0.125, -0.375, 0.25, 0.0].into_iter());
        assert!(deviation.maximum == 0.375 && deviation.bias.abs() < 1e-15);
        assert!((deviation.rmse - (0.21875f64 / 4.0).sqrt()).abs() < 1e-15);
        let mut judgement = Judgement::default();
        for (mode, surfaces) in [("3", Some(deviation)), ("4", None)] {
            let verdict = Verdict { group: "order".into(), mode: mode.into(), spheres: deviation, surfaces };
            judgement.add(verdict, 2, 2, &[Some(0.1), None, Some(0.3), Some(0.2)]).unwrap();
        }
        let table = judgement.to_string();
        assert_eq!(table.lines().count(), 4);
        assert!(table.contains("| order | 3 | 0.2339 | 0.375 | +0.0000 | 0.2339"), "{table}");
        assert!(table.contains("|  | 4 | 0.2339 | 0.375 | +0.0000 | - | - | - |"), "{table}");
        let folder = tempfile::tempdir().unwrap();
        judgement.write(folder.path()).unwrap();
        let csv = std::fs::read_to_string(folder.path().join("judgement.csv")).unwrap();
        assert!(csv.lines().all(|line| line.split(',').count() == 8), "{csv}");
        assert!(folder.path().join("differences.png").exists());
    }
}
