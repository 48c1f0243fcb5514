//! The tests of the public interface, in one program, since every program is linked with all dependencies.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod animation;
mod common;
mod e57;
mod formats;
mod gltf;
mod hostile;
mod interop;
mod las;
mod las_writing;
mod latest;
mod live;
mod losses;
mod merge;
mod meshes;
mod player;
mod point_cloud2;
mod progress;
mod ptx;
mod real_files;
mod recording;
#[cfg(feature = "zenoh")]
mod remote;
mod sampling;
mod scanner;
mod sensors;
mod text;
mod thin;
