use std::fs::{self, File};
use std::io::{BufRead, BufReader, Lines, Read, Seek};
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::npy;
use crate::{Error, Result};

/// A point with a normal, to receive light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Position.
    pub position: DVec3,
    /// Normal, of unit length up to [`NORMAL_TOLERANCE`].
    pub normal: DVec3,
}

/// How far the length of a normal in a file may be from 1.
///
/// Four printed decimals of three components leave an error of at most `sqrt(3) 5e-5 = 8.7e-5`.
pub const NORMAL_TOLERANCE: f64 = 1e-4;

/// Reads points with normals in double precision, used as given: a NumPy array of shape N x 6 (`.npy`, real numbers
/// of any type), or else text with six columns, position and normal, separated by blanks or by commas, where `#` starts a
/// comment.
///
/// # Errors
/// Each names the line of the text or the row (from 0) of the array: a number of columns other than six, what is not a
/// finite number, a normal that is zero or whose length is off by more than [`NORMAL_TOLERANCE`]. A file that is missing,
/// truncated or without points is an error too.
pub fn load_points(path: impl AsRef<Path>) -> Result<Vec<Point>> {
    let path = path.as_ref();
    let points = PointReader::open(path)?.block(usize::MAX)?;
    if points.is_empty() {
        return Err(Error::file(path, "no points in this file"));
    }
    Ok(points)
}

/// Points of a file that follow one another and are picked together.
const RUN: usize = 64;

/// Reads all of a file of points, as [`load_points`] does: their number and, if there are more than `most`, a sample, runs of 64
/// neighbours evenly spread.
///
/// # Errors
/// As [`load_points`].
pub fn survey_points(path: impl AsRef<Path>, most: usize) -> Result<(usize, Vec<Point>)> {
    let path = path.as_ref();
    let mut reader = PointReader::open(path)?;
    let (mut count, mut kept, mut stride) = (0, Vec::new(), 1);
    loop {
        let run = reader.block(RUN)?;
        if run.is_empty() {
            break;
        }
        if (count / RUN).is_multiple_of(stride) {
            kept.extend_from_slice(&run);
        }
        count += run.len();
        if kept.len() > most {
            kept = kept.chunks(RUN).step_by(2).flatten().copied().collect();
            stride *= 2;
        }
    }
    match count {
        0 => Err(Error::file(path, "no points in this file")),
        _ => Ok((count, kept)),
    }
}

/// Reads points as [`load_points`] does, a block at a time, so that a file of any length takes little memory. (An array in Fortran
/// order, whose rows are scattered, is held whole.)
pub struct PointReader {
    path: PathBuf,
    /// Lines or rows that have been read.
    read: usize,
    source: Source,
}

enum Source {
    Text(Lines<BufReader<File>>),
    /// Rows that follow one another.
    Rows(BufReader<File>, npy::Header),
    Whole(std::vec::IntoIter<Point>),
}

impl PointReader {
    /// Opens a file.
    ///
    /// # Errors
    /// As [`load_points`], about what stands before the first point.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let is_array = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
        let source = if is_array { Self::open_array(path)? } else { Source::Text(open(path)?.lines()) };
        Ok(Self { path: path.to_owned(), read: 0, source })
    }

    fn open_array(path: &Path) -> Result<Source> {
        let refuse = |message: String| Error::file(path, message);
        let mut file = open(path)?;
        let header = npy::Header::read(&mut file).map_err(refuse)?;
        let position = file.stream_position().map_err(|e| Error::file(path, e))?;
        let length = file.get_ref().metadata().map_err(|e| Error::file(path, e))?.len();
        header.check(length.saturating_sub(position)).map_err(refuse)?;
        header.numbers(&[]).map_err(refuse)?;
        let [_, 6] = header.shape[..] else {
            let message = format!("an array of shape {:?} instead of [N, 6]: position and unit normal", header.shape);
            return Err(refuse(message));
        };
        match header.fortran_order {
            true => Ok(Source::Whole(load_array(path)?.into_iter())),
            false => Ok(Source::Rows(file, header)),
        }
    }

    /// The next points, at most so many; none at the end.
    ///
    /// # Errors
    /// As [`load_points`], about these points.
    pub fn block(&mut self, most: usize) -> Result<Vec<Point>> {
        let Self { path, read, source } = self;
        let mut points = Vec::new();
        match source {
            Source::Whole(rest) => points.extend(rest.take(most)),
            Source::Text(lines) => {
                while points.len() < most
                    && let Some(line) = lines.next()
                {
                    *read += 1;
                    let line = line.map_err(|e| Error::file(&*path, e))?;
                    points.extend(parse(&line).map_err(|message| Error::line(&*path, *read, message))?);
                }
            }
            Source::Rows(file, header) => {
                let rows = most.min(header.shape[0] - *read);
                let mut bytes = vec![0; rows * 6 * header.size];
                file.read_exact(&mut bytes).map_err(|e| Error::file(&*path, e))?;
                let numbers = header.numbers(&bytes).map_err(|message| Error::file(&*path, message))?;
                for &row in numbers.as_chunks::<6>().0 {
                    let refuse = |message| Error::file(&*path, format!("row {read}: {message}"));
                    points.push(check(row).map_err(refuse)?);
                    *read += 1;
                }
            }
        }
        Ok(points)
    }
}

fn open(path: &Path) -> Result<BufReader<File>> {
    File::open(path).map(BufReader::new).map_err(|e| Error::file(path, e))
}

/// The point in a line of text, if there is one.
fn parse(line: &str) -> std::result::Result<Option<Point>, String> {
    let line = line.split('#').next().unwrap_or_default().trim();
    if line.is_empty() {
        return Ok(None);
    }
    let columns: Vec<&str> = match line.contains(',') {
        true => line.split(',').map(str::trim).collect(),
        false => line.split_whitespace().collect(),
    };
    let mut values = [0.0; 6];
    if columns.len() != values.len() {
        return Err(format!("{} columns instead of six: position and unit normal", columns.len()));
    }
    for (value, column) in values.iter_mut().zip(columns) {
        *value = column.parse().map_err(|_| format!("`{column}` is not a number"))?;
    }
    check(values).map(Some)
}

fn load_array(path: &Path) -> Result<Vec<Point>> {
    let bytes = fs::read(path).map_err(|e| Error::file(path, e))?;
    let content = npy::parse(&bytes).map_err(|message| Error::file(path, message))?;
    let npy::Content::Numbers { data, .. } = content else { return Err(Error::file(path, "holds no numbers")) };
    let rows = data.as_chunks::<6>().0.iter().enumerate();
    rows.map(|(i, &row)| check(row).map_err(|message| Error::file(path, format!("row {i}: {message}")))).collect()
}

fn check(values: [f64; 6]) -> std::result::Result<Point, String> {
    if let Some(value) = values.iter().find(|value| !value.is_finite()) {
        return Err(format!("{value} is not finite"));
    }
    let [x, y, z, nx, ny, nz] = values;
    let normal = DVec3::new(nx, ny, nz);
    match normal.length() {
        0.0 => Err("the normal is zero".into()),
        length if (length - 1.0).abs() > NORMAL_TOLERANCE => {
            Err(format!("the normal has length {length} instead of 1 (within {NORMAL_TOLERANCE:e}); normalise it"))
        }
        _ => Ok(Point { position: DVec3::new(x, y, z), normal }),
    }
}

#[cfg(test)]
mod tests {
    use npyz::WriterBuilder;

    use super::*;

    fn load_bytes(name: &str, bytes: &[u8]) -> Result<Vec<Point>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        load_points(path)
    }

    fn array<T: npyz::AutoSerialize + npyz::Serialize + Copy>(
        shape: &[u64],
        order: npyz::Order,
        values: &[T],
    ) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut writer =
            npyz::WriteOptions::new().default_dtype().shape(shape).order(order).writer(&mut bytes).begin_nd().unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    const TWO: [Point; 2] = [
        Point { position: DVec3::new(0.1, 2.0, -3e-7), normal: DVec3::Z },
        Point { position: DVec3::new(1e9, 0.0, 0.5), normal: DVec3::new(0.6, -0.8, 0.0) },
    ];

    #[test]
    fn text_is_kept_in_double_precision() {
        let text = "# x y z nx ny nz\n0.1 2 -3e-7\t0 0 1\n\n1000000000, 0 ,0.5,0.6,-0.8,0 # a comment\n";
        assert_eq!(load_bytes("points.csv", text.as_bytes()).unwrap(), TWO);
    }

    #[test]
    fn arrays_of_both_types_and_orders_are_read() {
        let rows: Vec<f64> =
            TWO.iter().flat_map(|p| p.position.to_array().into_iter().chain(p.normal.to_array())).collect();
        let columns: Vec<f64> = (0..12).map(|i| rows[i / 2 + 6 * (i % 2)]).collect();
        assert_eq!(load_bytes("p.npy", &array(&[2, 6], npyz::Order::C, &rows)).unwrap(), TWO);
        assert_eq!(load_bytes("p.NPY", &array(&[2, 6], npyz::Order::Fortran, &columns)).unwrap(), TWO);
        let single: Vec<f32> = rows.iter().map(|&x| x as f32).collect();
        let points = load_bytes("p.npy", &array(&[2, 6], npyz::Order::C, &single)).unwrap();
        assert_eq!(points[0].position.x, f64::from(0.1f32));
    }

    #[test]
    fn blocks_and_samples_hold_the_same_points() {
        let rows: Vec<f64> = (0..1000).flat_map(|i| [f64::from(i), 0.5, -0.25, 0.0, 0.0, 1.0]).collect();
        let folder = tempfile::tempdir().unwrap();
        let text: String = rows.chunks(6).map(|row| format!("{} 0.5 -0.25 0 0 1\n# {}\n", row[0], row[0])).collect();
        let columns: Vec<f64> = (0..6000).map(|i| rows[i / 1000 + 6 * (i % 1000)]).collect();
        for (name, bytes) in [
            ("a.txt", text.into_bytes()),
            ("c.npy", array(&[1000, 6], npyz::Order::C, &rows)),
            ("f.npy", array(&[1000, 6], npyz::Order::Fortran, &columns)),
        ] {
            let path = folder.path().join(name);
            fs::write(&path, bytes).unwrap();
            let all = load_points(&path).unwrap();
            assert_eq!(all.len(), 1000);
            let mut reader = PointReader::open(&path).unwrap();
            let blocks: Vec<Vec<Point>> = (0..5).map(|_| reader.block(300).unwrap()).collect();
            assert_eq!(blocks.iter().map(Vec::len).collect::<Vec<_>>(), [300, 300, 300, 100, 0]);
            assert_eq!(blocks.concat(), all);
            assert_eq!(survey_points(&path, 1000).unwrap(), (1000, all.clone()));
            // 16 runs, of which every fourth is kept.
            let (count, sample) = survey_points(&path, 300).unwrap();
            assert_eq!(count, 1000);
            assert_eq!(sample, [&all[..64], &all[256..320], &all[512..576], &all[768..832]].concat());
        }
    }

    #[test]
    fn four_printed_decimals_are_a_unit_normal_and_less_is_not() {
        assert!(load_bytes("p.txt", b"0 0 0 0.5774 0.5774 0.5774\n").is_ok());
        assert!(load_bytes("p.txt", b"0 0 0 0.577 0.577 0.577\n").is_err());
    }

    #[test]
    fn bad_text_names_the_line() {
        for (text, line, why) in [
            ("0 0 0 0 0 1\n0 0 0 0 0\n", 2, "5 columns"),
            ("0,0,0,0,0,1,\n", 1, "7 columns"),
            ("\n0,0,,0,0,1\n", 2, "`` is not a number"),
            ("x y z nx ny nz\n", 1, "`x` is not a number"),
            ("0 0 nan 0 0 1\n", 1, "NaN is not finite"),
            ("0 0 0 0 0 inf\n", 1, "inf is not finite"),
            ("0 0 0 0 0 1\n0 0 0 0 0 0\n", 2, "normal is zero"),
            ("0 0 0 0 0 2\n", 1, "length 2"),
        ] {
            let message = load_bytes("p.txt", text.as_bytes()).unwrap_err().to_string();
            assert!(message.contains(&format!("p.txt:{line}: ")) && message.contains(why), "{message}");
        }
        assert!(load_bytes("p.txt", b"# nothing\n").unwrap_err().to_string().contains("no points"));
        assert!(load_bytes("p.txt", b"\xff\xfe").is_err());
        assert!(load_points("missing.txt").unwrap_err().to_string().starts_with("missing.txt: "));
    }

    #[test]
    fn bad_arrays_name_the_row() {
        let mut values = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0].repeat(3);
        let good = array(&[3, 6], npyz::Order::C, &values);
        values[11] = f64::NAN;
        for (bytes, why) in [
            (array(&[3, 6], npyz::Order::C, &values), "row 1: NaN is not finite"),
            (array(&[6, 3], npyz::Order::C, &values), "shape [6, 3]"),
            (array(&[18], npyz::Order::C, &values), "shape [18]"),
            (array(&[1, 6], npyz::Order::C, &[0i32; 6]), "row 0: the normal is zero"),
            (array::<f64>(&[0, 6], npyz::Order::C, &[]), "no points"),
            (good[..good.len() - 1].to_vec(), "p.npy: "),
            (good[..20].to_vec(), "p.npy: "),
            (b"not an array".to_vec(), "p.npy: "),
        ] {
            let message = load_bytes("p.npy", &bytes).unwrap_err().to_string();
            assert!(message.contains(why) && !message.contains('\n'), "{message}");
        }
    }
}
