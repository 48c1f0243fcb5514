//! Memory whose lack is an error that the caller handles.

use std::cell::Cell;

thread_local! {
    static MAY_FAIL: Cell<bool> = const { Cell::new(false) };
}

/// Runs `reserve`, such as [`Vec::try_reserve`], whose caller goes on if there is not enough memory.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{may_fail, reserving};
///
/// let mut bytes = Vec::<u8>::new();
/// assert!(reserving(|| bytes.try_reserve(usize::MAX / 4)).is_err());
/// assert!(reserving(may_fail) && !may_fail());
/// ```
pub fn reserving<T>(reserve: impl FnOnce() -> T) -> T {
    let outer = MAY_FAIL.replace(true);
    let reserved = reserve();
    MAY_FAIL.set(outer);
    reserved
}

/// Whether this thread is [`reserving`] memory. A program's allocator may end the program where an allocation fails,
/// unless this is true.
#[must_use]
pub fn may_fail() -> bool {
    MAY_FAIL.get()
}
