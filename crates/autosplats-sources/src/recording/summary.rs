//! Summary of a recording for display.

use std::{collections::BTreeMap, time::Duration};

use autosplats_cloud::{excerpt, one_line};

use super::{
    files::{File, OpenedFiles},
    records::{Kind, Topic},
};

/// Content of a recording, as far as known without its points.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingSummary {
    /// Container and compressions, for instance `MCAP, zstd`.
    pub format: String,
    /// All topics, sorted by name.
    pub topics: Vec<RecordingTopic>,
    /// Time of the first message in nanoseconds since 1970.
    pub start: i64,
    /// Time from the first message to the last.
    pub duration: Duration,
    /// Coordinate frames of sensors and transforms, sorted by name.
    pub frames: Vec<String>,
    /// Coordinate frame that points are transformed into; `None` without transforms.
    pub frame: Option<String>,
    /// What cannot be played, and why.
    pub notes: Vec<String>,
}

/// Messages of one name and type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingTopic {
    /// Name, for instance `/lidar/points`.
    pub name: String,
    /// Type, for instance `sensor_msgs/msg/PointCloud2`.
    pub type_name: String,
    /// Number of messages.
    pub messages: u64,
    /// Whether the messages are points that can be played.
    pub points: bool,
}

/// Maximum number of topics listed in a message.
const MAX_LISTED_TOPICS: usize = 20;

impl RecordingSummary {
    pub(super) fn of(OpenedFiles { files, missing }: &OpenedFiles) -> Self {
        let mut topics: BTreeMap<(&str, &str), RecordingTopic> = BTreeMap::new();
        let mut kinds: Vec<String> = Vec::new();
        let mut times = None;
        for File { index, container, .. } in files {
            for (Topic { name, type_name, kind, .. }, messages) in index.topics.iter().zip(&index.counts) {
                let new =
                    || RecordingTopic { name: name.clone(), type_name: type_name.clone(), messages: 0, points: false };
                let topic = topics.entry((name, type_name)).or_insert_with(new);
                topic.messages += messages;
                topic.points |= *kind == Kind::Points;
            }
            let compressed = index.chunks.iter().map(|chunk| &*chunk.compression).filter(|name| !name.is_empty());
            for kind in std::iter::once(container.name()).chain(compressed) {
                let kind = excerpt(kind.as_bytes());
                if kind != "none" && !kinds.contains(&kind) {
                    kinds.push(kind);
                }
            }
            if let Some(own) = &index.times {
                let all = times.get_or_insert(own.clone());
                (all.start, all.end) = (all.start.min(own.start), all.end.max(own.end));
            }
        }
        let times = times.unwrap_or_default();
        let faults = files.iter().flat_map(|file| &file.index.faults);
        let faults = faults.map(|fault| one_line(&format!("{}: {}", fault.place(), fault.what)));
        Self {
            format: kinds.join(", "),
            topics: topics.into_values().collect(),
            start: times.start,
            duration: Duration::from_nanos(times.end.abs_diff(times.start)),
            notes: missing.iter().cloned().chain(faults).collect(),
            ..Self::default()
        }
    }

    /// The topics that can be played.
    pub(super) fn points(&self) -> impl Iterator<Item = &RecordingTopic> {
        self.topics.iter().filter(|topic| topic.points)
    }

    /// All topics with their types, for a message.
    pub(super) fn topic_names(&self) -> String {
        let names =
            self.topics.iter().take(MAX_LISTED_TOPICS).map(|topic| format!("{} ({})", topic.name, topic.type_name));
        let more = self.topics.len().saturating_sub(MAX_LISTED_TOPICS);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        if self.topics.is_empty() { "none".into() } else { names.collect::<Vec<_>>().join(", ") + &more }
    }
}
