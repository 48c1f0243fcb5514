//! TIFF: grey images of 16 bits or of floats.

use std::io::Cursor;

use autosplats_cloud::{Error, guard};
use tiff::{
    ColorType,
    decoder::{Decoder, DecodingResult, Limits},
    tags::Tag,
};

use super::{super::Job, MAX_EXPANSION, values::Values};

/// Whether the file begins like a TIFF or a BigTIFF, in either byte order.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| bytes.starts_with(*magic))
}

/// Tags of maps, whose values are heights or pictures.
const MAP_TAGS: [Tag; 4] =
    [Tag::ModelPixelScaleTag, Tag::ModelTiepointTag, Tag::ModelTransformationTag, Tag::GeoKeyDirectoryTag];

/// A sample format of whole numbers without a sign, the default.
const UNSIGNED: u16 = 1;

/// Largest strip or tile, in bytes, that any file may have: four times the usual one, of doubles.
const MAX_TILE: usize = 512 * 512 * 8;

/// Header of a TIFF.
pub(super) struct Header {
    pub(super) width: usize,
    pub(super) height: usize,
    bits: u8,
    whole: bool,
}

fn open<'a>(job: &Job<'a>) -> Result<Decoder<Cursor<&'a [u8]>>, String> {
    if values_fit(job.bytes) == Some(false) {
        return Err("an entry of the directory has more values than the file has bytes".into());
    }
    guard(|| Decoder::new(Cursor::new(job.bytes)).map_err(|error| error.to_string()))
}

/// Whether no entry of the directory claims more values than the file has bytes; `None` if the directory is cut off.
/// The decoder takes memory for them before its limits can be set.
fn values_fit(bytes: &[u8]) -> Option<bool> {
    let little = bytes.starts_with(b"II");
    let number = |at: usize, len: usize| {
        let raw = bytes.get(at..at.checked_add(len)?)?;
        let digits: &mut dyn Iterator<Item = &u8> = if little { &mut raw.iter().rev() } else { &mut raw.iter() };
        usize::try_from(digits.fold(0_u64, |sum, &byte| sum << 8 | u64::from(byte))).ok()
    };
    let big = number(2, 2)? == 43;
    let (word, entry) = if big { (8, 20) } else { (4, 12) };
    let directory = number(word, word)?;
    let count_len = if big { 8 } else { 2 };
    let first = directory.checked_add(count_len)?;
    let entries = number(directory, count_len)?.min(bytes.len() / entry);
    for index in 0..entries {
        if number(first.checked_add(index * entry + 4)?, word)? > bytes.len() {
            return Some(false);
        }
    }
    Some(true)
}

fn damaged(job: &Job<'_>, what: &str) -> Error {
    job.malformed("the TIFF's directory or pixels", format!("{what}; copy the file again"))
}

impl Header {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        let read = || {
            let mut decoder = open(job)?;
            let told = |error: tiff::TiffError| error.to_string();
            let is_map = MAP_TAGS.into_iter().any(|tag| matches!(decoder.find_tag(tag), Ok(Some(_))));
            let format = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat).map_err(told)?;
            let format = format.and_then(|formats| formats.first().copied()).unwrap_or(UNSIGNED);
            let color = decoder.colortype().map_err(told)?;
            Ok((decoder.dimensions().map_err(told)?, decoder.chunk_dimensions(), color, format, is_map))
        };
        let ((width, height), chunk, color, format, is_map) =
            guard(read).map_err(|what: String| damaged(job, &what))?;
        if is_map {
            let what = "a GeoTIFF, a map rather than a depth image; 'gdal_translate -of AAIGrid in.tif out.asc' makes a grid \
                        of heights that is read";
            return Err(job.unsupported(what));
        }
        let bits = match color {
            ColorType::Gray(bits @ (16 | 32 | 64)) => bits,
            ColorType::Gray(bits) => return Err(super::no_depth(job, &format!("{bits}-bit grey TIFF"))),
            _ => return Err(super::no_depth(job, "TIFF of several channels")),
        };
        let (width, height) = (width as usize, height as usize);
        let size = |width: usize, height: usize| width.saturating_mul(height).saturating_mul(usize::from(bits / 8));
        let bytes = size(width, height);
        // Memory for a strip or tile is taken as its size claims, which tiles of ordinary size may exceed a little.
        let tile = size(chunk.0 as usize, chunk.1 as usize).saturating_sub(MAX_TILE);
        if bytes == 0 || bytes.max(tile) / MAX_EXPANSION > job.bytes.len() {
            let what = format!("{width} × {height} pixels cannot be in {} bytes", job.bytes.len());
            return Err(damaged(job, &what));
        }
        Ok(Self { width, height, bits, whole: format == UNSIGNED && bits == 16 })
    }

    /// Type of the values.
    pub(super) fn type_name(&self) -> &'static str {
        match (self.bits, self.whole) {
            (16, true) => "uint16",
            (16, false) => "float16",
            (32, _) => "float32",
            _ => "float64",
        }
    }

    pub(super) fn values(&self, job: &Job<'_>) -> Result<Values, Error> {
        let count = self.width * self.height;
        job.check_memory(count, usize::from(self.bits / 8))?;
        let read = || {
            let mut limits = Limits::default();
            limits.decoding_buffer_size = count.saturating_mul(8);
            limits.intermediate_buffer_size = count.saturating_mul(8).saturating_add(1 << 20);
            let decoded = open(job)?.with_limits(limits).read_image().map_err(|error| error.to_string())?;
            Ok(match decoded {
                DecodingResult::U16(values) => Values::Whole(values),
                DecodingResult::F16(values) => Values::Floats(values.into_iter().map(f32::from).collect()),
                DecodingResult::F32(values) => Values::Floats(values),
                DecodingResult::F64(values) => Values::Floats(values.into_iter().map(|value| value as f32).collect()),
                DecodingResult::I16(values) => Values::Floats(values.into_iter().map(f32::from).collect()),
                DecodingResult::I32(values) => Values::Floats(values.into_iter().map(|value| value as f32).collect()),
                DecodingResult::U32(values) => Values::Floats(values.into_iter().map(|value| value as f32).collect()),
                _ => return Err("its values are of a type that is not read".into()),
            })
        };
        let values = guard(read).map_err(|what: String| damaged(job, &what))?;
        let len = match &values {
            Values::Whole(values) => values.len(),
            Values::Floats(values) => values.len(),
        };
        if len == count { Ok(values) } else { Err(damaged(job, "the size of the image differs from its header")) }
    }
}
