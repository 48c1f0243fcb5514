//! Colours of any type and limits to 8 bits.

use autosplats_cloud::{Error, FieldValues, PointCloud};
use rayon::prelude::*;

use super::{
    super::{Job, placed::fill, table::ProgressRange},
    element::Stored,
    source::Source,
};
use crate::color_scale::ColorScale;

/// Colour of the points of a scan without colours, if another scan has colours.
const GREY: [u8; 3] = [200; 3];

/// The colours of a scan.
#[derive(Clone, Copy)]
pub(super) struct Colors<'a> {
    source: &'a Source<'a>,
    elements: [usize; 3],
    /// The values of black and of full colour, per channel.
    limits: [[f64; 2]; 3],
}

impl<'a> Colors<'a> {
    pub(super) fn new(job: &Job<'_>, source: &'a Source<'a>) -> Option<Self> {
        let header = source.header;
        let elements = header.elements(["colorRed", "colorGreen", "colorBlue"])?;
        let mut colors = Self { source, elements, limits: [[0.0, 255.0]; 3] };
        let sane = |limits: &[f64; 2]| limits[0] < limits[1] && limits.iter().all(|limit| limit.abs() < 1e10);
        let mut unknown = false;
        for channel in 0..3 {
            let own = match header.elements[elements[channel]].stored {
                Stored::Integer { min, max } => Some([min as f64, max as f64]),
                Stored::Scaled { min, max, scale, offset } => {
                    Some([min as f64 * scale + offset, max as f64 * scale + offset])
                }
                Stored::Single | Stored::Double | Stored::Text => None,
            };
            let limits = header.color_limits[channel].filter(sane).or(own.filter(sane));
            unknown |= limits.is_none();
            colors.limits[channel] = limits.unwrap_or([0.0, 255.0]);
        }
        let wide = colors.limits.iter().any(|limits| limits[1] > 255.0);
        if unknown || wide {
            let scale = ColorScale::of(source.len(), true, |i| [0, 1, 2].map(|channel| colors.value(channel, i)));
            if unknown || scale.full() == 255.0 {
                let narrow = "colour limits exceed 255, but no value does; read as 8 bits";
                let note = scale.note().or_else(|| (!unknown).then(|| narrow.to_owned()));
                note.iter().for_each(|note| job.note(note));
                colors.limits = [[0.0, scale.full()]; 3];
            }
        }
        Some(colors)
    }

    fn value(&self, channel: usize, point: usize) -> f64 {
        self.source.values.streams[self.elements[channel]].value(self.source.value_of(point))
    }

    /// The value of a channel, 0 to 1.
    fn part(&self, channel: usize, point: usize) -> f64 {
        let [low, high] = self.limits[channel];
        (self.value(channel, point) - low) / (high - low)
    }

    pub(super) fn bytes(&self, point: usize) -> [u8; 3] {
        [0, 1, 2].map(|channel| match self.limits[channel] {
            [0.0, 255.0] => (self.value(channel, point) + 0.5) as u8,
            // Values are cut, not rounded: that restores the byte both of v * 256 and of v * 257.
            [0.0, 65535.0] => (self.value(channel, point) / 256.0) as u8,
            _ => (self.part(channel, point) * 255.0 + 0.5) as u8,
        })
    }

    fn wide(&self, channel: usize, point: usize) -> u16 {
        (self.part(channel, point) * 65535.0 + 0.5) as u16
    }

    /// Whether 8 bits keep all colours exactly.
    fn narrow(&self) -> bool {
        let same = |i| {
            let bytes = self.bytes(i);
            (0..3).all(|channel| (self.part(channel, i) * 255.0 - f64::from(bytes[channel])).abs() < 1e-4)
        };
        (0..self.source.len()).into_par_iter().all(same)
    }
}

/// Adds colours, if any scan has some. If all digits are wanted and 8 bits lose some, adds 16-bit fields too.
pub(super) fn color_fields(
    job: &Job<'_>,
    sources: &[Source<'_>],
    lens: &[usize],
    mut cloud: PointCloud,
    part: ProgressRange,
) -> Result<PointCloud, Error> {
    let colors: Vec<_> = sources.iter().map(|source| Colors::new(job, source)).collect();
    if colors.iter().all(Option::is_none) {
        return Ok(cloud);
    }
    let grey = lens.iter().zip(&colors).filter(|(_, colors)| colors.is_none()).map(|(len, _)| len).sum::<usize>();
    if grey > 0 {
        job.note(format!("{grey} points belong to scans without colours; they become grey"));
    }
    let bytes = fill(job, "colours", lens, part, |index| {
        let colors = &colors[index];
        move |i| colors.as_ref().map_or(GREY, |colors| colors.bytes(i))
    })?;
    cloud = cloud.with_colors(bytes)?;
    if job.options.exact && !colors.iter().flatten().all(Colors::narrow) {
        let part = ProgressRange { start: part.start + part.len, len: 0.0 };
        for (channel, name) in ["Red", "Green", "Blue"].into_iter().enumerate() {
            let wide = fill(job, name, lens, part, |index| {
                let colors = &colors[index];
                move |i| colors.as_ref().map_or(u16::from(GREY[channel]) * 257, |colors| colors.wide(channel, i))
            })?;
            cloud = cloud.with_field(name, FieldValues::U16(wide))?;
        }
    }
    Ok(cloud)
}
