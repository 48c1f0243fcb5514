//! The GPS times of compressed records.
//!
//! # How it works
//!
//! A time is its 64 bits as an integer, coded as the difference from the one before: a small multiple, told by a code, of a
//! step that the sequence usually takes, and a correction. Where scanners take turns their times alternate, so four
//! sequences are remembered, and a code switches to another of them, in which the time is coded anew.
//!
//! That is the place where damaged data can go round for ever: a code that is repeated costs less and less, in the end
//! some ten-thousandths of a bit, so that a few bytes can be millions of switches for one point. A writer switches to the
//! sequence that it needs, so more than a handful is damage. (The `laz` crate calls itself for each, until the stack is
//! full.)

use std::io::{self, Cursor, Read};

use laz::{
    decoders::ArithmeticDecoder,
    decompressors::{IntegerDecompressor, IntegerDecompressorBuilder},
    models::{ArithmeticModel, ArithmeticModelBuilder},
    record::FieldDecompressor,
};

/// A writer needs one; from anywhere, three reach all.
const MAX_SWITCHES: usize = 8;

const SEQUENCES: usize = 4;

/// Multiples of the step that codes tell of, 0 to 500 and -1 to -10.
const MULTIPLES: u32 = 511;

/// After so many times that are no multiple of the step, in one sequence, the step is what the last of them took.
const MAX_STRAYS: u8 = 3;

/// Decodes times that follow each other.
pub(super) struct GpsTimes {
    sequences: [Sequence; SEQUENCES],
    /// The sequence of the last time, and the one that began last.
    current: usize,
    newest: usize,
    /// Codes of a sequence that has no step yet, and of one that has.
    resting: ArithmeticModel,
    moving: ArithmeticModel,
    correction: IntegerDecompressor,
    repeats: bool,
}

#[derive(Clone, Copy, Default)]
struct Sequence {
    time: i64,
    step: i32,
    strays: u8,
}

enum Code {
    /// The same time as before.
    Repeat,
    /// About a multiple of the step.
    Multiple(u32),
    /// Too far from all sequences: it begins one.
    Begin,
    /// In the sequence that is so many further on.
    Switch(usize),
}

impl GpsTimes {
    /// Whether there is a code for times that repeat; records of formats 6 and up say it elsewhere.
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
                    self.sequences[self.current] = Sequence { time, step: 0, strays: 0 };
                    return Ok(time);
                }
                Code::Switch(on) => self.current = (self.current + on) % SEQUENCES,
            }
        }
        Err(io::Error::new(io::ErrorKind::InvalidData, "a GPS time belongs to no sequence"))
    }
}

/// What the symbols are of a sequence whose times have not changed.
fn resting(symbol: u32, repeats: bool) -> Code {
    match (symbol, repeats) {
        (0, true) => Code::Repeat,
        (0, false) | (1, true) => Code::Multiple(0),
        (symbol, repeats) => other(symbol - 1 - u32::from(repeats)),
    }
}

/// What the symbols are of a sequence that has a step.
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
        // The difference that is expected, how corrections to it are coded, and whether it is far from what was expected.
        let (expected, context, stray) = match code {
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
        self.strays += u8::from(stray);
        if self.step == 0 || self.strays > MAX_STRAYS {
            self.step = difference;
            self.strays = 0;
        } else if code == 1 {
            self.strays = 0;
        }
        Ok(self.time)
    }
}

/// The times of formats 1 to 5 from the second version of their compression on.
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
