//! The command as a user runs it, in one program of tests: each further one is linked for itself.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod bad_input;
mod bench_paper;
mod common;
mod convert;
mod doctor;
mod frames;
mod info;
#[cfg(feature = "zenoh")]
mod live_pictures;
mod normals;
mod real_files;
mod render;
mod streams;
mod usage;
