//! Sorting of records along a curve.

use rayon::prelude::*;

/// Records that one thread encodes at a time.
const PIECE: usize = 1 << 14;

/// Bits that one pass sorts by.
const DIGIT: u32 = 8;

/// Sorts records by a code of `bits` bits, and records of equal codes by their bytes. Returns the sorted codes and the
/// indices of the records.
pub(super) fn sort(records: &[u8], len: usize, bits: u32, code: impl Fn(&[u8]) -> u64 + Sync) -> (Vec<u64>, Vec<u32>) {
    let count = records.len() / len;
    let mut pairs: Vec<(u64, u32)> = vec![(0, 0); count];
    pairs.par_chunks_mut(PIECE).enumerate().for_each(|(piece, pairs)| {
        for (index, pair) in (piece * PIECE..).zip(pairs) {
            *pair = (code(&records[index * len..][..len]), index as u32);
        }
    });
    let mut others = vec![(0, 0); count];
    for shift in (0..bits).step_by(DIGIT as usize) {
        let digit = |pair: &(u64, u32)| (pair.0 >> shift) as usize & ((1 << DIGIT) - 1);
        let mut places = [0_usize; 1 << DIGIT];
        pairs.iter().for_each(|pair| places[digit(pair)] += 1);
        if places.contains(&count) {
            continue;
        }
        let mut start = 0;
        for place in &mut places {
            (*place, start) = (start, start + *place);
        }
        for pair in &pairs {
            let place = &mut places[digit(pair)];
            others[*place] = *pair;
            *place += 1;
        }
        std::mem::swap(&mut pairs, &mut others);
    }
    drop(others);
    let record = |index: u32| &records[index as usize * len..][..len];
    for run in pairs.chunk_by_mut(|a, b| a.0 == b.0).filter(|run| run.len() > 1) {
        run.sort_unstable_by(|a, b| record(a.1).cmp(record(b.1)));
    }
    pairs.into_iter().unzip()
}
