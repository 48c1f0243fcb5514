//! The tests of the public interface, in one program, since every program is linked with all dependencies.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod animation;
mod common;
mod first_points;
mod interop;
mod latest;
mod live;
mod player;
mod point_cloud2;
mod recording;
#[cfg(feature = "zenoh")]
mod remote;
mod scanner;
