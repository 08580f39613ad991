use std::fs;
use std::path::Path;

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
    let is_array = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    let points = if is_array { load_array(path)? } else { load_text(path)? };
    if points.is_empty() {
        return Err(Error::file(path, "no points in this file"));
    }
    Ok(points)
}

fn load_text(path: &Path) -> Result<Vec<Point>> {
    let text = fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    let mut points = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let columns: Vec<&str> = match line.contains(',') {
            true => line.split(',').map(str::trim).collect(),
            false => line.split_whitespace().collect(),
        };
        let mut values = [0.0; 6];
        if columns.len() != values.len() {
            let message = format!("{} columns instead of six: position and unit normal", columns.len());
            return Err(Error::line(path, number, message));
        }
        for (value, column) in values.iter_mut().zip(columns) {
            *value = column.parse().map_err(|_| Error::line(path, number, format!("`{column}` is not a number")))?;
        }
        points.push(check(values).map_err(|message| Error::line(path, number, message))?);
    }
    Ok(points)
}

fn load_array(path: &Path) -> Result<Vec<Point>> {
    let bytes = fs::read(path).map_err(|e| Error::file(path, e))?;
    let (shape, data) = match npy::parse(&bytes).map_err(|message| Error::file(path, message))? {
        npy::Content::Numbers { shape, data } => (shape, data),
        npy::Content::Text(_) => return Err(Error::file(path, "holds text where points are wanted")),
    };
    let [_, 6] = shape[..] else {
        let message = format!("an array of shape {shape:?} instead of [N, 6]: position and unit normal");
        return Err(Error::file(path, message));
    };
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
