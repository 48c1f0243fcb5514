//! Encodes the points of a cloud as records.

use std::borrow::Cow;

use autosplats_cloud::{FieldValues, PointCloud, each_type};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    super::colors::channels,
    shape::{Shape, angle_steps},
};
use crate::las::{self, Place};

/// How a cloud is written.
pub(in crate::write) struct Plan<'a> {
    cloud: &'a PointCloud,
    record_len: usize,
    scale: DVec3,
    offset: DVec3,
    /// Indices of the points that are written; `None` for all.
    kept: Option<Vec<usize>>,
    own: Vec<(Place, Cow<'a, FieldValues>)>,
    colors: Option<(usize, Colors<'a>)>,
    extras: Vec<Extra<'a>>,
}

/// Source of the colours.
enum Colors<'a> {
    Bytes(&'a [[u8; 3]]),
    Wide([&'a [u16]; 3]),
}

/// A field that becomes extra bytes.
struct Extra<'a> {
    values: &'a FieldValues,
    at: usize,
}

impl<'a> Plan<'a> {
    /// The plan of a cloud that has a shape.
    pub(in crate::write) fn bind(
        cloud: &'a PointCloud,
        shape: &'a Shape,
        scale: DVec3,
        offset: DVec3,
        kept: Option<Vec<usize>>,
    ) -> Self {
        let mut own = Vec::new();
        let mut extras = Vec::new();
        for column in &shape.columns {
            let Some(field) = cloud.fields().iter().find(|field| field.name == column.name) else { continue };
            match column.place {
                Some((place, None)) => own.push((place, Cow::Borrowed(&field.values))),
                Some((place, Some(scale))) => own.push((place, Cow::Owned(scale.apply(&field.values)))),
                None => {}
            }
            extras.extend(column.extra.map(|at| Extra { values: &field.values, at }));
        }
        let wide = if shape.wide { short_channels(cloud) } else { None };
        let source = match (wide, cloud.colors()) {
            (Some(wide), _) => Some(Colors::Wide(wide)),
            (None, bytes) => bytes.map(Colors::Bytes),
        };
        let Shape { format, record_len, .. } = *shape;
        let colors = las::colors(format).zip(source);
        Self { cloud, record_len, scale, offset, kept, own, colors, extras }
    }

    /// Number of points that are written.
    pub(in crate::write) fn points(&self) -> usize {
        self.kept.as_ref().map_or(self.cloud.len(), Vec::len)
    }

    /// Index in the cloud of a point of the file.
    pub(in crate::write) fn point(&self, index: usize) -> usize {
        self.kept.as_ref().map_or(index, |kept| kept[index])
    }

    /// Fills `records` completely; `point` maps a record's index to its point in the cloud.
    pub(in crate::write) fn encode(&self, records: &mut [u8], point: impl Fn(usize) -> usize) {
        let len = self.record_len;
        let point = &point;
        records.fill(0);
        each(records, len, point, |record, i| {
            let steps = ((self.cloud.world_position(i) - self.offset) / self.scale).round().to_array();
            place_at::<12>(record, 0, bytemuck::cast(steps.map(|step| (step as i32).to_le_bytes())));
        });
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one of the types is f64 itself")]
        for (place, values) in &self.own {
            each_type!(&**values, v => match *place {
                Place::Bits { at, shift, mask } => {
                    each(records, len, point, |record, i| record[at] |= (v[i] as u8 & mask) << shift);
                }
                Place::I8(at) => each(records, len, point, |record, i| record[at] = v[i] as i8 as u8),
                Place::U16(at) => each(records, len, point, |record, i| place_at(record, at, (v[i] as u16).to_le_bytes())),
                Place::Angle(at) => {
                    each(records, len, point, |record, i| place_at(record, at, angle_steps(v[i] as f64).to_le_bytes()));
                }
                Place::F64(at) => each(records, len, point, |record, i| place_at(record, at, (v[i] as f64).to_le_bytes())),
            });
        }
        match &self.colors {
            Some((at, Colors::Bytes(colors))) => each(records, len, point, |record, i| {
                let channels = colors[i].map(|channel| (u16::from(channel) * 257).to_le_bytes());
                place_at::<6>(record, *at, bytemuck::cast(channels));
            }),
            Some((at, Colors::Wide(channels))) => each(records, len, point, |record, i| {
                let channels = channels.map(|channel| channel[i].to_le_bytes());
                place_at::<6>(record, *at, bytemuck::cast(channels));
            }),
            None => {}
        }
        for Extra { values, at, .. } in &self.extras {
            each_type!(values, v => each(records, len, point, |record, i| place_at(record, *at, v[i].to_le_bytes())));
        }
    }
}

/// Calls `put` for every record with its point.
fn each(records: &mut [u8], len: usize, point: &impl Fn(usize) -> usize, put: impl Fn(&mut [u8], usize)) {
    records.chunks_exact_mut(len).enumerate().for_each(|(i, record)| put(record, point(i)));
}

fn place_at<const LEN: usize>(record: &mut [u8], at: usize, bytes: [u8; LEN]) {
    record[at..at + LEN].copy_from_slice(&bytes);
}

/// Indices of the points with finite coordinates; `None` if all are.
pub(in crate::write) fn finite(cloud: &PointCloud) -> Option<Vec<usize>> {
    let finite = |i: &usize| cloud.world_position(*i).is_finite();
    let all = (0..cloud.len()).into_par_iter().all(|i| finite(&i));
    (!all).then(|| (0..cloud.len()).into_par_iter().filter(finite).collect())
}

/// The 16-bit colour fields.
fn short_channels(cloud: &PointCloud) -> Option<[&[u16]; 3]> {
    match channels(cloud)? {
        [FieldValues::U16(red), FieldValues::U16(green), FieldValues::U16(blue)] => Some([red, green, blue]),
        _ => None,
    }
}
