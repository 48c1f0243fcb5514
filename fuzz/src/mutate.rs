//! Mutations of files, the same on every computer.

use autosplats_cloud::Random;

/// A number below `end`; 0 if there is none.
fn below(random: &mut Random, end: usize) -> usize {
    if end == 0 { 0 } else { random.modulo(end) }
}

fn pick<T: Copy>(random: &mut Random, of: &[T]) -> T {
    of[random.modulo(of.len())]
}

/// Values at the limits of the integers that readers compute with.
const EDGES: [u64; 16] = [
    0,
    1,
    2,
    3,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
    353_535_235_358,
];

/// Words that text readers may handle wrongly.
const WORDS: [&str; 28] = [
    "0",
    "-0",
    "-1",
    "1",
    "255",
    "256",
    "65536",
    "2147483648",
    "4294967295",
    "353535235358",
    "18446744073709551615",
    "99999999999999999999999",
    "1e308",
    "1e39",
    "-1e-308",
    "nan",
    "inf",
    "-inf",
    "0x10",
    "1,5",
    "",
    " ",
    "\n",
    "\r\n",
    "\"",
    "#",
    "end_header",
    "\u{0}",
];

/// Applies one to eight mutations to a file. Pieces come from `others`, files of the same format.
pub(crate) fn mutate(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    // Most faults lie near the start of a file, where the headers are, so half of the places are there.
    let ways = if random.modulo(4) > 0 { 1 } else { 2 + random.modulo(7) };
    for _ in 0..ways {
        let near = if random.modulo(2) == 0 { bytes.len().min(512) } else { bytes.len() };
        let at = below(random, near);
        match random.modulo(11) {
            0 => bit(bytes, at, random),
            1 => edge(bytes, at, random),
            2 => bytes.truncate(at),
            3 => {
                let end = (at + 1 + random.modulo(64)).min(bytes.len());
                bytes.drain(at..end);
            }
            4 => {
                let end = (at + 1 + random.modulo(64)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                insert(bytes, at, &piece);
            }
            5 => {
                let other = &others[below(random, others.len())];
                let from = below(random, other.len());
                let len = random.modulo(256);
                let piece = &other[from..(from + len).min(other.len())];
                if random.modulo(2) == 0 {
                    insert(bytes, at, piece);
                } else {
                    let end = (at + piece.len()).min(bytes.len());
                    bytes.splice(at..end, piece.iter().copied());
                }
            }
            6 | 7 => word(bytes, at, random),
            8 => line(bytes, at, random),
            9 => small_step(bytes, at, random),
            _ => {
                for _ in 0..random.modulo(8) {
                    let at = below(random, bytes.len());
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte = random.bits() as u8;
                    }
                }
            }
        }
    }
}

fn bit(bytes: &mut [u8], at: usize, random: &mut Random) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte ^= 1 << random.modulo(8);
    }
}

/// Writes one of `EDGES` with 1, 2, 4 or 8 bytes, in either byte order.
fn edge(bytes: &mut [u8], at: usize, random: &mut Random) {
    let size = pick(random, &[1, 2, 4, 8]);
    let value = pick(random, &EDGES);
    let raw = if random.modulo(4) == 0 { value.to_be_bytes() } else { value.to_le_bytes() };
    let raw = if random.modulo(4) == 0 { &raw[8 - size..] } else { &raw[..size] };
    // Most numbers of binary headers are aligned.
    let at = if random.modulo(2) == 0 { at / size * size } else { at };
    for (byte, new) in bytes.iter_mut().skip(at).zip(raw) {
        *byte = *new;
    }
}

/// Adds or subtracts 1, or adds 2 or 16, to break counts and sizes by a little.
fn small_step(bytes: &mut [u8], at: usize, random: &mut Random) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte = byte.wrapping_add(pick(random, &[1, 0xff, 2, 16]));
    }
}

fn insert(bytes: &mut Vec<u8>, at: usize, piece: &[u8]) {
    // Large files only slow the run down.
    if bytes.len() < 1 << 15 {
        bytes.splice(at..at, piece.iter().copied());
    }
}

/// Replaces the word around a place by one of `WORDS`.
fn word(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let separates = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b',' | b'"' | b'<' | b'>' | b'=' | b':');
    let start = bytes[..at].iter().rposition(separates).map_or(0, |found| found + 1);
    let len = bytes[at..].iter().take(64).position(separates).unwrap_or(0);
    let word = pick(random, &WORDS);
    bytes.splice(start.max(at.saturating_sub(64))..at + len, word.bytes());
}

/// Removes, doubles or moves the line around a place.
fn line(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let start = bytes[..at].iter().rposition(|&byte| byte == b'\n').map_or(0, |found| found + 1);
    let end = bytes[at..].iter().position(|&byte| byte == b'\n').map_or(bytes.len(), |found| at + found + 1);
    let line: Vec<u8> = bytes[start..end].iter().take(1 << 12).copied().collect();
    match random.modulo(3) {
        0 => drop(bytes.drain(start..end)),
        1 => insert(bytes, start, &line),
        _ => {
            bytes.drain(start..end);
            let at = below(random, bytes.len());
            insert(bytes, at, &line);
        }
    }
}

/// Corrects the checksums of E57 pages, so that the reader gets beyond them.
pub(crate) fn repair_pages(bytes: &mut [u8]) {
    const PAGE: usize = 1024;
    for page in bytes.chunks_exact_mut(PAGE) {
        let sum = crc32c(&page[..PAGE - 4]);
        page[PAGE - 4..].copy_from_slice(&sum.to_be_bytes());
    }
}

/// CRC-32C, reflected, polynomial 0x1EDC6F41.
fn crc32c(bytes: &[u8]) -> u32 {
    static TABLE: std::sync::LazyLock<[u32; 256]> = std::sync::LazyLock::new(|| {
        std::array::from_fn(|index| {
            (0..8).fold(index as u32, |sum, _| if sum & 1 == 1 { sum >> 1 ^ 0x82f6_3b78 } else { sum >> 1 })
        })
    });
    !bytes.iter().fold(!0, |sum: u32, &byte| sum >> 8 ^ TABLE[usize::from(sum as u8 ^ byte)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_castagnolis() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283, "the check value of CRC-32C");
    }

    #[test]
    fn changes_are_the_same_every_time() {
        let others = [b"ply\nformat ascii 1.0\n".to_vec()];
        let change = |seed| {
            let mut bytes = others[0].clone();
            mutate(&mut bytes, &others, &mut Random::from_state(seed));
            bytes
        };
        assert_eq!(change(7), change(7), "one seed, one file");
        assert!((0..100).any(|seed| change(seed) != others[0]), "files are changed");
    }
}
