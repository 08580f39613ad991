use crate::prefetch::prefetch;

/// Local numbers 0, 1, 2 .. for those of many things that a search meets: a sparse set (Briggs and Torczon, 1993).
///
/// The map from global to local numbers is never cleared: an entry counts only if the thing of that local number is the one asked
/// for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Numbering {
    /// Only the first `count` count.
    globals: Vec<u32>,
    count: usize,
    /// Smaller local numbers are not given again.
    first: usize,
    locals: Vec<u32>,
}

impl Numbering {
    /// Forgets all local numbers, and makes room for global ones below `bound`.
    pub(crate) fn clear(&mut self, bound: usize) {
        (self.count, self.first) = (0, 0);
        if self.locals.len() < bound {
            // Zeroed by the system, page by page where a search comes, which may be to little of a large mesh.
            self.locals = vec![0; bound];
        }
    }

    /// From now on everything gets a new local number, as if there were none yet.
    pub(crate) fn begin_part(&mut self) {
        self.first = self.count;
    }

    /// Makes room for `more` local numbers.
    pub(crate) fn reserve(&mut self, more: usize) {
        if self.globals.len() < self.count + more {
            self.globals.resize(self.count + more, 0);
        }
    }

    /// Local number of `global`, the next free one if it has none yet; there must be room for one.
    ///
    /// Without a branch on whether there is one, which nobody could predict.
    #[inline(always)]
    pub(crate) fn insert(&mut self, global: u32) -> u32 {
        let slot = &mut self.locals[global as usize];
        let old = *slot as usize;
        let known = (old >= self.first) & (old < self.count) & (self.globals[old] == global);
        self.globals[self.count] = global;
        let local = if known { old } else { self.count };
        *slot = local as u32;
        self.count += usize::from(!known);
        local as u32
    }

    /// Prepares for [`Numbering::insert`].
    #[inline(always)]
    pub(crate) fn prefetch(&self, global: u32) {
        prefetch(&self.locals[global as usize]);
    }

    /// Local number of `global`, if it has one, the last if it has several.
    pub(crate) fn get(&self, global: u32) -> Option<u32> {
        let &local = self.locals.get(global as usize)?;
        (self.globals().get(local as usize) == Some(&global)).then_some(local)
    }

    /// Global numbers in the order of the local ones.
    pub(crate) fn globals(&self) -> &[u32] {
        &self.globals[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_given_in_order_and_forgotten_when_cleared() {
        let mut numbering = Numbering::default();
        numbering.clear(10);
        numbering.reserve(5);
        assert_eq!([7, 3, 7, 9, 3].map(|global| numbering.insert(global)), [0, 1, 0, 2, 1]);
        assert_eq!(numbering.globals(), [7, 3, 9]);
        numbering.begin_part();
        numbering.reserve(5);
        assert_eq!([9, 1, 9].map(|global| numbering.insert(global)), [3, 4, 3]);
        assert_eq!([7, 9].map(|global| numbering.get(global)), [Some(0), Some(3)]);
        numbering.clear(10);
        assert_eq!((numbering.get(7), numbering.get(99)), (None, None));
        assert_eq!(numbering.insert(3), 0);
        assert_eq!((numbering.get(3), numbering.get(7)), (Some(0), None));
    }
}
