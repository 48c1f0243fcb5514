//! Where the messages of a file are: what MCAP and bags have in common.

use std::{collections::HashMap, ops::Range};

use super::{
    bag::Bag,
    chunk::{Chunk, unpack},
    mcap::Mcap,
};
use crate::{
    Error, Progress,
    error::message,
    progress::tick,
    source::wire::{Encoding, Fault},
};

/// What a topic's messages are good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    Points,
    /// Transforms between frames; fixed ones hold at all times.
    Transforms {
        fixed: bool,
    },
    Other,
}

/// Messages of one name and type.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Topic {
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) encoding: Option<Encoding>,
    pub(super) kind: Kind,
}

impl Topic {
    /// `encoding` is as the recording calls it: `ros1`, `cdr` or something else.
    pub(super) fn new(name: &str, type_name: &str, encoding: &str) -> Self {
        let encoding = match encoding {
            "ros1" => Some(Encoding::Ros1),
            "cdr" => Some(Encoding::Cdr),
            _ => None,
        };
        let kind = match type_name {
            _ if encoding.is_none() => Kind::Other,
            "sensor_msgs/PointCloud2" | "sensor_msgs/msg/PointCloud2" => Kind::Points,
            "tf2_msgs/TFMessage" | "tf2_msgs/msg/TFMessage" | "tf/tfMessage" | "tf/msg/tfMessage" => {
                Kind::Transforms { fixed: name.ends_with("tf_static") }
            }
            _ => Kind::Other,
        };
        Self { name: message(name), type_name: message(type_name), encoding, kind }
    }
}

/// Where a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// When it was recorded, in nanoseconds since 1970.
    pub(super) time: i64,
    pub(super) file: usize,
    pub(super) topic: usize,
    pub(super) chunk: Option<usize>,
    /// Byte of its record, in the chunk unpacked or in the file.
    pub(super) at: usize,
}

/// A record, as far as it matters here.
pub(super) enum Record<'a> {
    /// Messages of this number are of this topic.
    Topic(u32, Topic),
    Chunk(Chunk),
    /// Times and places, in the chunk before, of messages of this number.
    Index(u32, Vec<(i64, usize)>),
    Message(u32, i64, &'a [u8]),
    /// The recording was closed properly.
    End,
    Other,
}

/// How records are written.
pub(super) enum Container {
    Mcap(Mcap),
    Bag(Bag),
}

impl Container {
    /// The container and the byte of its first record, by what the file begins with.
    pub(super) fn of(bytes: &[u8]) -> Option<(Self, usize)> {
        if bytes.starts_with(super::mcap::MAGIC) {
            Some((Self::Mcap(Mcap::default()), super::mcap::MAGIC.len()))
        } else if bytes.starts_with(super::bag::MAGIC) {
            Some((Self::Bag(Bag), super::bag::MAGIC.len()))
        } else {
            None
        }
    }

    /// The record at a byte, and the byte behind it.
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

/// All that is known of a file without its points.
#[derive(Debug, Default)]
pub(super) struct Index {
    pub(super) topics: Vec<Topic>,
    /// Messages of each topic, those that are not played included.
    pub(super) counts: Vec<u64>,
    /// Topics by the numbers that messages have for them.
    pub(super) numbers: HashMap<u32, usize>,
    /// Messages of points and of transforms, in the file's order.
    pub(super) messages: Vec<Place>,
    pub(super) chunks: Vec<Chunk>,
    /// When the first and the last message was recorded.
    pub(super) times: Option<Range<i64>>,
    /// What cannot be played, and why.
    pub(super) faults: Vec<Fault>,
}

/// Records between two looks at the caller's wish to stop.
const BLOCK: usize = 1 << 12;

/// Faults told one by one; the rest are counted with them.
const MAX_FAULTS: usize = 8;

impl Index {
    /// Walks through a file from its first record on.
    pub(super) fn of(
        container: &mut Container,
        bytes: &[u8],
        first: usize,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let mut walk = Walk::default();
        let mut at = first;
        let mut cut = None;
        let mut records = 0_usize;
        while at < bytes.len() && !walk.ended {
            if records.is_multiple_of(BLOCK) {
                tick(progress, 0.5 * at as f32 / bytes.len() as f32)?;
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
            cut = Some(Fault::new(at, "the recording ends without an end; it was not closed or is cut off"));
        }
        // What was to follow the last chunk is not there either, or not all of it.
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

/// What has been seen on the way through a file.
#[derive(Default)]
struct Walk {
    topics: HashMap<u32, Topic>,
    chunks: Vec<Chunk>,
    /// Messages of each chunk by their topics' numbers, if records behind the chunk say them.
    indexed: Vec<Option<Vec<(u32, i64, usize)>>>,
    /// Messages outside of chunks.
    loose: Vec<(u32, i64, usize)>,
    faults: Vec<Fault>,
    ended: bool,
}

impl Walk {
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

    /// Looks into the chunks that nothing is known of, and puts everything together.
    fn settle(mut self, container: &mut Container, bytes: &[u8], progress: &dyn Progress) -> Result<Index, Error> {
        let mut index = Index { chunks: self.chunks, faults: self.faults, ..Index::default() };
        let mut more = 0;
        for (number, chunk) in index.chunks.iter().enumerate() {
            let known = |entries: &Vec<(u32, i64, usize)>| entries.iter().all(|(id, ..)| self.topics.contains_key(id));
            if self.indexed[number].as_ref().is_some_and(known) {
                continue;
            }
            tick(progress, 0.5 + 0.5 * chunk.data.start as f32 / bytes.len() as f32)?;
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
            // That a chunk is cut has been said.
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
        // Several writers may have given one topic several numbers.
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
                index.messages.push(Place { time, file: 0, topic, chunk, at });
            }
        }
        Ok(index)
    }
}
