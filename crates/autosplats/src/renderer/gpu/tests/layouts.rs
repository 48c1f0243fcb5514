//! Structs and constants have the same layouts and values in Rust and WGSL.

use std::mem::offset_of;

use wgpu::naga::{self, Expression, Literal, Module, TypeInner};

use super::passes;
use crate::adapt::gpu::tests::BUNCH;
use crate::adapt::{DepthRun, SCALES, SHEETS, SLABS};
use crate::fit::Surfel;
use crate::fit::orient::Sensor;
use crate::gpu::{FrameUniform, GROUPS_PER_ROW, PassSource, link};
use crate::project::gpu::{COUNTERS, Counter, RANK_BLOCK_FLAGS, Work};
use crate::project::{ChunkUniform, ScreenPoint};
use crate::search::splat_communication::gpu::Arguments;
use crate::shade::gpu::{ShadeUniform, ShownQuantity};
use crate::splat::over_time::Fitted;
use crate::splat::{BLOCK_PX, Cover, FRINGE_BLOCKS};

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
    ($name:literal, $rust:ident { $($field:ident),* $(,)? } $(, filled up with $unused:ident)?) => {{
        // Does not compile if a field is missing.
        let $rust { $($field: _,)* $($unused: _)? } = <$rust as bytemuck::Zeroable>::zeroed();
        let fields = vec![$((
            stringify!($field).to_owned(),
            offset_of!($rust, $field),
            field_size(|mirror: &$rust| &mirror.$field),
        )),*];
        Mirrored { name: $name, size: size_of::<$rust>(), fields }
    }};
}

fn mirrored() -> [Mirrored; 10] {
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
                margin,
                same_picture,
                past_rotation,
                past_shift,
                past_focal_px,
                dot_px,
                scan_lines,
                compares_density,
            },
            filled up with padding
        ),
        mirrored!("Chunk", ChunkUniform { first, len, values, padding }),
        mirrored!("Arguments", Arguments { points, queries, clear, boxes, last_clear, last_boxes, count, iterations }),
        mirrored!("Cover", Cover { weight, rim, point, scalar }),
        mirrored!("Sensor", Sensor { position, first }),
        mirrored!("DepthRun", DepthRun { position, first, axis, factor, power, padding }),
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
                key,
                key_wrap,
                key_light,
                shoulder,
                fill,
                darkening,
                fill_light,
                steepest,
                ground,
                furthest,
                sky,
                least_rise,
                clay,
                edge_factor,
                up,
                edge_offset,
                given_light,
                range,
                find_range,
                lighting,
                keep_linear,
                swap_red_blue,
                pitch,
                sample_step,
                samples,
                encode_steps,
                backgrounds,
                measures,
                edge_search,
                less_tilted,
                pairs,
            }
        ),
    ]
}

/// All passes, and the shared files that no pass needs to import.
fn modules() -> Vec<Module> {
    let shared = ["#import surfel\n", "#import counters\n", "#import rank\n", "#import groups\n"];
    passes().map(PassSource::module).chain(shared.map(parse)).collect()
}

fn parse(source: &str) -> Module {
    naga::front::wgsl::parse_str(&link(source)).expect("WGSL")
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

/// Names and values of the `u32` constants of a module.
fn constants(module: &Module) -> Vec<(String, u32)> {
    let constant = |constant: &naga::Constant| match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => Some((constant.name.clone()?, value)),
        _ => None,
    };
    module.constants.iter().filter_map(|(_, value)| constant(value)).collect()
}

fn constant(source: &str, name: &str) -> u32 {
    let constants = constants(&parse(source));
    constants.into_iter().find(|(known, _)| known == name).unwrap_or_else(|| panic!("no {name}")).1
}

/// WGSL's name of an enum's variant: `NotFinite` is `NOT_FINITE`.
fn screaming(variant: &impl std::fmt::Debug) -> String {
    let name = format!("{variant:?}");
    let words = name.char_indices().map(|(at, c)| if at > 0 && c.is_uppercase() { format!("_{c}") } else { c.into() });
    words.collect::<String>().to_uppercase()
}

#[test]
fn structs_lie_alike_in_rust_and_wgsl() {
    let modules = modules();
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
fn a_shifted_field_is_found() {
    let module = parse("struct Surfel { center: vec3f, normal: vec3f }");
    let (_, members) = layout(&module, "Surfel").expect("a struct");
    let expected = [("center".to_owned(), 0, 12), ("normal".to_owned(), 16, 12)];
    assert_eq!(members, expected, "vectors of three are aligned to four");
}

#[test]
fn constants_are_alike_in_rust_and_wgsl() {
    use Counter::{
        Active, Behind, Blocks, Bounded, CellColumns, CellPx, Clamped, Covered, Large, LeftActive, LeftRecovered,
        NotFinite, Outliers, Outside, Passive, RangeHigh, RangeLow, Recovered, StripPx, Visible,
    };
    let counters: [Counter; COUNTERS] = [
        NotFinite,
        Behind,
        Outside,
        Visible,
        Blocks,
        StripPx,
        CellPx,
        CellColumns,
        Active,
        Passive,
        Recovered,
        Clamped,
        Bounded,
        Outliers,
        RangeLow,
        RangeHigh,
        Covered,
        Large,
        LeftActive,
        LeftRecovered,
    ];
    let counters = counters.map(|counter| (screaming(&counter), counter as u32));
    assert_eq!(constants(&parse("#import counters\n")), counters, "counters in WGSL, and in Rust");

    use ShownQuantity::{Clay, Color, Curvature, Depth, Height, KRadius, Normal, Radius, Scalar};
    let shown = [Clay, Color, Normal, Height, Depth, Radius, KRadius, Curvature, Scalar];
    let shown = shown.map(|shown| (format!("SHOW_{}", screaming(&shown)), shown as u32));
    let shading = passes().find(|pass| pass.path == "shade/shade").expect("a pass").module();
    let in_wgsl: Vec<_> = constants(&shading).into_iter().filter(|(name, _)| name.starts_with("SHOW_")).collect();
    assert_eq!(in_wgsl, shown, "what is shown in WGSL, and in Rust");

    use Work::{
        Active64, Active256, ActiveFew, LargeSplats, LeftActive64, LeftRecovered64, PassiveBlocks, Queries256,
        Recovered64, Recovered256, RecoveredFew, Visible256, VisibleBlocks,
    };
    let works = [
        Visible256,
        VisibleBlocks,
        PassiveBlocks,
        Active64,
        Active256,
        Recovered64,
        Recovered256,
        Queries256,
        LargeSplats,
        LeftActive64,
        LeftRecovered64,
        ActiveFew,
        RecoveredFew,
    ];
    let works = works.map(|work| (screaming(&work), work as u32));
    let pass = passes().find(|pass| pass.path == "project/work").expect("a pass").module();
    let in_wgsl: Vec<_> = constants(&pass).into_iter().filter(|entry| works.contains(entry)).collect();
    assert_eq!(in_wgsl, works, "work in WGSL, and in Rust");

    let flags = ["BACK", "LINE"].map(|flag| constant("#import surfel\n", flag));
    assert_eq!(flags, [Surfel::BACK, Surfel::LINE], "flags of a surfel");
    assert_eq!(constant("#import frame\n#import blocks\n", "BLOCK_PX"), BLOCK_PX as u32, "side of a block");
    let trim = passes().find(|pass| pass.path == "splat/trim").expect("a pass");
    assert_eq!(constant(trim.source, "FRINGE_BLOCKS"), FRINGE_BLOCKS as u32, "blocks of a fringe");
    assert_eq!(constant("#import levels\n", "SLABS"), SLABS as u32, "slabs of a cell");
    assert_eq!(constant("#import levels\n", "BUNCH"), BUNCH as u32, "clusters side by side");
    assert_eq!(constant("#import sheet\n", "SHEETS"), SHEETS as u32, "sheets of a cell");
    let adapt = passes().find(|pass| pass.path == "adapt/adapt").expect("a pass");
    assert_eq!(constant(adapt.source, "SCALES"), SCALES as u32, "balls around a point");
    assert_eq!(constant("#import rank\n", "RANK_WORDS") * 32, RANK_BLOCK_FLAGS, "flags that a workgroup ranks");
    assert_eq!(constant("#import groups\n", "GROUPS_PER_ROW"), GROUPS_PER_ROW, "workgroups in a row");
}
