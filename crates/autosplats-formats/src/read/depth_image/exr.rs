//! OpenEXR: the channel of depths.

use std::io::Cursor;

use autosplats_cloud::{Error, guard};
use exr::{
    image::FlatSamples,
    meta::{MetaData, attribute::SampleType, header::Header as LayerHeader},
    prelude::{ReadChannels as _, ReadLayers as _},
};

use super::{super::Job, MAX_EXPANSION};

pub(super) const MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Header of an EXR, and where its depths are.
pub(super) struct Header {
    /// Size of the whole picture; the layer may cover a part of it.
    pub(super) width: usize,
    pub(super) height: usize,
    layer: usize,
    pub(super) channel: String,
    pub(super) type_name: &'static str,
    /// Bytes of all pixels in memory.
    bytes: usize,
}

fn failed(job: &Job<'_>, what: &str) -> Error {
    job.malformed("the EXR's header or pixels", format!("{what}; copy the file again, or write it again as ZIP"))
}

/// How much a channel's name says that it holds depths: less is more. `None` if it does not.
fn rank(name: &str, alone: bool) -> Option<usize> {
    let name = name.to_lowercase();
    let parts: Vec<&str> = name.split('.').collect();
    match parts.as_slice() {
        ["z" | "depth"] => Some(0),
        // Blender's passes.
        [.., "depth", _] | [.., "depth"] => Some(1),
        // A single channel has depths whatever its name: programs write Y, R or V.
        [_] | [.., "z" | "v" | "y" | "r"] if alone => Some(2),
        _ => None,
    }
}

impl Header {
    pub(super) fn parse(job: &Job<'_>) -> Result<Self, Error> {
        let read = || MetaData::read_from_buffered(Cursor::new(job.bytes), false).map_err(|error| error.to_string());
        let meta = guard(read).map_err(|what| failed(job, &what))?;
        let channels = |header: &LayerHeader| header.channels.list.len();
        let alone = meta.headers.iter().map(channels).sum::<usize>() == 1;
        let named = meta.headers.iter().enumerate().flat_map(|(layer, header)| {
            header.channels.list.iter().filter_map(move |channel| {
                let name = channel.name.to_string();
                let prefix = header.own_attributes.layer_name.as_ref().filter(|_| !name.contains('.'));
                let full = prefix.map_or_else(|| name.clone(), |prefix| format!("{prefix}.{name}"));
                let plain = rank(&name, alone).or_else(|| rank(&full, alone))?;
                Some((plain, layer, name, channel))
            })
        });
        let Some((_, layer, channel, found)) = named.min_by_key(|(rank, layer, ..)| (*rank, *layer)) else {
            return Err(super::no_depth(job, "EXR without a channel Z or depth"));
        };
        if found.sampling.x() != 1 || found.sampling.y() != 1 {
            return Err(super::no_depth(job, "EXR whose depths have a lower resolution"));
        }
        let type_name = match found.sample_type {
            SampleType::F16 => "float16",
            SampleType::F32 => "float32",
            SampleType::U32 => "uint32",
        };
        let window = meta.headers[layer].shared_attributes.display_window.size;
        let (width, height) = (window.width(), window.height());
        let size = |header: &LayerHeader| {
            let pixels = header.layer_size.width().saturating_mul(header.layer_size.height());
            pixels.saturating_mul(header.channels.bytes_per_pixel)
        };
        let bytes =
            meta.headers.iter().map(size).fold(width.saturating_mul(height).saturating_mul(4), usize::saturating_add);
        if width == 0 || height == 0 || bytes / MAX_EXPANSION > job.bytes.len() {
            let what = format!("{width} × {height} pixels cannot be in {} bytes", job.bytes.len());
            return Err(failed(job, &what));
        }
        Ok(Self { width, height, layer, channel, type_name, bytes })
    }

    /// All depths, row by row; 0 where the layer does not reach.
    pub(super) fn values(&self, job: &Job<'_>) -> Result<Vec<f32>, Error> {
        job.check_memory(1, self.bytes)?;
        let read = || {
            let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().all_layers();
            let reader = reader.all_attributes().non_parallel();
            let image = reader.from_buffered(Cursor::new(job.bytes)).map_err(|error| error.to_string())?;
            let window = image.attributes.display_window;
            let layer = image.layer_data.get(self.layer).ok_or("a layer is missing")?;
            let named = layer.channel_data.list.iter().find(|channel| channel.name.to_string() == self.channel);
            let samples = &named.ok_or("the channel of depths is missing")?.sample_data;
            let mut values = vec![0.0; self.width * self.height];
            let offset = layer.attributes.layer_position - window.position;
            for (index, value) in floats(samples).enumerate() {
                let (x, y) = (index % layer.size.width(), index / layer.size.width());
                let place = |at: usize, by: i32, len: usize| {
                    usize::try_from(at as i64 + i64::from(by)).ok().filter(|at| *at < len)
                };
                if let (Some(x), Some(y)) = (place(x, offset.x(), self.width), place(y, offset.y(), self.height)) {
                    values[y * self.width + x] = value;
                }
            }
            Ok(values)
        };
        guard(read).map_err(|what: String| failed(job, &what))
    }
}

fn floats(samples: &FlatSamples) -> Box<dyn Iterator<Item = f32> + '_> {
    match samples {
        FlatSamples::F16(values) => Box::new(values.iter().map(|value| value.to_f32())),
        FlatSamples::F32(values) => Box::new(values.iter().copied()),
        FlatSamples::U32(values) => Box::new(values.iter().map(|value| *value as f32)),
    }
}
