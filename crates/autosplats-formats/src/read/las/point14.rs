//! POINT14, the part of compressed records that point formats 6 and up share. See docs/decisions/0020-laz-codec.md.
//!
//! # How it works
//!
//! Each kind of value has its own layer in the chunk. Each scanner channel has its own statistics, which begin as
//! copies of the previous channel's last point. A symbol states which values differ from the last point of the channel.
//! The others are predicted: a coordinate's step by the median of the last five steps of the same kind of return,
//! heights and intensities by the last one of the kind. Corrections are coded in contexts given by the size of earlier
//! ones.
//!
//! The `laz` crate's coder is used here. Its POINT14 is not: damaged times overflow its stack
//! ([`gps_time`](super::gps_time)).

use std::io::{self, Cursor, ErrorKind, Read as _};

use laz::{
    DecompressionSelection,
    decoders::ArithmeticDecoder,
    decompressors::{IntegerDecompressor, IntegerDecompressorBuilder},
    models::{ArithmeticModel, ArithmeticModelBuilder},
    record::LayeredFieldDecompressor,
};

use self::statistics::{Median, Models, return_kind, size};
use super::gps_time::GpsTimes;

mod statistics;
#[cfg(test)]
mod tests;

/// Bytes of POINT14 in a record.
const LEN: usize = 30;

const CHANNELS: usize = 4;

/// Number of layers. Their order in the chunk: channel, returns, x and y; z; class; flags; intensity; angle; user data;
/// source; time. A layer is empty if its value is the same for all points.
pub(super) const LAYERS: usize = 9;

/// What selects each layer. The first is always decoded.
const KINDS: [u32; LAYERS] = [
    DecompressionSelection::XY_RETURNS_CHANNEL,
    DecompressionSelection::Z,
    DecompressionSelection::CLASSIFICATION,
    DecompressionSelection::FLAGS,
    DecompressionSelection::INTENSITY,
    DecompressionSelection::SCAN_ANGLE,
    DecompressionSelection::USER_DATA,
    DecompressionSelection::POINT_SOURCE_ID,
    DecompressionSelection::GPS_TIME,
];

type Layer = ArithmeticDecoder<Cursor<Vec<u8>>>;

/// Decoder of POINT14 in the records of one chunk.
pub(super) struct Point14 {
    /// Whether later items receive the channel of every point, or only where it changes, as the first writers had it.
    reports_channel: bool,
    selection: DecompressionSelection,
    sizes: [u32; LAYERS],
    layers: [Option<Layer>; LAYERS],
    channels: [Option<Box<Channel>>; CHANNELS],
    current: usize,
}

impl Point14 {
    /// A decoder for version 3 or 4 of the compression.
    pub(super) fn new(version: u16) -> Self {
        Self {
            reports_channel: version > 3,
            selection: DecompressionSelection::all(),
            sizes: [0; LAYERS],
            layers: [const { None }; LAYERS],
            channels: [const { None }; CHANNELS],
            current: 0,
        }
    }
}

fn damaged(what: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, what)
}

impl<'a> LayeredFieldDecompressor<Cursor<&'a [u8]>> for Point14 {
    fn size_of_field(&self) -> usize {
        LEN
    }

    /// Values that are not selected stay those of the first point. No other value depends on them.
    fn set_selection(&mut self, selection: DecompressionSelection) {
        self.selection = selection;
    }

    fn init_first_point(
        &mut self,
        src: &mut Cursor<&'a [u8]>,
        first_point: &mut [u8],
        context: &mut usize,
    ) -> io::Result<()> {
        let mut bytes = [0; LEN];
        src.read_exact(&mut bytes)?;
        first_point.copy_from_slice(&bytes);
        let point = Point::from_bytes(&bytes);
        self.current = point.channel();
        self.channels = [const { None }; CHANNELS];
        self.channels[self.current] = Some(Box::new(Channel::new(point)));
        *context = self.current;
        Ok(())
    }

    fn read_layers_sizes(&mut self, src: &mut Cursor<&'a [u8]>) -> io::Result<()> {
        for size in &mut self.sizes {
            let mut bytes = [0; 4];
            src.read_exact(&mut bytes)?;
            *size = u32::from_le_bytes(bytes);
        }
        Ok(())
    }

    fn read_layers(&mut self, src: &mut Cursor<&'a [u8]>) -> io::Result<()> {
        for ((layer, size), kind) in self.layers.iter_mut().zip(self.sizes).zip(KINDS) {
            *layer = None;
            if size > 0 {
                let rest = usize::try_from(src.position()).ok().and_then(|at| src.get_ref().get(at..));
                let bytes = rest.and_then(|rest| rest.get(..size as usize)).ok_or(ErrorKind::UnexpectedEof)?;
                if self.selection.0 & kind == kind {
                    let mut decoder = ArithmeticDecoder::new(Cursor::new(bytes.to_vec()));
                    decoder.read_init_bytes()?;
                    *layer = Some(decoder);
                }
                src.set_position(src.position() + u64::from(size));
            }
        }
        Ok(())
    }

    fn decompress_field_with(&mut self, current_point: &mut [u8], context: &mut usize) -> io::Result<()> {
        let [Some(places), ..] = &mut self.layers else { return Err(damaged("there are no positions")) };
        let unknown = || damaged("there is no first point");
        let before = self.channels[self.current].as_deref_mut().ok_or_else(unknown)?;
        let changes = Changes(places.decode_symbol(&mut before.changes[before.kind() % 8])?);
        if changes.channel() {
            let on = places.decode_symbol(&mut before.next_channel)? as usize;
            let last = before.last;
            self.current = (self.current + on + 1) % CHANNELS;
            let channel = self.channels[self.current].get_or_insert_with(|| Box::new(Channel::new(last)));
            channel.last.set_channel(self.current);
        }
        if changes.channel() || self.reports_channel {
            *context = self.current;
        }
        let channel = self.channels[self.current].as_deref_mut().ok_or_else(unknown)?;
        channel.advance(changes, &mut self.layers)?;
        current_point.copy_from_slice(&channel.last.to_bytes());
        Ok(())
    }
}

/// Bits that state which values differ from the last point of the channel.
#[derive(Clone, Copy)]
struct Changes(u32);

impl Changes {
    /// Whether the channel differs from that of the previous point.
    fn channel(self) -> bool {
        self.0 & 64 != 0
    }

    fn source(self) -> bool {
        self.0 & 32 != 0
    }

    fn time(self) -> bool {
        self.0 & 16 != 0
    }

    fn angle(self) -> bool {
        self.0 & 8 != 0
    }

    fn return_count(self) -> bool {
        self.0 & 4 != 0
    }

    /// 0 for the same number, 1 for one more, 2 for one less, 3 for another.
    fn return_number(self) -> u32 {
        self.0 & 3
    }
}

/// The values of a point.
#[derive(Clone, Copy)]
struct Point {
    position: [i32; 3],
    intensity: u16,
    /// Return number in the lower four bits, number of returns of the pulse in the upper four.
    returns: u8,
    /// Flags, with the channel in bits 4 and 5.
    flags: u8,
    class: u8,
    user_data: u8,
    angle: i16,
    source: u16,
    /// The bits of the floating-point number.
    time: i64,
}

impl Point {
    fn from_bytes(bytes: &[u8; LEN]) -> Self {
        let u16_at = |at: usize| u16::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        let i32_at = |at: usize| i32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        Self {
            position: [0, 4, 8].map(i32_at),
            intensity: u16_at(12),
            returns: bytes[14],
            flags: bytes[15],
            class: bytes[16],
            user_data: bytes[17],
            angle: u16_at(18) as i16,
            source: u16_at(20),
            time: i64::from_le_bytes(std::array::from_fn(|i| bytes[22 + i])),
        }
    }

    fn to_bytes(self) -> [u8; LEN] {
        let mut bytes = [0; LEN];
        bytes[..12].copy_from_slice(self.position.map(i32::to_le_bytes).as_flattened());
        bytes[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        bytes[14..18].copy_from_slice(&[self.returns, self.flags, self.class, self.user_data]);
        bytes[18..20].copy_from_slice(&self.angle.to_le_bytes());
        bytes[20..22].copy_from_slice(&self.source.to_le_bytes());
        bytes[22..].copy_from_slice(&self.time.to_le_bytes());
        bytes
    }

    fn channel(&self) -> usize {
        usize::from(self.flags >> 4 & 3)
    }

    fn set_channel(&mut self, channel: usize) {
        self.flags = self.flags & 0xcf | (channel as u8 & 3) << 4;
    }

    /// Return number, and number of returns.
    fn returns(&self) -> (u8, u8) {
        (self.returns & 15, self.returns >> 4)
    }
}

/// State of a scanner channel.
struct Channel {
    last: Point,
    time_changed: bool,
    /// The last steps in x and y, by the kind of return and whether the time changed.
    steps: [[Median; 2]; 12],
    /// Last height, by the number of returns still to come.
    heights: [i32; 8],
    intensities: [u16; 8],
    changes: [ArithmeticModel; 8],
    next_channel: ArithmeticModel,
    return_counts: Models<16>,
    return_numbers: Models<16>,
    /// Steps of the return number within a pulse.
    return_skips: ArithmeticModel,
    classes: Models<64>,
    flags: Models<64>,
    user_data: Models<64>,
    x: IntegerDecompressor,
    y: IntegerDecompressor,
    z: IntegerDecompressor,
    intensity: IntegerDecompressor,
    angle: IntegerDecompressor,
    source: IntegerDecompressor,
    times: GpsTimes,
}

impl Channel {
    /// A channel whose points follow this one.
    fn new(last: Point) -> Self {
        let model = |symbols| ArithmeticModelBuilder::new(symbols).build();
        let integer =
            |bits, contexts| IntegerDecompressorBuilder::new().bits(bits).contexts(contexts).build_initialized();
        Self {
            last,
            time_changed: false,
            steps: Default::default(),
            heights: [last.position[2]; 8],
            intensities: [last.intensity; 8],
            changes: std::array::from_fn(|_| model(128)),
            next_channel: model(CHANNELS as u32 - 1),
            return_counts: Models::new(16),
            return_numbers: Models::new(16),
            return_skips: model(13),
            classes: Models::new(256),
            flags: Models::new(64),
            user_data: Models::new(256),
            x: integer(32, 2),
            y: integer(32, 22),
            z: integer(32, 20),
            intensity: integer(16, 4),
            angle: integer(16, 2),
            source: integer(16, 1),
            times: GpsTimes::new(last.time, false),
        }
    }

    /// Kind of the last return: first or not, last or not, new time or not.
    fn kind(&self) -> usize {
        let (number, count) = self.last.returns();
        usize::from(number == 1) | usize::from(number >= count) << 1 | usize::from(self.time_changed) << 2
    }

    /// Decodes the next point of the channel.
    fn advance(&mut self, changes: Changes, layers: &mut [Option<Layer>; LAYERS]) -> io::Result<()> {
        let [Some(places), heights, classes, flags, intensities, angles, users, sources, times] = layers else {
            return Err(damaged("there are no positions"));
        };
        let last = &mut self.last;
        let later = usize::from(changes.time());
        self.time_changed = changes.time();

        let (mut number, mut count) = last.returns();
        let before = usize::from(number);
        if changes.return_count() {
            count = places.decode_symbol(self.return_counts.get(count.into()))? as u8;
        }
        number = match (changes.return_number(), changes.time()) {
            (0, _) => number,
            (1, _) => number + 1,
            (2, _) => number + 15,
            (_, true) => places.decode_symbol(self.return_numbers.get(before))? as u8,
            (_, false) => number + 2 + places.decode_symbol(&mut self.return_skips)? as u8,
        } & 15;
        last.returns = count << 4 | number;
        let single = u32::from(count == 1);
        let (first, end) = (number == 1, number >= count);
        let kind = usize::from(first) << 1 | usize::from(end);

        let [x_steps, y_steps] = &mut self.steps[usize::from(return_kind(count, number)) << 1 | later];
        let step = self.x.decompress(places, x_steps.middle(), single)?;
        x_steps.add(step);
        last.position[0] = last.position[0].wrapping_add(step);
        let step = self.y.decompress(places, y_steps.middle(), single + size(self.x.k(), 20))?;
        y_steps.add(step);
        last.position[1] = last.position[1].wrapping_add(step);
        if let Some(layer) = heights {
            let height = &mut self.heights[usize::from(number.abs_diff(count).min(7))];
            let context = single + size((self.x.k() + self.y.k()) / 2, 18);
            *height = self.z.decompress(layer, *height, context)?;
            last.position[2] = *height;
        }
        if let Some(layer) = classes {
            let model = self.classes.get(usize::from(last.class & 31) << 1 | usize::from(first && end));
            last.class = layer.decode_symbol(model)? as u8;
        }
        if let Some(layer) = flags {
            // Flags without the channel bits between them.
            let model = self.flags.get(usize::from(last.flags & 15 | last.flags >> 2 & 48));
            let coded = layer.decode_symbol(model)? as u8;
            last.flags = last.flags & 48 | coded & 15 | (coded & 48) << 2;
        }
        if let Some(layer) = intensities {
            let intensity = &mut self.intensities[kind << 1 | later];
            *intensity = self.intensity.decompress(layer, (*intensity).into(), kind as u32)? as u16;
            last.intensity = *intensity;
        }
        if let (Some(layer), true) = (angles, changes.angle()) {
            last.angle = self.angle.decompress(layer, last.angle.into(), later as u32)? as i16;
        }
        if let Some(layer) = users {
            last.user_data = layer.decode_symbol(self.user_data.get(usize::from(last.user_data) / 4))? as u8;
        }
        if let (Some(layer), true) = (sources, changes.source()) {
            last.source = self.source.decompress(layer, last.source.into(), 0)? as u16;
        }
        if let (Some(layer), true) = (times, changes.time()) {
            last.time = self.times.next(layer)?;
        }
        Ok(())
    }
}
