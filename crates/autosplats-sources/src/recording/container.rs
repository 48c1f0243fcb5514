//! The formats of recordings.

use super::{
    bag::{self, Bag},
    mcap::{self, Mcap},
    records::Record,
};
use crate::wire::Fault;

/// File format of the records.
pub(super) enum Container {
    Mcap(Mcap),
    Bag(Bag),
}

impl Container {
    /// Detects the container from the first bytes of a file. Also returns the offset of its first record.
    pub(super) fn of(bytes: &[u8]) -> Option<(Self, usize)> {
        if bytes.starts_with(mcap::MAGIC) {
            Some((Self::Mcap(Mcap::default()), mcap::MAGIC.len()))
        } else if bytes.starts_with(bag::MAGIC) {
            Some((Self::Bag(Bag), bag::MAGIC.len()))
        } else {
            None
        }
    }

    /// The record at an offset, and the offset of the next record.
    pub(super) fn record<'a>(&mut self, bytes: &'a [u8], at: usize) -> Result<(Record<'a>, usize), Fault> {
        match self {
            Self::Mcap(mcap) => mcap.record(bytes, at),
            Self::Bag(bag) => bag.record(bytes, at),
        }
    }

    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Mcap(_) => "MCAP",
            Self::Bag(_) => "ROS 1 bag",
        }
    }
}
