//! The values of a point, each in its own stream.

use std::ops::Range;

use autosplats_cloud::{Field, FieldValues, PointCloud};
use glam::{DMat3, DVec3};

use super::{
    super::colors::channels,
    facts::{CloudFacts, Frame, is_finite, named},
};

/// One value of each point: name and source.
pub(super) struct Value<'a> {
    /// Name, with the prefix of an extension.
    pub(super) name: String,
    pub(super) source: Source<'a>,
}

/// Source and storage of a value.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    Position {
        axis: usize,
        single: bool,
    },
    /// Whether a point has a position, in two bits.
    State,
    Color(usize),
    Field(&'a FieldValues),
    /// A return number, counted from 0.
    FromZero(&'a FieldValues),
    /// A field as 64-bit floats, whatever its type.
    Double(&'a FieldValues),
    Normal {
        fields: [&'a FieldValues; 3],
        axis: usize,
        /// Whether to store 32-bit floats; possible if nothing is rotated.
        single: bool,
    },
}

impl Source<'_> {
    /// Bits of a value.
    pub(super) fn bits(self) -> usize {
        match self {
            Self::State => 2,
            Self::Color(_) => 8,
            Self::Position { single: true, .. } | Self::Normal { single: true, .. } => 32,
            Self::Position { .. } | Self::Normal { .. } | Self::Double(_) => 64,
            Self::Field(values) | Self::FromZero(values) => match values {
                FieldValues::U8(_) | FieldValues::I8(_) => 8,
                FieldValues::U16(_) | FieldValues::I16(_) => 16,
                FieldValues::U32(_) | FieldValues::I32(_) | FieldValues::F32(_) => 32,
                FieldValues::U64(_) | FieldValues::I64(_) | FieldValues::F64(_) => 64,
            },
        }
    }

    /// Attributes of the value's element in the XML section.
    pub(super) fn stored(self) -> String {
        let integer = |min: i64, max: i64| format!("type=\"Integer\" minimum=\"{min}\" maximum=\"{max}\"");
        let float = |single| if single { "type=\"Float\" precision=\"single\"" } else { "type=\"Float\"" };
        match self {
            Self::State => integer(0, 2),
            Self::Color(_) => integer(0, 255),
            Self::Position { single, .. } | Self::Normal { single, .. } => float(single).into(),
            Self::Double(_) => float(false).into(),
            Self::Field(values) | Self::FromZero(values) => match values {
                FieldValues::U8(_) => integer(0, u8::MAX.into()),
                FieldValues::I8(_) => integer(i8::MIN.into(), i8::MAX.into()),
                FieldValues::U16(_) => integer(0, u16::MAX.into()),
                FieldValues::I16(_) => integer(i16::MIN.into(), i16::MAX.into()),
                FieldValues::U32(_) => integer(0, u32::MAX.into()),
                FieldValues::I32(_) => integer(i32::MIN.into(), i32::MAX.into()),
                FieldValues::U64(_) | FieldValues::I64(_) => integer(i64::MIN, i64::MAX),
                FieldValues::F32(_) => float(true).into(),
                FieldValues::F64(_) => float(false).into(),
            },
        }
    }

    /// Appends the values of some points.
    pub(super) fn encode(self, cloud: &PointCloud, frame: Frame, points: Range<usize>, out: &mut Vec<u8>) {
        let valid = |i: usize| is_finite(&cloud.positions()[i]);
        match self {
            Self::Position { axis, single } => {
                for i in points {
                    let local = if valid(i) { frame.local(cloud.world_position(i)) } else { DVec3::ZERO };
                    if single {
                        out.extend((local[axis] as f32).to_le_bytes());
                    } else {
                        out.extend(local[axis].to_le_bytes());
                    }
                }
            }
            Self::State => {
                out.extend(points.clone().step_by(4).map(|first| {
                    let bits = |(place, i): (usize, usize)| if valid(i) { 0 } else { 2_u8 << (2 * place) };
                    (first..points.end.min(first + 4)).enumerate().map(bits).sum::<u8>()
                }));
            }
            Self::Color(channel) => {
                if let Some(colors) = cloud.colors() {
                    out.extend(colors[points].iter().map(|color| color[channel]));
                }
            }
            Self::Double(values) => points.for_each(|i| out.extend(values.get(i).to_le_bytes())),
            Self::Normal { fields, axis, single } => {
                for i in points {
                    if single {
                        out.extend((fields[axis].get(i) as f32).to_le_bytes());
                    } else {
                        let world = DVec3::from(fields.map(|values| values.get(i)));
                        let local = if frame.is_world() { world } else { frame.rotation.transpose() * world };
                        out.extend(local[axis].to_le_bytes());
                    }
                }
            }
            Self::Field(values) => put(values, points, 0, out),
            Self::FromZero(values) => put(values, points, 1, out),
        }
    }
}

/// Appends values minus `less`. Integers are stored as the distance from the least value of their type.
fn put(values: &FieldValues, points: Range<usize>, less: u8, out: &mut Vec<u8>) {
    macro_rules! put {
        ($v:expr, $min:expr, $less:expr) => {
            for value in &$v[points] {
                out.extend(value.wrapping_sub($less).wrapping_sub($min).to_le_bytes());
            }
        };
    }
    match values {
        FieldValues::U8(v) => put!(v, 0, less),
        FieldValues::I8(v) => put!(v, i8::MIN, less as i8),
        FieldValues::U16(v) => put!(v, 0, u16::from(less)),
        FieldValues::I16(v) => put!(v, i16::MIN, i16::from(less)),
        FieldValues::U32(v) => put!(v, 0, u32::from(less)),
        FieldValues::I32(v) => put!(v, i32::MIN, i32::from(less)),
        // The stored minimum is that of a signed integer, half the range below zero.
        FieldValues::U64(v) => put!(v, 1 << 63, u64::from(less)),
        FieldValues::I64(v) => put!(v, i64::MIN, i64::from(less)),
        FieldValues::F32(v) => v[points].iter().for_each(|value| out.extend(value.to_le_bytes())),
        FieldValues::F64(v) => v[points].iter().for_each(|value| out.extend(value.to_le_bytes())),
    }
}

/// All values of a cloud's points: positions in 32 bits if `single`, with a `state` if some points have no position.
pub(super) fn values<'a>(
    cloud: &'a PointCloud,
    known: &CloudFacts,
    frame: Frame,
    single: bool,
    state: bool,
) -> Vec<Value<'a>> {
    // A field unchanged, or as floats if E57 cannot hold its integers.
    let source = |field: &'a Field| {
        let values = &field.values;
        if known.beyond.contains(&field.name) { Source::Double(values) } else { Source::Field(values) }
    };
    let mut all = Vec::new();
    let mut add = |name: &str, source| all.push(Value { name: name.into(), source });
    for (axis, name) in ["cartesianX", "cartesianY", "cartesianZ"].into_iter().enumerate() {
        add(name, Source::Position { axis, single });
    }
    if state {
        add("cartesianInvalidState", Source::State);
    }
    let three = |names: [&str; 3]| -> Option<[&'a FieldValues; 3]> {
        let found = names.map(|name| named(cloud, name));
        Some([found[0]?, found[1]?, found[2]?])
    };
    let wide = channels(cloud).filter(|_| known.wide);
    for (channel, name) in ["colorRed", "colorGreen", "colorBlue"].into_iter().enumerate() {
        match wide {
            Some(wide) => add(name, Source::Field(wide[channel])),
            None if cloud.colors().is_some() => add(name, Source::Color(channel)),
            None => {}
        }
    }
    let normals = three(["NormalX", "NormalY", "NormalZ"]);
    let mut names: Vec<String> = Vec::new();
    for one in cloud.fields() {
        let Field { name, values } = one;
        let integers = !matches!(values, FieldValues::F32(_) | FieldValues::F64(_));
        match &**name {
            "Red" | "Green" | "Blue" if wide.is_some() => {}
            "Intensity" => add("intensity", source(one)),
            "ReturnNumber" if known.counted => add("returnIndex", Source::FromZero(values)),
            "NumberOfReturns" if known.counted => add("returnCount", source(one)),
            "GpsTime" => add("timeStamp", Source::Double(values)),
            "rowIndex" | "columnIndex" | "isIntensityInvalid" | "isColorInvalid" if integers => {
                add(name, source(one));
            }
            "NormalX" | "NormalY" | "NormalZ" if normals.is_some() => {
                if let Some((axis, fields)) =
                    ["NormalX", "NormalY", "NormalZ"].iter().position(|it| it == name).zip(normals)
                {
                    let single = frame.rotation == DMat3::IDENTITY
                        && fields.iter().all(|values| matches!(values, FieldValues::F32(_)));
                    add(["nor:normalX", "nor:normalY", "nor:normalZ"][axis], Source::Normal { fields, axis, single });
                }
            }
            _ => {
                let mut fit = xml_name(name);
                while names.contains(&fit) {
                    fit.push('_');
                }
                add(&format!("autosplats:{fit}"), source(one));
                names.push(fit);
            }
        }
    }
    all
}

/// Replaces characters that an XML name must not have.
pub(super) fn xml_name(name: &str) -> String {
    let fit = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.') { c } else { '_' };
    let mut fit: String = name.chars().map(fit).collect();
    if !fit.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_') {
        fit.insert(0, '_');
    }
    fit
}
