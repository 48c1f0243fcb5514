//! The native half of the Python package `autosplats`: arrays to clouds, pictures to arrays, and a process that stays
//! its owner's. The package's Python files check and describe what callers give; this library is private to them.
//!
//! All long work leaves the interpreter: `wait::run` computes in threads of `pool` while the caller waits for
//! signals. Clouds and pictures are immutable; arrays show their memory without a copy.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod camera;
mod cloud;
mod command;
mod convert;
mod errors;
mod normals;
mod picture;
mod play;
mod pool;
mod read;
mod render;
mod tree;
mod view;
mod wait;

/// Functions and classes that the package's Python files call.
#[pyo3::pymodule(gil_used = false)]
mod _core {
    #[pymodule_export]
    use crate::camera::{axes_of, check_camera, fit_camera, project, unproject};
    #[pymodule_export]
    use crate::cloud::Cloud;
    #[pymodule_export]
    use crate::command::{command, main};
    #[pymodule_export]
    use crate::normals::estimate_normals;
    #[pymodule_export]
    use crate::picture::{Frame, encode_picture};
    #[pymodule_export]
    use crate::play::Recording;
    #[pymodule_export]
    use crate::pool::{num_threads, set_num_threads};
    #[pymodule_export]
    use crate::read::{read_bytes, read_source, write};
    #[pymodule_export]
    use crate::render::{Renderer, devices};
    #[pymodule_export]
    use crate::tree::{outline, tree_nodes};

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
