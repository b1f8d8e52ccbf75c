//! Counts the bytes that each thread allocates, so that a test can say how much work a job was without a
//! clock.
#![allow(unsafe_code)] // `GlobalAlloc` is an unsafe trait; this is test code, and it only counts

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static BYTES: Cell<u64> = const { Cell::new(0) };
}

/// Bytes that the current thread has allocated since it began, freed ones included.
pub fn of_this_thread_bytes() -> u64 {
    BYTES.get()
}

fn count(bytes: usize) {
    // A thread that ends may free and allocate after its locals are gone.
    let _ = BYTES.try_with(|total| total.set(total.get() + bytes as u64));
}

struct Counting;

// SAFETY: every call goes to the system's allocator as it is; the counter is a thread-local
// number without a destructor, so counting never allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count(new_size.saturating_sub(layout.size()));
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;
