//! Colours of any type and limits to 8 bits.

use super::{super::Job, element::Stored, source::Source, xml::ScanHeader};
use crate::color_scale::{ColorScale, Levels};

/// Colour of the points of a scan without colours, if another scan has colours.
pub(super) const GREY: [u8; 3] = [200; 3];

/// Where the colours of a scan are, and what their values mean.
#[derive(Clone, Copy)]
pub(super) struct Tint {
    elements: [usize; 3],
    /// The values of black and of full colour, per channel.
    limits: [[f64; 2]; 3],
    /// Whether some limit is unknown.
    unknown: bool,
}

impl Tint {
    /// What the header tells; `None` if there are no colours.
    pub(super) fn of(header: &ScanHeader) -> Option<Self> {
        let elements = header.elements(["colorRed", "colorGreen", "colorBlue"])?;
        let sane = |limits: &[f64; 2]| limits[0] < limits[1] && limits.iter().all(|limit| limit.abs() < 1e10);
        let mut tint = Self { elements, limits: [[0.0, 255.0]; 3], unknown: false };
        for channel in 0..3 {
            let own = match header.elements[elements[channel]].stored {
                Stored::Integer { min, max } => Some([min as f64, max as f64]),
                Stored::Scaled { min, max, scale, offset } => {
                    Some([min as f64 * scale + offset, max as f64 * scale + offset])
                }
                Stored::Single | Stored::Double | Stored::Text => None,
            };
            let limits = header.color_limits[channel].filter(sane).or(own.filter(sane));
            tint.unknown |= limits.is_none();
            tint.limits[channel] = limits.unwrap_or([0.0, 255.0]);
        }
        Some(tint)
    }

    /// Where the values of points lie, as far as that tells the limits.
    pub(super) fn levels(&self, source: &Source<'_>) -> Levels {
        if !self.needs_levels() {
            return Levels::default();
        }
        Levels::of(source.len(), |i| [0, 1, 2].map(|channel| self.value(source, channel, i)))
    }

    fn needs_levels(&self) -> bool {
        self.unknown || self.limits.iter().any(|limits| limits[1] > 255.0)
    }

    /// Settles the limits by the values of all points.
    pub(super) fn settle(&mut self, levels: Levels, job: &Job<'_>) {
        if !self.needs_levels() {
            return;
        }
        let scale = ColorScale::of_levels(levels, true);
        if self.unknown || scale.full() == 255.0 {
            let narrow = "colour limits exceed 255, but no value does; read as 8 bits";
            let note = scale.note().or_else(|| (!self.unknown).then(|| narrow.to_owned()));
            note.iter().for_each(|note| job.note(note));
            self.limits = [[0.0, scale.full()]; 3];
        }
    }

    fn value(&self, source: &Source<'_>, channel: usize, point: usize) -> f64 {
        source.values.streams[self.elements[channel]].value(source.value_of(point))
    }

    /// The value of a channel, 0 to 1.
    fn part(&self, source: &Source<'_>, channel: usize, point: usize) -> f64 {
        let [low, high] = self.limits[channel];
        (self.value(source, channel, point) - low) / (high - low)
    }

    pub(super) fn bytes(&self, source: &Source<'_>, point: usize) -> [u8; 3] {
        [0, 1, 2].map(|channel| match self.limits[channel] {
            [0.0, 255.0] => (self.value(source, channel, point) + 0.5) as u8,
            // Values are cut, not rounded: that restores the byte both of v * 256 and of v * 257.
            [0.0, 65535.0] => (self.value(source, channel, point) / 256.0) as u8,
            _ => (self.part(source, channel, point) * 255.0 + 0.5) as u8,
        })
    }

    /// The value of a channel as 16 bits.
    pub(super) fn wide(&self, source: &Source<'_>, channel: usize, point: usize) -> u16 {
        (self.part(source, channel, point) * 65535.0 + 0.5) as u16
    }

    /// Whether 8 bits lose something of a colour.
    pub(super) fn loses(&self, source: &Source<'_>, point: usize) -> bool {
        let bytes = self.bytes(source, point);
        let same = |channel| {
            let exact = self.part(source, channel, point) * 255.0;
            (exact - f64::from(bytes[channel])).abs() < 1e-4
        };
        !(0..3).all(same)
    }
}
