//! The values of points: which there are, and their statistics.

use std::borrow::Cow;

use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{Clouds, Crs, Error, FieldValues, PointCloud, Progress, Scan, add_scans};
use autosplats_formats::Attribute;
use rayon::prelude::*;

use super::report::AttributeFound;
use super::statistics::{Bins, Statistics, Summary, Values};
use crate::parts::sample_of;

/// Part of a cloud that an attribute becomes, if not a field of the same name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    Axis(usize),
    Channel(usize),
}

pub(super) fn meaning(name: &str) -> Option<Meaning> {
    Some(match name.to_ascii_lowercase().as_str() {
        "x" | "cartesianx" => Meaning::Axis(0),
        "y" | "cartesiany" => Meaning::Axis(1),
        "z" | "cartesianz" => Meaning::Axis(2),
        "red" | "r" | "diffuse_red" | "colorred" => Meaning::Channel(0),
        "green" | "g" | "diffuse_green" | "colorgreen" => Meaning::Channel(1),
        "blue" | "b" | "diffuse_blue" | "colorblue" => Meaning::Channel(2),
        _ => return None,
    })
}

/// An attribute's name without common prefixes, in PDAL's words.
fn plain_name(name: &str) -> String {
    let lower = name.to_ascii_lowercase();
    let plain: String = lower.trim_start_matches("scalar_").chars().filter(|c| !matches!(c, '_' | ' ')).collect();
    match plain.as_str() {
        "nx" | "ny" | "nz" => format!("normal{}", &plain[1..]),
        _ => plain,
    }
}

/// What a first look at all points shows.
pub(super) struct Surveyed<'a> {
    pub(super) points: u64,
    pub(super) finite: u64,
    pub(super) bounds: [DVec3; 2],
    /// All points, or else a sample of them, with all attributes.
    pub(super) like: Cow<'a, PointCloud>,
    pub(super) crs: Crs,
    pub(super) scans: Vec<Scan>,
    /// Of each of the [`rows`] of values.
    pub(super) summaries: Vec<Summary>,
}

pub(super) fn survey<'a>(
    clouds: &'a dyn Clouds,
    attributes: &[Attribute],
    progress: &dyn Progress,
) -> Result<Surveyed<'a>, Error> {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0_u64);
    let join = |a: (DVec3, DVec3, u64), b: (DVec3, DVec3, u64)| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2);
    let (mut points, mut all) = (0, none);
    let (mut few, mut crs, mut scans) = (Vec::new(), Crs::default(), Vec::new());
    let mut summaries: Vec<Summary> = Vec::new();
    clouds.read(progress, &mut |cloud| {
        let finite = (0..cloud.len()).into_par_iter().map(|i| cloud.world_position(i)).filter(|p| p.is_finite());
        let own = finite
            .fold(|| none, |(min, max, count), position| (min.min(position), max.max(position), count + 1))
            .reduce(|| none, join);
        all = join(all, own);
        crs = cloud.crs().clone();
        if clouds.whole().is_some() {
            scans = cloud.scans().to_vec();
        } else {
            add_scans(&mut scans, cloud.scans(), points as usize);
        }
        points += cloud.len() as u64;
        let rows = rows(cloud, attributes);
        summaries.resize(rows.len(), Summary::NONE);
        for (summary, row) in summaries.iter_mut().zip(&rows) {
            let values = row.values.map(|place| place.of(cloud));
            *summary = values.map_or(*summary, |values| summary.and(values.summary()));
        }
        if clouds.whole().is_none() {
            few.push(sample_of(cloud, clouds));
        }
        Ok(())
    })?;
    let like = clouds.whole().map_or_else(|| Cow::Owned(PointCloud::joined(few.iter())), Cow::Borrowed);
    Ok(Surveyed { points, finite: all.2, bounds: [all.0, all.1], like, crs, scans, summaries })
}

/// An attribute of the report: its name, how it is stored, and where its values are.
struct Row {
    name: String,
    stored: String,
    values: Option<Place>,
}

/// Place of values in a cloud.
#[derive(Clone, Copy, Debug)]
enum Place {
    Axis(usize),
    Channel(usize),
    Field(usize),
}

impl Place {
    fn of(self, cloud: &PointCloud) -> Values<'_> {
        match self {
            Self::Axis(axis) => Values::Axis(cloud, axis),
            Self::Channel(channel) => Values::Channel(cloud.colors().unwrap_or_default(), channel),
            Self::Field(index) => Values::Field(&cloud.fields()[index].values),
        }
    }
}

/// Statistics of all [`rows`].
pub(super) fn values_of(
    clouds: &dyn Clouds,
    like: &PointCloud,
    attributes: &[Attribute],
    summaries: Vec<Summary>,
    progress: &dyn Progress,
) -> Result<Vec<AttributeFound>, Error> {
    let rows = rows(like, attributes);
    let mut summaries = summaries;
    summaries.resize(rows.len(), Summary::NONE);
    let mut bins: Vec<Option<Bins>> = summaries.iter().map(Summary::bins).collect();
    clouds.read(progress, &mut |cloud| {
        for (bins, row) in bins.iter_mut().zip(&rows) {
            if let (Some(bins), Some(place)) = (bins, row.values) {
                bins.add(place.of(cloud));
            }
        }
        Ok(())
    })?;
    let found = rows.into_iter().zip(summaries).zip(bins).map(|((row, summary), bins)| {
        let classes = plain_name(&row.name) == "classification";
        let statistics = row.values.map_or_else(Statistics::default, |_| Statistics::new(&summary, bins, classes));
        AttributeFound { name: row.name, stored: row.stored, statistics }
    });
    Ok(found.collect())
}

/// The header's attributes, then the cloud's other values.
fn rows(cloud: &PointCloud, attributes: &[Attribute]) -> Vec<Row> {
    let field_of = |name: &str| cloud.fields().iter().position(|field| plain_name(&field.name) == plain_name(name));
    let mut rows: Vec<Row> = Vec::new();
    let mut taken = vec![false; cloud.fields().len()];
    let mut meanings = Vec::new();
    for Attribute { name, stored } in attributes {
        let known = meaning(name);
        // 16-bit colours are fields beside the 8-bit colours.
        let wide = match known {
            Some(Meaning::Channel(channel)) => field_of(["red", "green", "blue"][channel]),
            _ => None,
        };
        let field = wide.or_else(|| field_of(name));
        let values = match (field, known, cloud.colors()) {
            (Some(index), ..) => {
                taken[index] = true;
                Some(Place::Field(index))
            }
            (None, Some(Meaning::Axis(axis)), _) => Some(Place::Axis(axis)),
            (None, Some(Meaning::Channel(channel)), Some(_)) => Some(Place::Channel(channel)),
            _ => None,
        };
        meanings.extend(known);
        // Colours of other types were converted to 8 bits by the reader.
        let bytes =
            matches!(values, Some(Place::Channel(_))) && (stored.starts_with("uint16") || stored.starts_with("float"));
        let stored = if bytes { format!("{stored}, shown as 8 bits") } else { stored.clone() };
        rows.push(Row { name: name.clone(), stored, values });
    }
    let mut first = Vec::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if !meanings.contains(&Meaning::Axis(axis)) {
            first.push(Row { name: name.into(), stored: String::new(), values: Some(Place::Axis(axis)) });
        }
    }
    rows.splice(0..0, first);
    let wide = cloud.fields().iter().any(|field| plain_name(&field.name) == "red");
    if cloud.colors().is_some() && !wide {
        for (channel, name) in ["red", "green", "blue"].into_iter().enumerate() {
            if !meanings.contains(&Meaning::Channel(channel)) {
                rows.push(Row { name: name.into(), stored: "uint8".into(), values: Some(Place::Channel(channel)) });
            }
        }
    }
    for (index, (field, taken)) in cloud.fields().iter().zip(taken).enumerate() {
        if !taken {
            let (name, stored) = (field.name.clone(), type_name(&field.values).into());
            rows.push(Row { name, stored, values: Some(Place::Field(index)) });
        }
    }
    rows
}

fn type_name(values: &FieldValues) -> &'static str {
    match values {
        FieldValues::U8(_) => "uint8",
        FieldValues::I8(_) => "int8",
        FieldValues::U16(_) => "uint16",
        FieldValues::I16(_) => "int16",
        FieldValues::U32(_) => "uint32",
        FieldValues::I32(_) => "int32",
        FieldValues::U64(_) => "uint64",
        FieldValues::I64(_) => "int64",
        FieldValues::F32(_) => "float32",
        FieldValues::F64(_) => "float64",
    }
}
