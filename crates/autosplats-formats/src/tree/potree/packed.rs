//! Nodes that are stored value by value and compressed with Brotli.

use std::io::Read as _;

use brotli_decompressor::Decompressor;

use super::meta::{Meta, Packing};

/// Bytes of the buffer of the decompressor.
const BUFFER: usize = 4096;

/// The records of a node with so many points.
pub(super) fn unpacked(meta: &Meta, bytes: &[u8], points: u32) -> Result<Vec<u8>, String> {
    let points = points as usize;
    let expected = points * meta.packings.iter().map(|packing| packing.packed()).sum::<usize>();
    let mut packed = Vec::new();
    // One byte more shows that there are too many.
    let read = Decompressor::new(bytes, BUFFER).take(expected as u64 + 1).read_to_end(&mut packed);
    read.map_err(|error| format!("the compressed data are damaged ({error}); copy the file again"))?;
    if packed.len() != expected {
        return Err(format!("{points} points take {expected} bytes, not {}; copy the file again", packed.len()));
    }
    let stride = meta.stride();
    let mut records = vec![0; points * stride];
    let (mut rest, mut at) = (&packed[..], 0);
    for &packing in &meta.packings {
        let (values, after) = rest.split_at(points * packing.packed());
        for (value, record) in values.chunks_exact(packing.packed()).zip(records.chunks_exact_mut(stride)) {
            let record = &mut record[at..at + packing.plain()];
            match packing {
                Packing::Plain(_) => record.copy_from_slice(value),
                Packing::Position => {
                    let [high, low] = [0, 8].map(|at| woven(&value[at..]));
                    for axis in 0..3 {
                        let whole = u32::from(high[axis]) << 16 | u32::from(low[axis]);
                        record[4 * axis..4 * axis + 4].copy_from_slice(&whole.to_le_bytes());
                    }
                }
                Packing::Color => record.copy_from_slice(woven(value).map(u16::to_le_bytes).as_flattened()),
            }
        }
        rest = after;
        at += packing.plain();
    }
    Ok(records)
}

/// The three numbers whose bits are woven into the first eight bytes, the lowest bit of the first number first.
fn woven(bytes: &[u8]) -> [u16; 3] {
    let code = bytes[..8].iter().rev().fold(0, |sum: u64, &byte| sum << 8 | u64::from(byte));
    [0, 1, 2].map(|shift| {
        let mut bits = code >> shift & 0x2492_4924_9249;
        for (by, mask) in
            [(2, 0x0003_0c30_c30c_30c3), (4, 0x000f_00f0_0f00_f00f), (8, 0xff_0000_ff00_00ff), (16, 0xffff_0000_ffff)]
        {
            bits = (bits | bits >> by) & mask;
        }
        (bits | bits >> 32) as u16
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn woven_bits_are_told_apart() {
        for numbers in [[0; 3], [u16::MAX; 3], [1, 2, 4], [0x8000, 0x1234, 0xfedc], [0xa5a5, 0, 0x0f0f]] {
            let bit = |index: u64| u64::from(numbers[index as usize % 3] >> (index / 3) & 1) << index;
            let code: u64 = (0..48).map(bit).sum();
            assert_eq!(woven(&code.to_le_bytes()), numbers, "{code:x}");
        }
    }
}
