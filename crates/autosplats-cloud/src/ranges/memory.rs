//! Ranges of bytes in memory.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::{Counter, Ranges, Traffic, check_range};
use crate::{Error, Progress};

/// Ranges of bytes that are in memory.
#[derive(Debug)]
pub struct MemoryRanges {
    name: PathBuf,
    bytes: Vec<u8>,
    read: Counter,
}

impl MemoryRanges {
    /// Takes `bytes`; `name` is for messages.
    pub fn new(name: impl Into<PathBuf>, bytes: Vec<u8>) -> Self {
        Self { name: name.into(), bytes, read: Counter::default() }
    }
}

impl Ranges for MemoryRanges {
    fn name(&self) -> &Path {
        &self.name
    }

    fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read(&self, ranges: &[Range<u64>], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let one = |range: &Range<u64>| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            check_range(&self.name, range, self.size())?;
            self.read.add(range.end - range.start);
            Ok(self.bytes[range.start as usize..range.end as usize].to_vec())
        };
        ranges.iter().map(one).collect()
    }

    fn traffic(&self) -> Traffic {
        self.read.traffic()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_in_order_and_counted() {
        let memory = MemoryRanges::new("m", (0..10).collect());
        let read = memory.read(&[4..6, 0..1, 10..10], &()).expect("inside");
        assert_eq!(read, [vec![4, 5], vec![0], Vec::new()]);
        assert_eq!(memory.traffic(), Traffic { requests: 3, bytes: 3 });
        let told = memory.read(&[0..1, 9..11], &()).expect_err("beyond the end").to_string();
        assert!(told.starts_with("m: byte 9: bytes up to 11"), "{told}");
    }
}
