/// How many edges, leaves or faces ahead memory is asked for.
pub(crate) const AHEAD: usize = 16;

/// Asks the processor to bring a value into its caches, where it can be asked.
#[inline(always)]
pub fn prefetch<T>(value: &T) {
    /// Bytes of a cache line.
    const LINE: usize = 64;
    #[cfg(target_arch = "x86_64")]
    for offset in (0..size_of::<T>()).step_by(LINE) {
        let line = std::ptr::from_ref(value).cast::<i8>().wrapping_add(offset);
        // SAFETY: a hint, which neither reads nor faults; the instruction belongs to the baseline of the architecture.
        unsafe { std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(line) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (value, LINE);
}

/// Goes through `items` and calls `fetch` with the one `distance` ahead, to prefetch what will be needed for it: searches in large
/// meshes wait for memory most of the time.
#[inline(always)]
pub(crate) fn ahead<T>(items: &[T], distance: usize, fetch: impl Fn(&T)) -> impl Iterator<Item = &T> {
    items.iter().enumerate().map(move |(i, item)| {
        if let Some(later) = items.get(i + distance) {
            fetch(later);
        }
        item
    })
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    #[test]
    fn everything_passes_and_what_lies_ahead_is_fetched_before() {
        let fetched = RefCell::new(Vec::new());
        let items = [3, 1, 4, 1, 5];
        let passed: Vec<i32> = ahead(&items, 2, |&item| fetched.borrow_mut().push(item)).copied().collect();
        assert_eq!(passed, items);
        assert_eq!(*fetched.borrow(), items[2..]);
        prefetch(&items);
    }
}
