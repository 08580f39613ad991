//! Freed memory goes back to the system.

/// Buffers of this many bytes and more are given back as soon as they are freed. What a run of few receivers needs is smaller and kept:
/// with 256 KiB, runs of 512 receivers in a building were a fifth slower, for every one of them had its memory mapped anew.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED: std::ffi::c_int = 1 << 22;

/// Keeps the GNU C library from raising the size from which on it returns freed buffers, up to 32 MiB, whenever it returns one: of
/// what is built and dropped on the way to a tree over two million triangles it would keep some 40 MB.
pub fn return_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: sets a parameter of the allocator, which may be done at any time; a parameter that it refuses changes nothing.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, RETURNED);
    }
}
