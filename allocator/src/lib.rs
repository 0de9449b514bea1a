//! [`OrEnd`]: an allocator that ends the program its own way if memory is refused.
//!
//! The standard library aborts if an allocation fails, and its hook (`std::alloc::set_alloc_error_hook`) is not stable.
//! This is a crate of its own because implementing an allocator needs `unsafe`, which the program has nowhere else
//! but in its folder for Vulkan.

#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout};

/// The allocator `A`, except that `end` is called if it refuses memory. An allocation never fails, so `try_reserve` and
/// its like never return an error.
#[derive(Debug)]
pub struct OrEnd<A> {
    allocator: A,
    end: fn(usize) -> !,
}

impl<A> OrEnd<A> {
    /// Wraps an allocator. `end` receives the number of bytes that were refused. It may be called on several threads at
    /// once, and again on the same thread if it allocates.
    pub const fn new(allocator: A, end: fn(usize) -> !) -> OrEnd<A> {
        OrEnd { allocator, end }
    }

    fn checked(&self, block: *mut u8, bytes: usize) -> *mut u8 {
        if block.is_null() {
            (self.end)(bytes);
        }
        block
    }
}

// SAFETY: All calls are passed on unchanged, with the contracts of the caller, and what they return is returned. `end`
// does not return and so cannot break a contract; it must not unwind, and a function that ends the program does not.
unsafe impl<A: GlobalAlloc> GlobalAlloc for OrEnd<A> {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: The caller keeps the contract.
        self.checked(unsafe { self.allocator.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: The caller keeps the contract.
        self.checked(unsafe { self.allocator.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: The caller keeps the contract.
        self.checked(unsafe { self.allocator.realloc(block, layout, size) }, size)
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: The caller keeps the contract; the block is one of the wrapped allocator.
        unsafe { self.allocator.dealloc(block, layout) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::alloc::System;

    /// Refuses blocks over 100 bytes.
    struct Small;

    // SAFETY: Passes calls on to the system's allocator, or returns null, which is allowed.
    unsafe impl GlobalAlloc for Small {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            // SAFETY: The caller keeps the contract.
            if layout.size() > 100 { std::ptr::null_mut() } else { unsafe { System.alloc(layout) } }
        }

        unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
            // SAFETY: The caller keeps the contract.
            unsafe { System.dealloc(block, layout) }
        }
    }

    fn end(bytes: usize) -> ! {
        panic!("{bytes} bytes refused")
    }

    #[test]
    fn a_refused_block_ends_in_the_function_and_others_are_served() {
        let allocator = OrEnd::new(Small, end);
        let small = Layout::new::<[u64; 4]>();
        // SAFETY: The layouts are not empty, and each block is freed or grown with the layout it has.
        let refused = std::panic::catch_unwind(|| unsafe {
            let block = allocator.alloc_zeroed(small);
            assert_eq!(block.cast::<u64>().read(), 0);
            let block = allocator.realloc(block, small, 64);
            allocator.dealloc(block, Layout::from_size_align(64, 8).expect("a layout"));
            allocator.alloc(Layout::new::<[u64; 40]>())
        });
        let message = refused.expect_err("refused");
        assert_eq!(message.downcast_ref::<String>().map(String::as_str), Some("320 bytes refused"));
    }
}
