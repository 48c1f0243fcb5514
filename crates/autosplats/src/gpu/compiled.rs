//! The compute passes that a device has compiled.

use std::collections::HashMap;

/// The compute passes that a device has compiled. Constants are settings with few values, so their number is bounded.
pub(super) type CompiledPasses = HashMap<PassKey, Pass>;

/// What a pass is compiled from: its code before linking, and the values of its overrides, as bits.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct PassKey {
    pub(super) path: &'static str,
    pub(super) source: &'static str,
    pub(super) constants: Vec<(String, u64)>,
}

/// A compute pipeline with the layout of its bindings.
#[derive(Clone, Debug)]
pub(crate) struct Pass {
    pub(super) path: &'static str,
    pub(super) label: String,
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) layout: wgpu::BindGroupLayout,
    /// Whether the pass may write each binding.
    pub(super) writes: Vec<bool>,
}
