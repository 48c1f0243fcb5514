//! Buffers that are used again from frame to frame.
//!
//! New memory is left untouched. The system hands out a page when it is first written: so the threads that fill a
//! buffer share that work, and what is not written costs nothing.

use std::alloc::{Layout, alloc_zeroed, handle_alloc_error};
use std::sync::atomic::{AtomicU16, AtomicU32, AtomicU64};

use bytemuck::Zeroable;

/// Sizes a buffer for a frame. Values added are zero; those that were there may stay.
pub(crate) fn fit<T: Zeroable>(buffer: &mut Vec<T>, len: usize) {
    renew(buffer, len, bytemuck::zeroed_vec);
    buffer.resize_with(len, T::zeroed);
}

/// [`fit`] for atomic numbers.
pub(crate) fn fit_atomic<A: Atomic>(buffer: &mut Vec<A>, len: usize) {
    renew(buffer, len, atomic_zeros);
    buffer.resize_with(len, A::default);
}

/// Replaces a buffer that is too small, with room for larger frames, which costs nothing until they come.
fn renew<T>(buffer: &mut Vec<T>, len: usize, zeros: impl Fn(usize) -> Vec<T>) {
    if buffer.capacity() < len {
        // Gone before there is another.
        *buffer = Vec::new();
        *buffer = zeros(len + len / 4);
    }
}

/// An atomic number whose zero is zero bytes.
pub(crate) trait Atomic: Default {}

impl Atomic for AtomicU16 {}
impl Atomic for AtomicU32 {}
impl Atomic for AtomicU64 {}

/// `len` zeros, above 0.
#[allow(unsafe_code, reason = "what makes atomic numbers otherwise writes each of them")]
fn atomic_zeros<A: Atomic>(len: usize) -> Vec<A> {
    let layout = Layout::array::<A>(len).expect("as many as pixels");
    // SAFETY: neither a number nor their count is of no size, zero bytes are numbers, and vectors have this layout.
    unsafe {
        let memory = alloc_zeroed(layout);
        if memory.is_null() {
            handle_alloc_error(layout);
        }
        Vec::from_raw_parts(memory.cast(), len, len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_grow_and_shrink() {
        let (mut plain, mut atomic): (Vec<f32>, Vec<AtomicU64>) = Default::default();
        for len in [0, 3, 1000, 10, 1200, 1300, 0, 7] {
            let before = plain.len();
            fit(&mut plain, len);
            fit_atomic(&mut atomic, len);
            assert_eq!([plain.len(), atomic.len()], [len; 2], "lengths after {before}");
            assert!(plain[before.min(len)..].iter().all(|&number| number == 0.0), "{len} plain numbers after {before}");
            let added = atomic[before.min(len)..].iter_mut().all(|number| *number.get_mut() == 0);
            assert!(added, "{len} atomic numbers after {before}");
            plain.fill(1.0);
            atomic.iter_mut().for_each(|number| *number.get_mut() = 1);
        }
    }
}
