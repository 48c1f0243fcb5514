//! Checks of all passes that need no device.

use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};

use crate::gpu::{INT64_ATOMICS, INT64_IN_LANES, PassSource, link};

mod dispatches;
mod layouts;
mod past;

/// Whether a pass is a render pass: all of them blend.
fn is_raster(pass: &PassSource) -> bool {
    pass.needs.contains(wgpu::Features::FLOAT32_BLENDABLE)
}

fn passes() -> impl Iterator<Item = &'static PassSource> {
    let stages = [
        crate::project::gpu::PASSES,
        crate::search::screen_grid::gpu::PASSES,
        crate::search::splat_communication::gpu::PASSES,
        crate::search::splat_communication::compute::PASSES,
        crate::search::splat_communication::raster::PASSES,
        crate::search::kd_tree::gpu::PASSES,
        crate::fit::gpu::PASSES,
        crate::fit::orient::gpu::PASSES,
        crate::adapt::gpu::PASSES,
        crate::splat::gpu::PASSES,
        crate::splat::over_time::gpu::PASSES,
        crate::shade::gpu::PASSES,
        crate::shade::over_time::gpu::PASSES,
    ];
    stages.into_iter().flatten()
}

/// Naga's names of the features that a pass declares. Only 64-bit atomics and subgroups are beyond WebGPU's core.
fn capabilities(pass: &PassSource) -> Capabilities {
    let atomics = Capabilities::SHADER_INT64 | Capabilities::SHADER_INT64_ATOMIC_MIN_MAX;
    if pass.needs.contains(INT64_IN_LANES) {
        atomics | Capabilities::SHADER_INT64_ATOMIC_ALL_OPS | Capabilities::SUBGROUP
    } else if pass.needs.contains(INT64_ATOMICS) {
        atomics
    } else {
        Capabilities::empty()
    }
}

#[test]
fn passes_are_valid_with_what_they_declare() {
    for pass in passes() {
        let module = pass.module();
        let validated = Validator::new(ValidationFlags::all(), capabilities(pass)).validate(&module);
        assert!(validated.is_ok(), "{}: {:?}", pass.path, validated.err());
        let entries: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        let name = pass.entry_point();
        if is_raster(pass) {
            let stages = ["vertex", "fragment"].map(|stage| format!("{name}_{stage}"));
            assert_eq!(entries, stages, "{}: an entry point for each stage, named after the file", pass.path);
        } else {
            assert_eq!(entries, [name], "{}: one entry point, named after the file", pass.path);
        }
    }
}

#[test]
fn what_a_pass_does_not_declare_is_refused() {
    let pass = PassSource {
        needs: wgpu::Features::empty(),
        ..*passes().find(|pass| pass.needs == INT64_ATOMICS).expect("one")
    };
    let validated = Validator::new(ValidationFlags::all(), capabilities(&pass)).validate(&pass.module());
    assert!(validated.is_err(), "64-bit atomics are not core");
}

#[test]
fn every_file_is_imported_and_every_constant_named() {
    let linked: Vec<_> = passes().map(|pass| link(pass.source, pass.library)).collect();
    let files = || passes().flat_map(|pass| pass.library.files.iter().copied().flatten());
    let sources = || files().map(|(_, source)| *source).chain(passes().map(|pass| pass.source));
    for (name, _) in files() {
        let import = format!("#import {name}");
        assert!(sources().any(|source| source.lines().any(|line| line == import)), "no file has {import}");
    }
    let constants = passes().flat_map(|pass| pass.library.constants.iter().copied().flatten());
    // Of an enum, passes may name some variants.
    for constant in constants.filter(|constant| constant.name == constant.name.to_uppercase()) {
        let declared = constant.in_wgsl();
        assert!(linked.iter().any(|linked| linked.contains(&declared)), "no pass names {declared}");
    }
}
