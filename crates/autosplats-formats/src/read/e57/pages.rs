//! The pages of an E57 file, each of which ends in a checksum.
//!
//! There are two kinds of addresses: a *physical* one is a byte of the file; a *logical* one counts data bytes only.

use std::ops::Range;

use autosplats_cloud::Error;
use rayon::prelude::*;

use super::super::{Job, opened::Reader, table::reserve};

/// Bytes of the checksum at the end of a page.
const CHECKSUM: usize = 4;

/// Bytes of the file's header.
const HEADER: usize = 48;

/// Bytes of pages verified between two checks for cancellation.
const BLOCK: usize = 1 << 25;

/// The pages of a file, and the place of its XML.
#[derive(Clone, Copy)]
pub(super) struct Pages<'a> {
    data: Data<'a>,
    /// Bytes of the file.
    total: usize,
    /// Bytes of a page, including its checksum.
    size: usize,
    pub(super) version: (u32, u32),
    /// Physical address and logical length of the XML.
    xml: (u64, u64),
    /// Physical length of the file according to its header.
    claimed: u64,
}

/// Where the bytes are.
#[derive(Clone, Copy)]
enum Data<'a> {
    /// In memory: those from a physical address on.
    Held {
        bytes: &'a [u8],
        first: usize,
    },
    File(&'a Reader<'a>),
}

impl<'a> Pages<'a> {
    pub(super) fn new(job: &Job<'a>) -> Result<Self, Error> {
        let bytes = job.bytes;
        if !bytes.starts_with(super::MAGIC) {
            return Err(job.malformed("byte 0", "an E57 file begins with 'ASTM-E57'; this one does not"));
        }
        if bytes.len() < HEADER {
            return Err(
                job.malformed(format!("byte {}", bytes.len()), "the file ends inside the header; copy it again")
            );
        }
        let u32_at = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let u64_at = |at: usize| u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32;
        let size = u64_at(40);
        if !size.is_power_of_two() || !(64..=1 << 24).contains(&size) {
            return Err(job.malformed("byte 40", format!("pages of {size} bytes do not exist; copy the file again")));
        }
        let version = (u32_at(8), u32_at(12));
        if version.0 != 1 {
            return Err(job.unsupported(format!("E57 version {}.{}; version 1.0 can be read", version.0, version.1)));
        }
        let data = Data::Held { bytes, first: 0 };
        Ok(Self {
            data,
            total: bytes.len(),
            size: size as usize,
            version,
            xml: (u64_at(24), u64_at(32)),
            claimed: u64_at(16),
        })
    }

    /// The same pages, of which none is in memory.
    pub(super) fn in_file<'b>(&self, file: &'b Reader<'b>) -> Pages<'b> {
        Pages { data: Data::File(file), ..self.without_bytes() }
    }

    /// The same pages, without what they hold.
    pub(super) fn without_bytes(&self) -> Pages<'static> {
        let &Self { total, size, version, xml, claimed, .. } = self;
        Pages { data: Data::Held { bytes: &[], first: 0 }, total, size, version, xml, claimed }
    }

    /// Bytes that are read at a time, at most `most`.
    pub(super) fn step(&self, most: usize) -> usize {
        if let Data::File(file) = self.data { file.piece().min(most) } else { most }
    }

    /// The same pages, of which those of a logical range are in memory. `space` is used if they were not.
    pub(super) fn near<'b>(&'b self, range: Range<usize>, space: &'b mut Vec<u8>) -> Result<Pages<'b>, Error> {
        let Data::File(file) = self.data else { return Ok(*self) };
        let data = self.size - CHECKSUM;
        let first = (range.start / data * self.size).min(self.total);
        let end = (range.end.div_ceil(data) * self.size).clamp(first, self.total);
        space.clear();
        file.read(first..end, space)?;
        Ok(Pages { data: Data::Held { bytes: space, first }, ..*self })
    }

    /// Bytes of data in all pages, and in what is there of a last page that is cut off.
    pub(super) fn len(&self) -> usize {
        let data = self.size - CHECKSUM;
        self.total / self.size * data + (self.total % self.size).min(data)
    }

    /// Whether the file is shorter than its header states.
    pub(super) fn cut_off(&self) -> bool {
        self.claimed > self.total as u64
    }

    /// Converts a physical address from the file to a logical one; fails if there is no data at it.
    pub(super) fn logical(&self, job: &Job<'_>, what: &str, physical: u64) -> Result<usize, Error> {
        if physical >= self.total as u64 {
            let why = format!("the file ends before {what} at byte {physical}; it is cut off, copy it again");
            return Err(job.malformed(format!("byte {}", self.total), why));
        }
        let (page, within) = (physical as usize / self.size, physical as usize % self.size);
        if within >= self.size - CHECKSUM {
            let why = format!("{what} should begin here, inside a checksum; write the file again");
            return Err(job.malformed(format!("byte {physical}"), why));
        }
        Ok(page * (self.size - CHECKSUM) + within)
    }

    /// Converts a logical address to a physical one.
    pub(super) fn physical(&self, logical: usize) -> usize {
        logical / (self.size - CHECKSUM) * self.size + logical % (self.size - CHECKSUM)
    }

    /// Copies data from logical address `at` on; there must be enough.
    pub(super) fn copy(&self, mut at: usize, mut out: &mut [u8]) -> Result<(), Error> {
        let Data::Held { bytes, first } = self.data else {
            let mut space = Vec::new();
            return self.near(at..at + out.len(), &mut space)?.copy(at, out);
        };
        let data = self.size - CHECKSUM;
        while !out.is_empty() {
            let len = out.len().min(data - at % data);
            let start = self.physical(at) - first;
            let (now, later) = out.split_at_mut(len);
            now.copy_from_slice(&bytes[start..start + len]);
            out = later;
            at += len;
        }
        Ok(())
    }

    /// Verifies the checksums of all pages that overlap a logical range. A page that is cut off has none.
    pub(super) fn check(&self, job: &Job<'_>, range: Range<usize>) -> Result<(), Error> {
        let data = self.size - CHECKSUM;
        let pages = range.start / data..range.end.div_ceil(data).min(self.total / self.size);
        let step = (self.step(BLOCK) / self.size).max(1);
        let mut space = Vec::new();
        for start in pages.clone().step_by(step) {
            job.go_on()?;
            let block = start..pages.end.min(start + step);
            let near = self.near(block.start * data..block.end * data, &mut space)?;
            let Data::Held { bytes, first } = near.data else { continue };
            let wrong = |page: &usize| {
                let (data, checksum) = bytes[page * self.size - first..][..self.size].split_at(data);
                // Big endian, unlike everything else in the file.
                crc32c::crc32c(data).to_be_bytes() != checksum
            };
            if let Some(page) = block.into_par_iter().find_first(wrong) {
                return Err(job.malformed(
                    format!("byte {}", page * self.size),
                    format!("the checksum of page {} is wrong, so its data are damaged; copy the file again", page + 1),
                ));
            }
        }
        Ok(())
    }

    /// The bytes of the XML section that are there, and the error if some are not.
    pub(super) fn xml(&self, job: &Job<'_>) -> Result<(Vec<u8>, Option<Error>), Error> {
        let start = self.logical(job, "the XML section", self.xml.0)?;
        let wanted = usize::try_from(self.xml.1).unwrap_or(usize::MAX);
        let len = wanted.min(self.len() - start);
        let cut = (len < wanted).then(|| {
            let what =
                format!("the file ends inside the {wanted} bytes of its XML section; it is cut off, copy it again");
            job.malformed(format!("byte {}", self.total), what)
        });
        self.check(job, start..start + len)?;
        let mut xml = Vec::new();
        reserve(&mut xml, len, "the XML section")?;
        xml.resize(len, 0);
        self.copy(start, &mut xml)?;
        Ok((xml, cut))
    }
}
