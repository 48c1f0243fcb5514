//! Splits data into pages, each with a checksum at its end.

use std::{
    fs::File,
    io::{BufWriter, Result, Seek as _, SeekFrom, Write as _},
};

/// Bytes of a page.
const PAGE: u64 = 1024;
/// Bytes of data in a page.
const DATA: usize = 1020;

/// Bytes of the file's header.
const HEADER: usize = 48;

/// A file that is being written.
pub(super) struct Pages<'a, 'b> {
    file: &'a mut BufWriter<&'b mut File>,
    /// Data of the page that is not full yet.
    page: Vec<u8>,
    /// Data of the first page, which has the header and is rewritten at the end.
    first: Option<Vec<u8>>,
    written: u64,
    /// Hash of all checksums, which tells files apart.
    hash: u64,
}

impl<'a, 'b> Pages<'a, 'b> {
    pub(super) fn new(file: &'a mut BufWriter<&'b mut File>) -> Self {
        Self { file, page: vec![0; HEADER], first: None, written: 0, hash: 0xcbf2_9ce4_8422_2325 }
    }

    /// Physical address of the data that follow after `after` more bytes.
    pub(super) fn physical(&self, after: u64) -> u64 {
        let at = self.page.len() as u64 + after;
        (self.written + at / DATA as u64) * PAGE + at % DATA as u64
    }

    pub(super) fn hash(&self) -> u64 {
        self.hash
    }

    pub(super) fn write(&mut self, mut bytes: &[u8]) -> Result<()> {
        while !bytes.is_empty() {
            let (now, later) = bytes.split_at(bytes.len().min(DATA - self.page.len()));
            self.page.extend_from_slice(now);
            bytes = later;
            if self.page.len() == DATA {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Appends zeros up to a multiple of four, where sections begin.
    pub(super) fn align(&mut self) -> Result<()> {
        let missing = self.page.len().next_multiple_of(4) - self.page.len();
        self.write(&[0; 4][..missing])
    }

    fn flush(&mut self) -> Result<()> {
        self.page.resize(DATA, 0);
        let checksum = crc32c::crc32c(&self.page);
        self.file.write_all(&self.page)?;
        self.file.write_all(&checksum.to_be_bytes())?;
        self.hash = (self.hash ^ u64::from(checksum)).wrapping_mul(0x0100_0000_01b3);
        self.written += 1;
        let page = std::mem::replace(&mut self.page, Vec::with_capacity(DATA));
        self.first.get_or_insert(page);
        Ok(())
    }

    /// Writes the XML section, which comes last, and the header, which holds its address.
    pub(super) fn finish(mut self, xml: &str) -> Result<()> {
        self.align()?;
        let start = self.physical(0);
        self.write(xml.as_bytes())?;
        if !self.page.is_empty() {
            self.flush()?;
        }
        let mut first = self.first.take().unwrap_or_default();
        first[..8].copy_from_slice(b"ASTM-E57");
        first[8..12].copy_from_slice(&1_u32.to_le_bytes());
        for (at, value) in [(16, self.written * PAGE), (24, start), (32, xml.len() as u64), (40, PAGE)] {
            first[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(&first)?;
        self.file.write_all(&crc32c::crc32c(&first).to_be_bytes())
    }
}
