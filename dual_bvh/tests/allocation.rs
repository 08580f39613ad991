//! Searches reuse their memory.

#[path = "../benches/meshes/mod.rs"]
mod meshes;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use dual_bvh::{Candidates, Contours, Tile};
use glam::DVec3;

/// The system's allocator, with a count of what this thread asks for.
struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: as promised by the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as promised by the caller.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn nothing_is_allocated_once_the_memory_has_grown() {
    let mut mesh = meshes::sphere_over_plane(3);
    mesh.add(&meshes::foliage(300), glam::Vec3::Z);
    mesh.triangles.push([100, 101, 7]);
    mesh.triangles.push([100, 101, 9]);
    let tree = mesh.tree();
    let (mut candidates, mut contours) = (Candidates::default(), Contours::default());
    let mut round = || {
        let before = COUNT.get();
        for i in 0..20 {
            let p = DVec3::new(0.1 * f64::from(i), 0.3, 0.2);
            let excluded: &[u32] = if i % 3 == 0 { &[3, 40, 41] } else { &[] };
            let normal = (i % 2 == 0).then_some(DVec3::Z);
            let tile = Tile::new([(p, normal), (p + 0.1, normal)].into_iter()).with_faces(excluded);
            tree.search(&tile, &mut candidates);
            candidates.contours(p, excluded, &mut contours);
        }
        COUNT.get() - before
    };
    assert!(round() > 0, "the count counts");
    assert_eq!(round(), 0);
}
