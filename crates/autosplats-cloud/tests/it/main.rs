//! The tests of the public interface, in one program, since every program is linked with all dependencies.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod common;
mod merge;
mod sampling;
mod thin;
