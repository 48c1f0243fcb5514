//! The index of a recording: positions of messages, in the same form for MCAP files and bags.

use std::{collections::HashMap, ops::Range};

use autosplats_cloud::{Error, Progress};

use super::{
    chunk::{Chunk, unpack},
    container::Container,
    records::{Kind, MessagePosition, Record, Topic},
};
use crate::wire::Fault;

/// Everything known about a file without its points.
#[derive(Debug, Default)]
pub(super) struct Index {
    pub(super) topics: Vec<Topic>,
    /// Number of messages per topic, including topics that are not played.
    pub(super) counts: Vec<u64>,
    /// Topics by the numbers that messages use.
    pub(super) numbers: HashMap<u32, usize>,
    /// Messages of points and of transforms, in file order.
    pub(super) messages: Vec<MessagePosition>,
    pub(super) chunks: Vec<Chunk>,
    /// Times of the first and the last message.
    pub(super) times: Option<Range<i64>>,
    /// What cannot be played, and why.
    pub(super) faults: Vec<Fault>,
}

/// Number of records between two checks for cancellation.
const RECORDS_PER_CHECK: usize = 1 << 12;

/// Maximum number of separately reported faults; further faults are only counted.
const MAX_FAULTS: usize = 8;

impl Index {
    /// Walks through a file from its first record on.
    pub(super) fn of(
        container: &mut Container,
        bytes: &[u8],
        first: usize,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let mut walk = IndexBuilder::default();
        let mut at = first;
        let mut cut = None;
        let mut records = 0_usize;
        while at < bytes.len() && !walk.ended {
            if records.is_multiple_of(RECORDS_PER_CHECK) {
                progress.tick(0.5 * at as f32 / bytes.len() as f32)?;
            }
            records += 1;
            match container.record(bytes, at) {
                Ok((record, next)) => {
                    walk.take(record, at);
                    at = next;
                }
                Err(fault) => {
                    cut = Some(fault);
                    break;
                }
            }
        }
        if cut.is_none() && !walk.ended {
            cut = Some(Fault::new(at, "the recording has no end record; it was not closed or is cut off"));
        }
        // The index records after the last chunk are missing too, at least in part.
        if let Some(fault) = cut {
            if !walk.ended
                && let Some(last) = walk.indexed.last_mut()
            {
                *last = None;
            }
            walk.faults.push(fault);
        }
        walk.settle(container, bytes, progress)
    }
}

/// State of the walk through a file.
#[derive(Default)]
struct IndexBuilder {
    topics: HashMap<u32, Topic>,
    chunks: Vec<Chunk>,
    /// Messages of each chunk by the numbers of their topics, if index records follow the chunk.
    indexed: Vec<Option<Vec<(u32, i64, usize)>>>,
    /// Messages outside of chunks.
    loose: Vec<(u32, i64, usize)>,
    faults: Vec<Fault>,
    ended: bool,
}

impl IndexBuilder {
    fn take(&mut self, record: Record<'_>, at: usize) {
        match record {
            Record::Topic(number, topic) => {
                self.topics.insert(number, topic);
            }
            Record::Chunk(chunk) => {
                self.faults.extend(chunk.cut.clone());
                self.ended |= chunk.cut.is_some();
                self.chunks.push(chunk);
                self.indexed.push(None);
            }
            Record::Index(number, entries) => {
                if let Some(indexed) = self.indexed.last_mut() {
                    let entries = entries.into_iter().map(|(time, at)| (number, time, at));
                    indexed.get_or_insert_default().extend(entries);
                }
            }
            Record::Message(number, time, _) => self.loose.push((number, time, at)),
            Record::End => self.ended = true,
            Record::Other => {}
        }
    }

    /// Unpacks the chunks that have no index, and builds the index of the file.
    fn settle(mut self, container: &mut Container, bytes: &[u8], progress: &dyn Progress) -> Result<Index, Error> {
        let mut index = Index { chunks: self.chunks, faults: self.faults, ..Index::default() };
        let mut more = 0;
        for (number, chunk) in index.chunks.iter().enumerate() {
            let known = |entries: &Vec<(u32, i64, usize)>| entries.iter().all(|(id, ..)| self.topics.contains_key(id));
            if self.indexed[number].as_ref().is_some_and(known) {
                continue;
            }
            progress.tick(0.5 + 0.5 * chunk.data.start as f32 / bytes.len() as f32)?;
            let mut entries = Vec::new();
            let outcome = unpack(bytes, chunk).and_then(|content| {
                let mut at = 0;
                while at < content.len() {
                    let (record, next) = container.record(&content, at).map_err(|fault| fault.what)?;
                    match record {
                        Record::Topic(id, topic) => {
                            self.topics.insert(id, topic);
                        }
                        Record::Message(id, time, _) => entries.push((id, time, at)),
                        _ => {}
                    }
                    at = next;
                }
                Ok(())
            });
            // A chunk that is cut off has been reported already.
            if let Err(what) = outcome.as_ref()
                && chunk.cut.is_none()
            {
                let fault = Fault::new(chunk.data.start, format!("a chunk cannot be read to its end: {what}"));
                if index.faults.len() < MAX_FAULTS { index.faults.push(fault) } else { more += 1 }
            }
            self.indexed[number] = Some(entries);
        }
        if let Some(last) = index.faults.last_mut().filter(|_| more > 0) {
            last.what = format!("{}; and {more} more", last.what);
        }

        let mut ids: Vec<_> = self.topics.into_iter().collect();
        ids.sort_unstable_by_key(|(id, _)| *id);
        // Several writers may have numbered the same topic differently.
        let mut known: HashMap<Topic, usize> = HashMap::new();
        for (id, topic) in ids {
            let at = *known.entry(topic.clone()).or_insert_with(|| {
                index.topics.push(topic);
                index.topics.len() - 1
            });
            index.numbers.insert(id, at);
        }
        index.counts = vec![0; index.topics.len()];
        let chunked = self.indexed.into_iter().enumerate();
        let chunked = chunked.flat_map(|(chunk, entries)| entries.into_iter().flatten().map(move |e| (Some(chunk), e)));
        for (chunk, (id, time, at)) in chunked.chain(self.loose.into_iter().map(|entry| (None, entry))) {
            let Some(&topic) = index.numbers.get(&id) else { continue };
            index.counts[topic] += 1;
            let times = index.times.get_or_insert(time..time);
            (times.start, times.end) = (times.start.min(time), times.end.max(time));
            if index.topics[topic].kind != Kind::Other {
                index.messages.push(MessagePosition { time, file: 0, topic, chunk, at });
            }
        }
        Ok(index)
    }
}
