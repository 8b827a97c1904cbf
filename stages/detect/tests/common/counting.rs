//! A counting allocator, for tests of allocations per sample.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tauscope_bus::{Detection, Emit, LinkError};

/// The system's allocator with a counter per thread.
pub struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

/// Returns the number of allocations of this thread so far.
pub fn allocations() -> usize {
    ALLOCATIONS.with(Cell::get)
}

fn count() {
    ALLOCATIONS.with(|allocations| allocations.set(allocations.get() + 1));
}

// SAFETY: every call is passed unchanged to the system's allocator.
#[allow(
    unsafe_code,
    reason = "a global allocator is unsafe by its nature; test only"
)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Discards the detections of a stage.
pub struct Nowhere;

impl Emit<Detection> for Nowhere {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        write(&mut Detection::default());
        Ok(())
    }
}
