//! Links WGSL: `#import name` includes `shared/name.wgsl` once. See docs/decisions/0018-wgsl-linker.md.

/// Shared files by name. A file may import only files listed before it.
const SHARED: &[(&str, &str)] = &[
    ("frame", include_str!("../shared/frame.wgsl")),
    ("picture", include_str!("../shared/picture.wgsl")),
    ("gaps", include_str!("../shared/gaps.wgsl")),
    ("groups", include_str!("../shared/groups.wgsl")),
    ("put_work", include_str!("../shared/put_work.wgsl")),
    ("counters", include_str!("../shared/counters.wgsl")),
    ("rank", include_str!("../shared/rank.wgsl")),
    ("half", include_str!("../shared/half.wgsl")),
    ("fitted", include_str!("../shared/fitted.wgsl")),
    ("project_point", include_str!("../shared/project_point.wgsl")),
    ("count_dropped", include_str!("../shared/count_dropped.wgsl")),
    ("add_sixteenth", include_str!("../shared/add_sixteenth.wgsl")),
    ("divide", include_str!("../shared/divide.wgsl")),
    ("keys", include_str!("../shared/keys.wgsl")),
    ("density", include_str!("../shared/density.wgsl")),
    ("cell_order", include_str!("../shared/cell_order.wgsl")),
    ("screen", include_str!("../shared/screen.wgsl")),
    ("matters", include_str!("../shared/matters.wgsl")),
    ("culled", include_str!("../shared/culled.wgsl")),
    ("depth_noise", include_str!("../shared/depth_noise.wgsl")),
    ("surfel", include_str!("../shared/surfel.wgsl")),
    ("eigen", include_str!("../shared/eigen.wgsl")),
    ("orthonormal", include_str!("../shared/orthonormal.wgsl")),
    ("levels", include_str!("../shared/levels.wgsl")),
    ("clusters", include_str!("../shared/clusters.wgsl")),
    ("filling", include_str!("../shared/filling.wgsl")),
    ("quadric", include_str!("../shared/quadric.wgsl")),
    ("alone", include_str!("../shared/alone.wgsl")),
    ("together", include_str!("../shared/together.wgsl")),
    ("base_radius", include_str!("../shared/base_radius.wgsl")),
    ("noise", include_str!("../shared/noise.wgsl")),
    ("calls", include_str!("../shared/calls.wgsl")),
    ("choose", include_str!("../shared/choose.wgsl")),
    ("through", include_str!("../shared/through.wgsl")),
    ("rows", include_str!("../shared/rows.wgsl")),
    ("shrink", include_str!("../shared/shrink.wgsl")),
    ("sheet", include_str!("../shared/sheet.wgsl")),
    ("scatters", include_str!("../shared/scatters.wgsl")),
    ("quantiles", include_str!("../shared/quantiles.wgsl")),
    ("window", include_str!("../shared/window.wgsl")),
    ("window_points", include_str!("../shared/window_points.wgsl")),
    ("communication", include_str!("../shared/communication.wgsl")),
    ("splat_box", include_str!("../shared/splat_box.wgsl")),
    ("radius_search", include_str!("../shared/radius_search.wgsl")),
    ("answer", include_str!("../shared/answer.wgsl")),
    ("nearest", include_str!("../shared/nearest.wgsl")),
    ("search_task", include_str!("../shared/search_task.wgsl")),
    ("reproject", include_str!("../shared/reproject.wgsl")),
    ("past", include_str!("../shared/past.wgsl")),
    ("layers", include_str!("../shared/layers.wgsl")),
    ("blocks", include_str!("../shared/blocks.wgsl")),
    ("blurred", include_str!("../shared/blurred.wgsl")),
    ("range_keys", include_str!("../shared/range_keys.wgsl")),
    ("kd_tree", include_str!("../shared/kd_tree.wgsl")),
    ("kd_build", include_str!("../shared/kd_build.wgsl")),
    ("kd_work", include_str!("../shared/kd_work.wgsl")),
    ("kd_chunk", include_str!("../shared/kd_chunk.wgsl")),
    ("srgb", include_str!("../shared/srgb.wgsl")),
    ("shading", include_str!("../shared/shading.wgsl")),
    ("depth_map", include_str!("../shared/depth_map.wgsl")),
    ("hidden", include_str!("../shared/hidden.wgsl")),
    ("recovered", include_str!("../shared/recovered.wgsl")),
    ("splat", include_str!("../shared/splat.wgsl")),
    ("fragment", include_str!("../shared/fragment.wgsl")),
    ("redraw", include_str!("../shared/redraw.wgsl")),
    ("marked", include_str!("../shared/marked.wgsl")),
    ("moved", include_str!("../shared/moved.wgsl")),
    ("erased", include_str!("../shared/erased.wgsl")),
    ("patch", include_str!("../shared/patch.wgsl")),
];

/// The source of a pass with all its imports.
///
/// # Panics
/// If a name is unknown. The tests link every pass.
pub(crate) fn link(source: &str) -> String {
    let mut wanted = vec![false; SHARED.len()];
    want(source, &mut wanted);
    for at in (0..SHARED.len()).rev() {
        if wanted[at] {
            want(SHARED[at].1, &mut wanted);
        }
    }
    let shared = SHARED.iter().zip(wanted).filter(|&(_, wanted)| wanted).map(|((_, source), _)| *source);
    shared.chain([source]).map(without_imports).collect()
}

fn imports(source: &str) -> impl Iterator<Item = &str> {
    source.lines().filter_map(|line| line.strip_prefix("#import "))
}

fn want(source: &str, wanted: &mut [bool]) {
    for name in imports(source) {
        let at = SHARED.iter().position(|&(known, _)| known == name);
        wanted[at.unwrap_or_else(|| panic!("no shared/{name}.wgsl"))] = true;
    }
}

/// Keeps line numbers, so that messages about a file without imports name the right line.
fn without_imports(source: &str) -> String {
    source.lines().map(|line| if line.starts_with("#import ") { "\n".into() } else { format!("{line}\n") }).collect()
}
