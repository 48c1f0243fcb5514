//! The values of the points, filled from records by threads in parallel.
//!
//! # How it works
//!
//! All columns are allocated at once, as zeros that the system provides on first touch. A piece is a run of points with
//! its part of every column. A piece writes a column only if some value is not zero. So a column that stays zero takes
//! no memory, and is finally left out as not recorded.
//!
//! Colours have 16 bits in the file, but many writers store 8-bit values. One byte is kept of each: the low byte until
//! more values exceed 255 than [`ColorScale`] would clip. High bytes of points before are zero, but for those listed.

use std::{
    ops::Range,
    sync::atomic::{AtomicUsize, Ordering},
};

use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, each_type, residual};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    super::Job,
    dimension::{Dimension, Source, zeroed},
    header::Header,
    slices::{Slice, split, u16_at},
};
use crate::{
    color_scale::{ColorScale, Levels},
    las,
};

/// Points decoded between two checks for cancellation, and points of a preview chunk.
pub(super) const BATCH: usize = 1 << 19;

/// Records that stay in the innermost cache while their values are taken one field after the other.
const CACHED: usize = 1 << 9;

/// Facts about the values of some points.
#[derive(Clone, Debug, Default)]
pub(super) struct ValueFacts {
    /// Whether any value is not zero, by field.
    fields: Vec<bool>,
    residuals: bool,
    colors: bool,
    /// Whether 8 bits lose some of a colour.
    lossy_colors: bool,
    levels: Levels,
    /// Points whose colours were read as 8 bits though they exceed them, and the high bytes of these colours.
    bright: Vec<(usize, [u8; 3])>,
}

impl ValueFacts {
    pub(super) fn add(&mut self, other: &Self) {
        self.fields.resize(self.fields.len().max(other.fields.len()), false);
        for (seen, other) in self.fields.iter_mut().zip(&other.fields) {
            *seen |= other;
        }
        self.residuals |= other.residuals;
        self.colors |= other.colors;
        self.lossy_colors |= other.lossy_colors;
        self.levels = self.levels.and(other.levels);
        self.bright.extend(&other.bright);
    }

    /// How the colours of all points are read.
    pub(super) fn colors(&self) -> Colors {
        Colors::Settled { wide: self.levels.are_wide() }
    }

    /// Tells that the 16-bit colours are read as 8 bits, if they are.
    pub(super) fn narrow_note(&self) -> Option<String> {
        (self.colors && !self.levels.are_wide()).then(|| narrow_note(self.levels))
    }
}

/// How colours are read, which have 16 bits in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Colors {
    /// The values tell whether they have 8 or 16 bits.
    #[default]
    ByValue,
    /// They have 16 bits, or else 8, as other points of the scan tell.
    Settled { wide: bool },
    /// They are left out.
    Unwanted,
}

/// The values of all points.
pub(super) struct Columns<'a> {
    header: &'a Header,
    origin: DVec3,
    settled: Option<bool>,
    /// Byte offset of the colours in a record.
    colors_at: Option<usize>,
    dimensions: Vec<Dimension>,
    positions: Vec<[f32; 3]>,
    /// Empty unless all digits are wanted.
    residuals: Vec<[f32; 3]>,
    colors: Vec<[u8; 3]>,
    fields: Vec<FieldValues>,
    /// Number of colour values above 255 found so far.
    above_byte: AtomicUsize,
    seen: ValueFacts,
}

impl<'a> Columns<'a> {
    /// Makes columns of zeros for `count` points.
    pub(super) fn new(
        header: &'a Header,
        origin: DVec3,
        exact: bool,
        mut dimensions: Vec<Dimension>,
        count: usize,
        reading: Colors,
    ) -> Result<Self, Error> {
        let colors_at = las::colors(header.format).filter(|_| reading != Colors::Unwanted);
        let settled = if let Colors::Settled { wide } = reading { Some(wide) } else { None };
        if let (Some(at), true) = (colors_at, exact) {
            let color =
                |(index, name): (usize, &str)| Dimension { name: name.into(), source: Source::Color(at + 2 * index) };
            dimensions.extend(["Red", "Green", "Blue"].into_iter().enumerate().map(color));
        }
        Ok(Self {
            header,
            origin,
            settled,
            colors_at,
            positions: zeroed(count, "positions")?,
            residuals: zeroed(if exact { count } else { 0 }, "residuals")?,
            colors: zeroed(if colors_at.is_some() { count } else { 0 }, "colours")?,
            fields: dimensions.iter().map(|dimension| dimension.zeros(count)).collect::<Result<_, _>>()?,
            dimensions,
            // Settled colours of 16 bits have more such values from the start.
            above_byte: AtomicUsize::new(usize::from(settled == Some(true))),
            seen: ValueFacts::default(),
        })
    }

    /// Lets `work` fill consecutive runs of points, of the lengths `counts`, from point `start` on in parallel. `work`
    /// receives the run's index and its part of the columns. Returns the result of each run.
    pub(super) fn fill(
        &mut self,
        start: usize,
        counts: &[usize],
        work: impl Fn(usize, &mut Piece<'_>) -> Result<(), String> + Sync + Send,
    ) -> Vec<Result<(), String>> {
        let enough = self.enough();
        let were_wide = *self.above_byte.get_mut() > enough;
        let mut positions = &mut self.positions[start..];
        let mut residuals = self.residuals.get_mut(start..).unwrap_or_default();
        let mut colors = self.colors.get_mut(start..).unwrap_or_default();
        let mut fields: Vec<Slice<'_>> = self.fields.iter_mut().map(|values| Slice::from(values, start)).collect();
        let pieces = counts.iter().map(|&count| Piece {
            header: self.header,
            origin: self.origin,
            colors_at: self.colors_at,
            dimensions: &self.dimensions,
            above_byte: &self.above_byte,
            enough,
            start: 0,
            positions: split(&mut positions, count),
            residuals: split(&mut residuals, count),
            colors: split(&mut colors, count),
            fields: fields.iter_mut().map(|slice| slice.split(count)).collect(),
            seen: ValueFacts { fields: vec![false; self.dimensions.len()], ..ValueFacts::default() },
            narrow: 0,
            done: 0,
        });
        let mut pieces: Vec<Piece<'_>> = pieces.collect();
        let mut at = start;
        for (piece, &count) in pieces.iter_mut().zip(counts) {
            piece.start = at;
            at += count;
        }
        let outcomes: Vec<_> = pieces
            .into_par_iter()
            .enumerate()
            .map(|(index, mut piece)| {
                let outcome = work(index, &mut piece);
                (outcome, piece.seen, piece.narrow)
            })
            .collect();
        let wide = *self.above_byte.get_mut() > enough;
        if wide && !were_wide && !self.colors.is_empty() {
            clear(&mut self.colors[..start]);
        }
        let mut at = start;
        let mut errors = Vec::with_capacity(counts.len());
        for ((outcome, seen, narrow), &count) in outcomes.into_iter().zip(counts) {
            if wide && narrow > 0 {
                clear(&mut self.colors[at..at + narrow]);
            }
            self.seen.add(&seen);
            errors.push(outcome);
            at += count;
        }
        if wide {
            self.put_bright();
        }
        errors
    }

    /// Number of values above 255 that are more than may be clipped, whatever colours follow.
    fn enough(&self) -> usize {
        match self.settled {
            None => Levels::most_clipped(3 * self.colors.len()),
            Some(true) => 0,
            Some(false) => usize::MAX,
        }
    }

    /// How many colour values were found where.
    pub(super) fn levels(&self) -> Levels {
        self.seen.levels
    }

    fn put_bright(&mut self) {
        for (point, high) in self.seen.bright.drain(..) {
            self.colors[point] = high;
        }
    }

    /// Takes the high bytes of all colours, if after all points so many exceed 8 bits that 16 are meant.
    fn settle_colors(&mut self) {
        let enough = self.enough();
        if self.settled.is_none() && self.seen.levels.are_wide() {
            if *self.above_byte.get_mut() <= enough {
                clear(&mut self.colors);
                *self.above_byte.get_mut() = enough + 1;
            }
            self.put_bright();
        }
    }

    /// Removes ranges of points, which must be in order. Kept points move down, and no mask is allocated: a small file
    /// may claim millions of points that cannot be decompressed, whose memory is untouched.
    pub(super) fn remove(&mut self, ranges: &[Range<usize>]) {
        self.settle_colors();
        remove(&mut self.positions, ranges);
        remove(&mut self.residuals, ranges);
        remove(&mut self.colors, ranges);
        for values in &mut self.fields {
            each_type!(values, v => remove(v, ranges));
        }
    }

    /// A copy of some points, with the fields known so far.
    pub(super) fn preview(&self, range: Range<usize>) -> Result<PointCloud, Error> {
        let mut cloud = PointCloud::new(self.origin, self.positions[range.clone()].to_vec()).with_axes(Axes::ZUp);
        if self.seen.colors {
            cloud = cloud.with_colors(self.colors[range.clone()].to_vec())?;
        }
        for (index, name) in self.names() {
            let values = match &self.fields[index] {
                FieldValues::U8(v) => FieldValues::U8(v[range.clone()].to_vec()),
                FieldValues::U16(v) => FieldValues::U16(v[range.clone()].to_vec()),
                FieldValues::F64(v) => FieldValues::F64(v[range.clone()].to_vec()),
                // These types suffice for a preview.
                _ => continue,
            };
            cloud = cloud.with_field(name, values)?;
        }
        Ok(cloud)
    }

    /// Whether a field is kept: it is not all zero, or it is a 16-bit colour of which 8 bits lose some.
    fn is_recorded(&self, index: usize) -> bool {
        match self.dimensions[index].source {
            // Of some points of a scan, other points may have colours that lose.
            Source::Color(_) => self.seen.lossy_colors || self.settled.is_some() && self.seen.colors,
            _ => self.seen.fields.get(index).copied().unwrap_or(false),
        }
    }

    /// Indices and unique names of the fields to keep. Extra bytes may repeat a name of the point format.
    fn names(&self) -> Vec<(usize, String)> {
        let mut names: Vec<(usize, String)> = Vec::new();
        for (index, dimension) in self.dimensions.iter().enumerate().filter(|(index, _)| self.is_recorded(*index)) {
            let mut name = dimension.name.clone();
            while names.iter().any(|(_, other)| other.eq_ignore_ascii_case(&name)) {
                name.push('_');
            }
            names.push((index, name));
        }
        names
    }

    /// Names of the values that are zero at every point.
    fn zeros(&self) -> Vec<String> {
        let is_zero = |(index, dimension): &(usize, &Dimension)| {
            !matches!(dimension.source, Source::Color(_)) && !self.is_recorded(*index)
        };
        self.dimensions.iter().enumerate().filter(is_zero).map(|(_, dimension)| dimension.name.clone()).collect()
    }

    /// Makes the cloud; of a field that is zero at every point only the name is kept. The second result tells that the
    /// 16-bit colours are read as 8 bits.
    pub(super) fn into_cloud(mut self) -> Result<(PointCloud, Option<String>), Error> {
        self.settle_colors();
        let told = self.seen.narrow_note();
        Ok((self.finish()?, told))
    }

    /// Makes the cloud of some points of a file, all of which show these facts. The colours were
    /// [settled](Colors::Settled) by them.
    pub(super) fn into_part(mut self, facts: &ValueFacts) -> Result<PointCloud, Error> {
        self.seen = facts.clone();
        self.settled = None;
        self.finish()
    }

    /// What the points show, and how many are at (0, 0, 0).
    pub(super) fn into_facts(self) -> Result<(ValueFacts, usize), Error> {
        let Self { origin, positions, residuals, seen, .. } = self;
        let mut cloud = PointCloud::new(origin, positions);
        if seen.residuals {
            cloud = cloud.with_residuals(residuals)?;
        }
        Ok((seen, cloud.no_returns()))
    }

    fn finish(self) -> Result<PointCloud, Error> {
        let mut names = self.names().into_iter().peekable();
        let zeros = self.zeros();
        let mut cloud = PointCloud::new(self.origin, self.positions).with_axes(Axes::ZUp).with_zeros(zeros);
        if self.seen.residuals {
            cloud = cloud.with_residuals(self.residuals)?;
        }
        if self.seen.colors {
            cloud = cloud.with_colors(self.colors)?;
        }
        for (index, values) in self.fields.into_iter().enumerate() {
            if let Some((_, name)) = names.next_if(|(recorded, _)| *recorded == index) {
                cloud = cloud.with_field(name, values)?;
            }
        }
        Ok(cloud)
    }
}

/// Note on 16-bit colours that are read as 8 bits.
pub(crate) fn narrow_note(levels: Levels) -> String {
    let all = || "no colour value exceeds 255; the 16-bit colours are read as 8 bits".to_owned();
    ColorScale::of_levels(levels, false).note().unwrap_or_else(all)
}

/// A run of points with its part of every column.
pub(super) struct Piece<'a> {
    header: &'a Header,
    origin: DVec3,
    colors_at: Option<usize>,
    dimensions: &'a [Dimension],
    above_byte: &'a AtomicUsize,
    enough: usize,
    /// Index of the first point.
    start: usize,
    positions: &'a mut [[f32; 3]],
    residuals: &'a mut [[f32; 3]],
    colors: &'a mut [[u8; 3]],
    fields: Vec<Slice<'a>>,
    seen: ValueFacts,
    /// Number of leading points whose colours were read as 8 bits.
    narrow: usize,
    /// Number of points filled.
    done: usize,
}

impl Piece<'_> {
    /// Fills the next points from their records.
    pub(super) fn take(&mut self, records: &[u8]) {
        records.chunks(CACHED * self.header.record_len).for_each(|records| self.take_cached(records));
    }

    fn take_cached(&mut self, records: &[u8]) {
        let len = self.header.record_len;
        let range = self.done..self.done + records.len() / len;
        let (header, origin) = (self.header, self.origin);
        let records = || records.chunks_exact(len);
        for (position, record) in self.positions[range.clone()].iter_mut().zip(records()) {
            *position = (header.world(record) - origin).as_vec3().to_array();
        }
        if !self.residuals.is_empty() {
            let mut any = false;
            for (lost, record) in self.residuals[range.clone()].iter_mut().zip(records()) {
                *lost = residual(header.world(record) - origin);
                any |= *lost != [0.0; 3];
            }
            self.seen.residuals |= any;
        }
        if let Some(at) = self.colors_at {
            self.take_colors(range.clone(), at, records());
        }
        for ((slice, dimension), seen) in self.fields.iter_mut().zip(self.dimensions).zip(&mut self.seen.fields) {
            *seen |= slice.take(range.clone(), dimension, records());
        }
        self.done = range.end;
    }

    fn take_colors<'r>(&mut self, range: Range<usize>, at: usize, records: impl Iterator<Item = &'r [u8]> + Clone) {
        let colors = records.map(|record| [u16_at(record, at), u16_at(record, at + 2), u16_at(record, at + 4)]);
        let (mut positive, mut above) = (0, 0);
        let mut lossy = false;
        for channel in colors.clone().flatten() {
            positive += u32::from(channel > 0);
            above += u32::from(channel > 255);
            lossy |= channel != (channel >> 8) * 257;
        }
        if positive == 0 {
            return;
        }
        self.seen.colors = true;
        self.seen.lossy_colors |= lossy;
        self.seen.levels = self.seen.levels.and(Levels::whole(positive as usize, above as usize));
        let before = self.above_byte.fetch_add(above as usize, Ordering::Relaxed);
        let first = self.start + range.start;
        if before + above as usize > self.enough {
            for (color, channels) in self.colors[range].iter_mut().zip(colors) {
                *color = channels.map(|channel| (channel >> 8) as u8);
            }
            return;
        }
        self.narrow = range.end;
        for (color, channels) in self.colors[range].iter_mut().zip(colors.clone()) {
            *color = channels.map(|channel| channel.min(255) as u8);
        }
        if above > 0 && self.enough < usize::MAX {
            let high = colors.map(|channels| channels.map(|channel| (channel >> 8) as u8)).enumerate();
            self.seen.bright.extend(high.filter(|(_, high)| *high != [0; 3]).map(|(i, high)| (first + i, high)));
        }
    }
}

/// Removes ranges of elements, which must be in order.
fn remove<T: Copy>(values: &mut Vec<T>, ranges: &[Range<usize>]) {
    if values.is_empty() {
        return;
    }
    let (mut kept, mut at) = (0, 0);
    for range in ranges.iter().cloned().chain(std::iter::once(values.len()..values.len())) {
        values.copy_within(at..range.start, kept);
        kept += range.start - at;
        at = range.end;
    }
    values.truncate(kept);
    values.shrink_to_fit();
}

/// Makes colours black. Black ones are not written to: points that failed to decompress keep their memory untouched.
fn clear(colors: &mut [[u8; 3]]) {
    colors.iter_mut().filter(|color| **color != [0; 3]).for_each(|color| *color = [0; 3]);
}

/// Passes newly filled points to the caller as a preview chunk.
pub(super) fn preview(job: &Job<'_>, columns: &Columns<'_>, start: usize, count: usize) -> Result<(), Error> {
    job.preview(|| columns.preview(start..start + count))
}
