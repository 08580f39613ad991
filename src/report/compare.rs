use std::fmt;
use std::path::{Path, PathBuf};

use crate::bake::writers::{exr, npz};
use crate::bake::{Array, Arrays, Phase, components};
use crate::{Error, Result};

use super::panel::panel;
use super::{Curve, Picture, Plot};

/// Name of the array or channel that tells which pixels have values.
const COVERAGE: &str = "coverage";

/// The arrays of one file, to be compared.
#[derive(Clone, Debug)]
pub struct Results {
    path: PathBuf,
    arrays: Arrays,
    phase: Phase,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Archive,
    Image,
}

impl Results {
    /// Reads a NumPy archive (`.npz`) or an OpenEXR image (`.exr`), whose every channel is an array.
    ///
    /// # Errors
    /// When the file is neither or cannot be read.
    pub fn read(path: &Path) -> Result<Self> {
        let (archive, kind) = match path.extension().unwrap_or_default().to_string_lossy().to_lowercase().as_str() {
            "npz" => (npz::read(path)?, Kind::Archive),
            "exr" => (exr::read(path)?, Kind::Image),
            _ => return Err(Error::file(path, "only .npz and .exr files can be compared")),
        };
        let phase = archive.provenance.map_or(Phase::Plain, |provenance| provenance.sh_phase);
        Ok(Self { path: path.to_owned(), arrays: archive.arrays, phase, kind })
    }

    fn get(&self, name: &str) -> Result<&Array> {
        self.arrays.get(name).ok_or_else(|| {
            let names: Vec<_> = self.arrays.iter().map(|array| array.name.as_str()).collect();
            Error::file(&self.path, format!("has no array {name}; it has {}", names.join(", ")))
        })
    }
}

/// How far one array is from its reference, over all values that both files cover.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Name of the array or channel.
    pub name: String,
    /// Number of values compared.
    pub values: usize,
    /// Root of the mean squared difference.
    pub rmse: f64,
    /// Largest absolute difference.
    pub maximum: f64,
    /// Where the largest is: the row and component, or the pixel; a dash where all are equal.
    pub place: String,
    /// Mean of the signed difference, first file minus second.
    pub bias: f64,
    /// `rmse` over the root mean square of the second file's values; none where those are all zero.
    pub relative: Option<f64>,
}

/// Differences of a file of results from a second one, the reference.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// One per array, in the first file's order.
    pub differences: Vec<Difference>,
    /// Signed differences, for the picture.
    errors: Vec<Errors>,
    kind: Kind,
}

/// Signed differences of one array; none where a file does not cover the pixel.
#[derive(Clone, Debug)]
struct Errors {
    name: String,
    shape: Vec<usize>,
    values: Vec<Option<f64>>,
}

impl Comparison {
    /// Compares the arrays called `names`, or all if there are none, of `a` with those of the reference `b`.
    ///
    /// Where both files have an array `coverage`, values that one of them does not cover are left out.
    ///
    /// # Errors
    /// When an array is missing in one file or has another shape there, the files are of different kinds, or their
    /// spherical harmonics follow different phase conventions.
    pub fn new(a: &Results, b: &Results, names: &[String]) -> Result<Self> {
        if a.kind != b.kind {
            return Err(Error::input("a NumPy archive cannot be compared with an image; give two of a kind"));
        }
        if a.phase != b.phase {
            let message = format!("its harmonics are {}, those of {} are {}", a.phase, b.path.display(), b.phase);
            return Err(Error::file(&a.path, message));
        }
        let names: Vec<&str> = if names.is_empty() {
            // Arrays that only the second file has are asked for as well, and found missing in the first.
            let missing = b.arrays.iter().filter(|array| a.arrays.get(&array.name).is_none());
            a.arrays.iter().chain(missing).map(|array| array.name.as_str()).collect()
        } else {
            names.iter().map(String::as_str).collect()
        };
        let mut comparison = Self { differences: Vec::new(), errors: Vec::new(), kind: a.kind };
        for name in names {
            let (ours, theirs) = (a.get(name)?, b.get(name)?);
            if ours.shape != theirs.shape {
                let message =
                    format!("array {name} has shape {:?}, in {} {:?}", ours.shape, b.path.display(), theirs.shape);
                return Err(Error::file(&a.path, message));
            }
            let errors = Errors::new(ours, theirs, [a.arrays.get(COVERAGE), b.arrays.get(COVERAGE)]);
            comparison.differences.push(errors.difference(ours, theirs, a.kind));
            comparison.errors.push(errors);
        }
        Ok(comparison)
    }

    /// The array with the largest RMSE.
    pub fn worst(&self) -> Option<&Difference> {
        self.differences.iter().max_by(|a, b| a.rmse.total_cmp(&b.rmse))
    }

    /// Draws the differences. Images: one panel per group of channels (`sh`, `R G B`, ...) with the root mean square
    /// over the group in false colour. Archives: for every array the share of values whose error exceeds a bound, over
    /// that bound.
    ///
    /// # Errors
    /// When the extension is not `.png` (archives: `.png` or `.svg`), or the file cannot be written.
    pub fn write_picture(&self, path: &Path) -> Result<()> {
        match self.kind {
            Kind::Archive => self.plot().write(path),
            Kind::Image if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) => {
                self.panels()?.write(path)
            }
            Kind::Image => Err(Error::file(path, "a difference picture is written as .png")),
        }
    }

    fn plot(&self) -> Plot {
        let curve = |errors: &Errors| {
            let mut sizes: Vec<f64> = errors.values.iter().flatten().map(|error| error.abs()).collect();
            sizes.sort_by(|a, b| b.total_cmp(a));
            let count = sizes.len() as f64;
            // A thousand points are more than the plot has pixels for.
            let step = sizes.len().div_ceil(1000).max(1);
            let points = (0..sizes.len()).step_by(step).map(|i| (sizes[i], (i + 1) as f64 / count)).collect();
            // A curve of zeros has no place on a logarithmic axis; the legend tells.
            let equal = if sizes.first().is_some_and(|&size| size > 0.0) { "" } else { " (equal)" };
            Curve { name: errors.name.clone() + equal, points }
        };
        Plot {
            title: "Share of values with a larger difference".into(),
            x: "absolute difference".into(),
            y: "share".into(),
            curves: self.errors.iter().map(curve).collect(),
        }
    }

    fn panels(&self) -> Result<Picture> {
        let mut groups: Vec<(String, Vec<&Errors>)> = Vec::new();
        for errors in &self.errors {
            let name = match errors.name.split_once('.') {
                Some((stem, _)) => stem,
                None if matches!(errors.name.as_str(), "R" | "G" | "B") => "R G B",
                None => &errors.name,
            };
            match groups.iter_mut().find(|group| group.0 == name) {
                Some(group) => group.1.push(errors),
                None => groups.push((name.to_owned(), vec![errors])),
            }
        }
        let panels = groups.iter().map(|(name, channels)| group_panel(name, channels)).collect::<Result<Vec<_>>>()?;
        let columns = (1..).find(|n| n * n >= panels.len()).unwrap_or(1);
        let width = panels.iter().map(Picture::width).max().unwrap_or(1);
        let height = panels.iter().map(Picture::height).max().unwrap_or(1);
        let rows = panels.len().div_ceil(columns).max(1);
        let mut picture = Picture::filled(columns * width, rows * height, [255; 3]);
        for (i, panel) in panels.iter().enumerate() {
            picture.paste(panel, i % columns * width, i / columns * height);
        }
        Ok(picture)
    }
}

impl fmt::Display for Comparison {
    /// A table with one line per array.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let longest = |column: fn(&Difference) -> usize, head: usize| {
            self.differences.iter().map(column).max().unwrap_or(0).max(head)
        };
        let (name, place) = (longest(|d| d.name.len(), 5), longest(|d| d.place.len(), 5));
        writeln!(
            f,
            "{:name$} {:>10} {:>9} {:>9}  {:place$} {:>10} {:>9}",
            "array", "values", "RMSE", "maximum", "where", "bias", "relative"
        )?;
        for d in &self.differences {
            let relative = d.relative.map_or("-".into(), |relative| format!("{relative:.2e}"));
            writeln!(
                f,
                "{:name$} {:>10} {:>9.2e} {:>9.2e}  {:place$} {:>10.2e} {relative:>9}",
                d.name, d.values, d.rmse, d.maximum, d.place, d.bias
            )?;
        }
        Ok(())
    }
}

impl Errors {
    fn new(ours: &Array, theirs: &Array, coverage: [Option<&Array>; 2]) -> Self {
        let masks = coverage.into_iter().flatten();
        // Coverage itself, and what is not of its shape, is compared everywhere.
        let masks = masks.filter(|mask| ours.name != COVERAGE && ours.shape.starts_with(&mask.shape));
        let masks: Vec<_> = masks.map(|mask| (mask, ours.data.len() / mask.data.len().max(1))).collect();
        let covered = |i: usize| masks.iter().all(|(mask, stride)| mask.data[i / stride] > 0.0);
        let pairs = ours.data.iter().zip(&theirs.data).enumerate();
        let values = pairs.map(|(i, (a, b))| covered(i).then_some(a - b)).collect();
        Self { name: ours.name.clone(), shape: ours.shape.clone(), values }
    }

    fn difference(&self, ours: &Array, theirs: &Array, kind: Kind) -> Difference {
        let covered = || self.values.iter().enumerate().filter_map(|(i, error)| Some((i, (*error)?)));
        let values = covered().count();
        let mean = |sum: f64| sum / values.max(1) as f64;
        let rmse = mean(covered().map(|(_, error)| error * error).sum()).sqrt();
        let magnitude = mean(covered().map(|(i, _)| theirs.data[i].powi(2)).sum()).sqrt();
        // The first of equals.
        let largest = covered().fold(None, |largest: Option<(usize, f64)>, (i, error)| match largest {
            Some((_, size)) if size >= error.abs() => largest,
            _ => Some((i, error.abs())),
        });
        Difference {
            name: self.name.clone(),
            values,
            rmse,
            maximum: largest.map_or(0.0, |largest| largest.1),
            place: largest.filter(|largest| largest.1 > 0.0).map_or("-".into(), |(i, _)| place(ours, i, kind)),
            bias: mean(covered().map(|(_, error)| error).sum()),
            relative: if rmse == 0.0 { Some(0.0) } else { (magnitude > 0.0).then(|| rmse / magnitude) },
        }
    }
}

/// Where `array.data[flat]` is, in words.
fn place(array: &Array, flat: usize, kind: Kind) -> String {
    let index = array.index(flat);
    match (kind, index.as_slice()) {
        (Kind::Image, [y, x]) => format!("pixel {x},{y}"),
        (_, []) => String::new(),
        (_, [row]) => format!("row {row}"),
        (_, [row, ..]) => {
            let components = components(array, 1);
            format!("row {row}, {}", components[flat % components.len()])
        }
    }
}

/// Root mean square over `channels`, pixel by pixel.
fn group_panel(name: &str, channels: &[&Errors]) -> Result<Picture> {
    let [height, width] = channels[0].shape[..] else {
        return Err(Error::input(format!("channel {name} is no image")));
    };
    let root_mean_square = |i: usize| -> Option<f64> {
        let squares = channels.iter().map(|errors| errors.values[i].map(|error| error * error));
        Some((squares.sum::<Option<f64>>()? / channels.len() as f64).sqrt())
    };
    panel(name, width, height, &(0..width * height).map(root_mean_square).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::super::panel::LINE;
    use super::super::picture::colour;
    use super::*;
    use crate::bake::writers::write;
    use crate::bake::{Baked, BakedImage, Provenance};

    fn results(kind: Kind, arrays: &[(&str, &[usize], &[f64])]) -> Results {
        let mut all = Arrays::new();
        arrays.iter().for_each(|(name, shape, data)| all.push(Array::new(*name, *shape, data.to_vec())).unwrap());
        Results { path: "a.npz".into(), arrays: all, phase: Phase::Plain, kind }
    }

    fn message(a: &Results, b: &Results, names: &[String]) -> String {
        Comparison::new(a, b, names).unwrap_err().to_string()
    }

    #[test]
    fn numbers_of_known_arrays() {
        let a = results(Kind::Archive, &[("x", &[4], &[1.0, 2.0, 3.0, 4.0]), ("y_sh", &[1, 4], &[0.0, 0.5, 0.0, 0.0])]);
        let b = results(Kind::Archive, &[("y_sh", &[1, 4], &[0.0; 4]), ("x", &[4], &[1.0, 2.0, 1.0, 5.0])]);
        let comparison = Comparison::new(&a, &b, &[]).unwrap();
        let [x, y] = comparison.differences.as_slice() else { panic!() };
        // Differences 0, 0, 2, -1.
        assert_eq!((x.values, x.maximum, x.bias, x.place.as_str()), (4, 2.0, 0.25, "row 2"));
        assert!((x.rmse - 1.25f64.sqrt()).abs() < 1e-15);
        assert!((x.relative.unwrap() - (5.0f64 / 31.0).sqrt()).abs() < 1e-15);
        assert_eq!((y.rmse, y.relative, y.place.as_str()), (0.25, None, "row 0, y.l1.m-1"));
        assert_eq!(comparison.worst().unwrap().name, "x");
        let table = comparison.to_string();
        assert_eq!(table.lines().count(), 3);
        assert!(table.lines().nth(1).unwrap().contains("1.12e0    2.00e0  row 2"), "{table}");
        let same = Comparison::new(&a, &a, &["x".into()]).unwrap();
        assert_eq!(
            (same.differences.len(), same.differences[0].rmse, same.differences[0].relative),
            (1, 0.0, Some(0.0))
        );
    }

    #[test]
    fn uncovered_pixels_do_not_count() {
        let image = |values: &[f64], coverage: &[f64]| {
            results(Kind::Image, &[("R", &[1, 3], values), ("coverage", &[1, 3], coverage)])
        };
        let a = image(&[1.0, 9.0, 3.0], &[1.0, 0.0, 1.0]);
        let b = image(&[1.0, 0.0, 2.0], &[1.0, 0.0, 1.0]);
        let comparison = Comparison::new(&a, &b, &[]).unwrap();
        let red = &comparison.differences[0];
        assert_eq!((red.values, red.maximum, red.place.as_str()), (2, 1.0, "pixel 2,0"));
        let less = image(&[1.0, 0.0, 2.0], &[1.0, 0.0, 0.0]);
        let comparison = Comparison::new(&a, &less, &[]).unwrap();
        assert_eq!(comparison.differences[0].values, 1);
        // That one file covers more than the other shows in the coverage itself.
        assert_eq!((comparison.differences[1].values, comparison.differences[1].maximum), (3, 1.0));
    }

    #[test]
    fn what_cannot_be_compared_is_named() {
        let a = results(Kind::Archive, &[("x", &[2], &[0.0; 2])]);
        let wide = results(Kind::Archive, &[("x", &[2, 1], &[0.0; 2])]);
        let more = results(Kind::Archive, &[("x", &[2], &[0.0; 2]), ("y", &[1], &[0.0])]);
        assert!(message(&a, &wide, &[]).contains("array x has shape [2]"));
        assert_eq!(message(&a, &more, &[]), "a.npz: has no array y; it has x");
        assert_eq!(message(&more, &a, &[]), "a.npz: has no array y; it has x");
        assert!(message(&a, &a, &["z".into()]).contains("no array z"));
        assert!(message(&a, &results(Kind::Image, &[]), &[]).contains("two of a kind"));
        let other = Results { phase: Phase::CondonShortley, ..a.clone() };
        assert!(message(&a, &other, &[]).contains("Condon-Shortley"));
        assert!(Results::read(Path::new("a.txt")).unwrap_err().to_string().contains("only .npz and .exr"));
    }

    #[test]
    fn pictures_of_images_show_the_worst_pixel() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let (width, height) = (1500, 40);
        let bake = |spike: f64| {
            let mut rows = Arrays::new();
            let mut values = vec![0.5; width * height];
            values[20 * width + 700] += spike;
            rows.push(Array::new("ambient_occlusion", [width * height], values.clone())).unwrap();
            rows.push(Array::new("visibility_sh", [width * height, 1], values)).unwrap();
            let pixels: Vec<u32> = (0..(width * height) as u32).collect();
            Baked::Image(BakedImage::from_rows(width, height, &pixels, rows, Provenance::default()).unwrap())
        };
        write(&path("a.exr"), &bake(0.25)).unwrap();
        write(&path("b.exr"), &bake(0.0)).unwrap();
        let (a, b) = (Results::read(&path("a.exr")).unwrap(), Results::read(&path("b.exr")).unwrap());
        let comparison = Comparison::new(&a, &b, &[]).unwrap();
        assert_eq!(comparison.worst().unwrap().place, "pixel 700,20");
        let picture = comparison.panels().unwrap();
        // Three panels in two columns, reduced by two.
        assert_eq!(picture.width(), 2 * (750 + LINE));
        let plotters::style::RGBColor(r, g, b) = colour(1.0);
        assert_eq!(picture.pixel(LINE / 2 + 350, LINE + LINE / 2 + 10), [r, g, b]);
        comparison.write_picture(&path("d.png")).unwrap();
        assert_eq!(image::open(path("d.png")).unwrap().width(), 2 * (750 + LINE) as u32);
        assert!(comparison.write_picture(&path("d.svg")).is_err());
    }

    #[test]
    fn curves_of_archives_fall_from_one() {
        let folder = tempfile::tempdir().unwrap();
        let data: Vec<f64> = (1..=5000).map(|i| f64::from(i) * 1e-6).collect();
        let a = results(Kind::Archive, &[("x", &[5000], &data), ("same", &[1], &[1.0])]);
        let b = results(Kind::Archive, &[("x", &[5000], &[0.0; 5000]), ("same", &[1], &[1.0])]);
        let comparison = Comparison::new(&a, &b, &[]).unwrap();
        let plot = comparison.plot();
        assert_eq!(plot.curves[1].name, "same (equal)");
        assert_eq!(plot.curves[0].points[0], (5e-3, 1.0 / 5000.0));
        assert!(plot.curves[0].points.is_sorted_by(|p, q| p.0 > q.0 && p.1 < q.1));
        for name in ["d.png", "d.svg"] {
            comparison.write_picture(&folder.path().join(name)).unwrap();
        }
        assert!(comparison.write_picture(&folder.path().join("d.txt")).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
