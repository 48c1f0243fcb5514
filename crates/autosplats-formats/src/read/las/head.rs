//! What stands before the points of a compressed file, enough to decompress any of its chunks by itself.

use std::path::Path;

use autosplats_cloud::{Crs, Error, guard};
use glam::DVec3;

use super::{
    Job,
    chunks::MAX_RATIO,
    columns::Columns,
    coordinates, describe,
    dimension::{Dimension, dimensions},
    header::Header,
    laz::Layout,
    records::Records,
    shape::{Decoded, Shape},
};
use crate::{
    las,
    read::{Description, ReadOptions, units},
};

/// Header and records of a compressed file in layers.
pub(crate) struct Head {
    header: Header,
    layout: Layout,
    dimensions: Vec<Dimension>,
    /// The file as far as it is known without its points, in the units of decoded points.
    pub(crate) description: Description,
    /// Factor of heights, which makes their unit that of x and y.
    pub(crate) height_scale: f64,
    crs: Crs,
}

impl Head {
    /// Reads the bytes before the points. `extended` are the extended records, each with its header.
    pub(crate) fn read(name: &Path, bytes: &[u8], extended: &[Vec<u8>]) -> Result<Self, Error> {
        let job = Job { path: name, progress: &(), bytes, options: &ReadOptions::default(), triangles: false };
        let mut header = Header::read(&job)?;
        if !header.compressed || !las::is_wide(header.format) {
            let what = format!("point format {} is not one of COPC; it is read whole", header.format);
            return Err(job.malformed("byte 104", what));
        }
        // Bytes behind the points are not among `bytes`.
        header.extended = (0, 0);
        let mut records = Records::read(bytes, &header);
        extended.iter().for_each(|record| records.add_extended(record));
        let (layout, _) = Layout::read(&job, &header, &records)?;
        let (mut dimensions, notes) = dimensions(&header, &records);
        let meaning = coordinates::of(&header, &records);
        let mut description = describe::of_records(&header, &records, &dimensions, &meaning);
        description.notes.extend(records.notes.into_iter().chain(notes).chain(meaning.notes));
        description.points = Some(header.stated);
        let height_scale = meaning.crs.height_scale().unwrap_or(1.0);
        units::settle_description(&mut description);
        // A name is the same in every chunk, whichever values are zero there.
        for index in 1..dimensions.len() {
            let (before, rest) = dimensions.split_at_mut(index);
            while before.iter().any(|other| other.name.eq_ignore_ascii_case(&rest[0].name)) {
                rest[0].name.push('_');
            }
        }
        Ok(Self { header, layout, dimensions, description, height_scale, crs: meaning.crs })
    }

    /// Names of the fields, but for colours with all digits.
    pub(crate) fn fields(&self) -> Vec<String> {
        self.dimensions.iter().map(|dimension| dimension.name.clone()).collect()
    }

    pub(crate) fn has_colors(&self) -> bool {
        las::colors(self.header.format).is_some()
    }

    /// Bytes of an uncompressed record.
    pub(crate) fn record_len(&self) -> usize {
        self.header.record_len
    }

    /// Corners of the box that coordinates can reach in the file's units, which 32-bit integers hold.
    pub(crate) fn reach(&self) -> [DVec3; 2] {
        let reach = self.header.scale.abs() * 2_147_483_649.0;
        [self.header.offset - reach, self.header.offset + reach]
    }

    /// Most bytes of memory that a decoded point takes.
    pub(crate) fn point_bytes(&self, exact: bool, shape: &Shape<'_>) -> usize {
        let mut dimensions = self.dimensions.clone();
        shape.choose(&mut dimensions);
        let residuals = exact || self.height_scale != 1.0;
        let fields: usize = dimensions.iter().map(Dimension::size).sum();
        (if residuals { 24 } else { 12 }) + shape.color_bytes(&self.header, exact) + fields
    }

    /// Decompresses a chunk that holds this many points, in the file's order. `place` names the chunk.
    pub(crate) fn decode(
        &self,
        name: &Path,
        place: &str,
        chunk: &[u8],
        points: usize,
        exact: bool,
        shape: &Shape<'_>,
    ) -> Result<Decoded, Error> {
        let options = ReadOptions { exact, ..ReadOptions::default() };
        let job = Job { path: name, progress: &(), bytes: chunk, options: &options, triangles: false };
        let fail = |what: String| job.malformed(place, what);
        if points > MAX_RATIO.saturating_mul(chunk.len()) {
            return Err(fail(format!("{points} points cannot be in {} bytes", chunk.len())));
        }
        let stated = self.layout.stated_points(chunk);
        let stated = stated.ok_or_else(|| fail("its lengths are inconsistent; copy the file again".into()))?;
        if stated < points {
            return Err(fail(format!("it holds {stated} of {points} points; copy the file again")));
        }
        let mut dimensions = self.dimensions.clone();
        shape.choose(&mut dimensions);
        let layout = self.layout.selecting(shape.selection(&dimensions));
        job.check_memory(points, self.point_bytes(exact, shape))?;
        let origin = shape.origin.unwrap_or_default();
        let mut columns = Columns::new(&self.header, origin, exact, dimensions, points, shape.colors)?;
        let mut outcomes =
            columns.fill(0, &[points], |_, piece| guard(|| layout.take_chunk(chunk, points, piece).map(drop)));
        outcomes.pop().unwrap_or(Ok(())).map_err(fail)?;
        let levels = columns.levels();
        let (cloud, _) = columns.into_cloud()?;
        let cloud = cloud.with_crs(self.crs.clone()).with_resolution(self.header.scale.abs());
        let cloud = units::settled(name, cloud)?;
        Ok(Decoded { cloud, levels, lost: 0 })
    }
}
