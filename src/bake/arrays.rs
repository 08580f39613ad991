use crate::{Error, Result};

/// A named block of numbers in C order: the last axis varies fastest, row `i` belongs to receiver `i`.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// What the numbers are, e.g. `transfer_sh`.
    pub name: String,
    /// Length of every axis; empty for a single number.
    pub shape: Vec<usize>,
    /// The numbers; as many as the product of `shape`.
    pub data: Vec<f64>,
}

impl Array {
    /// Puts the three parts together; [`Arrays::push`] checks that they fit.
    pub fn new(name: impl Into<String>, shape: impl Into<Vec<usize>>, data: Vec<f64>) -> Self {
        Self { name: name.into(), shape: shape.into(), data }
    }

    /// Position of `data[flat]` along every axis.
    pub fn index(&self, flat: usize) -> Vec<usize> {
        let mut rest = flat;
        let mut index: Vec<usize> = self
            .shape
            .iter()
            .rev()
            .map(|&length| {
                let i = rest % length;
                rest /= length;
                i
            })
            .collect();
        index.reverse();
        index
    }

    /// Fails unless the shape is filled exactly and every number is finite.
    fn check(&self) -> Result<()> {
        let (name, shape) = (&self.name, &self.shape);
        let size = shape.iter().try_fold(1usize, |product, &length| product.checked_mul(length));
        if size != Some(self.data.len()) {
            return Err(Error::input(format!("array {name}: {} numbers do not fill shape {shape:?}", self.data.len())));
        }
        match self.data.iter().position(|x| !x.is_finite()) {
            Some(flat) => {
                let index = self.index(flat);
                Err(Error::input(format!(
                    "array {name}: {} at {index:?}; only finite numbers are kept",
                    self.data[flat]
                )))
            }
            None => Ok(()),
        }
    }
}

/// The named arrays of one result, in the order in which they were added.
///
/// Whatever is in here is fit to be written: names are unique, shapes are filled, no number is infinite or NaN.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrays(Vec<Array>);

impl Arrays {
    /// No arrays.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds `array`.
    ///
    /// # Errors
    /// When the name is empty or taken, the shape is not filled exactly, or a number is infinite or NaN.
    pub fn push(&mut self, array: Array) -> Result<()> {
        if array.name.is_empty() {
            return Err(Error::input("an array needs a name"));
        }
        if self.get(&array.name).is_some() {
            return Err(Error::input(format!("array {}: two arrays have this name", array.name)));
        }
        array.check()?;
        self.0.push(array);
        Ok(())
    }

    /// The array called `name`.
    pub fn get(&self, name: &str) -> Option<&Array> {
        self.0.iter().find(|array| array.name == name)
    }

    /// Takes the array called `name` out.
    pub fn remove(&mut self, name: &str) -> Option<Array> {
        let at = self.0.iter().position(|array| array.name == name)?;
        Some(self.0.remove(at))
    }

    /// The arrays in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Array> {
        self.0.iter()
    }

    /// Number of arrays.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<'a> IntoIterator for &'a Arrays {
    type Item = &'a Array;
    type IntoIter = std::slice::Iter<'a, Array>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl IntoIterator for Arrays {
    type Item = Array;
    type IntoIter = std::vec::IntoIter<Array>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(array: Array) -> String {
        Arrays::new().push(array).unwrap_err().to_string()
    }

    #[test]
    fn keeps_order_and_finds_by_name() {
        let mut arrays = Arrays::new();
        arrays.push(Array::new("b", [2], vec![1.0, 2.0])).unwrap();
        arrays.push(Array::new("a", [], vec![3.0])).unwrap();
        assert_eq!(arrays.iter().map(|array| array.name.as_str()).collect::<Vec<_>>(), ["b", "a"]);
        assert_eq!(arrays.get("a").unwrap().data, [3.0]);
        assert!(arrays.get("c").is_none());
        assert_eq!(arrays.remove("b").unwrap().shape, [2]);
        assert_eq!(arrays.len(), 1);
    }

    #[test]
    fn refuses_what_cannot_be_written() {
        assert_eq!(message(Array::new("a", [2, 2], vec![0.0; 3])), "array a: 3 numbers do not fill shape [2, 2]");
        assert_eq!(
            message(Array::new("a", [2, 3], vec![0.0, 0.0, 0.0, 0.0, 0.0, f64::NAN])),
            "array a: NaN at [1, 2]; only finite numbers are kept"
        );
        assert!(message(Array::new("a", [1], vec![f64::INFINITY])).contains("inf at [0]"));
        assert!(message(Array::new("a", [usize::MAX, 2], vec![])).contains("do not fill"));
        assert!(message(Array::new("", [0], vec![])).contains("needs a name"));
        let mut arrays = Arrays::new();
        arrays.push(Array::new("a", [0], vec![])).unwrap();
        assert!(arrays.push(Array::new("a", [0], vec![])).unwrap_err().to_string().contains("two arrays"));
    }
}
