//! Tests of the command as a user runs it. They form one program, since linking each test separately takes long.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod bad_input;
mod bench_paper;
mod choosing;
mod common;
mod convert;
mod doctor;
mod frames;
mod in_process;
mod info;
#[cfg(feature = "zenoh")]
mod live_pictures;
mod normals;
mod outputs;
mod real_files;
mod render;
mod streams;
mod texts;
#[cfg(feature = "http")]
mod trees;
mod usage;
