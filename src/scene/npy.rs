//! NumPy's array files, versions 1 to 3 of the format (NumPy enhancement proposal 1).

use std::io::{Read, Write};

const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// What an array file holds.
#[derive(Debug)]
pub(crate) enum Content {
    /// Real numbers, integers or booleans, in C order: the last axis varies fastest.
    Numbers {
        /// Length of every axis; empty for a single number.
        shape: Vec<usize>,
        /// As many as the product of `shape`.
        data: Vec<f64>,
    },
    /// A single string.
    Text(String),
}

/// Reads the array file `bytes`, numbers of any type as doubles.
///
/// # Errors
/// When the file is truncated, no array file, or of another type: a line that does not name the file.
pub(crate) fn parse(bytes: &[u8]) -> Result<Content, String> {
    let mut data = bytes;
    let header = Header::read(&mut data)?;
    header.check(data.len() as u64)?;
    if header.kind == 'U' && header.shape.is_empty() {
        return header.text(data).map(Content::Text);
    }
    let numbers = header.numbers(data)?;
    let numbers = if header.fortran_order { in_c_order(&header.shape, &numbers) } else { numbers };
    Ok(Content::Numbers { shape: header.shape, data: numbers })
}

/// Writes the header of a version 1 file for little-endian numbers of type `descr`, in C order.
pub(crate) fn write_header(file: &mut impl Write, descr: &str, shape: &[usize]) -> std::io::Result<()> {
    let axes: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}", axes.trim_end());
    // Numbers begin at a multiple of 64 bytes, behind the newline that ends the header.
    let unpadded = MAGIC.len() + 4 + text.len() + 1;
    text.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let length = u16::try_from(text.len()).map_err(std::io::Error::other)?;
    file.write_all(MAGIC)?;
    file.write_all(&[1, 0])?;
    file.write_all(&length.to_le_bytes())?;
    file.write_all(text.as_bytes())
}

/// What stands before an array's numbers.
#[derive(Debug)]
pub(crate) struct Header {
    big_endian: bool,
    /// NumPy's letter of the type: f, i, u, b, U, ...
    kind: char,
    /// Bytes of one element.
    pub(crate) size: usize,
    /// Whether the first axis varies fastest.
    pub(crate) fortran_order: bool,
    /// Length of every axis.
    pub(crate) shape: Vec<usize>,
}

impl Header {
    /// Reads as far as the first number.
    ///
    /// # Errors
    /// As [`parse`].
    pub(crate) fn read(file: &mut impl Read) -> Result<Self, String> {
        let not = || "not a NumPy array file, or truncated".to_owned();
        let mut start = [0; 8];
        file.read_exact(&mut start).map_err(|_| not())?;
        let (magic, version) = start.split_at(MAGIC.len());
        let mut length = [0; 4];
        let digits = match version[0] {
            1 => 2,
            2 | 3 => 4,
            _ => return Err(not()),
        };
        file.read_exact(&mut length[..digits]).map_err(|_| not())?;
        if magic != MAGIC {
            return Err(not());
        }
        let length = u32::from_le_bytes(length);
        let mut text = Vec::new();
        // Grows with what is really there.
        file.take(length.into()).read_to_end(&mut text).map_err(|_| not())?;
        let text = String::from_utf8(text).ok().filter(|text| text.len() == length as usize).ok_or_else(not)?;
        let text = text.as_str();

        let descr = value(text, "descr").ok_or_else(not)?;
        let descr = descr.strip_prefix(['\'', '"']).and_then(|rest| rest.split(['\'', '"']).next());
        let descr = descr.ok_or("holds records; plain numbers are wanted")?;
        let unsupported = || format!("holds numbers of type {descr}; real numbers, integers or booleans are wanted");
        let mut letters = descr.chars();
        let order = letters.next().ok_or_else(unsupported)?;
        let kind = letters.next().ok_or_else(unsupported)?;
        let digits: usize = letters.as_str().parse().map_err(|_| unsupported())?;
        // Lengths of Unicode strings count characters of four bytes.
        let size = if kind == 'U' { digits.checked_mul(4).ok_or_else(not)? } else { digits };
        if !matches!((kind, size), ('f', 4 | 8) | ('i' | 'u', 1 | 2 | 4 | 8) | ('b', 1) | ('U', 1..)) {
            return Err(unsupported());
        }

        let shape = value(text, "shape").and_then(|rest| rest.strip_prefix('(')?.split(')').next()).ok_or_else(not)?;
        let lengths = shape.split(',').map(str::trim).filter(|length| !length.is_empty());
        let shape: Vec<usize> = lengths.map(|length| length.parse().map_err(|_| not())).collect::<Result<_, _>>()?;
        let fortran_order = value(text, "fortran_order").ok_or_else(not)?.starts_with("True");
        Ok(Self { big_endian: order == '>', kind, size, fortran_order, shape })
    }

    /// Fails unless so many bytes hold exactly the array's numbers.
    ///
    /// # Errors
    /// A line that says so.
    pub(crate) fn check(&self, bytes: u64) -> Result<(), String> {
        let size = self.shape.iter().try_fold(self.size, |product, &length| product.checked_mul(length));
        match size.is_some_and(|size| size as u64 == bytes) {
            true => Ok(()),
            false => Err(format!("truncated: {bytes} bytes of numbers do not fill shape {:?}", self.shape)),
        }
    }

    /// The numbers that some of the array's bytes stand for, in the order of the file.
    ///
    /// # Errors
    /// An array of text.
    pub(crate) fn numbers(&self, data: &[u8]) -> Result<Vec<f64>, String> {
        Ok(match (self.kind, self.size) {
            ('f', 8) => self.elements(data, f64::from_le_bytes),
            ('f', 4) => self.elements(data, |b| f32::from_le_bytes(b).into()),
            ('i', 1) => self.elements(data, |b| i8::from_le_bytes(b).into()),
            ('i', 2) => self.elements(data, |b| i16::from_le_bytes(b).into()),
            ('i', 4) => self.elements(data, |b| i32::from_le_bytes(b).into()),
            ('i', 8) => self.elements(data, |b| i64::from_le_bytes(b) as f64),
            ('u', 1) | ('b', 1) => self.elements(data, |b| u8::from_le_bytes(b).into()),
            ('u', 2) => self.elements(data, |b| u16::from_le_bytes(b).into()),
            ('u', 4) => self.elements(data, |b| u32::from_le_bytes(b).into()),
            ('u', 8) => self.elements(data, |b| u64::from_le_bytes(b) as f64),
            _ => return Err("holds text where numbers are wanted".into()),
        })
    }

    fn elements<const N: usize>(&self, data: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
        let element = |bytes: &[u8; N]| {
            let mut bytes = *bytes;
            if self.big_endian {
                bytes.reverse();
            }
            number(bytes)
        };
        data.as_chunks::<N>().0.iter().map(element).collect()
    }

    fn text(&self, data: &[u8]) -> Result<String, String> {
        let code =
            |bytes: &[u8; 4]| if self.big_endian { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) };
        let characters = data.as_chunks::<4>().0.iter().map(code).map(char::from_u32);
        let text: Option<String> = characters.collect();
        Ok(text.ok_or("holds text that is not Unicode")?.trim_end_matches('\0').to_owned())
    }
}

/// What follows `'key':` in the dictionary `text`.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let after = ['\'', '"'].iter().find_map(|quote| text.split_once(&format!("{quote}{key}{quote}")))?.1;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

/// C order of numbers that stand in Fortran order: first axis fastest.
fn in_c_order(shape: &[usize], data: &[f64]) -> Vec<f64> {
    let strides: Vec<usize> = shape
        .iter()
        .scan(1, |product, &length| {
            let stride = *product;
            *product *= length;
            Some(stride)
        })
        .collect();
    let place = |mut flat: usize| -> usize {
        let axes = shape.iter().zip(&strides).rev();
        axes.map(|(length, stride)| {
            let index = flat % length;
            flat /= length;
            index * stride
        })
        .sum()
    };
    (0..data.len()).map(|flat| data[place(flat)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file as NumPy writes it.
    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{header:117}\n");
        [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
    }

    fn numbers(bytes: &[u8]) -> (Vec<usize>, Vec<f64>) {
        match parse(bytes).unwrap() {
            Content::Numbers { shape, data } => (shape, data),
            Content::Text(text) => panic!("{text}"),
        }
    }

    fn message(bytes: &[u8]) -> String {
        parse(bytes).unwrap_err()
    }

    #[test]
    fn reads_what_numpy_writes() {
        let doubles: Vec<u8> = [1.0f64, -2.5].iter().flat_map(|x| x.to_le_bytes()).collect();
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }";
        assert_eq!(numbers(&file(header, &doubles)), (vec![2], vec![1.0, -2.5]));
        let header = "{'descr': '>i2', 'fortran_order': False, 'shape': (1, 2), }";
        assert_eq!(numbers(&file(header, &[1, 0, 255, 255])), (vec![1, 2], vec![256.0, -1.0]));
        let header = "{'descr': '|b1', 'fortran_order': False, 'shape': (), }";
        assert_eq!(numbers(&file(header, &[1])), (vec![], vec![1.0]));
        // [[0, 1, 2], [3, 4, 5]] column by column.
        let header = "{'descr': '|u1', 'fortran_order': True, 'shape': (2, 3), }";
        assert_eq!(numbers(&file(header, &[0, 3, 1, 4, 2, 5])), (vec![2, 3], vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
    }

    #[test]
    fn headers_are_as_numpy_lays_them_out() {
        let mut bytes = Vec::new();
        write_header(&mut bytes, "<f8", &[3]).unwrap();
        let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }";
        assert_eq!(bytes, file(text, &[]));
        for shape in [&[][..], &[7, 16], &[2, 3, 3]] {
            let mut bytes = Vec::new();
            write_header(&mut bytes, "|u1", shape).unwrap();
            assert_eq!(bytes.len() % 64, 0);
            bytes.resize(bytes.len() + shape.iter().product::<usize>(), 7);
            assert_eq!(numbers(&bytes).0, shape);
        }
    }

    #[test]
    fn bad_files_are_refused_in_words() {
        let good = file("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }", &[0; 16]);
        for length in 0..good.len() {
            message(&good[..length]);
        }
        assert!(message(&good[..140]).contains("do not fill shape [2]"));
        assert!(message(b"PK\x03\x04 not an array").contains("not a NumPy array file"));
        let odd = |descr: &str, shape: &str| {
            message(&file(&format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"), &[]))
        };
        assert!(odd("'<c16'", "(0,)").contains("<c16"));
        assert!(odd("'|O'", "(0,)").contains("|O"));
        assert!(odd("[('x', '<f8')]", "(0,)").contains("records"));
        assert!(odd("'<f8'", "(-1,)").contains("not a NumPy"));
        assert!(odd("'<f8'", "(4294967296, 4294967296, 4294967296)").contains("do not fill"));
        assert!(odd("'<U99999999999999999999'", "()").contains("wanted"));
        assert!(odd("'é'", "()").contains("wanted"));
    }
}
