//! The GPS times of compressed records. See docs/decisions/0020-laz-codec.md.
//!
//! # How it works
//!
//! The 64 bits of a time are coded as an integer, as the difference from the previous time. A code states a multiple of
//! the sequence's usual step, and a correction follows. Scanners that alternate have alternating times. Four sequences
//! are therefore kept, and a code switches to another one, in which the time is coded anew.
//!
//! Damaged data can loop at that switch. A repeated code costs less and less, finally some ten-thousandths of a bit, so
//! a few bytes may encode millions of switches for one point. A writer switches straight to the sequence it needs, so
//! many switches mean damage. (The `laz` crate recurses at each switch until its stack overflows.)

use std::io::{self, Cursor, Read};

use laz::{
    decoders::ArithmeticDecoder,
    decompressors::{IntegerDecompressor, IntegerDecompressorBuilder},
    models::{ArithmeticModel, ArithmeticModelBuilder},
    record::FieldDecompressor,
};

/// Most switches of sequence per time. Writers need one, and three reach every sequence.
const MAX_SWITCHES: usize = 8;

const SEQUENCES: usize = 4;

/// Number of codes for multiples of the step: 0 to 500, and -1 to -10.
const MULTIPLES: u32 = 511;

/// Most differences in a sequence that do not fit its step. The next such difference becomes the step.
const MAX_MISFITS: u8 = 3;

/// Decoder of consecutive times.
pub(super) struct GpsTimes {
    sequences: [Sequence; SEQUENCES],
    /// Index of the sequence of the last time, and of the newest sequence.
    current: usize,
    newest: usize,
    /// Models of the codes in a sequence without a step, and in one with a step.
    resting: ArithmeticModel,
    moving: ArithmeticModel,
    correction: IntegerDecompressor,
    repeats: bool,
}

#[derive(Clone, Copy, Default)]
struct Sequence {
    time: i64,
    step: i32,
    misfits: u8,
}

enum Code {
    /// The same time as before.
    Repeat,
    /// About a multiple of the step.
    Multiple(u32),
    /// Too far from all sequences: the time begins a new one.
    Begin,
    /// In the sequence this many places further on.
    Switch(usize),
}

impl GpsTimes {
    /// A decoder after the time `first`. `repeats` adds a code for repeated times, which formats 6 and up do not need.
    pub(super) fn new(first: i64, repeats: bool) -> Self {
        let others = u32::from(repeats) + SEQUENCES as u32;
        let mut sequences = [Sequence::default(); SEQUENCES];
        sequences[0].time = first;
        Self {
            sequences,
            current: 0,
            newest: 0,
            resting: ArithmeticModelBuilder::new(1 + others).build(),
            moving: ArithmeticModelBuilder::new(MULTIPLES + others).build(),
            correction: IntegerDecompressorBuilder::new().bits(32).contexts(9).build_initialized(),
            repeats,
        }
    }

    pub(super) fn next<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<i64> {
        for _ in 0..=MAX_SWITCHES {
            let sequence = &mut self.sequences[self.current % SEQUENCES];
            let code = match sequence.step {
                0 => resting(decoder.decode_symbol(&mut self.resting)?, self.repeats),
                _ => moving(decoder.decode_symbol(&mut self.moving)?, self.repeats),
            };
            match code {
                Code::Repeat => return Ok(sequence.time),
                Code::Multiple(code) => return sequence.advance(code, decoder, &mut self.correction),
                Code::Begin => {
                    let high = self.correction.decompress(decoder, (sequence.time >> 32) as i32, 8)?;
                    let time = i64::from(high) << 32 | i64::from(decoder.read_int()?);
                    self.newest = (self.newest + 1) % SEQUENCES;
                    self.current = self.newest;
                    self.sequences[self.current] = Sequence { time, step: 0, misfits: 0 };
                    return Ok(time);
                }
                Code::Switch(on) => self.current = (self.current + on) % SEQUENCES,
            }
        }
        Err(io::Error::new(io::ErrorKind::InvalidData, "a GPS time belongs to no sequence"))
    }
}

/// Meaning of a symbol in a sequence whose times have not changed yet.
fn resting(symbol: u32, repeats: bool) -> Code {
    match (symbol, repeats) {
        (0, true) => Code::Repeat,
        (0, false) | (1, true) => Code::Multiple(0),
        (symbol, repeats) => other(symbol - 1 - u32::from(repeats)),
    }
}

/// Meaning of a symbol in a sequence with a step.
fn moving(symbol: u32, repeats: bool) -> Code {
    match (symbol.checked_sub(MULTIPLES), repeats) {
        (None, _) => Code::Multiple(symbol),
        (Some(0), true) => Code::Repeat,
        (Some(rest), repeats) => other(rest - u32::from(repeats)),
    }
}

fn other(rest: u32) -> Code {
    match rest {
        0 => Code::Begin,
        on => Code::Switch(on as usize),
    }
}

impl Sequence {
    fn advance<R: Read>(
        &mut self,
        code: u32,
        decoder: &mut ArithmeticDecoder<R>,
        correction: &mut IntegerDecompressor,
    ) -> io::Result<i64> {
        let times = |factor: i32| self.step.wrapping_mul(factor);
        // The expected difference, the context of its correction, and whether the difference does not fit the step.
        let (expected, context, misfit) = match code {
            _ if self.step == 0 => (0, 0, false),
            0 => (0, 7, true),
            1 => (self.step, 1, false),
            2..10 => (times(code as i32), 2, false),
            10..500 => (times(code as i32), 3, false),
            500 => (times(500), 4, true),
            501..510 => (times(500 - code as i32), 5, false),
            _ => (times(-10), 6, true),
        };
        let difference = correction.decompress(decoder, expected, context)?;
        self.time = self.time.wrapping_add(i64::from(difference));
        self.misfits += u8::from(misfit);
        if self.step == 0 || self.misfits > MAX_MISFITS {
            self.step = difference;
            self.misfits = 0;
        } else if code == 1 {
            self.misfits = 0;
        }
        Ok(self.time)
    }
}

/// The times of point formats 1 to 5, from version 2 of the compression on.
pub(super) struct GpsTime11(GpsTimes);

impl Default for GpsTime11 {
    fn default() -> Self {
        Self(GpsTimes::new(0, true))
    }
}

impl<'a> FieldDecompressor<Cursor<&'a [u8]>> for GpsTime11 {
    fn size_of_field(&self) -> usize {
        size_of::<i64>()
    }

    fn decompress_first(&mut self, src: &mut Cursor<&'a [u8]>, first_point: &mut [u8]) -> io::Result<()> {
        let mut bytes = [0; size_of::<i64>()];
        src.read_exact(&mut bytes)?;
        first_point.copy_from_slice(&bytes);
        self.0 = GpsTimes::new(i64::from_le_bytes(bytes), true);
        Ok(())
    }

    fn decompress_with(&mut self, decoder: &mut ArithmeticDecoder<Cursor<&'a [u8]>>, buf: &mut [u8]) -> io::Result<()> {
        buf.copy_from_slice(&self.0.next(decoder)?.to_le_bytes());
        Ok(())
    }
}
