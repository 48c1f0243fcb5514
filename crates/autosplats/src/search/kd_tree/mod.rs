//! The kd-tree engine.
pub(crate) mod gpu;
