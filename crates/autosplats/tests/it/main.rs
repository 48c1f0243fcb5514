//! The tests of the public interface, in one program: each further one is linked for itself, with all that the crate
//! stands on.

use std::sync::{LazyLock, Mutex, PoisonError};

use autosplats::{Backend, Error, Renderer};

mod backends;
mod extremes;
mod first_view;
mod kd_tree;
mod near;
mod pools;
mod properties;
mod ranges;
mod sensors;
mod smoothing;
mod surfels;
#[path = "../../src/test_clouds.rs"]
mod test_clouds;

/// A renderer on the GPU, which may be any that is there, also one that is a program on the processor. The device is
/// opened and its passes are compiled once for all tests. Without a device a test says that it checks nothing; where
/// `CI` is set, it fails.
fn gpu() -> Option<Renderer> {
    static FIRST: LazyLock<Mutex<Result<Renderer, Error>>> =
        LazyLock::new(|| Mutex::new(Renderer::with_backend(Backend::Gpu)));
    match &*FIRST.lock().unwrap_or_else(PoisonError::into_inner) {
        Ok(first) => Some(first.another().expect("a second renderer")),
        Err(error) => {
            assert!(std::env::var_os("CI").is_none(), "{error}");
            eprintln!("nothing checked on a GPU: {error}");
            None
        }
    }
}

/// A renderer on the CPU, and one on the GPU as far as there is one.
fn renderers() -> Vec<Renderer> {
    [Some(Renderer::new()), gpu()].into_iter().flatten().collect()
}
