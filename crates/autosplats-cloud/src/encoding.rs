//! Encodings of text: byte order marks and UTF-16.

use std::{borrow::Cow, path::Path};

use crate::{Error, check_memory, read_small};

/// Byte order mark of UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Largest text file, in bytes: cameras, poses and sessions have a few kilobytes.
const MAX_TEXT: u64 = 64 << 20;

/// Bytes after a mark that are inspected, an even number.
const SAMPLE: usize = 1 << 10;

/// A file's bytes without a byte order mark.
#[derive(Clone, Debug)]
pub struct Unmarked<'a> {
    /// The bytes; UTF-16 is converted to UTF-8.
    pub bytes: Cow<'a, [u8]>,
    /// The encoding that a mark states, for people.
    pub encoding: Option<&'static str>,
}

impl<'a> Unmarked<'a> {
    /// Removes the byte order marks before a text, and converts UTF-16 to UTF-8. Bytes that only look like a mark are
    /// kept, such as those of a binary file.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    ///
    /// # Examples
    ///
    /// ```
    /// use autosplats_cloud::Unmarked;
    ///
    /// assert_eq!(*Unmarked::of(b"\xef\xbb\xbfply\n")?.bytes, *b"ply\n");
    /// assert_eq!(*Unmarked::of(b"\xff\xfe1\0\n\0")?.bytes, *b"1\n");
    /// assert_eq!(*Unmarked::of(b"\xff\xfe\0\x01")?.bytes, *b"\xff\xfe\0\x01");
    /// # Ok::<(), autosplats_cloud::Error>(())
    /// ```
    pub fn of(bytes: &'a [u8]) -> Result<Self, Error> {
        if bytes.starts_with(MARK) {
            let mut rest = bytes;
            while let Some(after) = rest.strip_prefix(MARK) {
                rest = after;
            }
            if starts_with_text(rest) {
                return Ok(Self { bytes: rest.into(), encoding: Some("UTF-8 with a byte order mark") });
            }
        }
        for (mark, name, number) in [
            ([0xff, 0xfe], "UTF-16, little endian", u16::from_le_bytes as fn([u8; 2]) -> u16),
            ([0xfe, 0xff], "UTF-16, big endian", u16::from_be_bytes),
        ] {
            let Some(rest) = bytes.strip_prefix(&mark) else { continue };
            if !is_utf16_text(&rest[..rest.len().min(SAMPLE)], number) {
                continue;
            }
            // A character of two bytes becomes at most three.
            check_memory("UTF-16 as UTF-8", rest.len() as u64 / 2 * 3)?;
            let chars = char::decode_utf16(rest.chunks_exact(2).map(|pair| number([pair[0], pair[1]])));
            let text: String = chars.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
            return Ok(Self { bytes: text.into_bytes().into(), encoding: Some(name) });
        }
        Ok(Self { bytes: bytes.into(), encoding: None })
    }
}

/// Whether the first line is text, whatever follows: headers of text stand before binary data.
fn starts_with_text(bytes: &[u8]) -> bool {
    let sample = &bytes[..bytes.len().min(SAMPLE)];
    let line = sample.split(|&byte| byte == b'\n').next().unwrap_or_default();
    line.iter().all(|byte| !byte.is_ascii_control() || matches!(byte, b'\t' | b'\r' | 0x0c))
}

/// Whether UTF-16 is a text of points: a third is ASCII, and no control character but blanks is among it.
fn is_utf16_text(sample: &[u8], number: fn([u8; 2]) -> u16) -> bool {
    let chars = || char::decode_utf16(sample.chunks_exact(2).map(|pair| number([pair[0], pair[1]])));
    let blank = |c: char| matches!(c, '\t' | '\n' | '\r' | '\x0c');
    // The sample may end inside a pair of surrogates.
    let broken = chars().filter(Result::is_err).count();
    let plain = chars().flatten().filter(char::is_ascii).count();
    broken <= 1 && plain * 3 >= sample.len() / 2 && chars().flatten().all(|c| !c.is_control() || blank(c))
}

/// Reads a text file of any encoding that [`Unmarked`] knows.
///
/// # Errors
/// Those of the operating system; of the kind `InvalidData` if the file is not text, `FileTooLarge` if it has more than
/// 64 MiB, and `InvalidInput` for a device, which has no end.
pub fn read_text(path: &Path) -> std::io::Result<String> {
    let bytes = read_small(path, MAX_TEXT)?;
    let full = |error| std::io::Error::new(std::io::ErrorKind::OutOfMemory, error);
    let text = Unmarked::of(&bytes).map_err(full)?.bytes.into_owned();
    String::from_utf8(text).map_err(|_| std::io::Error::new(std::io::ErrorKind::InvalidData, "this is not UTF-8 text"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_texts_go_and_bytes_of_binary_files_stay() {
        let same = |bytes: &[u8]| *Unmarked::of(bytes).expect("enough memory").bytes == *bytes;
        let wide = |text: &str, big: bool| -> Vec<u8> {
            let number = |c: u16| if big { c.to_be_bytes() } else { c.to_le_bytes() };
            std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(number).collect()
        };
        let text = "Höhe;Ost 🗻\n1;2\n";
        let utf8 = format!("\u{feff}\u{feff}{text}").into_bytes();
        for bytes in [utf8, wide(text, true), wide(text, false)] {
            let found = Unmarked::of(&bytes).expect("enough memory");
            assert_eq!((&*found.bytes, found.encoding.is_some()), (text.as_bytes(), true), "{bytes:?}");
        }
        let floats: Vec<u8> = [-1.7e38_f32, 2.5, -0.75].iter().flat_map(|value| value.to_le_bytes()).collect();
        let marked = |mark: &[u8]| [mark, &floats].concat();
        for bytes in [marked(&[0xff, 0xfe]), marked(&[0xfe, 0xff]), marked(&[0xef, 0xbb, 0xbf]), b"\xff\xfe\0\0".into()]
        {
            assert!(same(&bytes), "{bytes:?}");
        }
        assert!(same(b"") && same(b"1 2 3\n"), "no mark");
    }
}
