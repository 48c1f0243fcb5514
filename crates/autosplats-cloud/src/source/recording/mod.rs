//! Recordings of robots: MCAP, ROS 1 bags and folders of ROS 2, played by their index.
//!
//! # How it works
//!
//! A file is mapped, and its records are walked from front to end without a look into its chunks: what follows each chunk says
//! which messages are in it and when. That is an [`Index`](index::Index), the same for all containers. Chunks that nothing is
//! said of, as when a file is cut off, are unpacked for it. The transforms between the sensors' frames are read at once,
//! points only when they are played, a message at a time.

mod bag;
mod chunk;
mod files;
mod index;
mod mcap;
mod play;
mod summary;
#[cfg_attr(not(feature = "zenoh"), allow(dead_code, reason = "transforms are heard as they are sent over Zenoh alone"))]
pub(super) mod transforms;

use std::{collections::HashMap, path::Path};

pub use self::{
    files::is_recording,
    summary::{RecordingSummary, RecordingTopic},
};
use self::{
    files::{File, Parts, open_files},
    index::{Kind, Place, Topic},
    transforms::Transforms,
};
use super::{
    point_cloud2::{frame_name, stamp_and_frame},
    stream::{Statistics, Timeline},
};
use crate::{
    Error, Progress, ReadOptions,
    progress::{Part, tick},
};

/// What is played of a recording, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingOptions {
    /// The topics of points to play, each a channel in this order; all of them, by name, if there are none.
    pub topics: Vec<String>,
    /// The coordinate frame that all points are brought into; the topmost one that the sensors share if there is none.
    pub frame: Option<String>,
    /// How points are read.
    pub read: ReadOptions,
}

/// The points of a recording, a message after the other.
///
/// Its [timeline](crate::Stream::timeline) has the times at which messages were recorded; each
/// [update](crate::Update) has the time at which its points were measured, where the message says so.
pub struct Recording {
    files: Vec<File>,
    options: RecordingOptions,
    summary: RecordingSummary,
    /// Topics that are played, by name.
    channels: Vec<String>,
    /// Messages of points, in the order of time, and which channel each is of.
    frames: Vec<(Place, usize)>,
    timeline: Timeline,
    transforms: Transforms,
    position: usize,
    statistics: Statistics,
    /// Channels of which something was told that need not be told again.
    told: Vec<bool>,
}

impl Recording {
    /// Opens an MCAP file, a ROS 1 bag or the folder of a ROS 2 bag. No points are read yet, but all transforms.
    ///
    /// What cannot be played, as the end of a recording that was cut off or a part that a folder lacks, is told as a
    /// [note](Progress::note) and counted as [refused](Statistics::refused).
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Malformed`] if nothing can be played, [`Error::Unsupported`] if it has no such points, and
    /// [`Error::Cancelled`].
    pub fn open(path: &Path, options: &RecordingOptions, progress: &dyn Progress) -> Result<Self, Error> {
        Self::of(path, open_files(path, &indexing(progress))?, options, progress)
    }

    /// [Opens](Self::open) a recording from the bytes of a file, whose name stands in messages.
    ///
    /// # Errors
    /// Those of [`open`](Self::open).
    pub fn from_bytes(
        name: &Path,
        bytes: Vec<u8>,
        options: &RecordingOptions,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let files = vec![File::of_bytes(name, bytes, &indexing(progress))?];
        Self::of(name, Parts { files, missing: Vec::new() }, options, progress)
    }

    fn of(path: &Path, parts: Parts, options: &RecordingOptions, progress: &dyn Progress) -> Result<Self, Error> {
        let mut summary = RecordingSummary::of(&parts);
        let Parts { mut files, missing } = parts;
        let unsupported = |what: String| Error::Unsupported { path: path.into(), what: crate::error::message(&what) };
        let mut channels: Vec<String> = summary.points().map(|topic| topic.name.clone()).collect();
        channels.dedup();
        if channels.is_empty() {
            return Err(unsupported(format!(
                "there are no PointCloud2 messages; its topics: {}",
                summary.topic_names()
            )));
        }
        if !options.topics.is_empty() {
            if let Some(missing) = options.topics.iter().find(|name| !channels.contains(name)) {
                let there = channels.join(", ");
                return Err(unsupported(format!("no points are recorded as '{missing}'; topics with points: {there}")));
            }
            channels.clone_from(&options.topics);
        }

        let numbers: HashMap<&str, usize> = channels.iter().enumerate().map(|(at, name)| (&**name, at)).collect();
        let mut frames = Vec::new();
        for (number, File { index, .. }) in files.iter().enumerate() {
            let channel = |topic: &Topic| numbers.get(&*topic.name).copied().filter(|_| topic.kind == Kind::Points);
            let channels: Vec<Option<usize>> = index.topics.iter().map(channel).collect();
            let own = index.messages.iter().map(|place| Place { file: number, ..*place });
            frames.extend(own.filter_map(|place| Some((place, channels[place.topic]?))));
        }
        frames.sort_by_key(|(place, _)| place.time);
        let timeline = Timeline::new(frames.iter().map(|(place, _)| place.time).collect());

        let mut statistics = Statistics::default();
        for told in missing {
            progress.note(&told);
            statistics.refused += 1;
            statistics.last_refusal = Some(told);
        }
        for file in &files {
            for fault in &file.index.faults {
                let told = format!("{}: {}", fault.place(), fault.what);
                progress.note(&crate::error::message(&told));
                statistics.refused += 1;
                statistics.last_refusal = Some(crate::error::message(&format!("{}: {told}", file.path.display())));
            }
        }

        let mut transforms = Transforms::read(&files, &Part { whole: progress, start: INDEXING, len: 1.0 - INDEXING })?;
        let sensors = sensors(&mut files, &frames, channels.len());
        transforms.choose(&sensors, options.frame.as_deref().map(frame_name)).map_err(&unsupported)?;
        summary.frames = transforms.frames(&sensors);
        summary.frame = transforms.target().map(str::to_owned);
        tick(progress, 1.0)?;
        let told = vec![false; channels.len()];
        let options = options.clone();
        Ok(Self { files, options, summary, channels, frames, timeline, transforms, position: 0, statistics, told })
    }

    /// What is in the recording.
    pub fn summary(&self) -> &RecordingSummary {
        &self.summary
    }

    /// The topic of each channel.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }
}

/// The frames of the channels' sensors, in their order, as the first messages that can be read say.
fn sensors(files: &mut [File], frames: &[(Place, usize)], channels: usize) -> Vec<String> {
    let mut found: Vec<Result<String, usize>> = vec![Err(0); channels];
    let mut open = channels;
    for (place, channel) in frames {
        let Err(tried) = &mut found[*channel] else { continue };
        *tried += 1;
        let tried = *tried;
        if tried > FIRST {
            continue;
        }
        let file = &mut files[place.file];
        let encoding = file.index.topics[place.topic].encoding;
        let frame = encoding.and_then(|encoding| stamp_and_frame(file.message(place).ok()?, encoding));
        open -= usize::from(frame.is_some() || tried == FIRST);
        if let Some((_, frame)) = frame {
            found[*channel] = Ok(frame);
        }
        if open == 0 {
            break;
        }
    }
    found.into_iter().flatten().collect()
}

/// Part of opening that finding the messages is; the rest is reading transforms.
const INDEXING: f32 = 0.5;

fn indexing(progress: &dyn Progress) -> Part<'_> {
    Part { whole: progress, start: 0.0, len: INDEXING }
}

/// Messages of a topic that are looked at for the frame of its sensor.
const FIRST: usize = 8;

/// What is in a recording, without its points.
///
/// # Errors
/// Those of [`Recording::open`]; that there are no points is none.
pub fn describe_recording(path: &Path, progress: &dyn Progress) -> Result<RecordingSummary, Error> {
    match Recording::open(path, &RecordingOptions::default(), progress) {
        Ok(recording) => Ok(recording.summary),
        Err(Error::Unsupported { .. }) => Ok(RecordingSummary::of(&open_files(path, &())?)),
        Err(error) => Err(error),
    }
}
