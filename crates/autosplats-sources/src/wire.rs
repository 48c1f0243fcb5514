//! Numbers and strings in ROS messages. Records of MCAP files and bags use the layout of ROS 1.

use std::borrow::Cow;

use autosplats_cloud::one_line;

/// Serialization of a ROS message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// ROS 1: little-endian, without padding.
    Ros1,
    /// CDR of ROS 2: a header of four bytes gives the byte order, and numbers are aligned.
    Cdr,
}

/// First bytes of data compressed by Zstandard.
pub(crate) const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

/// A fault in a byte sequence and its offset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) at: usize,
    pub(crate) what: String,
}

impl Fault {
    pub(crate) fn new(at: usize, what: impl Into<String>) -> Self {
        Self { at, what: what.into() }
    }

    /// The offset as the `place` of an [`Error::Malformed`](autosplats_cloud::Error::Malformed).
    pub(crate) fn place(&self) -> String {
        format!("byte {}", self.at)
    }
}

/// Reader of single values that never reads beyond the end.
#[derive(Clone)]
pub(crate) struct Wire<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Offset from which alignment counts.
    start: usize,
    /// Largest alignment of a number, in bytes.
    alignment: usize,
    big_endian: bool,
    /// Whether strings end with a zero byte.
    zero: bool,
}

macro_rules! number {
    ($($type:ident),*) => {$(
        pub(crate) fn $type(&mut self, what: &str) -> Result<$type, Fault> {
            self.align(size_of::<$type>());
            let mut raw = [0; size_of::<$type>()];
            raw.copy_from_slice(self.take(size_of::<$type>(), what)?);
            Ok(if self.big_endian { $type::from_be_bytes(raw) } else { $type::from_le_bytes(raw) })
        }
    )*};
}

impl<'a> Wire<'a> {
    /// Reads little-endian values without padding, from offset `at` on.
    pub(crate) fn plain(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at, start: at, alignment: 1, big_endian: false, zero: false }
    }

    /// Reads a message.
    pub(crate) fn message(bytes: &'a [u8], encoding: Encoding) -> Result<Self, Fault> {
        if encoding == Encoding::Ros1 {
            return Ok(Self::plain(bytes, 0));
        }
        let Some([first, kind, _, _]) = bytes.first_chunk::<4>() else {
            return Err(Fault::new(0, "the message is cut off within the four bytes of its CDR header"));
        };
        if bytes.starts_with(ZSTD) {
            let what = "the messages of this recording are compressed one by one; convert it with 'ros2 bag convert'";
            return Err(Fault::new(0, what));
        }
        let alignment = match (first, kind) {
            (0, 0 | 1) => 8,
            // XCDR2 aligns 8-byte numbers to 4 bytes and is otherwise the same.
            (0, 6 | 7) => 4,
            (0, 2 | 3 | 8..=11) => {
                let what =
                    format!("CDR of kind {kind}, with parameters or lengths of structures; only plain CDR is read");
                return Err(Fault::new(0, what));
            }
            _ => return Err(Fault::new(0, format!("{first:02x}{kind:02x} begins no CDR message"))),
        };
        Ok(Self { bytes, at: 4, start: 4, alignment, big_endian: kind % 2 == 0, zero: true })
    }

    number!(u8, u16, u32, i32, u64, f64);

    /// Offset of the next byte.
    pub(crate) fn at(&self) -> usize {
        self.at
    }

    /// Number of bytes left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// Takes `len` bytes.
    pub(crate) fn take(&mut self, len: usize, what: &str) -> Result<&'a [u8], Fault> {
        let taken = self.at.checked_add(len).and_then(|end| self.bytes.get(self.at..end));
        let Some(taken) = taken else {
            let what = format!("{what}: {len} bytes expected, {} left; the data are cut off or damaged", self.left());
            return Err(Fault::new(self.at.min(self.bytes.len()), what));
        };
        self.at += len;
        Ok(taken)
    }

    /// Takes a byte string that is preceded by its length.
    pub(crate) fn bytes(&mut self, what: &str) -> Result<&'a [u8], Fault> {
        let len = self.u32(what)?;
        self.take(len as usize, what)
    }

    /// Takes a string. Invalid UTF-8 becomes replacement characters.
    pub(crate) fn string(&mut self, what: &str) -> Result<Cow<'a, str>, Fault> {
        let mut text = self.bytes(what)?;
        if self.zero {
            text = text.strip_suffix(b"\0").unwrap_or(text);
        }
        Ok(String::from_utf8_lossy(text))
    }

    /// Takes the length of a list with items of at least `least` bytes. Fails if the bytes left cannot hold the list.
    pub(crate) fn list(&mut self, least: usize, what: &str) -> Result<usize, Fault> {
        let at = self.at;
        let len = self.u32(what)? as usize;
        if len > self.left() / least {
            return Err(Fault::new(at, format!("{len} {what} do not fit into the {} bytes left", self.left())));
        }
        Ok(len)
    }

    fn align(&mut self, size: usize) {
        let from_start = self.at - self.start;
        self.at = self.start + from_start.next_multiple_of(size.min(self.alignment));
    }
}

/// Reads a message header: time of measurement in nanoseconds and name of the coordinate frame.
pub(crate) fn header<'a>(wire: &mut Wire<'a>, encoding: Encoding) -> Result<(i64, Cow<'a, str>), Fault> {
    let seconds = match encoding {
        Encoding::Ros1 => {
            let _sequence = wire.u32("the header")?;
            i64::from(wire.u32("the time stamp")?)
        }
        Encoding::Cdr => i64::from(wire.i32("the time stamp")?),
    };
    let nanoseconds = i64::from(wire.u32("the time stamp")?);
    let frame = wire.string("the frame's name")?;
    Ok((seconds * 1_000_000_000 + nanoseconds, frame))
}

/// Normalizes the name of a coordinate frame: ROS 1 put a slash before it.
pub(crate) fn frame_name(name: &str) -> String {
    one_line(name.strip_prefix('/').unwrap_or(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cdr_aligns_from_behind_its_header() -> Result<(), Fault> {
        let bytes = [0, 1, 0, 0, 7, 0xaa, 0xaa, 0xaa, 0x02, 0, 0, 0, b'a', 0, 0xaa, 0xaa, 5, 0, 0, 0];
        let mut wire = Wire::message(&bytes, Encoding::Cdr)?;
        assert_eq!(wire.u8("a")?, 7, "a byte");
        assert_eq!(wire.string("b")?, "a", "a string, of which the zero is no part");
        assert_eq!((wire.u32("c")?, wire.left()), (5, 0), "a number on its boundary");
        assert!(wire.u8("d").is_err(), "beyond the end");
        let eight = [&[0, 0, 0, 0, 1, 2, 3, 4][..], &[0; 4], &1.5_f64.to_be_bytes()].concat();
        let mut wire = Wire::message(&eight, Encoding::Cdr)?;
        assert_eq!((wire.u32("a")?, wire.f64("b")?), (0x0102_0304, 1.5), "big-endian");
        let second = [&[0, 7, 0, 0, 1, 0, 0, 0][..], &1.5_f64.to_le_bytes()].concat();
        let mut wire = Wire::message(&second, Encoding::Cdr)?;
        assert_eq!((wire.u32("a")?, wire.f64("b")?), (1, 1.5), "the second version");
        Ok(())
    }

    #[test]
    fn what_is_no_plain_cdr_is_refused() {
        for kind in [2, 3, 8, 11, 12, 255] {
            assert!(Wire::message(&[0, kind, 0, 0, 0], Encoding::Cdr).is_err(), "kind {kind}");
        }
        assert!(Wire::message(&[0, 1], Encoding::Cdr).is_err(), "cut off");
        let mut wire = Wire::plain(&[255, 255, 255, 255, 1], 0);
        assert!(wire.clone().bytes("a").is_err() && wire.list(1, "b").is_err(), "lengths beyond the end");
    }
}
