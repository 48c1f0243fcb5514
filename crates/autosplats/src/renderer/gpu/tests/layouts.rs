//! Structs have the same layouts in Rust and WGSL.

use std::mem::offset_of;

use wgpu::naga::{self, Module, TypeInner};

use super::passes;
use crate::adapt::gpu::Asked;
use crate::adapt::{DepthRun, FrameStatistics, Noise};
use crate::fit::Surfel;
use crate::fit::orient::Sensor;
use crate::gpu::{FrameUniform, PassSource};
use crate::project::gpu::DensityCell;
use crate::project::{ChunkUniform, ScreenPoint};
use crate::search::splat_communication::gpu::Arguments;
use crate::shade::gpu::{ShadePair, ShadeUniform};
use crate::splat::Cover;
use crate::splat::over_time::Fitted;

/// Name, offset and size of a field.
type Field = (String, usize, usize);

/// A struct in Rust: its name in WGSL, its size and its fields.
struct Mirrored {
    name: &'static str,
    size: usize,
    fields: Vec<Field>,
}

fn field_size<S, F>(_: impl Fn(&S) -> &F) -> usize {
    size_of::<F>()
}

macro_rules! mirrored {
    ($name:literal, $rust:ident { $($field:ident),* $(,)? }) => {{
        // Does not compile if a field is missing.
        let $rust { $($field: _,)* } = <$rust as bytemuck::Zeroable>::zeroed();
        let fields = vec![$((
            stringify!($field).to_owned(),
            offset_of!($rust, $field),
            field_size(|mirror: &$rust| &mirror.$field),
        )),*];
        Mirrored { name: $name, size: size_of::<$rust>(), fields }
    }};
}

fn mirrored() -> [Mirrored; 16] {
    [
        mirrored!(
            "Frame",
            FrameUniform {
                view_from_world,
                eye_local,
                focal_px,
                size,
                near,
                perspective,
                k,
                halves,
                grid_culling,
                lenient,
                keep_outliers,
                splat_scale,
                outlier_growth,
                gap_growth,
                first_radius,
                longest,
                frames_averaged,
                same_points,
                picture,
                past_half,
                same_picture,
                past_rotation,
                past_shift,
                past_focal_px,
                dot_px,
                scan_lines,
                compares_density,
                near_cells,
                middle,
                past_middle,
                unstretched,
                eye_parts,
            }
        ),
        mirrored!("Chunk", ChunkUniform { first, len, values, slot_shift, slots }),
        mirrored!(
            "Arguments",
            Arguments {
                points,
                queries,
                clear,
                boxes,
                last_clear,
                last_boxes,
                queries_groups,
                iterations,
                points_groups,
                padding,
            }
        ),
        mirrored!("Cover", Cover { weight, rim, point, scalar }),
        mirrored!("Sensor", Sensor { position, first }),
        mirrored!("DepthRun", DepthRun { position, first, axis, factor, power, padding }),
        mirrored!("Noise", Noise { level, power, most, sure }),
        mirrored!("FrameStatistics", FrameStatistics { noise, k_radius, sheet_level }),
        mirrored!("Asked", Asked { count, k_radii, point }),
        mirrored!("DensityCell", DensityCell { count, nearest }),
        mirrored!("CountedCell", DensityCell { count, nearest }),
        mirrored!("ShadePair", ShadePair { step, inverse_px, part }),
        mirrored!("ScreenPoint", ScreenPoint { position_view, pixel }),
        mirrored!(
            "Surfel",
            Surfel {
                center,
                radius,
                normal,
                k_radius,
                major_axis,
                major_ratio,
                curvature,
                pixel,
                source,
                screen_and_flags
            }
        ),
        mirrored!("Fitted", Fitted { offset, source, normal, frames }),
        mirrored!(
            "ShadeUniform",
            ShadeUniform {
                up,
                darkening,
                given_light,
                range,
                edge_factor,
                edge_offset,
                find_range,
                lighting,
                keep_linear,
                swap_red_blue,
                pitch,
                sample_step,
                samples,
                backgrounds,
                measures,
                value_noise,
                pairs,
            }
        ),
    ]
}

/// Size and fields of a struct.
fn layout(module: &Module, name: &str) -> Option<(usize, Vec<Field>)> {
    module.types.iter().find_map(|(_, ty)| match &ty.inner {
        TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => {
            let field = |member: &naga::StructMember| {
                let size = module.types[member.ty].inner.size(module.to_ctx());
                (member.name.clone().unwrap_or_default(), member.offset as usize, size as usize)
            };
            Some((*span as usize, members.iter().map(field).collect()))
        }
        _ => None,
    })
}

#[test]
fn structs_lie_alike_in_rust_and_wgsl() {
    let modules: Vec<_> = passes().map(PassSource::module).collect();
    for Mirrored { name, size, fields } in mirrored() {
        let found: Vec<_> = modules.iter().filter_map(|module| layout(module, name)).collect();
        assert!(!found.is_empty(), "no pass has a struct {name}");
        for (span, members) in found {
            assert_eq!(members, fields, "{name}: fields in WGSL, and in Rust");
            assert_eq!(span, size, "{name}: size in WGSL, and in Rust");
        }
    }
}

#[test]
fn buffers_have_room_for_structs() {
    use crate::search::splat_communication::compute;
    use crate::search::{kd_tree, screen_grid};
    use crate::{adapt, splat};
    let rooms = [
        (adapt::gpu::PASSES, adapt::gpu::SIZES),
        (compute::PASSES, compute::SIZES),
        (kd_tree::gpu::PASSES, kd_tree::gpu::SIZES),
        (screen_grid::gpu::PASSES, screen_grid::gpu::SIZES),
        (splat::gpu::PASSES, splat::gpu::SIZES),
    ];
    for (passes, sizes) in rooms {
        let modules: Vec<_> = passes.iter().map(PassSource::module).collect();
        for &(name, size) in sizes {
            let spans: Vec<_> =
                modules.iter().filter_map(|module| layout(module, name)).map(|(span, _)| span).collect();
            assert!(
                !spans.is_empty() && spans.iter().all(|&span| span == size),
                "{name}: {spans:?} in WGSL, {size} in Rust"
            );
        }
    }
}

#[test]
fn a_shifted_field_is_found() {
    let source = "struct Surfel { center: vec3f, normal: vec3f }";
    let module = naga::front::wgsl::parse_str(source).expect("WGSL");
    let (_, members) = layout(&module, "Surfel").expect("a struct");
    let expected = [("center".to_owned(), 0, 12), ("normal".to_owned(), 16, 12)];
    assert_eq!(members, expected, "vectors of three are aligned to four");
}
