//! Shared by the tests of sources: recordings, messages and Zenoh's peers.

#![allow(dead_code, reason = "not every test uses all of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

#[path = "../../../../autosplats-formats/tests/it/common/mod.rs"]
mod files;
pub(crate) mod recording;
pub(crate) mod ros;
#[cfg(feature = "zenoh")]
pub(crate) mod zenoh_peer;

pub(crate) use self::files::*;
