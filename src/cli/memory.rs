//! Freed memory goes back to the system.

/// Buffers of this many bytes and more are given back as soon as they are freed. What a receiver needs is mostly smaller, and kept
/// from one to the next.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED: std::ffi::c_int = 1 << 18;

/// Keeps the GNU C library from raising the size from which on it returns freed buffers, up to 32 MiB, whenever it returns one: of
/// what is built and dropped on the way to a tree over two million triangles it would keep some 50 MB.
pub fn return_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: sets a parameter of the allocator, which may be done at any time; a parameter that it refuses changes nothing.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, RETURNED);
    }
}
